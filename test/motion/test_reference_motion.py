# SPDX-License-Identifier: MIT
"""The two references that judge the integrators, each worked out by itself, agree with each other."""

import numpy as np
import pytest
from mpmath import mp, mpf
from reference_motion import free_motion, rotation_of
from reference_taylor import ReferenceProblem, reference_motion

from problems import P1, tuples

FULL = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
ATTITUDE = (0.2, -0.4, 0.4, 0.8)


@pytest.mark.parametrize(
    ("inertia", "spin", "time"),
    [
        (np.array(P1.inertia), P1.row[10:], 20),
        (np.diag([1.0, 2.0, 3.0]), (0.1, 0.2, 3.0), 5),
        (np.diag([3.0, 1.0, 2.0]), (-2.0, 0.1, 0.2), 5),
        (FULL, (0.3, 1.0, -0.2), 5),
        (FULL, (-3.0, 0.2, 0.5), 5),
    ],
)
def test_closed_form_and_taylor_series_agree_to_38_digits(inertia, spin, time):
    row = [0, 0, 0, *ATTITUDE, 0, 0, 0, *spin]
    (turned,) = reference_motion(ReferenceProblem(1.0, tuples(inertia)), row, [time], digits=40)
    R, w = free_motion(inertia, spin, time, ATTITUDE)
    with mp.workdps(60):
        assert np.abs(rotation_of(turned[3:7]) - R).max() < mpf("1e-38")
        assert np.abs(turned[10:] - w).max() < mpf("1e-38")
