# SPDX-License-Identifier: MIT
"""Arrays found by their addresses, which costs a call less than being handed them.

A compiled function that is handed arrays looks into each of them first, at more cost than a
short flight has. Whoever gives an address away keeps the array.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import carray, float64, int64, types

from .compilation import intrinsic, njit
from .kernel_calls import _INTERPRETED


def address_of_array(array: np.ndarray) -> int:
    """Where the first number of an array stands."""
    return array.__array_interface__["data"][0]


def _pointer_to(kind: types.Type) -> Callable:
    @intrinsic
    def pointer(_typing_context: Any, _address: Any) -> tuple:
        def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(int64), code

    return pointer


def _array_at(kind: types.Type, dtype: type) -> Callable:
    """The function (address, shape) that gives a contiguous array of this kind."""
    pointer = _pointer_to(kind)

    @njit(cache=True, error_model="numpy")
    def compiled(address: int, shape: tuple[int, ...]) -> np.ndarray:
        return carray(pointer(address), shape)

    def interpreted(address: int, shape: tuple[int, ...]) -> np.ndarray:
        bytes_there = (ctypes.c_char * (8 * int(np.prod(shape)))).from_address(int(address))
        return np.frombuffer(memoryview(bytes_there), dtype).reshape(shape)

    return interpreted if _INTERPRETED else compiled


doubles_at, integers_at = _array_at(float64, np.float64), _array_at(int64, np.int64)
