# SPDX-License-Identifier: MIT
"""Damping a million and more times faster than the motion beside it: no step is wasted on it, and the accuracy is kept."""

import numpy as np
import pytest
from flights import SECOND, flight, spinning, wrench
from mpmath import mp, mpc, mpf
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rigid_proto_ros.core.body import make_body
from rigid_proto_ros.core.string import StringSettings

MOMENTS = (0.02, 0.03, 0.04)
BODY = make_body(2.0, np.zeros(3), np.diag(MOMENTS))
NEEDLE = make_body(2.0, np.zeros(3), np.diag([2e-6, 0.03, 0.03 + 1e-6]))
MOST_EVALUATIONS = 12_000
"""Explicit steps would need 1e6 and more, each an evaluation of a series."""


def distance(row, attitude, position, velocity, spin) -> float:
    """The measure of accuracy, by 1 m, between a state row and what should be there."""
    turn = (Rotation.from_quat(attitude).inv() * Rotation.from_quat(row[3:7])).magnitude()
    moved = np.linalg.norm(row[0:3] - position)
    sped = np.linalg.norm(row[7:10] - velocity) / max(np.linalg.norm(velocity), 1.0)
    spun = np.linalg.norm(row[10:13] - spin) / max(np.linalg.norm(spin), 1.0)
    return max(turn, moved, sped, spun)


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("rate", [1e6, 1e8, 1e9, 1e13])
def test_a_spin_soon_goes_as_fast_as_its_torque_keeps_up(rate, accuracy):
    damping, torque, spin = rate * MOMENTS[2], 3.0 * rate * MOMENTS[2], 20.0
    simulation = flight(
        BODY, integrator="auto", accuracy=accuracy, initial=spinning((0, 0, spin)), angular_damping=damping
    )
    simulation.submit(wrench("body@com", torque=(0, 0, torque)))
    row = simulation.advance(SECOND).row
    with mp.workdps(40):
        slow, fast = mpf(torque) / mpf(damping), mpf(damping) / mpf(MOMENTS[2])
        kept = mp.exp(-fast)
        angle = slow + (spin - slow) * (1 - kept) / fast
        half = [float(mp.sin(angle / 2)), float(mp.cos(angle / 2))]
        speed = float(slow + (spin - slow) * kept)
    error = distance(row, (0, 0, *half), np.zeros(3), np.zeros(3), np.array([0, 0, speed]))
    assert error <= accuracy
    assert simulation.force_evaluations <= MOST_EVALUATIONS
    assert simulation.steps <= 300


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9])
@pytest.mark.parametrize("rate", [1e6, 1e9, 1e13])
def test_a_force_that_turns_with_the_body_pushes_it_round_through_honey(rate, accuracy):
    spin, force = 5.0, 4.0 * rate
    row = spinning((0, 0, spin))
    row[7] = 0.5
    simulation = flight(BODY, integrator="auto", accuracy=accuracy, initial=row, linear_damping=rate * BODY.mass)
    simulation.submit(wrench("body@com", (force, 0, 0)))
    row = simulation.advance(SECOND).row
    with mp.workdps(40):
        c, g, turn = mpf(rate), mpf(force) / 2, mpc(0, spin)
        round_, kept = mp.exp(turn), mp.exp(-c)
        velocity = g * (round_ - kept) / (turn + c) + mpf("0.5") * kept
        place = g / (turn + c) * ((round_ - 1) / turn - (1 - kept) / c) + mpf("0.5") * (1 - kept) / c
    position = np.array([float(place.real), float(place.imag), 0.0])
    speed = np.array([float(velocity.real), float(velocity.imag), 0.0])
    error = distance(row, (0, 0, np.sin(spin / 2), np.cos(spin / 2)), position, speed, np.array([0, 0, spin]))
    assert error <= accuracy
    assert simulation.force_evaluations <= MOST_EVALUATIONS


@pytest.mark.parametrize("ratio", [1e4, 1e6])
def test_a_body_creeps_down_on_a_string_that_is_all_damper(ratio):
    stiffness, mass, g = 50.0, 2.0, -9.81
    string = StringSettings(True, (0, 0, 0), (0, 0, 0), stiffness, 0.0, ratio, 0.0)
    start = np.array([0.3, 0, 0, 0, 0, 0, 1, 0, 0, 2.0, 0, 0, 0])
    simulation = flight(
        BODY, integrator="auto", accuracy=1e-9, initial=start, gravity=np.array([0, 0, g]), string=string
    )
    row = simulation.advance(SECOND).row
    with mp.workdps(40):
        k, c = mpf(stiffness) / mass, 2 * mpf(ratio) * mp.sqrt(mpf(stiffness) / mass)
        root = mp.sqrt(c * c / 4 - k)
        slow, fast = -k / (c / 2 + root), -c / 2 - root

        def creep(at, speed, pull):
            rest = pull / k
            a = (speed - fast * (at - rest)) / (slow - fast)
            b = at - rest - a
            return rest + a * mp.exp(slow) + b * mp.exp(fast), a * slow * mp.exp(slow) + b * fast * mp.exp(fast)

        x, u = creep(mpf("0.3"), mpf(0), mpf(0))
        z, w = creep(mpf(0), mpf(2), mpf(g))
    error = distance(
        row, (0, 0, 0, 1), np.array([float(x), 0, float(z)]), np.array([float(u), 0, float(w)]), np.zeros(3)
    )
    assert error <= 1e-9
    assert simulation.force_evaluations <= MOST_EVALUATIONS


def stiff_reference(body, row, until, *, angular=0.0, linear=0.0, load=None, gravity=0.0, string=None, tied=None):
    """The state row by SciPy's Radau (order 5, tolerance 1e-10) from the equations of docs/physics.md.

    load: (axes, point, force, torque). string: settings, and as tied (stiffness, damping).
    """
    inertia = np.diag(body.inertia)
    axes, point, force, torque = load or ("body", np.zeros(3), np.zeros(3), np.zeros(3))
    point, force, torque = np.array(point), np.array(force), np.array(torque)

    def turned(q):
        x, y, z, w = q / np.linalg.norm(q)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def rates(_, s):
        x, q, v, w = s[:3], s[3:7], s[7:10], s[10:]
        R = turned(q)
        f = R.T @ force if axes == "world" else force
        t = (R.T @ torque if axes == "world" else torque) + np.cross(point, f)
        pull = R @ f - linear * v + np.array([0, 0, gravity * body.mass])
        if tied is not None:
            r = np.array(string.attach)
            a = x + R @ r - np.array(string.target)
            rate = v + R @ np.cross(w, r)
            if string.rest_length == 0.0:
                F = -tied.stiffness * a - tied.damping * rate
            else:
                length = np.linalg.norm(a)
                n = a / length
                F = -(tied.stiffness * (length - string.rest_length) + tied.damping * (n @ rate)) * n
            pull = pull + F
            t = t + np.cross(r, R.T @ F)
        dw = (t - angular * w - np.cross(w, inertia * w)) / inertia
        qx, qy, qz, qw = q
        dq = 0.5 * np.array(
            [
                qw * w[0] + qy * w[2] - qz * w[1],
                qw * w[1] - qx * w[2] + qz * w[0],
                qw * w[2] + qx * w[1] - qy * w[0],
                -qx * w[0] - qy * w[1] - qz * w[2],
            ]
        )
        return np.concatenate([v, dq, pull / body.mass, dw])

    found = solve_ivp(rates, (0, until), row, "Radau", rtol=1e-10, atol=1e-12)
    assert found.success
    return found.y[:, -1]


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


@pytest.mark.parametrize("name", SCENES)
def test_stiff_damping_of_every_kind_keeps_the_accuracy(name):
    body, scene = SCENES[name]
    string = scene.get("string", StringSettings())
    simulation = flight(
        body,
        integrator="auto",
        accuracy=1e-7,
        initial=START,
        angular_damping=scene.get("angular", 0.0),
        linear_damping=scene.get("linear", 0.0),
        gravity=np.array([0, 0, scene.get("gravity", 0.0)]),
        string=string,
    )
    if "load" in scene:
        axes, point, force, torque = scene["load"]
        simulation.submit(wrench(f"{axes}@point/{','.join(map(str, point))}", force, torque))
    tied = simulation.string
    # Half a second in portions, as a publisher asks.
    for k in range(1, 6):
        row = simulation.advance(k * SECOND // 10).row
    exact = stiff_reference(body, START, 0.5, **scene, tied=tied)
    assert distance(row, exact[3:7], exact[:3], exact[7:10], exact[10:]) <= 1e-7 * 0.5
    assert "radau" in simulation.choice
    assert simulation.force_evaluations <= MOST_EVALUATIONS


def test_portions_have_no_bearing_on_stiff_steps():
    def state(portion_ns):
        simulation = flight(BODY, integrator="auto", initial=START, angular_damping=2e6, string=LONG)
        for at in range(portion_ns, SECOND // 10, portion_ns):
            simulation.advance(at)
        return simulation.advance(SECOND // 10).sha256()

    assert len({state(10**9), state(10**6), state(123_457)}) == 1
