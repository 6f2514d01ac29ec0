# SPDX-License-Identifier: MIT
"""Stepping through a segment by the method that it needs: the kernels of all integrators in one compiled function.

A method is a number in a record, the same on every machine: its way, and for fixed steps the place of its kernel among
all. ``commit`` commits only steps that are functions of their initial variables, and ``reach`` takes one shorter step
from there on a copy. So neither depends on the times of sampling.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.compilation import matrix_of, njit, record_type
from ...base.vectors import FloatArray, Records
from ..problem import Variables
from .auto import steady_steps
from .free_body import free_body_steps, free_body_strang_steps
from .gram_schmidt import euler_steps, midpoint_steps
from .integrator import ADAPTIVE, FIXED_STEPS, NOTHING, Integrator, Kernel
from .lie_midpoint import lie_midpoint_steps
from .runge_kutta import dop853_steps, rk4_steps, semi_implicit_euler_steps
from .series import taylor_steps
from .series_steps import series_steps

KERNELS: tuple[Kernel, ...] = (
    steady_steps,
    free_body_steps,
    free_body_strang_steps,
    euler_steps,
    midpoint_steps,
    semi_implicit_euler_steps,
    rk4_steps,
    lie_midpoint_steps,
    dop853_steps,
    taylor_steps,
)
"""The kernels of fixed steps of all integrators, a method's code being the place of its own here. The only adaptive
kernel is ``series_steps``.
"""

_Choice = Callable[[int, Variables, np.record, float, int], int]


@njit(error_model="numpy", allocates=False, inline="always", cache=False)
def _no_steps(_code: int, _y: Variables, _p: np.record, _h: float, _n: int) -> int:
    return 0


def _either(number: int, kernel: Kernel, others: _Choice) -> _Choice:
    """The kernel for its own number, the others for any other one."""

    @njit(error_model="numpy", allocates=False, inline="always", cache=False)
    def steps(code: int, y: Variables, p: np.record, h: float, n: int) -> int:
        if code == number:
            return kernel(y, p, h, n)
        return others(code, y, p, h, n)

    return steps


_choice: _Choice = _no_steps
for _number in reversed(range(len(KERNELS))):
    _choice = _either(_number, KERNELS[_number], _choice)


@njit(error_model="numpy", allocates=False)
def fixed_steps(code: int, y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place by a kernel of KERNELS; returns the number of good ones.

    It is compiled to one if after another: not every target has addresses of functions.
    """
    return _choice(code, y, p, h, n)


CONTROL = record_type(
    [
        ("accuracy", np.float64),  # requested local error rate [1/s]
        ("degree", np.int64),  # of the series of the spin
        ("accepted_ns", np.int64),  # length of the pending step, which isn't committed yet; 0 for none
        ("elapsed_ns", np.int64),  # committed since the segment's start
        ("steps", np.int64),  # committed
        ("evaluations", np.int64),  # in committed steps, one for each series
        ("pending", np.int64),  # evaluations spent on the pending step
        # Largest error rates of a step [1/s] that are set by rounding instead of the accuracy; and those set by
        # rounding of a string's tension.
        ("floor_rate", np.float64),
        ("pull_floor_rate", np.float64),
        ("failed", np.bool_),  # even a step of a nanosecond is too long, or the motion diverged
        ("series", np.bool_),  # the workspace holds the series about the committed variables
        # Of the pending step, if the string's law changes within it:
        ("law", np.float64),  # the string's law at its start
        ("switch", np.float64),  # time [s] at which the last series replaces the first; infinite for none
        ("last_start", np.float64),  # start time of the last series [s]
        ("last_law", np.float64),  # the law of the last series
    ]
)
"""State of an adaptive kernel between calls."""

METHOD = record_type(
    [
        ("way", np.int64),
        ("code", np.int64),  # of FIXED_STEPS and ONE_STEP: the place of the kernel in KERNELS
        ("evaluations", np.int64),
        ("sleeps", np.bool_),
        ("rows", np.int64),  # of the workspace
        ("columns", np.int64),
    ]
)


@functools.lru_cache(maxsize=256)
def method_table(integrator: Integrator, degree: int) -> Records:
    """The integrator's methods (n,) METHOD as compiled loops read them."""
    table = np.zeros(len(integrator.methods), METHOD)
    for number, method in enumerate(integrator.methods):
        rows, columns = method.workspace(degree) if method.workspace else (0, 0)
        code = KERNELS.index(method.kernel) if method.kernel in KERNELS else 0
        table[number] = method.way, code, method.evaluations, method.sleeps, rows, columns
    return table


def workspace_size(table: Records) -> int:
    """Size of the largest workspace [doubles] of the methods in one table or several."""
    return int((table["rows"] * table["columns"]).max())


# Arguments of kernels: for literal ones they would be compiled a second time.
_COMMITTING: Any = np.bool_(False)
_SAMPLING: Any = np.bool_(True)
_ONCE: Any = np.int64(1)


# Inlined as source, as is what calls these in simulation/flight.py: every function that is compiled for itself is
# optimized with all integrators in it.


@njit(error_model="numpy", allocates=False, inline="always")
def commit(
    method: np.record,
    y: Variables,
    p: np.record,
    control: np.record,
    following: Variables,
    room: FloatArray,
    step_ns: int,
    span_ns: int,
) -> tuple[int, int, bool]:
    """Commit the steps in y that fit into ``span_ns``; returns the time advanced [ns], the number of steps counted
    here, and whether all were good. room: memory for the workspace, at least as large as needed.
    """
    if method.way == FIXED_STEPS:
        wanted = span_ns // step_ns
        if wanted <= 0:
            return 0, 0, True
        done = fixed_steps(method.code, y, p, step_ns * 1e-9, wanted)
        return done * step_ns, done, done == wanted
    if method.way == ADAPTIVE:
        workspace = matrix_of(room, method.rows, method.columns)
        advanced = series_steps(y, p, control, following, workspace, span_ns, _COMMITTING)
        return advanced, 0, not control.failed
    return 0, 0, True


@njit(error_model="numpy", allocates=False, inline="always")
def reach(
    method: np.record,
    y: Variables,
    p: np.record,
    control: np.record,
    following: Variables,
    room: FloatArray,
    rest_ns: int,
) -> bool:
    """Take one step of ``rest_ns`` in y, a copy; returns whether it was good."""
    if method.way == NOTHING:
        return True
    if method.way == ADAPTIVE:
        workspace = matrix_of(room, method.rows, method.columns)
        return bool(series_steps(y, p, control, following, workspace, rest_ns, _SAMPLING) == rest_ns)
    return bool(fixed_steps(method.code, y, p, rest_ns * 1e-9, _ONCE) == 1)
