# SPDX-License-Identifier: MIT
"""Uncounted arrays are the caller's own, written where they stand and never let go by compiled code."""

import sys

import numpy as np
from numba import njit

from rigid_proto_ros.base.uncounted_arrays import uncounted


@njit
def add_to_rows(arrays):
    (first, some), second = uncounted(arrays)
    for k in range(first.shape[0]):
        row = first[k]
        row[:] += second[k]
    return some


def test_an_uncounted_array_is_the_callers_own() -> None:
    first, second = np.zeros((3, 2)), np.array([1.0, 2.0, 3.0])
    arrays = (first, True), second
    before = sys.getrefcount(first), sys.getrefcount(second)
    some = add_to_rows(arrays)
    assert some is True
    assert first.tolist() == [[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]
    assert (sys.getrefcount(first), sys.getrefcount(second)) == before
