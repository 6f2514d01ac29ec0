# SPDX-License-Identifier: MIT
"""Numbers are copied where there is room, and kernels said to make no arrays make none."""

import numpy as np
import pytest
from numba import float64
from numba.core.errors import NumbaError

from rigid_proto_ros.base import compilation
from rigid_proto_ros.base.records import copy_numbers


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
