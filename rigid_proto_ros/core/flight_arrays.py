# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (core/flight.py): made, filled from a setup, and read."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from . import flight as fl
from .body import BODY
from .commands import Pending
from .compilation import njit
from .integrators.stepping import COLUMNS, ROWS, Method, method_table, provide_kernel
from .integrators.taylor_adaptive import degree_for
from .kernel_calls import entry_of
from .loads import LOAD, LOADS_SIZE, Load, load_of_row, share_of
from .problem import SIZE, STRING
from .setup import Setup
from .state import State
from .string import Tied

FIRST_ROWS = 8
"""Of the tables at first; they double as needed."""

_TIMES = struct.Struct("=5q")
_LOAD_BYTES = 8 * fl.LOAD_ROW

_F, _N, _TABLE, _ROWS = float64[::1], int64[::1], int64[:, ::1], float64[:, ::1]


class Acting(NamedTuple):
    """A load that acts from begin_ns until end_ns; held: it is the held wrench."""

    load: Load
    begin_ns: int
    end_ns: int
    load_id: int
    held: bool


@njit(cache=True, error_model="numpy")
def _share_anew(f, n, loads):
    """What the loads that act add to the sums, for another body."""
    for row in range(n[fl.ACTING]):
        share_of(loads[row, :LOAD], f[fl.BODY : fl.BODY + BODY], loads[row, fl.SHARE :])


@functools.cache
def _fly() -> Callable:
    return entry_of(fl.fly, int64(_F, _N, _TABLE, _ROWS, _TABLE, _TABLE, int64))


class FlightArrays:
    """f, n, times, loads, events: as core/flight.py lays them out. What isn't a matter of arrays is the simulation's."""

    def __init__(self, setup: Setup) -> None:
        self.f = np.zeros(fl.ROOM)
        self.n = np.zeros(fl.INTEGERS, np.int64)
        self.n[fl.HELD] = fl.NOBODY
        self.first_due = 0
        self._make_tables(FIRST_ROWS)
        self._call = _fly()
        self.take(setup)

    def take(self, setup: Setup) -> None:
        """Body, settings and integrator are those of a setup from now on; the segment in hand stays as it is."""
        degree = degree_for(setup.accuracy)
        self.integrator = setup.integrator
        self.methods = method_table(setup.integrator, degree)
        room = int((self.methods[:, ROWS] * self.methods[:, COLUMNS]).max())
        if len(self.f) < fl.ROOM + room:
            self.f = np.concatenate([self.f[: fl.ROOM], np.zeros(room)])
        f, n = self.f, self.n
        f[fl.ROOM :] = 0.0
        self.row = f[fl.ROW : fl.ROW + 13]
        f[fl.BODY : fl.BODY + BODY] = setup.body_row
        f[fl.COMMON : fl.COMMON + SIZE] = setup.problem
        f[fl.ACCURACY], f[fl.DEGREE] = setup.accuracy, degree
        n[fl.STEP_NS], n[fl.TIMEOUT_NS], n[fl.POKE_NS] = setup.step_ns, setup.wrench_timeout_ns, setup.poke_duration_ns
        n[fl.CHOOSES] = setup.integrator.chooses
        _share_anew(f, n, self.loads)
        if n[fl.HELD] != fl.NOBODY:
            held = self.times[n[fl.HELD]]
            held[fl.END_NS] = fl.end_of_held(n, held[fl.AT_NS])

    def start_over(self, setup: Setup, tied: Tied | None) -> None:
        """Time 0, the initial state, and nothing that acts but a string."""
        load_ids = self.n[fl.LOAD_IDS]
        self.n[:] = 0
        self.n[fl.LOAD_IDS], self.n[fl.HELD] = load_ids, fl.NOBODY
        self.f[fl.WORK_BEFORE] = self.f[fl.LOST_BEFORE] = 0.0
        self.take(setup)
        self.row[:] = setup.initial
        self.f[fl.START : fl.START + 13] = setup.initial
        self.tie(tied)
        fl.begin_segment(self.f, self.n, self.loads, self.methods)

    def tie(self, tied: Tied | None) -> None:
        """The string is tied like this, or not at all, from the next segment on."""
        self.n[fl.TIED] = tied is not None
        if tied is not None:
            self.f[fl.STRING : fl.STRING + STRING] = tied.row
            self.n[fl.STRING_BEGIN_NS], self.n[fl.STRING_END_NS] = tied.begin_ns, tied.end_ns

    # Commands

    def put(self, due: list[Pending]) -> None:
        """Put commands into the tables, behind the loads that act, as those that act next."""
        first = self.first_due = int(self.n[fl.ACTING])
        last = first + len(due)
        if last > len(self.times):
            self._make_tables(2 * last)
        times, loads = self._times_bytes, self._loads_bytes
        for row, pending in enumerate(due, first):
            at_ns, kind, bytes_of_load = pending.time_ns, pending.kind, pending.row
            _TIMES.pack_into(times, _TIMES.size * row, at_ns, pending.duration_ns, kind, 0, 0)
            loads[row * _LOAD_BYTES : row * _LOAD_BYTES + len(bytes_of_load)] = bytes_of_load
        self.n[fl.DUE], self.n[fl.DUE_END] = first, last

    @property
    def waiting(self) -> int:
        """How many of the commands put last haven't acted yet."""
        return int(self.n[fl.DUE_END] - self.n[fl.DUE])

    def fly(self, until_ns: int) -> bool:
        """Advance to ``until_ns``; False when the motion failed."""
        call, f, n = self._call, self.f, self.n
        while (came := call(f, n, self.times, self.loads, self.events, self.methods, until_ns)) == fl.NO_KERNEL:
            provide_kernel(self.integrator, self.methods, int(n[fl.METHOD]))
        return came == fl.REACHED

    def apply(self) -> None:
        """Bring about the command due next, at the time of the flight."""
        n = self.n
        n[fl.EVENTS] = 0
        fl.apply(self.f, n, self.times, self.loads, self.events, int(n[fl.DUE]))
        n[fl.DUE] += 1

    def end_due(self) -> bool:
        """End what ends at the time of the flight; whether anything did."""
        self.n[fl.EVENTS] = 0
        return fl.end_due(self.n, self.times, self.loads, self.events)

    def end_all(self) -> None:
        """End the held wrench and the pulses."""
        self.n[fl.EVENTS] = 0
        fl.end_all(self.n, self.times, self.events)

    def last_events(self) -> list[list[int]]:
        """What the last call began and ended: rows (EVENT,)."""
        return self.events[: self.n[fl.EVENTS]].tolist()

    # Segments

    def cut_segment(self) -> None:
        """End the segment at the time of the flight by the step that looking there took, and begin another."""
        fl.cut_segment(self.f, self.n, self.loads, self.methods)

    def finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        fl.finish_segment(self.f, self.n, self.loads, self.methods)

    # Readings

    @property
    def time_ns(self) -> int:
        return int(self.n[fl.NOW_NS])

    @property
    def state(self) -> State:
        """The state now."""
        return State(int(self.n[fl.NOW_NS]), self.row.copy())

    @property
    def acts(self) -> bool:
        """Whether any load acts."""
        return bool(self.n[fl.ACTING])

    def acting(self) -> Iterator[Acting]:
        """The loads that act, in the order in which they began."""
        for row in range(self.n[fl.ACTING]):
            begin_ns, _, _, end_ns, load_id = self.times[row].tolist()
            yield Acting(load_of_row(self.loads[row, :LOAD]), begin_ns, end_ns, load_id, row == self.n[fl.HELD])

    @property
    def sums(self) -> np.ndarray:
        """All of them summed (LOADS_SIZE,), as core/loads.py lays them out."""
        return self.f[fl.SUMS : fl.SUMS + LOADS_SIZE].copy()

    @property
    def steps(self) -> int:
        """Steps committed since time 0."""
        return int(self.n[fl.STEPS_BEFORE]) + fl.steps_of_segment(self.f, self.n)

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in them."""
        return int(self.n[fl.EVALUATIONS_BEFORE]) + fl.evaluations_of_segment(self.f, self.n, self.methods)

    @property
    def hand_work(self) -> float:
        """Of the string's hand since time 0 [J]."""
        return float(self.f[fl.WORK_BEFORE] + self.f[fl.WORK])

    @property
    def heat(self) -> float:
        """In the string's damper since time 0 [J]."""
        return float(self.f[fl.LOST_BEFORE] + self.f[fl.LOST])

    @property
    def method(self) -> Method:
        """How the segment is stepped."""
        return self.integrator.methods[int(self.n[fl.METHOD])]

    def _make_tables(self, rows: int) -> None:
        times, loads = np.zeros((rows, fl.TIMES), np.int64), np.zeros((rows, fl.LOAD_ROW))
        events = np.zeros((4 * rows + 4, fl.EVENT), np.int64)
        kept = self.n[fl.ACTING]
        if kept:
            times[:kept], loads[:kept] = self.times[:kept], self.loads[:kept]
        self.times, self.loads, self.events = times, loads, events
        self._times_bytes, self._loads_bytes = memoryview(times).cast("B"), memoryview(loads).cast("B")
