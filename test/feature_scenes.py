# SPDX-License-Identifier: MIT
"""Random flights of every pair of features, for the simulation and for the reference (test/reference_flights.py) alike.

All last END_S; the free end may move from MOVE_S[0] to MOVE_S[1], a wrench may act from LOAD_S[0] to LOAD_S[1].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flights import SECOND, flight_setup, wrench
from random_scenes import log_uniform, random_turn, turned_body
from reference_flights import DIRECTIONS, error, fly, numbers
from scipy.spatial.transform import Rotation

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.string import StringSettings
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import MoveString
from rigid_proto_ros.simulation.setup import Setup
from rigid_proto_ros.simulation.simulation import Simulation

END_S = 2.0
MOVE_S = (0.3, 0.4)
LOAD_S = (0.5, 0.7)

FEATURES = {
    "spin": ("zero", "slow", "fast"),
    "speed": ("zero", "ordinary"),
    "string": ("pulls", "bilateral", "no rest length", "none"),
    "start": ("slack", "taut", "at the free end"),
    "knot": ("com", "off"),
    "damping_ratio": (0.0, 0.1, 1.5),
    "gravity": (False, True),
    "linear_damping": (False, True),
    "angular_damping": (False, True),
    "hand": ("still", "moves"),
    "load": ("none", "wrench"),
    "scale": (1e-6, 1e-3, 1.0, 1e3),
}
"""Each with its levels; all pairs of levels of two features occur."""


@dataclass(frozen=True)
class SizedSetup(Setup):
    """A setup of a body without a mesh but of known size ℓ [m]."""

    size: float = 1.0

    @property
    def length(self) -> float:
        return self.size


@dataclass(frozen=True)
class Scene:
    """setup, and commands (command, time [ns]); numbers: what the reference takes of it (test/reference_flights.py)."""

    setup: Setup
    commands: tuple
    numbers: np.ndarray

    def row_at(self, time_s: float) -> np.ndarray:
        """The simulation's row (13,) after so many seconds; its flight must not stop nor refuse anything."""
        simulation = self.simulation()
        row = simulation.advance(round(time_s * SECOND)).row
        assert not simulation.failure, simulation.failure
        assert not simulation.refused
        return row

    def simulation(self) -> Simulation:
        simulation = Simulation(self.setup)
        for command, time_ns in self.commands:
            simulation.submit(command, time_ns)
        return simulation


def make_scene(features: dict, rng: np.random.Generator, accuracy: float = 1e-9) -> Scene:
    """A scene of these features, all else at random."""
    f, size = features, features["scale"] * log_uniform(rng, 0.3, 3.0)
    body = turned_body(rng, log_uniform(rng, 0.1, 10.0) * size**3, 0.3 * size, 0.05)
    reach = np.sqrt(body.principal_moments.max() / body.mass)
    arm = reach * rng.normal(size=3) if f["knot"] == "off" else np.zeros(3)
    turn = random_turn(rng)
    row = np.zeros(13)
    row[3:7] = Rotation.from_matrix(turn).as_quat()
    if f["spin"] != "zero":
        spin = log_uniform(rng, 1e-6, 0.5) if f["spin"] == "slow" else log_uniform(rng, 1.0, 25.0)
        row[10:13] = spin * _direction(rng)
    if f["speed"] != "zero":
        row[7:10] = size * log_uniform(rng, 0.1, 3.0) * _direction(rng)
    has_string, rest = (
        f["string"] != "none",
        0.0 if f["string"] == "no rest length" else size * log_uniform(rng, 0.3, 2.0),
    )
    target = size * rng.normal(size=3)
    # A bilateral string has no direction where its ends meet.
    start = "slack" if f["start"] == "at the free end" and f["string"] == "bilateral" else f["start"]
    # An effective mass is taken along the string: where rounding alone gives it a direction nobody knows it.
    nearest = 0.0 if f["knot"] == "com" else 1e-4
    distance = {"slack": rng.uniform(0.05, 0.99), "taut": rng.uniform(1.0, 1.2), "at the free end": nearest}[start]
    away = (rest or size) * distance * _direction(rng)
    row[0:3] = target + away - Rotation.from_quat(row[3:7]).apply(arm)
    if start == "at the free end" and f["knot"] == "com":
        row[0:3] = target
    settings = StringSettings()
    if has_string:
        settings = StringSettings(
            attached=True,
            attach=tuple(arm.tolist()),
            target=tuple(target.tolist()),
            frequency=log_uniform(rng, 1.5, 30.0),
            damping_ratio=f["damping_ratio"],
            rest_length=rest,
            bilateral=f["string"] == "bilateral",
            timeout_ns=0,
        )
    gravity = np.array([0.0, 0.0, -9.81 * size]) if f["gravity"] else np.zeros(3)
    linear = body.mass * log_uniform(rng, 0.01, 3.0) if f["linear_damping"] else 0.0
    angular = body.principal_moments.min() * log_uniform(rng, 0.01, 3.0) if f["angular_damping"] else 0.0
    commands, moved, loads = [], target, [np.zeros(3)] * 6
    if has_string and f["hand"] == "moves":
        moved = target + size * log_uniform(rng, 0.01, 0.5) * _direction(rng)
        commands.append((MoveString(tuple(moved.tolist())), round(MOVE_S[0] * SECOND)))
    if f["load"] != "none":
        loads = _loads(rng, body, reach, size)
        commands += _wrenches(loads)
    base = flight_setup(
        body,
        integrator="auto",
        accuracy=accuracy,
        initial=row,
        gravity=gravity,
        linear_damping=linear,
        angular_damping=angular,
        string=settings,
    )
    return Scene(
        SizedSetup(**vars(base), size=size),
        tuple(commands),
        numbers_of(base, size, moved, loads),
    )


def numbers_of(setup: Setup, size: float, moved, loads) -> np.ndarray:
    """A scene's numbers for the reference, k and c of the string by its own arithmetic."""
    body, string, row = setup.body, setup.string, setup.initial
    arm = np.array(string.attach) * body.scale - body.center_of_mass if string.attached else np.zeros(3)
    R = Rotation.from_quat(row[3:7]).as_matrix()
    span = row[0:3] + R @ arm - np.array(string.target)
    length = np.linalg.norm(span)
    ways = [R.T @ span / length] if length > 0.0 else list(np.eye(3))
    levers = [np.cross(arm, way) for way in ways]
    turning = float(np.mean([lever @ np.linalg.solve(body.inertia, lever) for lever in levers]))
    mass = 1.0 / (1.0 / body.mass + turning)
    stiffness = mass * string.frequency**2 if string.frequency > 0.0 else string.stiffness
    names = ("force_world", "point_world", "torque_world", "force_body", "point_body", "torque_body")
    return numbers(
        {
            "row": row,
            "mass": body.mass,
            "inertia": body.inertia,
            "length": size,
            "gravity": setup.gravity,
            "linear_damping": setup.linear_damping,
            "angular_damping": setup.angular_damping,
            **dict(zip(names, loads, strict=True)),
            "tied": string.attached,
            "arm": arm,
            "target": string.target,
            "moved": moved,
            "stiffness": stiffness,
            "damping": 2.0 * string.damping_ratio * np.sqrt(stiffness * mass),
            "rest_length": string.rest_length,
            "one_sided": not (string.bilateral or string.rest_length == 0.0),
        }
    )


TRIES = 6
CHAOS = 1e-2
"""An error that is no longer a small one."""

_CONDITION_RNG = 2024


def share(scene: Scene, row_at, accuracy: float, end_s: float = END_S) -> float:
    """What the error of a flight is of what it may be: accuracy × time × condition. row_at(t): its row after t seconds.

    The condition is 1 at least; where that isn't enough it is measured, by errors of ten times the accuracy all along. A
    flight so chaotic that nobody can know its end is judged at half its time.
    """
    size = scene.setup.length
    exact = fly(scene.numbers, LOAD_S, MOVE_S, end_s)
    found, allowed = error(row_at(end_s), exact, size), accuracy * end_s
    if found <= allowed:
        return found / allowed
    rng = np.random.default_rng(_CONDITION_RNG)
    for _ in range(TRIES):
        ways = rng.normal(size=(DIRECTIONS, 4, 3))
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        disturbed = fly(scene.numbers, LOAD_S, MOVE_S, end_s, 10.0 * accuracy, ways)
        allowed = max(allowed, error(disturbed, exact, size))
        if found <= allowed <= CHAOS:
            break  # more tries can only allow more
    if allowed > CHAOS:
        return share(scene, row_at, accuracy, 0.5 * end_s)
    return found / allowed


def _loads(rng, body, reach, size):
    """Force and its point, torque: in world axes, then in body axes."""
    found = []
    for _ in range(2):
        force = body.mass * size * log_uniform(rng, 0.3, 10.0) * _direction(rng)
        torque = body.principal_moments.min() * log_uniform(rng, 0.3, 10.0) * _direction(rng)
        found += [force, reach * rng.normal(size=3), torque]
    return found


def _wrenches(loads):
    for k, axes in enumerate(("world", "body")):
        force, point, torque = loads[3 * k : 3 * k + 3]
        frame = f"{axes}@point/{','.join(repr(float(c)) for c in point)};duration={LOAD_S[1] - LOAD_S[0]:.9f}"
        yield wrench(frame, force.tolist(), torque.tolist(), held=False), round(LOAD_S[0] * SECOND)


def _direction(rng) -> np.ndarray:
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


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
    setup = make_scenario(values).setup
    target = np.array(setup.string.target)
    return Scene(setup, (), numbers_of(setup, setup.length, target, [np.zeros(3)] * 6))
