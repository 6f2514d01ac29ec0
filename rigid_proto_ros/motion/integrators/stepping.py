# SPDX-License-Identifier: MIT
"""How a segment is stepped: fixed steps, one exact step, nothing at all, or steps whose length follows from the error.

All keep the same promise. ``commit`` commits only steps that are functions of the variables they start from; ``reach``
takes one shorter step from there on a copy. So neither depends on when anybody asked.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from ...base.addresses import (
    ADAPTIVE_STEPS,
    STEPS,
    adaptive_steps_at,
    address_of,
    steps_at,
)
from ...base.compilation import njit
from . import control as ctl
from .integrator import ADAPTIVE, FIXED_STEPS, NOTHING, Integrator, Method


def fixed_steps(integrator: Integrator) -> tuple[Method, ...]:
    """Steps of one length, counted from the segment's start; the second method is for a segment with a string."""

    def choice(_p: np.ndarray, step_s: float, _accuracy: float) -> str:
        return f"{integrator.name}: fixed steps of {step_s:g} s"

    without = Method(FIXED_STEPS, integrator.kernel, choice, integrator.evaluations)
    return without, replace(without, kernel=integrator.string_kernel or integrator.kernel, on_string=True)


# A row of a table of methods.
WAY, ADDRESS, EVALUATIONS, SLEEPS, ROWS, COLUMNS, METHOD = range(7)
"""ADDRESS 0: not compiled yet. ROWS and COLUMNS of the workspace."""


@functools.lru_cache(maxsize=256)
def method_table(integrator: Integrator, degree: int) -> np.ndarray:
    """The integrator's methods as compiled loops read them (n, METHOD); kernels have no address until
    they are wanted.
    """
    table = np.zeros((len(integrator.methods), METHOD), np.int64)
    for row, method in zip(table, integrator.methods, strict=True):
        rows, columns = method.workspace(degree).shape if method.workspace else (0, 0)
        row[:] = method.way, 0, method.evaluations, method.sleeps, rows, columns
    return table


def provide_kernel(integrator: Integrator, table: np.ndarray, number: int) -> None:
    """Compile a method's kernel, or load it from the cache, and put its address into the table."""
    kernel, way = integrator.methods[number].kernel, table[number, WAY]
    if kernel is not None and table[number, ADDRESS] == 0:
        table[number, ADDRESS] = address_of(kernel, ADAPTIVE_STEPS if way == ADAPTIVE else STEPS)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def is_provided(table: np.ndarray, number: int) -> bool:
    """Whether the method's kernel can be called."""
    return table[number, WAY] == NOTHING or table[number, ADDRESS] != 0


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def commit(
    method: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    following: np.ndarray,
    room: np.ndarray,
    step_ns: int,
    span_ns: int,
) -> tuple[int, int, bool]:
    """Commit steps in y that fit into ``span_ns``; returns how far it came [ns], how many were counted here, and
    whether all were good. room: for the workspace, of any size that is enough.
    """
    if method[WAY] == FIXED_STEPS:
        wanted = span_ns // step_ns
        if wanted <= 0:
            return 0, 0, True
        done = steps_at(method[ADDRESS])(y, p, step_ns * 1e-9, wanted)
        return done * step_ns, done, done == wanted
    if method[WAY] == ADAPTIVE:
        workspace = room[: method[ROWS] * method[COLUMNS]].reshape((method[ROWS], method[COLUMNS]))
        advanced = adaptive_steps_at(method[ADDRESS])(y, p, control, following, workspace, span_ns, False)
        return advanced, 0, control[ctl.FAILED] == 0.0
    return 0, 0, True


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def reach(
    method: np.ndarray,
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    following: np.ndarray,
    room: np.ndarray,
    rest_ns: int,
) -> bool:
    """One step of ``rest_ns`` in y, a copy; whether it was good."""
    if method[WAY] == NOTHING:
        return True
    if method[WAY] == ADAPTIVE:
        workspace = room[: method[ROWS] * method[COLUMNS]].reshape((method[ROWS], method[COLUMNS]))
        steps = adaptive_steps_at(method[ADDRESS])
        return steps(y, p, control, following, workspace, rest_ns, True) == rest_ns
    return steps_at(method[ADDRESS])(y, p, rest_ns * 1e-9, 1) == 1
