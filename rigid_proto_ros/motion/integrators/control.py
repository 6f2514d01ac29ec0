# SPDX-License-Identifier: MIT
"""What a kernel that chooses its own steps keeps between calls.

An accepted step that reaches beyond the time asked for is kept until it can be committed, so that when anybody asks
never changes the steps.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.records import record_type
from ...base.uncounted_arrays import copy_numbers
from .error_measure import FLOOR

CONTROL = record_type(
    [
        ("accuracy", np.float64),  # local error rate asked for [1/s]
        ("degree", np.int64),  # of the series
        ("accepted_ns", np.int64),  # length of the step that waits for its commitment; 0 for none
        ("elapsed_ns", np.int64),  # committed since the segment's start
        ("steps", np.int64),  # committed
        ("evaluations", np.int64),  # in committed steps, one for each series
        ("pending", np.int64),  # evaluations spent on the step that waits
        ("floor_rate", np.float64),  # the largest [1/s] that rounding, and not the accuracy, has allowed a step
        ("failed", np.bool_),  # a nanosecond would be too long a step, or the motion ran away
        ("series", np.bool_),  # the workspace holds the series from the committed variables on
        # Of the step that waits, where the string's law changes within it (integrators/series_steps.py):
        ("law", np.float64),  # the string's law at its start
        ("switch", np.float64),  # time after which the last series holds and no more the first [s]; infinite for none
        ("last_start", np.float64),  # where the last series starts [s]
        ("last_law", np.float64),  # the law of the last series
        ("passages", np.int64),  # steps past the free end of a string that pushes, which keep no accuracy
    ]
)

LONGEST = 1e6
"""Longest step [s]: 10¹⁵ ns are exact in a double."""


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def begin_control(control: np.record, accuracy: float, degree: int) -> None:
    """What a segment starts with."""
    control.accuracy, control.degree = accuracy, degree
    control.accepted_ns, control.elapsed_ns = 0, 0
    control.steps, control.evaluations, control.pending, control.passages = 0, 0, 0, 0
    control.floor_rate = 0.0
    control.failed, control.series = False, False
    control.law, control.switch, control.last_start, control.last_law = 0.0, 0.0, 0.0, 0.0


@njit(cache=True, error_model="numpy", allocates=False)
def accept(control: np.record, length_ns: int) -> None:
    """Let a step of this length wait for its commitment, its allowance no less than the floor."""
    control.accepted_ns = length_ns
    if control.accuracy * length_ns * 1e-9 < FLOOR:
        control.floor_rate = max(control.floor_rate, FLOOR / (length_ns * 1e-9))


@njit(cache=True, error_model="numpy", allocates=False)
def commit(control: np.record, y: np.ndarray, following: np.ndarray, room_ns: int) -> int:
    """Commit the step that waits, which ends in ``following``, in y if it fits into ``room_ns``; returns its length
    [ns], 0 where it goes beyond.
    """
    length = control.accepted_ns
    if length > room_ns:
        return 0
    copy_numbers(following, y)
    count(control)
    return length


@njit(cache=True, error_model="numpy", allocates=False)
def count(control: np.record) -> None:
    """The step that waits is committed."""
    control.elapsed_ns += control.accepted_ns
    control.evaluations += control.pending
    control.steps += 1
    control.accepted_ns = 0
    control.pending = 0
    control.series = False
