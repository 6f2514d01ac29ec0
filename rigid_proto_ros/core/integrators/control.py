# SPDX-License-Identifier: MIT
"""What a kernel that chooses its own steps keeps between calls, as one array of doubles.

An accepted step that reaches beyond the time asked for is kept until it can be committed, so that when anybody asks never
changes the steps.
"""

from __future__ import annotations

import numpy as np
from numba import njit

ACCURACY = 0  # local error rate asked for [1/s]
NEXT_S = 1  # length of the next trial [s]
ACCEPTED_NS = 2  # length of the step that waits for its commitment; 0 for none
ELAPSED_NS = 3  # committed since the segment's start
STEPS = 4  # committed
EVALUATIONS = 5  # in committed steps, rejected trials included
PENDING = 6  # evaluations spent on the step that waits
FLOOR_BINDS = 7  # 1 once rounding, not the accuracy, set the allowance of a step
FAILED = 8  # 1 when no step was short enough, or the motion ran away
DEGREE = 9  # of a Taylor series
SIZE = 10

LONGEST = 1e6
"""Longest step [s]: 10¹⁵ ns are exact in a double."""


def new_control(accuracy: float, first_s: float = 0.0, degree: int = 0) -> np.ndarray:
    """The array at a segment's start."""
    control = np.zeros(SIZE)
    control[ACCURACY], control[NEXT_S], control[DEGREE] = accuracy, first_s, degree
    return control


@njit(cache=True, error_model="numpy")
def commit(control):
    """Count the step that waited as committed."""
    control[ELAPSED_NS] += control[ACCEPTED_NS]
    control[EVALUATIONS] += control[PENDING]
    control[STEPS] += 1.0
    control[ACCEPTED_NS] = 0.0
    control[PENDING] = 0.0
