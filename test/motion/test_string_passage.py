# SPDX-License-Identifier: MIT
"""A bilateral string pushes at the full length of its rest where its knot passes near its free end."""

import math

import numpy as np
import pytest
from flights import SECOND, flight
from scipy.integrate import solve_ivp

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.string import StringSettings

BALL = make_body(2.0, np.zeros(3), 0.02 * np.eye(3))
STIFFNESS, REST = 50.0, 0.25
CONDITION = 113.0
"""1/s; of what becomes of the distance at which the knot passes, at 1e-10 m."""


def tied(attach=(0.0, 0.0, 0.0), damping_ratio=0.0):
    return StringSettings(
        *(True, attach, (0.0, 0.0, 0.0), STIFFNESS, 0.0, damping_ratio, REST), bilateral=True, timeout_ns=0
    )


@pytest.mark.parametrize("miss", [0.0, 1e-12, 1e-9])
def test_a_knot_that_meets_its_free_end_stops_there_and_that_is_said(miss):
    row = [0.3, 0, miss, 0, 0, 0, 1, -3.0, 0, 0, 0, 0, 0]
    simulation = flight(BALL, integrator="auto", initial=row, string=tied())
    state = simulation.advance(SECOND)
    # Some nanoseconds' way at 3 m/s before it.
    assert 0.0 <= state.position[0] <= 1e-8 and state.linear_velocity[0] < -2.0
    assert "no direction where its knot meets its free end" in simulation.failure


@pytest.mark.parametrize("damping_ratio", [0.0, 0.1])
@pytest.mark.parametrize("miss", [1e-8, 1e-6, 1e-4])
def test_a_knot_that_passes_nearby_is_turned_as_the_reference_has_it(miss, damping_ratio):
    damping = 2.0 * damping_ratio * math.sqrt(STIFFNESS * BALL.mass)

    def rates(_, s):
        length = math.hypot(s[0], s[1])
        n = s[:2] / length
        pull = STIFFNESS * (length - REST) + damping * (n @ s[2:])
        return np.concatenate([s[2:], -pull / BALL.mass * n])

    start = [0.3, miss, -3.0, 0.0]
    end = solve_ivp(rates, (0.0, 0.15), start, "DOP853", rtol=1e-13, atol=1e-22, first_step=1e-3).y[:, -1]
    row = [0.3, 0, miss, 0, 0, 0, 1, -3.0, 0, 0, 0, 0, 0]
    for accuracy in (1e-6, 1e-9, 1e-12):
        string = tied(damping_ratio=damping_ratio)
        simulation = flight(BALL, integrator="auto", accuracy=accuracy, initial=row, string=string)
        state = simulation.advance(round(0.15 * SECOND))
        assert not simulation.failure
        # The knot comes there after 0.1 s, and a miss that is off by 1 m turns the velocity by CONDITION m/s more.
        allowed = CONDITION * accuracy * 0.1
        assert np.abs(state.position[[0, 2]] - end[:2]).max() <= allowed
        assert np.abs(state.linear_velocity[[0, 2]] - end[2:]).max() <= allowed
