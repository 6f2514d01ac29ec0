# SPDX-License-Identifier: MIT
"""What a kernel that chooses its own steps keeps between calls, as one array of doubles.

An accepted step that reaches beyond the time asked for is kept until it can be committed, so that when anybody asks
never changes the steps.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.uncounted_arrays import copy_numbers
from .error_measure import FLOOR

ACCURACY = 0  # local error rate asked for [1/s]
DEGREE = 1  # of the series
ACCEPTED_NS = 2  # length of the step that waits for its commitment; 0 for none
ELAPSED_NS = 3  # committed since the segment's start
STEPS = 4  # committed
EVALUATIONS = 5  # in committed steps, one for each series
PENDING = 6  # evaluations spent on the step that waits
FLOOR_RATE = 7  # the largest error rate [1/s] that rounding, and not the accuracy, has allowed a step; 0 for none
FAILED = 8  # 1 when a nanosecond would be too long a step, or the motion ran away
SERIES = 9  # 1 while the workspace holds the series from the committed variables on
# Of the step that waits, where the string's law changes within it (integrators/series_steps.py):
LAW = 10  # the string's law at its start
SWITCH = 11  # time after which the last series holds and no more the first [s]; infinite for none
LAST_START = 12  # where the last series starts [s]
LAST_LAW = 13  # the law of the last series
PASSAGES = 14  # steps past the free end of a string that pushes, which keep no accuracy
SIZE = 15

LONGEST = 1e6
"""Longest step [s]: 10¹⁵ ns are exact in a double."""


@njit(cache=True, error_model="numpy", allocates=False)
def accept(control: np.ndarray, length_ns: int) -> None:
    """Let a step of this length wait for its commitment, its allowance no less than the floor."""
    control[ACCEPTED_NS] = length_ns
    if control[ACCURACY] * length_ns * 1e-9 < FLOOR:
        control[FLOOR_RATE] = max(control[FLOOR_RATE], FLOOR / (length_ns * 1e-9))


@njit(cache=True, error_model="numpy", allocates=False)
def commit(control: np.ndarray, y: np.ndarray, following: np.ndarray, room_ns: int) -> int:
    """Commit the step that waits, which ends in ``following``, in y if it fits into ``room_ns``; returns its length
    [ns], 0 where it goes beyond.
    """
    length = int(control[ACCEPTED_NS])
    if length > room_ns:
        return 0
    copy_numbers(following, y)
    count(control)
    return length


@njit(cache=True, error_model="numpy", allocates=False)
def count(control: np.ndarray) -> None:
    """The step that waits is committed."""
    control[ELAPSED_NS] += control[ACCEPTED_NS]
    control[EVALUATIONS] += control[PENDING]
    control[STEPS] += 1.0
    control[ACCEPTED_NS] = 0.0
    control[PENDING] = 0.0
    control[SERIES] = 0.0
