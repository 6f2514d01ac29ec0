# SPDX-License-Identifier: MIT
"""Scenes whose damping is far faster than the motion beside it, and their motion by SciPy's Radau."""

import numpy as np
from flights import flight, wrench
from reference_flights import StillFlight, numbers
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.string import StringSettings

MOMENTS = (0.02, 0.03, 0.04)
BODY = make_body(2.0, np.zeros(3), np.diag(MOMENTS))
NEEDLE = make_body(2.0, np.zeros(3), np.diag([2e-6, 0.03, 0.03 + 1e-6]))


def distance(row, attitude, position, velocity, spin) -> float:
    """The measure of accuracy, by 1 m, between a state row and what should be there."""
    turn = (Rotation.from_quat(attitude).inv() * Rotation.from_quat(row[3:7])).magnitude()
    moved = np.linalg.norm(row[0:3] - position)
    sped = np.linalg.norm(row[7:10] - velocity) / max(np.linalg.norm(velocity), 1.0)
    spun = np.linalg.norm(row[10:13] - spin) / max(np.linalg.norm(spin), 1.0)
    return max(turn, moved, sped, spun)


def still_flight(body, row, *, angular=0.0, linear=0.0, load=None, gravity=0.0, string=None, tied=None):
    """The equations of a scene, compiled, for somebody else's method.

    load: (axes, point, force, torque). string: settings, and as tied (stiffness, damping).
    """
    axes, point, force, torque = load or ("body", np.zeros(3), np.zeros(3), np.zeros(3))
    none = (
        "point_world",
        "force_world",
        "torque_world",
        "point_body",
        "force_body",
        "torque_body",
        "arm",
        "target",
        "moved",
    )
    scene = dict.fromkeys(none, np.zeros(3)) | dict.fromkeys(("stiffness", "damping", "rest_length"), 0.0)
    scene |= {f"point_{axes}": point, f"force_{axes}": force, f"torque_{axes}": torque, "tied": tied is not None}
    scene |= {"row": row, "mass": body.mass, "inertia": body.inertia, "length": 1.0, "gravity": (0.0, 0.0, gravity)}
    scene |= {"linear_damping": linear, "angular_damping": angular, "one_sided": False}
    if tied is not None:
        scene |= {"arm": string.attach, "target": string.target, "moved": string.target}
        scene |= {"stiffness": tied.stiffness, "damping": tied.damping, "rest_length": string.rest_length}
    return StillFlight(numbers(scene))


def stiff_reference(
    body, row, until, *, angular=0.0, linear=0.0, load=None, gravity=0.0, string=None, tied=None, tolerance=1e-10
):
    """The state row by SciPy's Radau (order 5) from the equations of test/reference_flights.py, begun anew where a pull-only string's
    law changes; the scene as ``still_flight`` takes it.
    """
    one_sided = tied is not None and not string.bilateral and string.rest_length > 0.0
    flight = still_flight(
        body, row, angular=angular, linear=linear, load=load, gravity=gravity, string=string, tied=tied
    )

    def rates(_, Y, pulls):
        return flight.rates(Y, pulls)

    def stretch(_, Y, pulls):
        return flight.law(Y, pulls)[0]

    def tension(_, Y, pulls):
        return flight.law(Y, pulls)[2]

    def event(of, direction):
        def value(t, Y, pulls):
            return of(t, Y, pulls)

        value.terminal, value.direction = True, direction
        return value

    def flown(Y, begin, end, pulls, ends):
        found = solve_ivp(
            rates, (begin, end), Y, "Radau", rtol=tolerance, atol=0.01 * tolerance, args=(pulls,), events=ends
        )
        assert found.success
        return found

    Y, now = flight.start, 0.0
    while now < until:
        x, _, pull, _ = flight.law(Y, True)
        pulls = tied is not None and (not one_sided or (x > 0.0 and pull > 0.0))
        ends, values = None, ()
        if one_sided:
            # Of the law: which number ends it, and its way.
            values = ((2, -1),) if pulls else ((0, 1),) if x <= 0.0 else ((2, 1), (0, -1))
            ends = [event(tension if which == 2 else stretch, way) for which, way in values]
        found = flown(Y, now, until, pulls, ends)
        if found.t[-1] == until:
            return flight.row(found.y[:, -1])
        # Up to the event once more: what is interpolated there is less exact than steps are.
        which, at = next((w, t[0]) for (w, _), t in zip(values, found.t_events, strict=True) if len(t))
        for _ in range(3):
            reached = flown(Y, now, at, pulls, None).y[:, -1]
            law = flight.law(reached, pulls)
            at -= law[which] / law[which + 1]
        # Begun a hair on, where the law is beyond doubt.
        Y, now = reached + 1e-12 * flight.rates(reached, pulls), at + 1e-12
    return flight.row(Y)


START = np.array([0.2, -0.1, 0.9, 0.1, 0.3, -0.2, 0.9, 0.3, -0.5, 0.2, 3.0, 4.0, 5.0])
START[3:7] /= np.linalg.norm(START[3:7])
LOAD = ("world", (0.1, 0.0, 0.1), (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
TURNING = ("body", (0.1, 0.0, 0.1), (1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
SOFT = StringSettings(True, (0.1, 0.15, 0.2), (0.0, 0.0, 0.0), 50.0, 0.0, 1e4, 0.0)
LONG = StringSettings(True, (0.1, 0.15, 0.2), (0.0, 0.0, 0.0), 50.0, 0.0, 1e4, 0.7, True)
SCENES = {
    "spin under a world force": (BODY, {"angular": 2e6, "load": LOAD}),
    "slaved spin": (BODY, {"angular": 2e6, "load": ("world", (0, 0, 0), (0, 0, 0), (6e6, 2e6, 4e6))}),
    "needle, one axis stiff": (NEEDLE, {"angular": 0.2, "load": TURNING}),
    "body force, linear damping": (BODY, {"linear": 2e8, "load": TURNING}),
    "everything damped": (BODY, {"linear": 2e7, "angular": 3e5, "load": LOAD, "gravity": -9.81}),
    "string of rest length 0": (BODY, {"string": SOFT, "gravity": -9.81}),
    "string pulls and pushes": (BODY, {"string": LONG, "gravity": -9.81}),
    "string and damped spin": (BODY, {"string": LONG, "angular": 3e4, "load": LOAD}),
}


def flown(body, row, scene, accuracy):
    """A Simulation of a scene, as ``stiff_reference`` takes it, at time 0."""
    simulation = flight(
        body,
        integrator="auto",
        accuracy=accuracy,
        initial=row,
        angular_damping=scene.get("angular", 0.0),
        linear_damping=scene.get("linear", 0.0),
        gravity=np.array([0, 0, scene.get("gravity", 0.0)]),
        string=scene.get("string", StringSettings()),
    )
    if "load" in scene:
        axes, point, force, torque = scene["load"]
        frame = f"{axes}@point/{','.join(repr(float(x)) for x in point)}"
        simulation.submit(wrench(frame, np.array(force).tolist(), np.array(torque).tolist()))
    return simulation
