# SPDX-License-Identifier: MIT
"""A slack string hangs down between its ends, as long as it is; any other one is straight."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.rerun_view.string_curve import POINTS, sag, string_curves


@settings(deadline=None)
@given(st.floats(0.01, 0.999), st.floats(1e-3, 1e3))
def test_a_slack_string_is_drawn_as_long_as_it_is(taut, length):
    (depth,) = sag(np.array([taut * length]), length)
    along = np.linspace(0.0, 1.0, 4001)
    curve = np.column_stack([taut * length * along, 4.0 * depth * along * (1.0 - along)])
    assert np.isclose(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum(), length, rtol=1e-5)


def test_a_string_hangs_down_from_end_to_end_or_is_straight():
    free = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0], [0.5, 0.5, 0.5]])
    knots = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
    curves = string_curves(free, knots, np.array([1.5, 1.5, 2.0, 1.5, 1.5]))
    assert curves.shape == (5, POINTS, 3)
    assert np.array_equal(curves[:, 0], free) and np.abs(curves[:, -1] - knots).max() < 1e-12
    straight = 0.5 * (free + knots)
    middles = curves[:, POINTS // 2]
    lengths = np.linalg.norm(np.diff(curves, axis=1), axis=2).sum(axis=1)
    assert np.abs(lengths[[0, 1, 3, 4]] / 1.5 - 1.0).max() < 2e-3  # measured 7e-4, of 24 chords
    assert (middles[[0, 1], 2] < straight[[0, 1], 2] - 0.3).all()
    assert np.abs(middles[2] - straight[2]).max() < 1e-12, "as long as its ends are apart"
    assert abs(middles[3, 2] - 0.5) < 1e-12 and middles[3, 0] > 0.3, "a vertical one hangs sideways"
    assert np.abs(string_curves(free, knots, 0.0)[:, POINTS // 2] - straight).max() < 1e-12
