# SPDX-License-Identifier: MIT
"""Damping a million and more times faster than the motion beside it: no step is wasted on it, and the accuracy is kept."""

import numpy as np
import pytest
from flights import SECOND, flight, spinning, wrench
from mpmath import mp, mpc, mpf
from random_scenes import log_uniform, random_body
from stiff_scenes import BODY, LONG, MOMENTS, SCENES, START, TURNING, distance, flown, stiff_reference

from rigid_proto_ros.motion.string import StringSettings

MOST_EVALUATIONS = 12_000
"""Explicit steps would need 1e6 and more, each an evaluation of a series."""


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


SLOW_TO_JUDGE = [name for name in SCENES if "string" in SCENES[name][1]]


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.stress] * (n in SLOW_TO_JUDGE)) for n in SCENES])
def test_stiff_damping_of_every_kind_keeps_the_accuracy(name):
    body, scene = SCENES[name]
    simulation = flown(body, START, scene, 1e-7)
    # In portions, as a publisher asks.
    for k in range(1, 6):
        row = simulation.advance(k * SECOND // 25).row
    exact = stiff_reference(body, START, 0.2, **scene, tied=simulation.string)
    assert distance(row, exact[3:7], exact[:3], exact[7:10], exact[10:]) <= 1e-7 * 0.2
    assert "radau" in simulation.choice
    assert simulation.force_evaluations <= MOST_EVALUATIONS


def stiff_scene(seed):
    """Any body with stiff damping of one kind or several: of its spin, its flight, its string, taut or slack at first, with loads or without."""
    rng = np.random.default_rng(seed)
    body = random_body(rng)
    smallest, arm = body.principal_moments.min(), np.sqrt(body.principal_moments.max() / body.mass)
    row = np.zeros(13)
    row[:3], row[3:7], row[7:10] = rng.normal(size=3), rng.normal(size=4), rng.normal(size=3)
    row[3:7] /= np.linalg.norm(row[3:7])
    row[10:13] = rng.choice([0.0, 0.3, 20.0]) * rng.normal(size=3) / 1.7
    scene = {"gravity": -9.81 if rng.random() < 0.6 else 0.0}
    tied = rng.random() < 0.75
    if tied:
        scene["string"] = StringSettings(
            attached=True,
            attach=tuple((arm * rng.normal(size=3)).tolist()),
            target=tuple(rng.normal(size=3).tolist()),
            damping_ratio=log_uniform(rng, 1.0, 1e6),
            frequency=log_uniform(rng, 2.0, 100.0),
            rest_length=float(rng.choice([0.0, 0.5, 1.0])),
            bilateral=bool(rng.random() < 0.35),
        )
    angular = log_uniform(rng, 3e4, 1e10) if rng.random() < (0.4 if tied else 0.7) else 0.0
    linear = log_uniform(rng, 3e4, 1e10) if rng.random() < 0.25 else 0.0
    if rng.random() < 0.7:
        # Half of the loads are as strong as what damps them.
        strong = rng.random() < 0.5
        push, turn = (max(linear / 10, 1.0), max(angular / 10, 1.0)) if strong else (1.0, 1.0)
        force = push * body.mass * log_uniform(rng, 0.3, 30.0) * rng.normal(size=3)
        torque = turn * smallest * log_uniform(rng, 0.3, 30.0) * rng.normal(size=3)
        point = np.zeros(3) if strong else arm * rng.normal(size=3)
        scene["load"] = (str(rng.choice(["world", "body"])), point, force, torque)
    return body, row, {**scene, "angular": angular * smallest, "linear": linear * body.mass}


@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(40, 1000), marks=pytest.mark.stress)], ids=["few", "many"]
)
def test_stiff_damping_of_any_scene_costs_little_and_all_accuracies_agree(seeds):
    for seed in seeds:
        body, row, scene = stiff_scene(seed)
        size = np.sqrt(np.trace(body.inertia) / body.mass)
        fine, coarse = flown(body, row, scene, 1e-10), flown(body, row, scene, 1e-7)
        if "radau" not in coarse.choice:
            continue
        exact = fine.advance(SECOND // 5).row
        row = coarse.advance(SECOND // 5).row
        assert not fine.failure and not coarse.failure, seed
        assert coarse.steps <= 2000 or coarse.too_slow, seed
        away = distance(row, exact[3:7], exact[:3], exact[7:10], exact[10:])
        assert away <= 1e-7 * 0.2 * max(1.0, 1.0 / size), seed


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(1000, 1200))
def test_stiff_damping_of_any_scene_keeps_the_accuracy(seed):
    body, row, scene = stiff_scene(seed)
    size = np.sqrt(np.trace(body.inertia) / body.mass)
    simulation = flown(body, row, scene, 1e-7)
    got = simulation.advance(SECOND // 10).row
    exact = stiff_reference(body, row, 0.1, **scene, tied=simulation.string, tolerance=1e-9)
    away = distance(got, exact[3:7], exact[:3], exact[7:10], exact[10:])
    assert away <= 1e-7 * 0.1 * max(1.0, 1.0 / size)


def test_a_pull_only_string_that_is_all_damper_catches_a_body_and_lets_it_go():
    string = StringSettings(True, (0, 0, 0), (0, 0, 0), 50.0, 0.0, 1e6, 0.5)
    start = np.array([0, 0, 0.0, 0, 0, 0, 1, 0, 0, 4.0, 0, 0, 0])
    simulation = flight(
        BODY, integrator="auto", accuracy=1e-9, initial=start, gravity=np.array([0, 0, -9.81]), string=string
    )
    row = simulation.advance(SECOND // 5).row
    # Up with 4 m/s it comes to the end at 0.5 m, stops within a millionth of a second at a rate λ, and falls when the damper lets it go.
    with mp.workdps(30):
        g, v, rate = mpf("9.81"), mpf(4), 2 * mpf(10) ** 6 * mp.sqrt(mpf(50) / 2)
        caught = (v - mp.sqrt(v * v - g)) / g
        coming = mp.sqrt(v * v - g)
        held = mp.log(1 + rate * coming / g) / rate
        fallen = mpf("0.2") - caught - held
        z, w = mpf("0.5") + (coming - g * held) / rate - g * fallen**2 / 2, -g * fallen
    assert "radau" in simulation.choice
    assert abs(row[2] - float(z)) <= 1e-9
    assert abs(row[9] - float(w)) <= 1e-9
    assert simulation.force_evaluations <= MOST_EVALUATIONS
    assert simulation.accuracy_floor == ""


def test_a_motion_that_takes_more_steps_than_the_clock_leaves_time_for_says_so():
    string = StringSettings(True, (0, 0, 0), (0, 0, 0), 1e12, 0.0, 0.0, 0.0)
    start = np.array([0.1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.1])
    simulation = flight(BODY, integrator="auto", initial=start, string=string)
    # Before, by the swing of 7e5 rad/s; and after, by what it took.
    assert "4.7e+05 steps for a second of the motion, slower than real time" in simulation.too_slow
    simulation.advance(SECOND // 10)
    assert "slower than real time" in simulation.too_slow
    tiny = flight(BODY, integrator="rk4", step_s=1e-7, initial=START)
    assert "1e+07 steps" in tiny.too_slow
    tiny.advance(SECOND // 50)
    assert "slower than real time" in tiny.too_slow
    # Without the gyroscopic term the force turns along with a spin of 2e6 rad/s, which nothing slows down.
    spun = flight(BODY, integrator="auto", initial=spinning((0, 0, 2e6)), gyroscopic=False)
    assert spun.too_slow == ""
    spun.submit(wrench("body@com", (1.0, 0.0, 0.0)))
    spun.advance(1)
    assert "1.3e+06 steps" in spun.too_slow
    calm = flight(BODY, integrator="auto", initial=START, angular_damping=2e6)
    assert calm.too_slow == ""
    calm.advance(SECOND)
    assert calm.too_slow == ""


def test_implicit_steps_that_will_take_too_long_are_told_of_before_the_flight():
    """A force that turns with a body of 1e4 rad/s, its flight damped 1e9 times a second: measured 5e4 steps a second."""
    fast = flown(BODY, np.array([*START[:10], 0.0, 0.0, 1e4]), {"linear": 2e9, "load": TURNING}, 1e-9)
    fast.advance(1)
    assert "radau" in fast.choice
    assert "5e+04 steps for a second of the motion, slower than real time" in fast.too_slow
    fast.advance(SECOND // 100)
    assert "radau" in fast.choice
    assert "slower than real time" in fast.too_slow
    # A spin that is damped away at once asks for nothing.
    stopped = flown(BODY, np.array([*START[:10], 0.0, 0.0, 1e4]), {"angular": 2e8, "load": TURNING}, 1e-9)
    stopped.advance(1)
    assert "radau" in stopped.choice
    assert stopped.too_slow == ""


def test_portions_have_no_bearing_on_stiff_steps():
    def state(portion_ns):
        simulation = flight(BODY, integrator="auto", initial=START, angular_damping=2e6, string=LONG)
        for at in range(portion_ns, SECOND // 10, portion_ns):
            simulation.advance(at)
        return simulation.advance(SECOND // 10).sha256()

    assert len({state(10**9), state(10**6), state(123_457)}) == 1
