# SPDX-License-Identifier: MIT
"""Stepping through a segment by the method that it needs: the kernels of all integrators in one compiled function.

A method is a number in a record, the same on every machine: its way, and for fixed steps the place of its kernel among
all. ``commit`` commits only steps that are functions of their initial variables, and ``reach`` takes one shorter step
from there on a copy. So neither depends on the times of sampling.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...base.compilation import matrix_of, njit, record_type
from ...base.vectors import FloatArray
from ..problem import Variables
from . import INTEGRATORS
from .integrator import ADAPTIVE, FIXED_STEPS, NOTHING, ONE_STEP, Kernel, Method
from .series import MAX_DEGREE, MOTION_COLUMNS
from .series_steps import series_steps, series_workspace, spin_workspace

_METHODS = [method for integrator in INTEGRATORS.values() for method in integrator.methods]
"""Those of all integrators, one after the other, by number."""

KERNELS: tuple[Kernel, ...] = tuple(
    dict.fromkeys(
        method.kernel for method in _METHODS if method.kernel is not None and method.way in (ONE_STEP, FIXED_STEPS)
    )
)
"""The kernels that take steps of given lengths, by number; the only adaptive one is ``series_steps``."""


_Steps = Callable[[int, Variables, np.record, float, int], int]


def _either(number: int, kernel: Kernel, others: _Steps) -> _Steps:
    """The kernel for its own number, the others for any other one."""

    @njit(error_model="numpy", allocates=False)
    def steps(asked: int, y: Variables, p: np.record, h: float, n: int) -> int:
        if asked == number:
            return kernel(y, p, h, n)
        return others(asked, y, p, h, n)

    return steps


@njit(error_model="numpy", allocates=False)
def _no_steps(_asked: int, _y: Variables, _p: np.record, _h: float, _n: int) -> int:
    return 0


def _chained() -> _Steps:
    """One if after another: WebAssembly has no addresses of functions, and records hold none."""
    chain: _Steps = _no_steps
    for number in reversed(range(len(KERNELS))):
        chain = _either(number, KERNELS[number], chain)
    return chain


fixed_steps = _chained()
"""(number, y, p, h, n): up to n steps of h seconds in place by a kernel of KERNELS; returns how many were good."""

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

_FIRST = np.cumsum([0, *(len(integrator.methods) for integrator in INTEGRATORS.values())])
_WAY = np.array([method.way for method in _METHODS])
_KERNEL = np.array([KERNELS.index(method.kernel) if method.kernel in KERNELS else -1 for method in _METHODS])
_EVALUATIONS = np.array([method.evaluations for method in _METHODS])
_SLEEPS = np.array([method.sleeps for method in _METHODS])
_SPIN_ALONE = np.array([method.spin_alone for method in _METHODS])


@njit(error_model="numpy", allocates=False)
def method_for(integrator: int, kind: int) -> int:
    """The number of an integrator's method for a kind of segment; kind: 0 for one that doesn't choose."""
    return int(_FIRST[integrator]) + kind


@njit(error_model="numpy", allocates=False)
def way_of(method: int) -> int:
    """How a method steps: NOTHING, ONE_STEP, FIXED_STEPS or ADAPTIVE."""
    return int(_WAY[method])


@njit(error_model="numpy", allocates=False)
def evaluations_of(method: int) -> int:
    """Evaluations of the equations of motion per step of a method; adaptive ones count their own."""
    return int(_EVALUATIONS[method])


@njit(error_model="numpy", allocates=False)
def sleeps(method: int) -> bool:
    """Whether nothing moves by a method."""
    return bool(_SLEEPS[method])


@njit(error_model="numpy", allocates=False)
def workspace_of(method: int, degree: int) -> tuple[int, int]:
    """Rows and columns of the memory of an adaptive method, whose series of the spin have this degree."""
    return spin_workspace(degree) if _SPIN_ALONE[method] else series_workspace(degree)


ROOM = (2 * (MAX_DEGREE + 2) + 1) * MOTION_COLUMNS
"""Doubles in the largest workspace, that of ``series_workspace`` at MAX_DEGREE."""


def method_of(number: int) -> Method:
    """The method with this number."""
    return _METHODS[number]


# Arguments of kernels: for literal ones they would be compiled a second time.
_COMMITTING: Any = np.bool_(False)
_SAMPLING: Any = np.bool_(True)
_ONCE: Any = np.int64(1)


@njit(error_model="numpy", allocates=False, forceinline=True)
def commit(
    method: int,
    y: Variables,
    p: np.record,
    control: np.record,
    following: Variables,
    room: FloatArray,
    step_ns: int,
    span_ns: int,
) -> tuple[int, int, bool]:
    """Commit the steps in y that fit into ``span_ns``; returns the time advanced [ns], the number of steps counted
    here, and whether all were good. room (ROOM,): memory for the workspace.
    """
    if way_of(method) == FIXED_STEPS:
        wanted = span_ns // step_ns
        if wanted <= 0:
            return 0, 0, True
        done = fixed_steps(_KERNEL[method], y, p, step_ns * 1e-9, wanted)
        return done * step_ns, done, done == wanted
    if way_of(method) == ADAPTIVE:
        rows, columns = workspace_of(method, control.degree)
        workspace = matrix_of(room, rows, columns)
        advanced = series_steps(y, p, control, following, workspace, span_ns, _COMMITTING)
        return advanced, 0, not control.failed
    return 0, 0, True


@njit(error_model="numpy", allocates=False, forceinline=True)
def reach(
    method: int,
    y: Variables,
    p: np.record,
    control: np.record,
    following: Variables,
    room: FloatArray,
    rest_ns: int,
) -> bool:
    """Take one step of ``rest_ns`` in y, a copy; returns whether it was good."""
    if way_of(method) == NOTHING:
        return True
    if way_of(method) == ADAPTIVE:
        rows, columns = workspace_of(method, control.degree)
        workspace = matrix_of(room, rows, columns)
        return bool(series_steps(y, p, control, following, workspace, rest_ns, _SAMPLING) == rest_ns)
    return bool(fixed_steps(_KERNEL[method], y, p, rest_ns * 1e-9, _ONCE) == 1)
