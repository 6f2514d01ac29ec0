# SPDX-License-Identifier: MIT
"""How a segment is stepped: fixed steps, one exact step, nothing at all, or steps whose length follows from the error.

A kernel's address stands in an array of integers, so that one loop can call whichever kernel a segment needs without
compiling the others in; what is called there is the machine code that numba made of the kernel for one fixed signature.
Compiling or loading it waits until somebody asks for the address.

All keep the same promise. ``commit`` commits only steps that are functions of the variables they start from; ``reach``
takes one shorter step from there on a copy. So neither depends on when anybody asked.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import boolean, float64, from_dtype, int64, types
from numba.core import cgutils
from numba.core.types.function_type import CompileResultWAP

from ...base.compilation import INTERPRETED, Emitted, intrinsic, njit
from ...base.records import record_type
from ..problem import PROBLEM
from .integrator import ADAPTIVE, FIXED_STEPS, NOTHING, Integrator
from .series_steps import CONTROL

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


STEPS = types.FunctionType(int64(float64[::1], from_dtype(PROBLEM), float64, int64))
"""A kernel (y, p, h, n)."""

ADAPTIVE_STEPS = types.FunctionType(
    int64(float64[::1], from_dtype(PROBLEM), from_dtype(CONTROL), float64[::1], float64[:, ::1], int64, boolean)
)
"""A kernel (y, p, control, following, workspace, span_ns, sampling)."""

steps_at, adaptive_steps_at = function_at(STEPS), function_at(ADAPTIVE_STEPS)

METHOD = record_type(
    [
        ("way", np.int64),
        ("address", np.int64),  # of the kernel; 0: not compiled yet
        ("evaluations", np.int64),
        ("sleeps", np.bool_),
        ("rows", np.int64),  # of the workspace
        ("columns", np.int64),
    ]
)


@functools.lru_cache(maxsize=256)
def method_table(integrator: Integrator, degree: int) -> np.ndarray:
    """The integrator's methods as compiled loops read them (n,) METHOD; kernels have no address until they are
    wanted.
    """
    table = np.zeros(len(integrator.methods), METHOD)
    for number, method in enumerate(integrator.methods):
        rows, columns = method.workspace(degree).shape if method.workspace else (0, 0)
        table[number] = method.way, 0, method.evaluations, method.sleeps, rows, columns
    return table


def workspace_size(table: np.ndarray) -> int:
    """Of the method that needs most [doubles]; of one table or several."""
    return int((table["rows"] * table["columns"]).max())


def provide_kernel(integrator: Integrator, table: np.ndarray, number: int) -> None:
    """Compile a method's kernel, or load it from the cache, and put its address into the table."""
    kernel, method = integrator.methods[number].kernel, table[number]
    if kernel is not None and method["address"] == 0:
        method["address"] = address_of(kernel, ADAPTIVE_STEPS if method["way"] == ADAPTIVE else STEPS)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def is_provided(method: np.record) -> bool:
    """Whether the method's kernel can be called."""
    return bool(method.way == NOTHING or method.address != 0)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def commit(
    method: np.record,
    y: np.ndarray,
    p: np.record,
    control: np.record,
    following: np.ndarray,
    room: np.ndarray,
    step_ns: int,
    span_ns: int,
) -> tuple[int, int, bool]:
    """Commit steps in y that fit into ``span_ns``; returns how far it came [ns], how many were counted here, and
    whether all were good. room: for the workspace, of any size that is enough.
    """
    if method.way == FIXED_STEPS:
        wanted = span_ns // step_ns
        if wanted <= 0:
            return 0, 0, True
        done = steps_at(method.address)(y, p, step_ns * 1e-9, wanted)
        return done * step_ns, done, done == wanted
    if method.way == ADAPTIVE:
        workspace = room[: method.rows * method.columns].reshape((method.rows, method.columns))
        advanced = adaptive_steps_at(method.address)(y, p, control, following, workspace, span_ns, False)
        return advanced, 0, not control.failed
    return 0, 0, True


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def reach(
    method: np.record,
    y: np.ndarray,
    p: np.record,
    control: np.record,
    following: np.ndarray,
    room: np.ndarray,
    rest_ns: int,
) -> bool:
    """One step of ``rest_ns`` in y, a copy; whether it was good."""
    if method.way == NOTHING:
        return True
    if method.way == ADAPTIVE:
        workspace = room[: method.rows * method.columns].reshape((method.rows, method.columns))
        steps = adaptive_steps_at(method.address)
        return bool(steps(y, p, control, following, workspace, rest_ns, True) == rest_ns)
    return bool(steps_at(method.address)(y, p, rest_ns * 1e-9, 1) == 1)
