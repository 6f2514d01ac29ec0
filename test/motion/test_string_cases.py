# SPDX-License-Identifier: MIT
"""Strings where they are hard: slack and caught late, past their free end, and as stiff as auto resolves.

Of a body that doesn't spin, or hardly, free flight is a polynomial of time, and its first contact is found however late.
"""

import math

import numpy as np
import pytest
from flights import SECOND, StringSettings, flight, flight_setup
from reference_scenes import Scene

import problems
from motion_measures import energy
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators.string_law import NONE, first_rise
from rigid_proto_ros.scene.scenario import make_scenario
from work_precision_ours import simulation_of

BALL = make_body(2.0, np.zeros(3), 0.02 * np.eye(3))
THROWN = {"mesh": "book", "gravity": [0.0, 0.0, -9.81], "initial.linear_velocity": [0.2, 0.0, 2.0]}


def test_a_book_thrown_on_a_slack_rope_lands_where_the_reference_has_it():
    """Thrown up beside the point where its rope of 0.2 m ends."""
    scene = make_scenario({**THROWN, "string.attached": True, "string.rest_length": 0.2})
    thrown = Scene(scene.setup)
    exact = np.array(thrown.reference(2.0), float)
    for accuracy in (1e-3, 1e-6, 1e-9, 1e-12):
        # Measured 6e-4 to 1.6e-3 of it.
        assert np.abs(thrown.flown(2.0, accuracy=accuracy)[:3] - exact[:3]).max() <= 2.0 * accuracy


def test_a_ball_that_leaves_its_own_target_bounces_between_both_ends_of_its_rope():
    speed, rest_length, stiffness = 0.3, 0.25, 50.0
    rope = StringSettings(attached=True, rest_length=rest_length, stiffness=stiffness, damping_ratio=0.0)
    row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, speed, 0.0, 0.0, 0.0, 0.0, 0.0]
    simulation = flight(BALL, integrator="auto", initial=row, string=rope)
    rate = math.sqrt(stiffness / BALL.mass)
    there, turn = rest_length / speed, math.pi / rate
    for k in range(1, 400):
        time = 0.05 * k
        x = simulation.advance(round(time * SECOND)).position[0]
        bounces, since = divmod(time + there, 2.0 * there + turn)
        away = since * speed - rest_length
        if since > 2.0 * there:
            away = rest_length + speed / rate * math.sin(rate * (since - 2.0 * there))
        # Measured 2.3e-10.
        assert abs(x - away * (-1.0) ** bounces) <= 1e-9, time


def test_a_rope_that_is_reached_after_hours_pulls_then():
    rope = StringSettings(attached=True, rest_length=1000.0, stiffness=50.0, damping_ratio=0.0)
    row = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.125, 0.0, 0.0, 0.0, 0.0, 0.0]
    end = flight(BALL, integrator="auto", initial=row, string=rope).advance(10_000 * SECOND)
    # Taut after 8000 s for half a swing of the spring; measured 1e-8 m off.
    assert end.position[0] == pytest.approx(1000.0 - (2000.0 - math.pi / 5.0) * 0.125, abs=1e-6)


@pytest.mark.parametrize(
    ("roots", "first"),
    [
        ([0.3, 0.5, 0.7], 0.3),
        ([0.25, 0.25, 0.75], 0.75),
        ([0.5 - 1e-6, 0.5 + 1e-6], 0.5 - 1e-6),
        ([0.25, 0.25], NONE),
        ([1e-9, 0.9, 0.95], 1e-9),
        ([-0.5, 1.5], NONE),
        ([0.1] * 5 + [0.9] * 3, 0.1),
    ],
)
def test_the_first_rise_of_a_polynomial_is_never_a_later_one(roots, first):
    g = np.polynomial.polynomial.polyfromroots(roots)
    g *= -1.0 if g[0] > 0.0 else 1.0
    found = first_rise(g, len(g) - 1)
    if roots.count(first) > 1:
        # Rounding of the coefficients moves a root of this many by its root.
        assert abs(found - first) <= 1e-16 ** (1.0 / roots.count(first)) * 4.0
    else:
        assert abs(found - first) <= 1e-9


STIFFNESS, REST = 50.0, 0.25
CONDITION = 113.0
"""1/s; of what becomes of the distance at which the knot passes, at 1e-10 m."""


def pushing(damping_ratio=0.0):
    return StringSettings(
        attached=True, stiffness=STIFFNESS, damping_ratio=damping_ratio, rest_length=REST, bilateral=True, timeout_ns=0
    )


@pytest.mark.parametrize("miss", [0.0, 1e-12, 1e-9])
def test_a_knot_that_meets_its_free_end_stops_there_and_that_is_said(miss):
    row = [0.3, 0, miss, 0, 0, 0, 1, -3.0, 0, 0, 0, 0, 0]
    simulation = flight(BALL, integrator="auto", initial=row, string=pushing())
    state = simulation.advance(SECOND)
    # Some nanoseconds' way at 3 m/s before it.
    assert 0.0 <= state.position[0] <= 1e-8 and state.linear_velocity[0] < -2.0
    assert "no direction where its knot meets its free end" in simulation.failure


@pytest.mark.parametrize("damping_ratio", [0.0, 0.1])
@pytest.mark.parametrize("miss", [1e-8, 1e-6, 1e-4])
def test_a_knot_that_passes_nearby_is_turned_as_the_reference_has_it(miss, damping_ratio):
    row = np.array([0.3, 0, miss, 0, 0, 0, 1, -3.0, 0, 0, 0, 0, 0])
    scene = Scene(flight_setup(BALL, integrator="auto", initial=row, string=pushing(damping_ratio)))
    end = np.array(scene.reference(0.15), float)
    for accuracy in (1e-6, 1e-9, 1e-12):
        # The knot comes there after 0.1 s, and a miss that is off by 1 m turns the velocity by CONDITION m/s more.
        assert np.abs(scene.flown(0.15, accuracy=accuracy) - end)[[0, 2, 7, 9]].max() <= CONDITION * accuracy * 0.1


FREQUENCIES = (10.0, 1e2, 1e3, 1e4, 1e5)
"""ω_s [rad/s]."""


@pytest.mark.parametrize(
    ("frequency", "every_s"),
    [(10.0, 0.125), (1e3, 0.125), *(pytest.param(f, 0.0125, marks=pytest.mark.stress) for f in FREQUENCIES)],
)
@pytest.mark.parametrize("bilateral", [True, False], ids=["bilateral", "pull-only"])
def test_auto_keeps_the_energy_on_a_string(bilateral, frequency, every_s):
    problem = problems.string_problem(frequency, 0.0, bilateral, 10.0)
    simulation = simulation_of(problem, "auto", 1e-3)
    start, largest = energy(problem, simulation.state.row)
    worst = 0.0
    for k in range(1, round(10.0 / every_s) + 1):
        now, kinetic = energy(problem, simulation.advance(round(k * every_s * SECOND)).row)
        worst, largest = max(worst, abs(now - start)), max(largest, kinetic)
    assert not simulation.failure and simulation.time_ns == 10 * SECOND
    # Measured 8e-12 at most.
    assert worst / largest <= 1e-9
