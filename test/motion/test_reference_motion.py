# SPDX-License-Identifier: MIT
"""The two references that judge the integrators, each worked out by itself, agree with each other."""

import numpy as np
import pytest
from mpmath import mp, mpf
from reference_motion import free_motion, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from problems import P1, tuples

FULL = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
ATTITUDE = (0.2, -0.4, 0.4, 0.8)


@pytest.mark.parametrize(
    ("inertia", "spin", "time", "digits"),
    [
        (np.array(P1.inertia), P1.row[10:], 20, 18),
        (np.diag([1.0, 2.0, 3.0]), (0.1, 0.2, 3.0), 5, 18),
        (np.diag([3.0, 1.0, 2.0]), (-2.0, 0.1, 0.2), 5, 18),
        (FULL, (0.3, 1.0, -0.2), 5, 18),
        (FULL, (-3.0, 0.2, 0.5), 1, 25),
    ],
)
def test_closed_form_and_taylor_series_agree_to_all_but_two_digits(inertia, spin, time, digits):
    row = [0, 0, 0, *ATTITUDE, 0, 0, 0, *spin]
    (turned,) = reference_motion(ReferenceProblem(1.0, tuples(inertia)), row, [time], digits)
    R, w = free_motion(inertia, spin, time, ATTITUDE)
    with mp.workdps(60):
        assert np.abs(rotation_of(turned[3:7]) - R).max() < mpf(10) ** (2 - digits)
        assert np.abs(turned[10:] - w).max() < mpf(10) ** (2 - digits)


@pytest.mark.parametrize("digits", [18, 22])
def test_an_undamped_string_in_the_reference_is_the_spring_of_the_textbook(digits):
    """Pulled along its length by a free end that moves on evenly, it turns taut, swings about it, and turns slack."""
    string = ReferenceString((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 50.0, rest_length=0.25, target_velocity=(0.5, 0.0, 0.0))
    problem = ReferenceProblem(2.0, tuples(np.eye(3)), string=string)
    row = [0.0, 0.0, 0.0, *ATTITUDE, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    inside, after = reference_motion(problem, row, [0.7, 1.4], digits)
    with mp.workdps(40):
        # Taut after 0.5 s for half a period, π/5 s; then the body is twice as fast as the free end.
        swung = mpf("0.5") * mpf(0.7) - mpf("0.25") - mpf("0.1") * mp.sin(5 * (mpf(0.7) - mpf("0.5")))
        assert abs(inside[0] - swung) < mpf(10) ** (3 - digits)
        assert abs(after[7] - 1) < mpf(10) ** (3 - digits)
