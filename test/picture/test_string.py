# SPDX-License-Identifier: MIT
"""A slack string hangs along gravity between its ends, as long as it is; any other one is straight."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.picture.string import POINTS, sags, string_curves

DOWN = np.array([0.0, 0.0, -9.81])


@settings(deadline=None)
@given(st.floats(0.0, 0.9999), st.floats(0.0, np.pi), st.floats(1e-3, 1e3))
def test_a_slack_string_is_drawn_as_long_as_it_is(taut, slope, length):
    span = taut * length * np.array([[np.sin(slope), 0.0, np.cos(slope)]])
    sag = sags(span, length, DOWN)
    along = np.linspace(0.0, 1.0, 4001)[:, np.newaxis]
    curve = along * span + 4.0 * along * (1.0 - along) * sag
    assert np.isclose(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum(), length, rtol=1e-5)


def test_a_string_hangs_down_from_end_to_end_or_is_straight():
    free = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.5]])
    knots = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
    curves = string_curves(free, knots, np.array([1.5, 1.5, 2.0, 1.5, 1.5]), DOWN)
    assert curves.shape == (5, POINTS, 3)
    assert np.array_equal(curves[:, 0], free) and np.abs(curves[:, -1] - knots).max() < 1e-12
    straight = 0.5 * (free + knots)
    middles = curves[:, POINTS // 2]
    lengths = np.linalg.norm(np.diff(curves, axis=1), axis=2).sum(axis=1)
    assert np.abs(lengths[[0, 1, 3, 4]] / 1.5 - 1.0).max() < 4e-3  # measured 3e-3, of 24 chords, one in the bight
    assert (middles[[0, 1], 2] < straight[[0, 1], 2] - 0.3).all()
    assert np.abs(middles[2] - straight[2]).max() < 1e-12, "as long as its ends are apart"
    assert np.abs(curves[3, :, :2]).max() == 0.0, "a vertical one hangs below its lower end and turns back"
    assert abs(curves[3, :, 2].min() - -0.25) < 2e-3
    assert abs(curves[4, :, 2].min() - (0.5 - 0.75)) < 1e-12, "ends that meet: two halves side by side"
    assert np.abs(string_curves(free, knots, 0.0, DOWN)[:, POINTS // 2] - straight).max() < 1e-12


def test_it_hangs_where_gravity_pulls_and_downward_without_any():
    span = np.array([[0.3, 0.1, 0.2]] * 3)
    gravity = np.array([[3.0, 0.0, 0.0], [0.0, -1.6, 1.2], [0.0, 0.0, 0.0]])
    found = sags(span, 1.0, gravity)
    depths = np.linalg.norm(found, axis=1)
    ways = np.array([[1.0, 0.0, 0.0], [0.0, -0.8, 0.6], [0.0, 0.0, -1.0]])
    assert (depths > 0.2).all() and np.abs(found / depths[:, np.newaxis] - ways).max() < 1e-15
    (alone,) = sags(span[1:2], 1.0, gravity[1])
    assert np.array_equal(alone, found[1])
