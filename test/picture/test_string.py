# SPDX-License-Identifier: MIT
"""A slack string hangs along gravity between its ends, as long as it is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.picture.string import POINTS, string_curves

GRAVITY = np.array([0.0, 0.0, -9.81])


@settings(deadline=None, max_examples=30)
@given(st.floats(0.0, 0.9999), st.floats(0.0, np.pi), st.floats(1e-3, 1e3))
def test_a_slack_string_is_drawn_as_long_as_it_is_from_end_to_end(taut, slope, length):
    free = np.array([[0.3, -0.2, 1.0]])
    knots = free + taut * length * np.array([[np.sin(slope), 0.0, np.cos(slope)]])
    (curve,) = string_curves(free, knots, np.array([length]), GRAVITY)
    assert curve.shape == (POINTS, 3)
    assert np.isclose(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum(), length, rtol=1e-9)
    assert np.array_equal(curve[0], free[0]) and np.abs(curve[-1] - knots[0]).max() < 1e-12 * max(length, 1.0)
    # Not above the straight line, and in the plane of its ends.
    straight = free + np.linspace(0.0, 1.0, POINTS)[:, np.newaxis] * (knots - free)
    assert (curve[:, 2] <= straight[:, 2]).all() and np.array_equal(curve[:, :2], straight[:, :2])


@pytest.mark.parametrize(
    "gravity, way",
    [([3.0, 0.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, -1.6, 1.2], [0.0, -0.8, 0.6]), ([0.0, 0.0, 0.0], [0.0, 0.0, -1.0])],
)
def test_it_hangs_where_gravity_pulls_and_downward_without_any(gravity, way):
    knot = np.array([[0.3, 0.1, 0.2]])
    (curve,) = string_curves(np.zeros((1, 3)), knot, np.ones(1), np.array(gravity))
    sag = curve[POINTS // 2] - 0.5 * knot[0]
    assert np.linalg.norm(sag) > 0.2 and np.abs(sag / np.linalg.norm(sag) - way).max() < 1e-15
