# SPDX-License-Identifier: MIT
"""Scenes that the simulation and the reference (test/reference_taylor.py) fly alike: all that an integrator supports, random
flights of every pair of features, and everyday throws.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flights import SECOND, StringSettings, changed, flight_setup, wrench
from reference_motion import angle_between, rotation_of
from reference_taylor import DIGITS, ReferenceProblem, ReferenceString, reference_motion
from scipy.spatial.transform import Rotation

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.body import Body, make_body
from rigid_proto_ros.motion.integrators.integrator import Integrator
from rigid_proto_ros.motion.loads import (
    ANGULAR_DAMPING,
    BODY_FORCE,
    BODY_TORQUE,
    NO_GYROSCOPIC_TERM,
    ROTOR,
    STRING,
    WORLD_TORQUE,
)
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import MoveString
from rigid_proto_ros.simulation.setup import Setup
from rigid_proto_ros.simulation.simulation import Simulation

ZERO = (0.0, 0.0, 0.0)
END_S = 2.0
"""How long random scenes last."""
MOVE_S, LOAD_S = (0.3, 0.4), (0.5, 0.7)
"""When the free end moves and wrenches act in them."""


@dataclass(frozen=True)
class Scene:
    """loads: axes, point (body axes, from the COM), force, torque of wrenches that act over load_s; moved: where the free end goes."""

    setup: Setup
    loads: tuple = ()
    load_s: tuple[float, float] = (0.0, np.inf)
    moved: tuple | None = None

    def simulation(self, **changes) -> Simulation:
        """With some of the setup changed (``flights.changed``)."""
        simulation, (begin, end) = Simulation(changed(self.setup, **changes)), self.load_s
        for axes, point, force, torque in self.loads:
            place = f"point/{','.join(repr(float(c)) for c in point)}" if np.any(point) else "com"
            frame = f"{axes}@{place}"
            frame += f";duration={end - begin:.9f}" if end < np.inf else f";slot={axes}"
            command = wrench(frame, map(float, force), map(float, torque), held=end == np.inf)
            simulation.submit(command, round(begin * SECOND))
        if self.moved is not None:
            simulation.submit(MoveString(self.moved), round(MOVE_S[0] * SECOND))
        return simulation

    def flown(self, end_s: float, **changes) -> np.ndarray:
        """The row (13,) after so many seconds of the simulation, which must not stop nor refuse anything."""
        simulation = self.simulation(**changes)
        row = simulation.advance(round(end_s * SECOND)).row
        assert not simulation.failure, simulation.failure
        assert not simulation.refused
        return row

    def reference(self, end_s: float, kicks=()) -> list:
        """The row of 13 mpf after so many seconds. kicks (n, 4, 3): errors as ``error`` measures them, evenly spread."""
        row, times = [float(x) for x in self.setup.initial], np.linspace(0.0, END_S, len(kicks) + 1)[1:].tolist()
        edges = {0.0, end_s, *self.load_s, *(MOVE_S if self.moved else ()), *times}
        edges = sorted(time_s for time_s in edges if time_s <= end_s)
        for begin, end in zip(edges, edges[1:], strict=False):
            (row,) = reference_motion(self._problem(begin), row, [end - begin], DIGITS)
            if end in times:
                row = _kicked(row, kicks[times.index(end)], self.setup.length)
        return row

    def error(self, row, exact) -> float:
        return error(row, exact, self.setup.length)

    def _problem(self, time_s: float) -> ReferenceProblem:
        """What acts from this time on, until something begins or ends."""
        setup, loads = self.setup, {}
        if self.load_s[0] <= time_s < self.load_s[1]:
            for axes, point, force, torque in self.loads:
                loads[f"force_{axes}"] = tuple(force)
                loads[f"torque_{axes}"] = tuple(torque)
                if axes == "world":
                    loads["moment"] = tuple(map(tuple, np.outer(point, force)))
                else:
                    loads["torque_body"] = tuple(torque + np.cross(point, force))
        return ReferenceProblem(
            setup.body.mass,
            setup.body.inertia,
            tuple(setup.gravity),
            linear_damping=float(setup.scene.linear_damping),
            angular_damping=float(setup.scene.angular_damping),
            gyroscopic=bool(setup.scene.gyroscopic),
            string=self._string(time_s),
            rotor=tuple(setup.scene.rotor_momentum + time_s * setup.scene.rotor_torque),
            rotor_torque=tuple(setup.scene.rotor_torque),
            **loads,
        )

    def _string(self, time_s: float) -> ReferenceString | None:
        """k and c from the effective mass at the start, by plain linear algebra."""
        body, scene, row = self.setup.body, self.setup.scene, self.setup.initial
        if not scene.string_attached:
            return None
        arm, target = scene.string_attach * body.scale - body.center_of_mass, scene.string_target
        R = Rotation.from_quat(row[3:7]).as_matrix()
        span = row[0:3] + R @ arm - target
        length = np.linalg.norm(span)
        levers = [np.cross(arm, way) for way in ([R.T @ span / length] if length > 0.0 else np.eye(3))]
        turning = float(np.mean([lever @ np.linalg.solve(body.inertia, lever) for lever in levers]))
        mass = 1.0 / (1.0 / body.mass + turning)
        stiffness = float(mass * scene.string_frequency**2 or scene.string_stiffness)
        damping, velocity = float(2.0 * scene.string_damping_ratio * np.sqrt(stiffness * mass)), ZERO
        if self.moved is not None and time_s >= MOVE_S[0]:
            way = np.array(self.moved) - target
            target, velocity = (target, way / (MOVE_S[1] - MOVE_S[0])) if time_s < MOVE_S[1] else (target + way, ZERO)
        end = (tuple(target), stiffness, damping, float(scene.string_rest_length), bool(scene.string_bilateral))
        return ReferenceString(tuple(arm), *end, target_velocity=tuple(velocity))


def error(row, exact, length: float = 1.0) -> float:
    """max(attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1), |Δv|/max(|v|, ℓ)) of a row (13,) of doubles against one of 13 mpf."""
    angle = angle_between(row[3:7], rotation_of(exact[3:7]))
    off = np.array([float(a - float(b)) for a, b in zip(exact, row, strict=True)])
    moved, sped, spun = (np.linalg.norm(off[k : k + 3]) for k in (0, 7, 10))
    speed, spin = (np.linalg.norm(row[k : k + 3]) for k in (7, 10))
    return float(max(angle, moved / length, sped / max(speed, length), spun / max(spin, 1.0)))


def _kicked(row: list, kick: np.ndarray, length: float) -> list:
    """A row moved by errors (4, 3) of position, velocity, spin and attitude as ``error`` measures them."""
    x, q, v, w = (np.array(row[part], float) for part in (slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)))
    turned = Rotation.from_rotvec(kick[3]) * Rotation.from_quat(q)
    v += max(np.linalg.norm(v), length) * kick[1]
    return [*(x + length * kick[0]), *turned.as_quat(), *v, *(w + max(np.linalg.norm(w), 1.0) * kick[2])]


TENSOR = ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9))
BODY = make_body(2.0, ZERO, TENSOR)
ROW = np.array((0.3, -0.2, 0.1, 0.2, -0.4, 0.4, 0.8, 0.4, 0.1, -0.3, 0.9, 1.3, -0.6))
POINT, FORCE = (0.2, 0.1, -0.15), (0.4, -0.7, 0.5)


def scene_with(needs, string: StringSettings | None = None) -> Scene:
    """A scene with these needs of integrators (motion/integrators/integrator.py), gravity, linear damping and a world force."""
    setup = flight_setup(
        BODY,
        initial=ROW,
        gravity=np.array((0.0, 0.0, -9.81)),
        linear_damping=0.3,
        angular_damping=0.2 if ANGULAR_DAMPING in needs else 0.0,
        gyroscopic=NO_GYROSCOPIC_TERM not in needs,
        rotor_momentum=(0.3, -0.5, 0.2) if ROTOR in needs else ZERO,
        rotor_torque=(-0.1, 0.2, 0.3) if ROTOR in needs else ZERO,
        string=string or StringSettings(),
    )
    turns = WORLD_TORQUE in needs
    loads = [("world", POINT if turns else ZERO, FORCE, (0.2, 0.3, -0.4) if turns else ZERO)]
    torque, force = BODY_TORQUE in needs, BODY_FORCE in needs
    if torque or force:
        point = POINT if torque and force else ZERO
        loads.append(("body", point, (0.5, -0.3, 0.8) if force else ZERO, (-0.3, 0.2, 0.4) if torque else ZERO))
    return Scene(setup, tuple(loads))


def scene_for(integrator: Integrator, string: StringSettings | None = None) -> Scene:
    """Everything that the integrator supports except a string, but the given one, and a dropped gyroscopic term."""
    return scene_with(integrator.supports - {STRING, NO_GYROSCOPIC_TERM}, string)


FEATURES = {
    "spin": ("zero", "slow", "fast"),
    "speed": ("zero", "ordinary"),
    "string": ("pulls", "bilateral", "no rest length", "none"),
    "start": ("slack", "taut", "at the free end"),
    "knot": ("com", "off"),
    "frequency": ((1.5, 30.0),),
    "damping_ratio": (0.0, 0.1, 1.5),
    "gravity": (False, True),
    "linear_damping": (False, True),
    "angular_damping": (False, True),
    "hand": ("still", "moves"),
    "load": ("none", "wrench"),
    "scale": (1e-6, 1e-3, 1.0, 1e3),
}
"""Each with its levels."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))


def direction(rng: np.random.Generator) -> np.ndarray:
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


def random_body(rng: np.random.Generator, mass: float, reach: float, thinnest: float) -> Body:
    """Anything from stick (1 to ``thinnest``) to ball, turned in its mesh."""
    second = mass * reach**2 * np.array([1.0, log_uniform(rng, thinnest, 1.0), log_uniform(rng, thinnest, 1.0)])
    turn = Rotation.random(random_state=rng).as_matrix()
    inertia = turn @ np.diag(second.sum() - second) @ turn.T
    return make_body(mass, np.zeros(3), 0.5 * (inertia + inertia.T))


def make_scene(features: dict, rng: np.random.Generator) -> Scene:
    """A scene of these features, all else at random."""
    f, size = features, features["scale"] * log_uniform(rng, 0.3, 3.0)
    body = random_body(rng, log_uniform(rng, 0.1, 10.0) * size**3, 0.3 * size, 0.05)
    reach = np.sqrt(body.principal_moments.max() / body.mass)
    arm = reach * rng.normal(size=3) if f["knot"] == "off" else np.zeros(3)
    row = np.zeros(13)
    row[3:7] = Rotation.random(random_state=rng).as_quat()
    if f["spin"] != "zero":
        row[10:13] = direction(rng) * log_uniform(rng, *((1e-6, 0.5) if f["spin"] == "slow" else (1.0, 25.0)))
    if f["speed"] != "zero":
        row[7:10] = size * log_uniform(rng, 0.1, 3.0) * direction(rng)
    rest = 0.0 if f["string"] == "no rest length" else size * log_uniform(rng, 0.3, 2.0)
    target = size * rng.normal(size=3)
    # A bilateral string has no direction where its ends meet.
    start = "slack" if f["start"] == "at the free end" and f["string"] == "bilateral" else f["start"]
    # An effective mass is taken along the string: where rounding alone gives it a direction nobody knows it.
    nearest = 0.0 if f["knot"] == "com" else 1e-4
    distance = {"slack": rng.uniform(0.05, 0.99), "taut": rng.uniform(1.0, 1.2), "at the free end": nearest}[start]
    row[0:3] = target + (rest or size) * distance * direction(rng) - Rotation.from_quat(row[3:7]).apply(arm)
    string, moved, loads = StringSettings(), None, ()
    if f["string"] != "none":
        string = StringSettings(
            attached=True,
            attach=tuple(arm.tolist()),
            target=tuple(target.tolist()),
            frequency=log_uniform(rng, *f["frequency"]),
            damping_ratio=f["damping_ratio"],
            rest_length=rest,
            bilateral=f["string"] == "bilateral",
            timeout_ns=0,
        )
        if f["hand"] == "moves":
            moved = tuple((target + size * log_uniform(rng, 0.01, 0.5) * direction(rng)).tolist())
    if f["load"] != "none":
        forces = [body.mass * size * log_uniform(rng, 0.3, 10.0) * direction(rng) for _ in range(2)]
        torques = [body.principal_moments.min() * log_uniform(rng, 0.3, 10.0) * direction(rng) for _ in range(2)]
        points = reach * rng.normal(size=(2, 3))
        loads = tuple(zip(("world", "body"), points, forces, torques, strict=True))
    rotor = {}
    if f.get("rotor", "none") != "none":
        least = body.principal_moments.min()
        rotor["rotor_momentum"] = least * log_uniform(rng, 0.1, 30.0) * direction(rng)
        rotor["rotor_torque"] = least * log_uniform(rng, 0.1, 30.0) * direction(rng) * (f["rotor"] == "driven")
    setup = flight_setup(
        body,
        integrator="auto",
        initial=row,
        gravity=np.array([0.0, 0.0, -9.81 * size]) if f["gravity"] else np.zeros(3),
        linear_damping=body.mass * log_uniform(rng, 0.01, 3.0) if f["linear_damping"] else 0.0,
        angular_damping=body.principal_moments.min() * log_uniform(rng, 0.01, 3.0) if f["angular_damping"] else 0.0,
        string=string,
        size=size,
        **rotor,
    )
    return Scene(setup, loads, LOAD_S, moved)


# What people try first: a bundled body thrown on a rope, all else as the parameters' defaults have it, in numbers that
# people type.

SPEEDS = (0.0, 0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0)
SPINS = (0.0, 0.0, 0.0, 0.1, 0.5, 1.0, 3.0, 10.0)
LENGTHS = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0)


def _signed(rng, numbers) -> float:
    return float(rng.choice(numbers) * rng.choice([-1.0, 1.0]))


def everyday_scene(seed: int) -> Scene:
    """A throw; the same for every run of a seed."""
    rng = np.random.default_rng([1000, seed])
    mesh = str(rng.choice(body_names()))
    attach = [0.0, 0.0, 0.0]
    if rng.random() < 0.6:
        attach = [round(float(c), 3) for c in rng.choice(load_mesh(mesh).vertices)]
    values = {
        "mesh": mesh,
        "gravity": [0.0, 0.0, 0.0 if rng.random() < 0.2 else -9.81],
        "initial.linear_velocity": [_signed(rng, SPEEDS) for _ in range(3)],
        "initial.angular_velocity": [_signed(rng, SPINS) for _ in range(3)],
        "string.attached": True,
        "string.attach": attach,
        "string.rest_length": float(rng.choice(LENGTHS)),
        "string.target": [0.0, 0.0, float(rng.choice([0.0, 0.0, 0.1, 0.2, 0.5]))],
    }
    if rng.random() < 0.3:
        values["string.damping_ratio"] = float(rng.choice([0.0, 0.3, 1.0]))
    if rng.random() < 0.3:
        values["linear_damping"] = float(rng.choice([0.01, 0.1]))
    if rng.random() < 0.3:
        values["initial.position"] = [float(rng.choice([0.0, 0.1, -0.2])) for _ in range(3)]
    return Scene(make_scenario(values).setup)


TRIES, KICKS = 6, 16
CHAOS = 1e-2
"""An error that is no longer a small one."""


def share(scene: Scene, accuracy: float, end_s: float = END_S) -> float:
    """What the error of a flight by auto is of what it may be: accuracy × time × condition.

    The condition is 1 at least; where that isn't enough it is measured, by errors of ten times the accuracy all along. A
    flight so chaotic that nobody can know its end is judged at half its time.
    """
    exact = scene.reference(end_s)
    found, allowed = scene.error(scene.flown(end_s, accuracy=accuracy), exact), accuracy * end_s
    rng = np.random.default_rng(2024)
    for _ in range(TRIES):
        if found <= allowed <= CHAOS:
            break  # more tries can only allow more
        kicks = [10.0 * accuracy * END_S / KICKS * direction(rng) for _ in range(4 * KICKS)]
        disturbed = scene.reference(end_s, np.reshape(kicks, (KICKS, 4, 3)))
        allowed = max(allowed, scene.error(np.array(disturbed, float), exact))
    if allowed > CHAOS:
        return share(scene, accuracy, 0.5 * end_s)
    return found / allowed
