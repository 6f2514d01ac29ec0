# SPDX-License-Identifier: MIT
"""Series in vector registers: a flight's coefficients don't depend on whether others go beside it."""

import numpy as np
from numba import njit

from rigid_proto_ros.base.simd import aligned, filled
from rigid_proto_ros.motion import problem as of
from rigid_proto_ros.motion.integrators.rough_logarithm import rough_exp2, rough_log2
from rigid_proto_ros.motion.integrators.taylor import COLUMNS, series, series_beside, sum_beside, sum_series
from rigid_proto_ros.motion.variables import STORED

FLIGHTS, DEGREE, STEP = 8, 13, 0.17


@njit
def eight_series(y, p, c):
    series_beside(y, p, DEGREE, c, True, filled(0.0, FLIGHTS))


@njit
def eight_sums(c, out):
    sum_beside(c, True, DEGREE, filled(STEP, FLIGHTS), out, filled(0.0, FLIGHTS))


def test_eight_flights_side_by_side_have_the_bits_of_each_alone():
    rng = np.random.default_rng(3)
    for _ in range(250):
        y, p = np.zeros((STORED, FLIGHTS)), np.zeros((of.SIZE, FLIGHTS))
        y[:13] = rng.normal(size=(13, FLIGHTS))
        y[:4] /= np.linalg.norm(y[:4], axis=0)
        y[4:7] *= 10.0 ** rng.uniform(-3.0, 3.0, FLIGHTS)
        p[of.MOMENTS : of.MOMENTS + 3] = np.sort(rng.uniform(1.0, 1.9, (3, FLIGHTS)), axis=0)
        p[of.TORQUE_BODY : of.TORQUE_BODY + 3] = rng.normal(size=(3, FLIGHTS))
        p[of.ACCELERATION_BODY : of.ACCELERATION_BODY + 3] = rng.normal(size=(3, FLIGHTS))
        p[of.DAMPING_LINEAR], p[of.DAMPING_ANGULAR] = rng.uniform(0.0, 1.0, (2, FLIGHTS))
        p[of.GYROSCOPIC] = rng.integers(0, 2, FLIGHTS)
        p[of.TRANSLATES] = 1.0
        beside, sums = aligned((DEGREE + 1, COLUMNS * FLIGHTS)), np.zeros((STORED, FLIGHTS))
        eight_series(y, p, beside)
        eight_sums(beside, sums)
        for flight in range(FLIGHTS):
            alone, row = aligned((DEGREE + 1, COLUMNS)), np.zeros(STORED)
            own = np.ascontiguousarray(p[:, flight])
            series(np.ascontiguousarray(y[:, flight]), own, DEGREE, alone)
            sum_series(alone, own, DEGREE, STEP, row)
            np.testing.assert_array_equal(beside.reshape(DEGREE + 1, COLUMNS, FLIGHTS)[..., flight], alone)
            np.testing.assert_array_equal(sums[:13, flight], row[:13])


def test_a_workspace_begins_a_line_of_the_cache():
    for rows in range(1, 30):
        work = aligned((rows, COLUMNS))
        assert work.ctypes.data % 64 == 0 and work.flags.c_contiguous and not work.any()


def test_rough_logarithms_and_powers_are_right_to_two_digits():
    x = 10.0 ** np.random.default_rng(1).uniform(-300.0, 300.0, 2000)
    logarithms = np.array([rough_log2(v) for v in x])
    # Measured 0.0053 and 0.0006.
    assert np.abs(logarithms - np.log2(x)).max() < 0.006
    assert max(abs(rough_exp2(v) / 2.0**v - 1.0) for v in np.log2(x)) < 0.001
