# SPDX-License-Identifier: MIT
"""Definition of an integrator: name, properties, supported loads, and the way it steps through a segment: fixed steps,
one exact step, no step at all, or steps whose length follows from the error.

Addresses of kernels are stored in an array of integers, so that one loop can call the kernel that a segment needs
without compiling all others into it. An address refers to the machine code of a kernel for one fixed signature; the
kernel is compiled or loaded when its address is first requested.

All integrators share one invariant: ``commit`` commits only steps that are functions of their initial variables, and
``reach`` takes one shorter step from there on a copy. So neither depends on the times of sampling.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numba import boolean, float64, from_dtype, int64, types
from numba.core import cgutils
from numba.core.types.function_type import CompileResultWAP

from ...base.compilation import INTERPRETED, Emitted, compiled_for, intrinsic, njit, record_type
from ...base.vectors import FloatArray, Records
from ..loads import Load
from ..problem import ENVIRONMENT_NEEDS, PROBLEM, Variables

BODY_TORQUE = "a torque"
WORLD_TORQUE = "a torque fixed in the world or a world force off the centre of mass"
BODY_FORCE = "a force that turns with the body"
ANGULAR_DAMPING = ENVIRONMENT_NEEDS["angular_damping"]
STRING = "a string"
NO_GYROSCOPIC_TERM = "gyroscopic: false"

LOADS = frozenset({BODY_TORQUE, WORLD_TORQUE, BODY_FORCE})
"""Needs of wrenches and pokes. Gravity, world forces at the COM and linear damping have a closed form for all."""
EVALUATED = LOADS | {STRING, *ENVIRONMENT_NEEDS.values()}
"""Needs that integrators support which take all rates from ``accelerations`` (motion/problem.py)."""


def needs_of_load(load: Load) -> frozenset[str]:
    """Needs of a wrench or poke, to be supported by the integrator."""
    turns = any(load.torque) or (load.mesh_point is not None and any(load.force))
    if load.axes == "world":
        return frozenset({WORLD_TORQUE}) if turns else frozenset()
    return frozenset(({BODY_TORQUE} if turns else set()) | ({BODY_FORCE} if any(load.force) else set()))


NOTHING, ONE_STEP, FIXED_STEPS, ADAPTIVE = range(4)
"""Ways to step. ONE_STEP: a single step of any length from the segment's start, for exact maps. NOTHING: the variables
are constant.
"""


Kernel = Callable[[Variables, np.record, float, int], int]
"""(y, p, h, n): takes up to n steps of h seconds in place and returns how many were good; a step whose result isn't
finite or exceeds MAX_SPEED is undone.
"""


@dataclass(frozen=True)
class Method:
    """A way to step, and its kernel.

    kernel: a Kernel, or for ADAPTIVE (y, p, control, following, workspace, span_ns, sampling), which commits steps, or
    samples; control: CONTROL. choice: description and reason, a format string with {step_s}, {degree} and
    {degree_of_motion} of series, and {swing}, the string's highest frequency [rad/s]. evaluations: of the equations of
    motion per step; adaptive kernels count their own. workspace(degree): rows and columns of the kernel's memory.
    sleeps: nothing moves.
    """

    way: int
    kernel: Callable[..., Any] | None
    choice: str
    evaluations: int = 0
    workspace: Callable[[int], tuple[int, int]] | None = None
    sleeps: bool = False


@dataclass(frozen=True)
class Integrator:
    """order: global order of accuracy, None when exact. evaluations: of the equations of motion per step. source:
    reference. limits: range of use and limits, in one sentence. stability_limit: largest |ω|h, and ω_s h of a string,
    at which a fixed step is still meaningful. supports: needs of a scene (above) that it can meet. kernel: for fixed
    steps; None for auto. ways: its methods, if they aren't fixed steps of the kernel.
    """

    name: str
    order: int | None
    evaluations: int
    source: str
    limits: str
    stability_limit: float
    supports: frozenset[str]
    kernel: Kernel | None
    ways: tuple[Method, ...] = ()

    @property
    def chooses(self) -> bool:
        """Whether the method is chosen for each segment (auto)."""
        return self.kernel is None

    @cached_property
    def methods(self) -> tuple[Method, ...]:
        """Its methods, in the order of auto's kinds of segments."""
        choice = f"{self.name}: fixed steps of {{step_s:g}} s"
        return self.ways or (Method(FIXED_STEPS, self.kernel, choice, self.evaluations),)

    @cached_property
    def supports_loads(self) -> bool:
        """Whether it supports every wrench and poke."""
        return self.supports >= LOADS

    def lacks(self, needs: frozenset[str]) -> frozenset[str]:
        """The needs of a scene that it doesn't support; empty if it supports all."""
        return needs - self.supports


# Stepping through a segment

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

_kept: dict[int, Any] = {}
"""Objects at the addresses handed out: code must not be garbage collected while an array refers to it."""


def address_of(kernel: Callable[..., Any], taken_as: types.FunctionType) -> int:
    """The address of a function compiled for this signature; it is compiled or loaded from the cache if necessary."""
    if INTERPRETED:
        found, address = kernel, id(kernel)
    else:
        found = CompileResultWAP(compiled_for(kernel, taken_as.signature))
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
            return function._getvalue()  # noqa: SLF001 (as in numba's guide to extensions)

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
def method_table(integrator: Integrator, degree: int) -> Records:
    """The integrator's methods (n,) METHOD as compiled loops read them; a kernel gets its address when it is first
    needed.
    """
    table = np.zeros(len(integrator.methods), METHOD)
    for number, method in enumerate(integrator.methods):
        rows, columns = method.workspace(degree) if method.workspace else (0, 0)
        table[number] = method.way, 0, method.evaluations, method.sleeps, rows, columns
    return table


def workspace_size(table: Records) -> int:
    """Size of the largest workspace [doubles] of the methods in one table or several."""
    return int((table["rows"] * table["columns"]).max())


def provide_kernel(integrator: Integrator, table: Records, number: int) -> None:
    """Compile a method's kernel, or load it from the cache, and put its address into the table."""
    kernel, method = integrator.methods[number].kernel, table[number]
    if kernel is not None and method["address"] == 0:
        method["address"] = address_of(kernel, ADAPTIVE_STEPS if method["way"] == ADAPTIVE else STEPS)


@njit(error_model="numpy", allocates=False, forceinline=True)
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
        done = steps_at(method.address)(y, p, step_ns * 1e-9, wanted)
        return done * step_ns, done, done == wanted
    if method.way == ADAPTIVE:
        workspace = room[: method.rows * method.columns].reshape((method.rows, method.columns))
        advanced = adaptive_steps_at(method.address)(y, p, control, following, workspace, span_ns, False)
        return advanced, 0, not control.failed
    return 0, 0, True


@njit(error_model="numpy", allocates=False, forceinline=True)
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
        workspace = room[: method.rows * method.columns].reshape((method.rows, method.columns))
        steps = adaptive_steps_at(method.address)
        return bool(steps(y, p, control, following, workspace, rest_ns, True) == rest_ns)
    return bool(steps_at(method.address)(y, p, rest_ns * 1e-9, 1) == 1)
