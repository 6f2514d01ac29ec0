# SPDX-License-Identifier: MIT
"""Times of publication, and the quaternion from one to the next."""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.scenario import publication_ns

SECOND = 10**9
SCENE = read_scene("t_handle")


@given(st.floats(1e-6, 1e4), st.integers(0, 10**7))
def test_publication_times_are_rounded_exactly(rate, k):
    exact = k * SECOND / Fraction(rate)
    assert abs(publication_ns(k, rate) - exact) <= Fraction(1, 2)


def test_publication_times_of_well_known_rates():
    assert [publication_ns(k, 3.0) for k in range(4)] == [0, 333_333_333, 666_666_667, SECOND]
    assert publication_ns(10**9 * 60, 60.0) == 10**18


def test_the_quaternion_is_never_flipped():
    simulation = OfflineRun(SCENE).simulation
    before = simulation.advance(0).orientation_xyzw.copy()
    # Twelve turns and more: q crosses its own negative many times.
    for k in range(1, 800):
        q = simulation.advance(10_000_000 * k).orientation_xyzw.copy()
        assert float(np.dot(q, before)) > 0.99
        before = q
