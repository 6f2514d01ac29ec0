# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (simulation/flight.py): allocation, initialization from a setup, and access."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numba import float64, from_dtype, int64, types

from ..base.compilation import entry_of, njit, place_of
from ..base.simd import aligned
from ..base.vectors import Attitude, FloatArray, Records
from ..motion.integrators.stepping import METHOD
from ..motion.loads import Load, load_of_bytes
from ..motion.state import State
from ..motion.string import StringState
from . import flight as fl
from .commands import HELD_WRENCH, NO_SLOT, Pending
from .flight import EVENT, FLIGHT, LOAD_ROW
from .setup import Setup

FIRST_ROWS = 8
"""Initial number of rows of the tables, which grow as needed."""

_pack = struct.Struct("=6q").pack_into
_ROW_BYTES, _EVENT_BYTES = LOAD_ROW.itemsize, EVENT.itemsize
_FLIGHT_BYTES, _STATE_AT = FLIGHT.itemsize, place_of(FLIGHT, "row")
_LOAD_AT = place_of(LOAD_ROW, "load")


# Indices of integers in the flight's memory that are accessed at every advance or reset: the fastest access to single
# numbers in Python.
def _numbers(*names: str) -> list[int]:
    return [place_of(FLIGHT, name) // 8 for name in names]


_NOW_NS, _ACTING, _DUE, _DUE_END, _EVENTS = _numbers("now_ns", "acting", "due", "due_end", "events")
TIMEOUTS, _LOAD_IDS = _numbers("timeouts", "load_ids")
_REACHED = fl.REACHED


class ActingLoad(NamedTuple):
    """An active load, from begin_ns until end_ns. kind and slot: numbers as in the flight's tables."""

    load: Load
    begin_ns: int
    end_ns: int
    load_id: int
    kind: int
    slot: int

    @property
    def thruster(self) -> int:
        """Number of the thruster that causes the load, or −1."""
        return -1 - self.slot if self.slot < NO_SLOT else -1

    @property
    def shown_kind(self) -> str:
        """Kind as reported to observers: wrench, poke or thruster."""
        return "thruster" if self.thruster >= 0 else "wrench" if self.kind == HELD_WRENCH else "poke"


FLY, BEGIN, APPLY, CUT, FINISH, END_DUE, END_ALL, TAKE_BODY = range(8)
"""Operations of a call, at the flight's current time. APPLY: apply the commands put last. CUT: end the segment,
counting the shorter step taken to that time, and begin another. FINISH: add its counts to the totals and begin another
one now. END_DUE: end the loads whose end is due. END_ALL: end all active loads.
"""


@njit(error_model="numpy", allocates=False)
def _call(
    flights: Records,
    loads: Records,
    events: Records,
    methods: Records,
    room: FloatArray,
    what: int,
    until_ns: int,
) -> int:
    """Perform an operation on the flight; returns its result."""
    flight = flights[0]
    if what == FLY:
        return fl.fly(flight, loads, events, methods, room, until_ns)
    if what == BEGIN:
        fl.begin_segment(flight, loads, methods, room)
        return 0
    if what == CUT:
        fl.cut_segment(flight, loads, methods, room)
        return 0
    if what == FINISH:
        fl.finish_segment(flight, loads, methods, room)
        return 0
    if what == TAKE_BODY:
        fl.take_body(flight, loads)
        return 0
    flight.events, flight.timeouts = 0, 0
    if what == APPLY:
        while flight.due < flight.due_end:
            fl.apply(flight, loads, events, flight.due)
            flight.due += 1
    elif what == END_ALL:
        fl.end_all(flight, loads, events)
    else:
        return int(fl.end_due(flight, loads, events))
    return 0


_RECORDS = [types.Array(from_dtype(kind), 1, "C") for kind in (FLIGHT, LOAD_ROW, EVENT, METHOD)]
SIGNATURE = int64(*_RECORDS, float64[::1], int64, int64)


@functools.cache
def _entry() -> Callable[..., int]:
    return entry_of(_call, SIGNATURE)


class FlightArrays:
    """Arrays of one flight; all other logic is in Simulation. integers: the memory of the flight's record. row (13,):
    its current state.
    """

    def __init__(self, setup: Setup) -> None:
        self.first_due = 0
        self._call = _entry()
        self.integrator, self.methods = setup.integrator, setup.flight_start.methods
        self._allocate(FIRST_ROWS, setup.flight_start.room)
        self.integers[_LOAD_IDS] = 0

    def _allocate(self, rows: int, room: int) -> None:
        """Memory for the flight, tables with this number of rows and a workspace of so many doubles."""
        # In one piece: allocating five arrays of records takes twice as long.
        events = 4 * rows + 4
        loads_at = _FLIGHT_BYTES
        events_at = loads_at + rows * _ROW_BYTES
        room_at = events_at + events * _EVENT_BYTES
        memory = aligned(room_at // 8 + room, before=room_at // 8).view(np.int64)
        self.integers = memory[: _FLIGHT_BYTES // 8].data
        self._flights = np.ndarray(1, FLIGHT, memory)
        self.row = np.ndarray(13, np.float64, memory, _STATE_AT)
        self._loads = np.ndarray(rows, LOAD_ROW, memory, loads_at)
        self._events = np.ndarray(events, EVENT, memory, events_at)
        self.room = np.ndarray(room, np.float64, memory, room_at)
        self._table = memory.data.cast("B")[loads_at:events_at]

    def _grow(self, rows: int, room: int) -> None:
        """Have at least this number of rows and a workspace of so many doubles; what is there is kept."""
        if rows <= len(self._loads) and room <= len(self.room):
            return
        numbers, loads, before = self.integers, self._loads, self.room
        self._allocate(max(rows, len(loads)), max(room, len(before)))
        self.integers[:] = numbers
        self._loads[: len(loads)] = loads
        self.room[: len(before)] = before

    @property
    def flight(self) -> np.record:
        """The record (simulation/flight.py)."""
        found: np.record = self._flights[0]
        return found

    def _take_methods(self, setup: Setup) -> None:
        start = setup.flight_start
        self.integrator, self.methods = setup.integrator, start.methods
        self._grow(0, start.room)

    def take(self, setup: Setup) -> None:
        """End the segment, which counts by its own methods and settings, and use those of a setup and its body from now
        on.
        """
        self.call(CUT)
        self._take_methods(setup)
        flight = self.flight
        flight.method = 0  # a number in the present table, which may be shorter
        new = setup.flight_start.flight[0]
        flight.body[:], flight.common = new.body, new.common
        flight.accuracy, flight.degree, flight.chooses = new.accuracy, new.degree, new.chooses
        flight.step_ns, flight.timeout_ns, flight.poke_ns = new.step_ns, new.timeout_ns, new.poke_ns
        self.call(TAKE_BODY)

    def start_over(self, setup: Setup, tied: StringState | None) -> None:
        """Restart at time 0 in the initial state, with the string ``tied`` and no other load."""
        self._take_methods(setup)
        numbers = self.integers
        load_ids = numbers[_LOAD_IDS]
        numbers[:] = setup.flight_start.integers
        numbers[_LOAD_IDS] = load_ids
        if tied is not None:
            self.tie(tied)
        self.call(BEGIN)

    def tie(self, tied: StringState | None) -> None:
        """Tie the string in this state, or no string if None, from the next segment on."""
        flight = self.flight
        flight.tied = tied is not None
        if tied is not None:
            flight.string[:] = tied.row
            flight.string_begin_ns, flight.string_end_ns = tied.begin_ns, tied.end_ns

    # Commands

    def put(self, due: list[Pending]) -> None:
        """Put commands into the table, after the active loads, to be applied next."""
        first = self.first_due = self.integers[_ACTING]
        last = first + len(due)
        if last > len(self._loads):
            self._grow(2 * last, 0)
        numbers = self.integers
        table, at = self._table, _ROW_BYTES * first
        for pending in due:
            bytes_of_load = pending.row
            _pack(table, at, pending.time_ns, pending.duration_ns, pending.kind, pending.slot, 0, 0)
            table[at + _LOAD_AT : at + _LOAD_AT + len(bytes_of_load)] = bytes_of_load
            at += _ROW_BYTES
        numbers[_DUE], numbers[_DUE_END] = first, last

    @property
    def waiting(self) -> int:
        """Number of the commands put last that haven't been applied yet."""
        return self.integers[_DUE_END] - self.integers[_DUE]

    @property
    def arrays(self) -> tuple[Records, Records, Records, Records, FloatArray]:
        """Arguments of compiled functions: flight (1,), tables of loads, events and methods, workspace."""
        return self._flights, self._loads, self._events, self.methods, self.room

    def call(self, what: int, until_ns: int = 0) -> int:
        """Perform an operation; returns its result: for END_DUE, whether any load ended."""
        return self._call(*self.arrays, what, until_ns)

    def fly(self, until_ns: int) -> bool:
        """Advance to ``until_ns``; returns False when the motion failed."""
        return self.call(FLY, until_ns) == _REACHED

    def last_events(self) -> list[tuple[int, ...]]:
        """Events of the last call: time_ns, what, load_id and row of each."""
        events = self._events[: self.integers[_EVENTS]]
        return list(zip(*(events[name].tolist() for name in ("time_ns", "what", "load_id", "row")), strict=True))

    def attitude_at(self, number: int) -> Attitude:
        """Attitude (4,) xyzw of the body when a command was applied, by the index of the event in the last call."""
        attitude: Attitude = self._events["attitude"][number].copy()
        return attitude

    # Observables

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.integers[_NOW_NS]

    @property
    def state(self) -> State:
        """The current state."""
        return State(self.integers[_NOW_NS], self.row.copy())

    def acting(self) -> Iterator[ActingLoad]:
        """The active loads, in the order in which they began."""
        for row in self._loads[: self.integers[_ACTING]]:
            load = load_of_bytes(row.load.tobytes())
            yield ActingLoad(load, int(row.at_ns), int(row.end_ns), int(row.id), int(row.kind), int(row.slot))
