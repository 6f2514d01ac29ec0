# SPDX-License-Identifier: MIT
"""A block of variations in one compiled call without the interpreter's lock: bodies, flights and their measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import boolean, float64, int64, types
from numba.core.types.function_type import CompileResultWAP

from .batch_body import BODY, GYROSCOPIC, make_body_row
from .batch_flight import AUTO, FIXED_STEPS, KERNELS, ONE_EXACT_STEP, fly
from .compilation import njit
from .flight_measures import measure_flight
from .integrators import series_steps, stiff_steps, taylor_adaptive
from .integrators.auto import AUTO as AUTO_INTEGRATOR
from .integrators.auto import steady_steps
from .integrators.free_body import FREE_BODY, free_body_steps
from .integrators.integrator import Integrator
from .quantities import CONTEXT, STATE


@dataclass
class Variants:
    """Many variations of one scene. settings (n, SETTINGS), times (n, TIMES), ballast (n, k, 4), constants (CONSTANTS,):
    core/batch_body.py. commands (n, c, 3), loads (n, c, LOAD): core/batch_flight.py. Those alike in all have one row only.
    """

    settings: np.ndarray
    times: np.ndarray
    ballast: np.ndarray
    constants: np.ndarray
    integrator: Integrator
    commands: np.ndarray
    loads: np.ndarray

    def __len__(self) -> int:
        return len(self.settings)

    @property
    def stepping(self) -> int:
        """How the integrator steps, as core/batch_flight.py numbers it."""
        return {AUTO_INTEGRATOR.name: AUTO, FREE_BODY.name: ONE_EXACT_STEP}.get(self.integrator.name, FIXED_STEPS)

    @property
    def arrays(self) -> tuple:
        """What the compiled call takes of it."""
        ints = (self.times, self.commands)
        floats = (self.settings, self.ballast, self.constants, self.loads)
        return (*map(np.ascontiguousarray, (*floats, *ints)), self.stepping, _kernels(self.integrator))


@dataclass
class Results:
    """status (n,): 1 done, 0 the simulation must do it. end_ns (n,), stop (n,): which condition ended it, −1 none.
    measured (n, k); states (n, 13) at the end.
    """

    status: np.ndarray
    end_ns: np.ndarray
    stop: np.ndarray
    measured: np.ndarray
    states: np.ndarray


def new_results(rows: int, measures: int) -> Results:
    """Empty ones, as failed rows have them."""
    unknown = np.full((rows, measures), np.nan)
    state = np.full((rows, STATE - 1), np.nan)
    return Results(np.zeros(rows, np.int64), np.zeros(rows, np.int64), np.full(rows, -1), unknown, state)


_VARIANTS = (
    float64[:, ::1],  # settings
    float64[:, :, ::1],  # ballast
    float64[::1],  # constants
    float64[:, :, ::1],  # loads
    int64[:, ::1],  # times
    int64[:, :, ::1],  # commands
    int64,  # stepping
    KERNELS,
)
_LOOKS = (int64[::1], boolean[::1], float64[:, ::1], float64[:, ::1])
_RESULTS = (int64[::1], int64[::1], int64[::1], float64[:, ::1], float64[:, ::1])


@njit(cache=True, error_model="numpy")
def _one(
    i, settings, ballast, constants, loads, times, commands, stepping, kernels, body, looks_ns, stops, context, states
):
    """Body and flight of variation i; as ``fly`` returns."""
    own = settings[i if settings.shape[0] > 1 else 0]
    if not make_body_row(own, ballast[i if ballast.shape[0] > 1 else 0], constants, body):
        return 0, -1
    c = i if commands.shape[0] > 1 else 0
    load = loads[i if loads.shape[0] > 1 else 0]
    own_times = times[i if times.shape[0] > 1 else 0]
    return fly(
        own,
        own_times,
        body,
        constants[GYROSCOPIC],
        stepping,
        kernels,
        commands[c],
        load,
        looks_ns,
        stops,
        context,
        states,
    )


def _fly_block(first, last, variants, references, has_references, looks_ns, watched, stops, measures, results):
    """Variations first to last − 1."""
    status, end_ns, stop, measured, finals = results
    body, context = np.zeros(BODY), np.zeros(CONTEXT)
    states = np.zeros((looks_ns.shape[0], STATE))
    others = np.zeros((looks_ns.shape[0] if has_references else 1, STATE))
    # One place that flies, whichever it is: a second one would be compiled a second time.
    sides, kept, ends = (references, variants), (others, states), (np.zeros((0, 3)), stops)
    for i in range(first, last):
        status[i] = 0
        reached = 0
        for side in range(0 if has_references else 1, 2):
            reached, stop[i] = _one(i, *sides[side], body, looks_ns, ends[side], context, kept[side])
            if reached == 0:
                break
        if reached == 0:
            continue
        status[i] = 1
        end_ns[i] = looks_ns[reached - 1]
        finals[i, :] = states[reached - 1, :13]
        measure_flight(measures, states, others, looks_ns, watched, reached, context, measured[i])


@cache
def _compiled():
    """``_fly_block`` compiled, or loaded from the cache: when it is first wanted and not at import."""
    block = (types.Tuple(_VARIANTS), types.Tuple(_VARIANTS), boolean, *_LOOKS, types.Tuple(_RESULTS))
    signature = types.void(int64, int64, *block)
    return njit(signature, cache=True, nogil=True, error_model="numpy")(_fly_block)


@njit(cache=True)
def _no_steps(y, p, h, n):
    return 0


@njit(cache=True)
def _no_adaptive_steps(y, p, control, following, workspace, span_ns, look):
    return 0


@cache
def _kernels(integrator: Integrator) -> tuple:
    """The compiled kernels that an integrator may call, in the order of batch_flight's methods."""
    kernels: list[Any] = [*[_no_steps] * 3, *[_no_adaptive_steps] * 3]
    if integrator.name == AUTO_INTEGRATOR.name:
        adaptive = (taylor_adaptive.steps, series_steps.steps, stiff_steps.steps)
        kernels = [steady_steps, free_body_steps, _no_steps, *adaptive]
    elif integrator.name == FREE_BODY.name:
        kernels[1] = free_body_steps
    else:
        kernels[2] = integrator.kernel
    for kernel, taken in zip(kernels, KERNELS, strict=True):
        kernel.compile(taken.signature)
    # The compiled results themselves: dispatchers would be looked through again at every call.
    return tuple(
        CompileResultWAP(kernel.get_compile_result(taken.signature))
        for kernel, taken in zip(kernels, KERNELS, strict=True)
    )


def fly_variants(
    variants: Variants,
    references: Variants | None,
    looks_ns: np.ndarray,
    watched: np.ndarray,
    stops: np.ndarray,
    measures: np.ndarray,
) -> Results:
    """Fly all variants, each beside its reference if there are any; the rows that it can't judge have status 0."""
    rows = len(variants)
    results = new_results(rows, len(measures))
    filled = (results.status, results.end_ns, results.stop, results.measured, results.states)
    own = variants.arrays
    other = own if references is None else references.arrays
    _compiled()(0, rows, own, other, references is not None, looks_ns, watched, stops, measures, filled)
    return results
