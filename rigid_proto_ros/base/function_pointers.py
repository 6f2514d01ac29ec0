# SPDX-License-Identifier: MIT
"""Compiled functions and arrays as numbers: what stands at an address is called or read without being handed over.

A kernel's address stands in an array of integers, so that one loop can call whichever kernel a segment needs without
compiling the others in; what is called there is the machine code that numba made of the kernel for one fixed signature.
Compiling or loading it waits until somebody asks for the address. Arrays are found by their addresses because a
compiled function that is handed arrays inspects each of them first, at more cost than a short flight has: whoever gives
an address away keeps the array.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import from_dtype, int64, types
from numba.core import cgutils
from numba.core.types.function_type import CompileResultWAP
from numba.core.typing.templates import Signature
from numba.np.numpy_support import carray

from .compilation import INTERPRETED, Emitted, intrinsic, njit

_kept: dict[int, Any] = {}
"""What stands at the addresses given away: code must not be collected while an array points at it."""


def address_of(kernel: Callable[..., Any], taken_as: types.FunctionType) -> int:
    """The address of a compiled function for this signature, compiled or loaded from the cache if it isn't yet."""
    if INTERPRETED:
        found, address = kernel, id(kernel)
    else:
        kernel.compile(taken_as.signature)  # type: ignore[attr-defined]  # numba's
        found = CompileResultWAP(kernel.get_compile_result(taken_as.signature))  # type: ignore[attr-defined]  # numba's
        address = found.__wrapper_address__()
    _kept[address] = found
    return address


def entry_of(kernel: Callable[..., Any], signature: Signature) -> Callable[..., Any]:
    """The compiled function itself for this signature: called without looking at its arguments' types.

    A call through numba's dispatcher looks them up each time, which costs more than a short kernel takes.
    """
    if INTERPRETED:
        return kernel
    kernel.compile(signature)  # type: ignore[attr-defined]  # numba's
    entry: Callable[..., Any] = kernel.get_compile_result(signature).entry_point  # type: ignore[attr-defined]  # numba's
    return entry


def function_at(taken_as: types.FunctionType) -> Callable[..., Any]:
    """The compiled function that turns an address into a function of this signature."""

    @intrinsic
    def at(_typing_context: Any, _address: Any) -> Emitted:
        def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            function = cgutils.create_struct_proxy(taken_as)(context, builder)
            nothing = cgutils.get_null_value(cgutils.voidptr_t)
            function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
            function.py_addr, function.jit_addr = nothing, nothing
            return function._getvalue()  # noqa: SLF001 (so numba's guide to extensions does it)

        return taken_as(int64), code

    return _kept.__getitem__ if INTERPRETED else at


def address_of_array(array: np.ndarray) -> int:
    """Where the first number of an array stands, which may be written to."""
    return int(array.ctypes.data) if array.dtype.names else int(array.__array_interface__["data"][0])


def _pointer_to(kind: types.Type) -> Callable[..., Any]:
    @intrinsic
    def pointer(_typing_context: Any, _address: Any) -> Emitted:
        def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(types.CPointer(kind)))

        return types.CPointer(kind)(int64), code

    at: Callable[..., Any] = pointer
    return at


def array_at(dtype: np.dtype) -> Callable[..., Any]:
    """The function (address, shape) that gives a contiguous array of these."""
    pointer = _pointer_to(from_dtype(dtype))

    @njit(cache=True, error_model="numpy")
    def compiled(address: int, shape: tuple[int, ...]) -> np.ndarray:
        return carray(pointer(address), shape)

    def interpreted(address: int, shape: tuple[int, ...]) -> np.ndarray:
        bytes_there = (ctypes.c_char * (dtype.itemsize * int(np.prod(shape)))).from_address(int(address))
        return np.frombuffer(memoryview(bytes_there), dtype).reshape(shape)

    return interpreted if INTERPRETED else compiled


doubles_at = array_at(np.dtype(np.float64))
