# SPDX-License-Identifier: MIT
"""Many bodies through one shooting segment in one compiled call: the same flight that simulations,
replays and sweeps advance with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numba import from_dtype, int64, types

from ..base.compilation import copy_numbers, entry_of, njit, record_type
from ..base.rotation import rotate_inverse
from ..base.vectors import BoolArray, FloatArray, IntArray, Records
from ..mass.tensor import principal_axes_kernel
from ..motion.body import BODY, fill_body
from ..motion.integrators.auto import AUTO
from ..motion.integrators.series_steps import degree_for
from ..motion.integrators.stepping import METHOD, method_table, workspace_size
from ..motion.problem import ENVIRONMENT_FIELDS, PROBLEM, VARIABLES, begin_body
from ..simulation import flight as fl
from ..simulation.commands import NO_SLOT

ACCURACY = 1e-11
"""Local error rate: differences over steps of 2e-6 then keep five digits, more than an estimate needs."""

FLOWN = record_type(
    [
        ("mass", np.float64),  # [kg]
        ("center_of_mass", np.float64, 3),  # [m, tracked frame]
        ("inertia", np.float64, (3, 3)),  # [kg m²]
        *ENVIRONMENT_FIELDS,
        ("start", np.float64, 13),  # state of the COM at the segment's start
    ]
)
"""A body to fly: what of it varies."""

# A row of what is known at a sample: the state (13,), and
STATE = 13
SPECIFIC_FORCE = 13  # (3,) at the COM: acceleration without gravity [m/s², body axes]
ANGULAR_ACCELERATION = 16  # (3,) [rad/s², body axes]
SAMPLE = 19


@dataclass(frozen=True)
class Wrenches:
    """What acts in a segment: times (c, 3) and loads (c, LOAD) as simulation/flight.py takes them, from
    the segment's start.
    """

    commands: IntArray
    loads: FloatArray

    @cached_property
    def edges_ns(self) -> IntArray:
        """When loads begin and end, ascending."""
        return np.sort(np.concatenate([self.commands[:, 0], self.commands[:, 0] + self.commands[:, 1]]))


def _fly_all(
    flown: Records,
    times_ns: IntArray,
    commands: IntArray,
    loads: FloatArray,
    degree: int,
    tables: tuple[Records, Records, Records, Records, FloatArray],
    samples: FloatArray,
    good: IntArray,
) -> None:
    """Each of flown (n,), FLOWN, through times_ns (m,) ascending from 0: samples (n, m, SAMPLE); good (n,) whether it
    came through. tables: methods, one flight, loads with room for all commands, events and workspace, as
    simulation/flight.py takes them.
    """
    methods, flights, rows, events, room = tables
    count, flight = commands.shape[0], flights[0]
    body, scale = np.zeros(BODY), np.ones(3)
    problem, variables = np.zeros(1, PROBLEM), np.zeros(VARIABLES)
    for i in range(flown.shape[0]):
        own = flown[i]
        good[i] = 0
        inertia = own.inertia.copy()
        principal = principal_axes_kernel(inertia)
        fill_body(own.mass, own.center_of_mass, inertia, principal, scale, body)
        if not (principal[0][0] > 0.0 and np.isfinite(principal[0][2]) and own.mass > 0.0):
            continue
        fl.begin_flight(flight)
        flight.method, flight.chooses, flight.step_ns = -1, True, 1_000_000
        flight.timeout_ns, flight.poke_ns = 0, 0
        copy_numbers(own.start, flight.row)
        copy_numbers(flight.row, flight.start)
        copy_numbers(body, flight.body)
        begin_body(flight.common, body, own, 1.0)
        flight.accuracy, flight.degree = ACCURACY, degree
        for c in range(count):
            row = rows[c]
            row.at_ns, row.duration_ns, row.kind, row.slot = commands[c, 0], commands[c, 1], commands[c, 2], NO_SLOT
            copy_numbers(loads[c], row.load)
        flight.due_end = count
        fl.begin_segment(flight, rows, methods, room)
        good[i] = 1
        for k in range(times_ns.shape[0]):
            if fl.fly(flight, rows, events, methods, room, times_ns[k]) != fl.REACHED:
                good[i] = 0
                break
            sample = samples[i, k]
            copy_numbers(flight.row, sample[:STATE])
            rates = fl.accelerations_now(flight, problem, variables)
            g, q = own.gravity, sample[3:7]
            felt = rotate_inverse(q[0], q[1], q[2], q[3], rates[0] - g[0], rates[1] - g[1], rates[2] - g[2])
            for j in range(3):
                sample[SPECIFIC_FORCE + j], sample[ANGULAR_ACCELERATION + j] = felt[j], rates[3 + j]


@cache
def _compiled() -> tuple[Callable[..., None], Records, int]:
    """``_fly_all`` compiled, or loaded from the cache, the table of the methods, and the degree of their series."""
    flat, table, cube = types.float64[:, ::1], types.int64[:, ::1], types.float64[:, :, ::1]
    bodies, *records = (from_dtype(kind)[::1] for kind in (FLOWN, METHOD, fl.FLIGHT, fl.LOAD_ROW, fl.EVENT))
    tables = types.Tuple((*records, types.float64[::1]))
    signature = types.void(bodies, types.int64[::1], table, flat, int64, tables, cube, types.int64[::1])
    degree = degree_for(ACCURACY)
    methods = method_table(AUTO, degree)
    return entry_of(njit(nogil=True, error_model="numpy")(_fly_all), signature), methods, degree


def fly_rows(flown: Records, times_ns: IntArray, wrenches: Wrenches) -> tuple[FloatArray, BoolArray]:
    """Samples (n, m, SAMPLE) of each body in ``flown`` (n,), FLOWN, at times_ns (m,) ascending from 0, and whether it
    came through (n,).
    """
    kernel, methods, degree = _compiled()
    samples = np.empty((len(flown), len(times_ns), SAMPLE))
    good = np.zeros(len(flown), np.int64)
    count, room = len(wrenches.commands), np.zeros(max(1, workspace_size(methods)))
    rows, events = np.zeros(count + 1, fl.LOAD_ROW), np.zeros(4 * count + 8, fl.EVENT)
    tables = methods, np.zeros(1, fl.FLIGHT), rows, events, room
    kernel(flown, times_ns, wrenches.commands, wrenches.loads, degree, tables, samples, good)
    return samples, good == 1
