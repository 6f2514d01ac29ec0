# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (simulation/flight.py): made, filled from a setup, and read."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numba import int64

from ..base.compilation import njit
from ..base.function_pointers import address_of_array, array_at, doubles_at, entry_of
from ..base.records import place_of, record_type
from ..base.simd import aligned
from ..motion.integrators.stepping import METHOD, provide_kernel
from ..motion.loads import Load, load_of_row
from ..motion.state import State
from ..motion.string import StringState
from . import flight as fl
from .commands import HELD_WRENCH, NO_SLOT, Pending
from .flight import EVENT, FLIGHT, LOAD_ROW
from .setup import FlightStart, Setup

FIRST_ROWS = 8
"""Of the tables at first; they double as needed."""

HELD = record_type(
    [
        ("flight", FLIGHT),
        # Where the tables, of loads, of events and of methods, and the workspace are, and of what size.
        ("loads_at", np.int64),
        ("events_at", np.int64),
        ("rows", np.int64),
        ("methods_at", np.int64),
        ("methods", np.int64),
        ("room_at", np.int64),
        ("room", np.int64),
    ]
)
"""A flight with the addresses of what it works with, so that a compiled function finds all by one number."""

_held_at, _loads_at, _events_at, _methods_at = map(array_at, (HELD, LOAD_ROW, EVENT, METHOD))

_ROW_BYTES, _pack = LOAD_ROW.itemsize, struct.Struct("=6q").pack_into
_LOAD_AT = place_of(LOAD_ROW, "load")
_ROW_NUMBERS, _EVENT_NUMBERS, _ATTITUDE = LOAD_ROW.itemsize // 8, EVENT.itemsize // 8, place_of(EVENT, "attitude") // 8


# Where integers that are looked up at every advance or reset stand in the memory of what is held: Python reads and
# writes single numbers fastest so, and arrays of integers are made in a tenth of the time that those of records take.
def _numbers(kind: np.dtype, *names: str) -> list[int]:
    return [place_of(kind, name) // 8 for name in names]


_NOW_NS, _ACTING, _DUE, _DUE_END, _EVENTS = _numbers(FLIGHT, "now_ns", "acting", "due", "due_end", "events")
TIMEOUTS, _LOAD_IDS = _numbers(FLIGHT, "timeouts", "load_ids")
_LOADS_AT, _EVENTS_AT, _ROWS = _numbers(HELD, "loads_at", "events_at", "rows")
_METHODS_AT, _METHODS, _ROOM_AT, _ROOM = _numbers(HELD, "methods_at", "methods", "room_at", "room")
_NUMBERS = FLIGHT.itemsize // 8
_REACHED = fl.REACHED


class ActingLoad(NamedTuple):
    """A load that acts from begin_ns until end_ns. kind and slot: as flights number them."""

    load: Load
    begin_ns: int
    end_ns: int
    load_id: int
    kind: int
    slot: int

    @property
    def thruster(self) -> int:
        """The number of the thruster whose load it is, or −1."""
        return -1 - self.slot if self.slot < NO_SLOT else -1

    @property
    def shown_kind(self) -> str:
        """As observers are told: wrench, poke or thruster."""
        return "thruster" if self.thruster >= 0 else "wrench" if self.kind == HELD_WRENCH else "poke"


@njit(cache=True, error_model="numpy")
def _arrays(at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What is held (1,) at this address, and its loads, events, methods and workspace."""
    whole = _held_at(at, (1,))
    held = whole[0]
    loads, events = _loads_at(held.loads_at, (held.rows,)), _events_at(held.events_at, (4 * held.rows + 4,))
    return (
        whole,
        loads,
        events,
        _methods_at(held.methods_at, (held.methods,)),
        doubles_at(held.room_at, (held.room,)),
    )


_FLY, _BEGIN, _APPLY, _CUT, _FINISH, _END_DUE, _END_ALL, _TAKE_BODY = range(8)


@njit(cache=True, error_model="numpy")
def _call_at(at: int, what: int, until_ns: int) -> int:
    """One of these on the flight that is held at this address; how it came back."""
    held, loads, events, methods, room = _arrays(at)
    flight = held[0].flight
    if what == _FLY:
        return fl.fly(flight, loads, events, methods, room, until_ns)
    if what == _BEGIN:
        fl.begin_segment(flight, loads, methods, room)
        return 0
    if what == _CUT:
        fl.cut_segment(flight, loads, methods, room)
        return 0
    if what == _FINISH:
        fl.finish_segment(flight, loads, methods, room)
        return 0
    if what == _TAKE_BODY:
        fl.take_body(flight, loads)
        return 0
    flight.events, flight.timeouts = 0, 0
    if what == _APPLY:
        while flight.due < flight.due_end:
            fl.apply(flight, loads, events, flight.due)
            flight.due += 1
    elif what == _END_ALL:
        fl.end_all(flight, loads, events)
    else:
        return int(fl.end_due(flight, loads, events))
    return 0


@functools.cache
def _entry() -> Callable[[int, int, int], int]:
    return entry_of(_call_at, int64(int64, int64, int64))


class FlightArrays:
    """integers: the memory of a flight's record; row (13,): its state. What isn't a matter of arrays is the
    simulation's.
    """

    def __init__(self, setup: Setup) -> None:
        self.first_due = 0
        self._loads: np.ndarray
        self._call = _entry()
        self._memory = np.zeros(HELD.itemsize // 8, np.int64)
        self._at = address_of_array(self._memory)
        self.integers = self._memory.data
        self.row = np.ndarray(13, np.float64, self._memory, place_of(FLIGHT, "row"))
        self._make_tables(FIRST_ROWS)
        self._take_methods(setup, setup.flight_start)

    @functools.cached_property
    def flight(self) -> np.record:
        """The record (simulation/flight.py)."""
        found: np.record = np.ndarray(1, HELD, self._memory)[0].flight
        return found

    def _take_methods(self, setup: Setup, start: FlightStart) -> None:
        self.integrator, self.methods = setup.integrator, start.methods
        numbers = self.integers
        if numbers[_ROOM] < max(start.room, 1):
            # The workspace begins a line of the processor's cache.
            self.room = aligned((1, max(start.room, 1)))[0]
            numbers[_ROOM_AT], numbers[_ROOM] = address_of_array(self.room), len(self.room)
        numbers[_METHODS_AT], numbers[_METHODS] = start.methods_at, len(start.methods)

    def take(self, setup: Setup) -> None:
        """Body, settings and integrator are those of a setup from now on; the segment in hand stays as it is."""
        start, flight = setup.flight_start, self.flight
        self._take_methods(setup, start)
        self.room[:] = 0.0
        new = start.flight[0]
        flight.body[:], flight.common = new.body, new.common
        flight.accuracy, flight.degree, flight.chooses = new.accuracy, new.degree, new.chooses
        flight.step_ns, flight.timeout_ns, flight.poke_ns = new.step_ns, new.timeout_ns, new.poke_ns
        self._call(self._at, _TAKE_BODY, 0)

    def start_over(self, setup: Setup, tied: StringState | None) -> None:
        """Time 0, the initial state, and nothing that acts but a string."""
        start, numbers = setup.flight_start, self.integers
        load_ids = numbers[_LOAD_IDS]
        self._take_methods(setup, start)
        numbers[:_NUMBERS] = start.integers
        numbers[_LOAD_IDS] = load_ids
        if tied is not None:
            self.tie(tied)
        self._call(self._at, _BEGIN, 0)

    def tie(self, tied: StringState | None) -> None:
        """The string is tied like this, or not at all, from the next segment on."""
        flight = self.flight
        flight.tied = tied is not None
        if tied is not None:
            flight.string[:] = tied.row
            flight.string_begin_ns, flight.string_end_ns = tied.begin_ns, tied.end_ns

    # Commands

    def put(self, due: list[Pending]) -> None:
        """Put commands into the table, behind the loads that act, as those that act next."""
        numbers = self.integers
        first = self.first_due = numbers[_ACTING]
        last = first + len(due)
        if last > numbers[_ROWS]:
            self._make_tables(2 * last)
        table, at = self._table_bytes, _ROW_BYTES * first
        for pending in due:
            bytes_of_load = pending.row
            _pack(table, at, pending.time_ns, pending.duration_ns, pending.kind, pending.slot, 0, 0)
            table[at + _LOAD_AT : at + _LOAD_AT + len(bytes_of_load)] = bytes_of_load
            at += _ROW_BYTES
        numbers[_DUE], numbers[_DUE_END] = first, last

    @property
    def waiting(self) -> int:
        """How many of the commands put last haven't acted yet."""
        return self.integers[_DUE_END] - self.integers[_DUE]

    def fly(self, until_ns: int) -> bool:
        """Advance to ``until_ns``; False when the motion failed."""
        while (came := self._call(self._at, _FLY, until_ns)) != _REACHED:
            if came == fl.FAILED:
                return False
            provide_kernel(self.integrator, self.methods, int(self.flight.method))
        return True

    def apply(self) -> None:
        """Apply the commands put last, at the time of the flight."""
        self._call(self._at, _APPLY, 0)

    def end_due(self) -> bool:
        """End what ends at the time of the flight; whether anything did."""
        return bool(self._call(self._at, _END_DUE, 0))

    def end_all(self) -> None:
        """End the held wrench and the pulses."""
        self._call(self._at, _END_ALL, 0)

    def last_events(self) -> list[list[int]]:
        """What the last call began and ended: time_ns, what, load_id and row of each."""
        events: list[list[int]] = self._events[: self.integers[_EVENTS], :4].tolist()
        return events

    def attitude_at(self, number: int) -> np.ndarray:
        """The body's attitude (4,) xyzw when a command acted, by the number of its event among the last."""
        return self._events[number, _ATTITUDE : _ATTITUDE + 4].view(np.float64).copy()

    # Segments

    def cut_segment(self) -> None:
        """End the segment at the time of the flight by the step that sampling there took, and begin another."""
        self._call(self._at, _CUT, 0)

    def finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        self._call(self._at, _FINISH, 0)

    # Observables

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.integers[_NOW_NS]

    @property
    def state(self) -> State:
        """The state now."""
        return State(self.integers[_NOW_NS], self.row.copy())

    @property
    def acts(self) -> bool:
        """Whether any load acts."""
        return bool(self.integers[_ACTING])

    def acting(self) -> Iterator[ActingLoad]:
        """The loads that act, in the order in which they began."""
        for row in np.ndarray(self.integers[_ACTING], LOAD_ROW, self._loads):
            load = load_of_row(row.load)
            yield ActingLoad(load, int(row.at_ns), int(row.end_ns), int(row.id), int(row.kind), int(row.slot))

    # Memory

    def _make_tables(self, rows: int) -> None:
        """Tables of so many rows; what acts goes on."""
        numbers = self.integers
        loads = np.zeros(rows * _ROW_NUMBERS, np.int64)
        kept = numbers[_ACTING] * _ROW_NUMBERS
        if kept:
            loads[:kept] = self._loads[:kept]
        self._loads, self._events = loads, np.zeros((4 * rows + 4, _EVENT_NUMBERS), np.int64)
        self._table_bytes = loads.data.cast("B")
        numbers[_LOADS_AT], numbers[_EVENTS_AT] = address_of_array(loads), address_of_array(self._events)
        numbers[_ROWS] = rows
