# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (simulation/flight.py): made, filled from a setup, and read."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numba import int64

from ..base.addresses import address_of_array, array_at, doubles_at, entry_of
from ..base.compilation import njit
from ..base.records import place_of, record_type
from ..base.simd import aligned
from ..motion.integrators.integrator import Method
from ..motion.integrators.stepping import METHOD, provide_kernel
from ..motion.loads import Load, load_of_row, share_of
from ..motion.problem import PROBLEM
from ..motion.state import State
from ..motion.string import Tied
from ..motion.variables import STORED
from . import flight as fl
from .commands import Pending
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
_EVENT_NUMBERS = EVENT.itemsize // 8


# Where integers that are looked up at every advance or reset stand in the memory of what is held: Python reads single
# numbers fastest so.
def _numbers(kind: np.dtype, *names: str) -> list[int]:
    return [place_of(kind, name) // 8 for name in names]


_NOW_NS, _ACTING, _DUE, _DUE_END, _EVENTS = _numbers(FLIGHT, "now_ns", "acting", "due", "due_end", "events")
TIMEOUTS, _LOAD_IDS = _numbers(FLIGHT, "timeouts", "load_ids")
_METHODS_AT, _METHODS, _ROOM = _numbers(HELD, "methods_at", "methods", "room")
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
        return -1 - self.slot if self.slot < fl.NO_SLOT else -1

    @property
    def shown_kind(self) -> str:
        """As observers are told: wrench, poke or thruster."""
        return "thruster" if self.thruster >= 0 else "wrench" if self.kind == fl.HELD_WRENCH else "poke"


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


@njit(cache=True, error_model="numpy")
def _fly_at(at: int, until_ns: int) -> int:
    held, loads, events, methods, room = _arrays(at)
    flight = held[0].flight
    return fl.fly(flight, loads, events, methods, room, until_ns)


@njit(cache=True, error_model="numpy")
def _begin_at(at: int) -> int:
    held, loads, _, methods, room = _arrays(at)
    flight = held[0].flight
    fl.begin_segment(flight, loads, methods, room)
    return 0


@njit(cache=True, error_model="numpy")
def _share_anew(at: int) -> int:
    """What the loads that act add to the sums, for another body."""
    held, loads, _, _, _ = _arrays(at)
    flight = held[0].flight
    for row in range(flight.acting):
        acting = loads[row]
        share_of(acting.load, flight.body, acting.share)
        if acting.kind == fl.HELD_WRENCH:
            acting.end_ns = fl.end_of_held(flight, acting.at_ns)
    return 0


@njit(cache=True, error_model="numpy")
def _apply_at(at: int) -> int:
    held, loads, events, _, _ = _arrays(at)
    flight = held[0].flight
    flight.events, flight.timeouts = 0, 0
    while flight.due < flight.due_end:
        fl.apply(flight, loads, events, flight.due)
        flight.due += 1
    return 0


@njit(cache=True, error_model="numpy")
def _cut_at(at: int) -> int:
    held, loads, _, methods, room = _arrays(at)
    flight = held[0].flight
    fl.cut_segment(flight, loads, methods, room)
    return 0


@njit(cache=True, error_model="numpy")
def _finish_at(at: int) -> int:
    held, loads, _, methods, room = _arrays(at)
    flight = held[0].flight
    fl.finish_segment(flight, loads, methods, room)
    return 0


@njit(cache=True, error_model="numpy")
def _end_due_at(at: int) -> bool:
    held, loads, events, _, _ = _arrays(at)
    return fl.end_due(held[0].flight, loads, events)


@njit(cache=True, error_model="numpy")
def _end_all_at(at: int) -> int:
    held, loads, events, _, _ = _arrays(at)
    fl.end_all(held[0].flight, loads, events)
    return 0


@functools.cache
def _entries() -> tuple[Callable, Callable, Callable]:
    return (
        entry_of(_fly_at, int64(int64, int64)),
        entry_of(_begin_at, int64(int64)),
        entry_of(_apply_at, int64(int64)),
    )


class FlightArrays:
    """flight: the record (simulation/flight.py); integers: its memory as integers, as Python reads single numbers
    fastest. What isn't a matter of arrays is the simulation's.
    """

    def __init__(self, setup: Setup) -> None:
        self.first_due = 0
        self._fly, self._begin, self._apply = _entries()
        self._memory = np.zeros(1, HELD)
        self._at = address_of_array(self._memory)
        self._held = self._memory[0]
        self.flight = self._held.flight
        self.row = self.flight.row
        self.integers = self._memory.view(np.uint8).view(np.int64).data
        self._loads = np.zeros(0, LOAD_ROW)
        self._make_tables(FIRST_ROWS)
        self._take_methods(setup, setup.flight_start)

    def _take_methods(self, setup: Setup, start: FlightStart) -> None:
        self.integrator, self.methods = setup.integrator, start.methods
        numbers = self.integers
        if numbers[_ROOM] < max(start.room, 1):
            # The workspace begins a line of the processor's cache.
            self.room = aligned((1, max(start.room, 1)))[0]
            self._held.room_at, self._held.room = address_of_array(self.room), len(self.room)
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
        _share_anew(self._at)

    def start_over(self, setup: Setup, tied: Tied | None) -> None:
        """Time 0, the initial state, and nothing that acts but a string."""
        start, numbers = setup.flight_start, self.integers
        load_ids = numbers[_LOAD_IDS]
        self._take_methods(setup, start)
        numbers[:_NUMBERS] = start.integers
        numbers[_LOAD_IDS] = load_ids
        if tied is not None:
            self.tie(tied)
        self._begin(self._at)

    def tie(self, tied: Tied | None) -> None:
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
        if last > len(self._loads):
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
        while (came := self._fly(self._at, until_ns)) != _REACHED:
            if came == fl.FAILED:
                return False
            provide_kernel(self.integrator, self.methods, int(self.flight.method))
        return True

    def apply(self) -> None:
        """Apply the commands put last, at the time of the flight."""
        self._apply(self._at)

    def end_due(self) -> bool:
        """End what ends at the time of the flight; whether anything did."""
        self.integers[_EVENTS] = self.integers[TIMEOUTS] = 0
        return bool(_end_due_at(self._at))

    def end_all(self) -> None:
        """End the held wrench and the pulses."""
        self.integers[_EVENTS] = self.integers[TIMEOUTS] = 0
        if self.integers[_ACTING]:
            _end_all_at(self._at)

    def last_events(self) -> list[list[int]]:
        """What the last call began and ended: time_ns, what, load_id and row of each."""
        return self._event_numbers[: self.integers[_EVENTS], :4].tolist()

    def attitude_at(self, number: int) -> np.ndarray:
        """The body's attitude (4,) xyzw when a command acted, by the number of its event among the last."""
        return self._events[number].attitude.copy()

    # Segments

    def cut_segment(self) -> None:
        """End the segment at the time of the flight by the step that sampling there took, and begin another."""
        _cut_at(self._at)

    def finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        _finish_at(self._at)

    # Readings

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.integers[_NOW_NS]

    @property
    def state(self) -> State:
        """The state now."""
        return State(self.integers[_NOW_NS], self.row.copy())

    def accelerations(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the COM (3,) [m/s², world] and angular (3,) [rad/s², body axes], now."""
        six = np.array(fl.accelerations_now(self.flight, np.zeros(1, PROBLEM), np.zeros(STORED)))
        return six[:3], six[3:]

    @property
    def acts(self) -> bool:
        """Whether any load acts."""
        return bool(self.integers[_ACTING])

    def acting(self) -> Iterator[ActingLoad]:
        """The loads that act, in the order in which they began."""
        for row in self._loads[: self.integers[_ACTING]]:
            load = load_of_row(row.load)
            yield ActingLoad(load, int(row.at_ns), int(row.end_ns), int(row.id), int(row.kind), int(row.slot))

    @property
    def sums(self) -> np.ndarray:
        """All of them summed (LOADS_SIZE,), as motion/loads.py lays them out."""
        return self.flight.sums.copy()

    @property
    def steps(self) -> int:
        """Steps committed since time 0."""
        return int(self.flight.steps_before + fl.steps_of_segment(self.flight))

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in them."""
        return int(self.flight.evaluations_before + fl.evaluations_of_segment(self.flight, self.methods))

    @property
    def hand_work(self) -> float:
        """Of the string's hand since time 0 [J]."""
        return float(self.flight.work_before + self.flight.work)

    @property
    def heat(self) -> float:
        """In the string's damper since time 0 [J]."""
        return float(self.flight.lost_before + self.flight.lost)

    @property
    def floors(self) -> list[float]:
        """What has held the motion to less than its accuracy since time 0, by kind (flight.FLOOR_KINDS)."""
        floors = self.flight.floors.copy()
        fl.note_floors(self.flight, self.methods, floors)
        return floors.tolist()

    @property
    def method(self) -> Method:
        """How the segment is stepped."""
        return self.integrator.methods[int(self.flight.method)]

    # Memory

    def _make_tables(self, rows: int) -> None:
        """Tables of so many rows; what acts goes on."""
        held, kept = self._held, self.integers[_ACTING]
        loads = np.zeros(rows, LOAD_ROW)
        if kept:
            loads[:kept] = self._loads[:kept]
        self._loads, self._events = loads, np.zeros(4 * rows + 4, EVENT)
        self._table_bytes = loads.view(np.uint8).data
        self._event_numbers = self._events.view(np.uint8).view(np.int64).reshape(-1, _EVENT_NUMBERS)
        held.loads_at, held.events_at = address_of_array(self._loads), address_of_array(self._events)
        held.rows = rows
