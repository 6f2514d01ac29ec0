# SPDX-License-Identifier: MIT
"""Borrowed arrays are the caller's own, written where they stand and never let go by compiled code."""

import sys

import numpy as np
import pytest
from numba import float64, njit
from numba.core.errors import NumbaError

from rigid_proto_ros.base import compilation
from rigid_proto_ros.base.borrowed_views import borrowed, copy_numbers


@njit
def add_to_rows(arrays):
    (first, some), second = borrowed(arrays)
    for k in range(first.shape[0]):
        row = first[k]
        row[:] += second[k]
    return some


def test_a_borrowed_array_is_the_callers_own() -> None:
    first, second = np.zeros((3, 2)), np.array([1.0, 2.0, 3.0])
    arrays = (first, True), second
    before = sys.getrefcount(first), sys.getrefcount(second)
    some = add_to_rows(arrays)
    assert some is True
    assert first.tolist() == [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]
    assert (sys.getrefcount(first), sys.getrefcount(second)) == before


def second_row(array):
    return array[1]


def copied_sum(array):
    return array.copy().sum()


def test_numbers_are_copied_as_many_as_there_is_room_for() -> None:
    numbers = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    copy_numbers(numbers[0], numbers[1, :2])
    assert numbers.tolist() == [[1.0, 2.0, 3.0], [1.0, 2.0, 6.0]]


@pytest.mark.parametrize(
    ("function", "why"), [(copied_sum, "NRT required"), (second_row, "Only accept returning of array passed")]
)
def test_a_function_said_to_make_no_arrays_neither_makes_nor_returns_one(function, why) -> None:
    with pytest.raises(NumbaError, match=why):
        compilation.njit((float64[:, ::1],), allocates=False)(function)
