# SPDX-License-Identifier: MIT
"""Sums of powers and rough logarithms: what series are computed with."""

import numpy as np
import pytest
from numba import njit

from rigid_proto_ros.base.simd import filled, largest
from rigid_proto_ros.motion.integrators.series import power_sum
from rigid_proto_ros.motion.integrators.series_steps import fast_exp2, fast_log2


@njit
def sum_of_four(c, at, degree, h):
    return largest(power_sum(c, at, c.shape[1], degree, h, filled(0.0, 4)))


@pytest.mark.parametrize("degree", range(4, 27))
def test_a_sum_of_powers_takes_every_coefficient_once(degree):
    c = np.zeros((degree + 1, 8))
    c[:, 4] = np.random.default_rng(degree).uniform(0.5, 1.0, degree + 1)
    known = sum(float(a) * 0.7**k for k, a in enumerate(c[:, 4]))
    assert abs(sum_of_four(c, 4, degree, 0.7) / known - 1.0) < 1e-15 * degree


def test_rough_logarithms_and_powers_are_right_to_two_digits():
    x = 10.0 ** np.random.default_rng(1).uniform(-300.0, 300.0, 2000)
    logarithms = np.array([fast_log2(v) for v in x])
    # Measured 0.0053 and 0.0006.
    assert np.abs(logarithms - np.log2(x)).max() < 0.006
    assert max(abs(fast_exp2(v) / 2.0**v - 1.0) for v in np.log2(x)) < 0.001
