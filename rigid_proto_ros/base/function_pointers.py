# SPDX-License-Identifier: MIT
"""Compiled functions as numbers: what stands at an address is called without being handed over.

A kernel's address stands in an array of integers, so that one loop can call whichever kernel a segment needs without
compiling the others in; what is called there is the machine code that numba made of the kernel for one fixed signature.
Compiling or loading it waits until somebody asks for the address.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import int64, types
from numba.core import cgutils
from numba.core.types.function_type import CompileResultWAP
from numba.core.typing.templates import Signature

from .compilation import INTERPRETED, Emitted, intrinsic

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
