# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (simulation/flight.py): made, filled from a setup, and read."""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numba import int64

from ..base.addresses import address_of_array, doubles_at, entry_of, integers_at
from ..base.compilation import njit
from ..base.simd import LINE
from ..motion.body import BODY
from ..motion.integrators.integrator import Method
from ..motion.integrators.stepping import METHOD, provide_kernel
from ..motion.loads import LOAD, LOADS_SIZE, Load, load_of_row, share_of
from ..motion.problem import SIZE, STRING
from ..motion.state import State
from ..motion.string import Tied
from . import flight as fl
from .commands import Pending
from .setup import FlightStart, Setup

FIRST_ROWS = 8
"""Of the tables at first; they double as needed."""

_TIMES_BYTES, _pack = 8 * fl.TIMES, struct.Struct(f"={fl.TIMES}q").pack_into
_LOAD_BYTES = 8 * fl.LOAD_ROW

# Behind the integers of a flight: how many doubles there are, and where the tables are and of what size.
DOUBLES, TABLES_AT, TABLE_ROWS, METHODS_AT, METHODS = range(fl.INTEGERS, fl.INTEGERS + 5)
INTEGERS = fl.INTEGERS + 5

# Looked up at every advance.
_REACHED, _ACTING, _DUE, _DUE_END = fl.REACHED, fl.ACTING, fl.DUE, fl.DUE_END


def _sizes(rows: int) -> tuple[int, int, int]:
    """Numbers in the tables of times, loads and events, which stand one behind the other."""
    return fl.TIMES * rows, fl.LOAD_ROW * rows, fl.EVENT * (4 * rows + 4)


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
def _arrays(at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """f, n, times, loads, events and methods of the flight whose integers are at this address, with its
    doubles behind them.
    """
    n = integers_at(at, (INTEGERS,))
    f = doubles_at(at + 8 * INTEGERS, (n[DOUBLES],))
    rows, times_at = n[TABLE_ROWS], n[TABLES_AT]
    loads_at = times_at + 8 * fl.TIMES * rows
    events_at = loads_at + 8 * fl.LOAD_ROW * rows
    times, loads = integers_at(times_at, (rows, fl.TIMES)), doubles_at(loads_at, (rows, fl.LOAD_ROW))
    events, methods = integers_at(events_at, (4 * rows + 4, fl.EVENT)), integers_at(n[METHODS_AT], (n[METHODS], METHOD))
    return f, n, times, loads, events, methods


@njit(cache=True, error_model="numpy")
def _fly_at(at: int, until_ns: int) -> int:
    f, n, times, loads, events, methods = _arrays(at)
    return fl.fly(f, n, times, loads, events, methods, until_ns)


@njit(cache=True, error_model="numpy")
def _begin_at(at: int) -> int:
    f, n, _, loads, _, methods = _arrays(at)
    fl.begin_segment(f, n, loads, methods)
    return 0


@njit(cache=True, error_model="numpy")
def _share_anew(at: int) -> int:
    """What the loads that act add to the sums, for another body."""
    f, n, times, loads, _, _ = _arrays(at)
    for row in range(n[fl.ACTING]):
        share_of(loads[row, :LOAD], f[fl.BODY : fl.BODY + BODY], loads[row, fl.SHARE :])
        if times[row, fl.KIND] == fl.HELD_WRENCH:
            times[row, fl.END_NS] = fl.end_of_held(n, times[row, fl.AT_NS])
    return 0


@njit(cache=True, error_model="numpy")
def _apply_at(at: int) -> int:
    f, n, times, loads, events, _ = _arrays(at)
    n[fl.EVENTS], n[fl.TIMEOUTS] = 0, 0
    while n[fl.DUE] < n[fl.DUE_END]:
        fl.apply(f, n, times, loads, events, n[fl.DUE])
        n[fl.DUE] += 1
    return 0


@functools.cache
def _entries() -> tuple[Callable, Callable, Callable]:
    return (
        entry_of(_fly_at, int64(int64, int64)),
        entry_of(_begin_at, int64(int64)),
        entry_of(_apply_at, int64(int64)),
    )


class FlightArrays:
    """f, n, times, loads, events: as simulation/flight.py lays them out; integers: n once more, as Python reads single
    numbers fastest. What isn't a matter of arrays is the simulation's.
    """

    def __init__(self, setup: Setup) -> None:
        self.first_due = 0
        self._fly, self._begin, self._apply = _entries()
        start = setup.flight_start
        self._make_room(start.room)
        self._make_tables(FIRST_ROWS)
        self._take_methods(setup, start)

    def _take_methods(self, setup: Setup, start: FlightStart) -> None:
        self.integrator, self.methods = setup.integrator, start.methods
        if len(self.f) < fl.ROOM + start.room:
            f, n, head = self.f[: fl.ROOM].copy(), self.n.copy(), self.integers
            table = head[TABLES_AT], head[TABLE_ROWS]
            self._make_room(start.room)
            self.f[: fl.ROOM], self.n[:] = f, n
            self.integers[TABLES_AT], self.integers[TABLE_ROWS] = table
        self.integers[METHODS_AT], self.integers[METHODS] = start.methods_at, len(start.methods)

    def take(self, setup: Setup) -> None:
        """Body, settings and integrator are those of a setup from now on; the segment in hand stays as it is."""
        start = setup.flight_start
        self._take_methods(setup, start)
        f, n = self.f, self.n
        f[fl.ROOM :] = 0.0
        f[fl.BODY : fl.BODY + BODY] = start.f[fl.BODY : fl.BODY + BODY]
        f[fl.COMMON : fl.COMMON + SIZE] = start.f[fl.COMMON : fl.COMMON + SIZE]
        f[fl.ACCURACY], f[fl.DEGREE] = start.f[fl.ACCURACY], start.f[fl.DEGREE]
        for setting in (fl.STEP_NS, fl.TIMEOUT_NS, fl.POKE_NS, fl.CHOOSES):
            n[setting] = start.n[setting]
        _share_anew(self._at)

    def start_over(self, setup: Setup, tied: Tied | None) -> None:
        """Time 0, the initial state, and nothing that acts but a string."""
        start, load_ids = setup.flight_start, self.integers[fl.LOAD_IDS]
        self._take_methods(setup, start)
        self.f[: fl.ROOM] = start.f
        self.n[:] = start.n
        self.integers[fl.LOAD_IDS] = load_ids
        if tied is not None:
            self.tie(tied)
        self._begin(self._at)

    def go_on(self, setup: Setup, tied: Tied | None, loads: Sequence[ActingLoad], segment: State | None) -> bool:
        """Time 0 with loads that act already, from the initial state; or from the state at the start of a segment
        before that, flown up to time 0: then whether the motion didn't fail. What that takes isn't counted.
        """
        self.start_over(setup, tied)
        f, n = self.f, self.n
        if len(loads) > self.integers[TABLE_ROWS]:
            self._make_tables(2 * len(loads))
        n[fl.ACTING] = len(loads)
        for row, acting in enumerate(loads):
            n[fl.LOAD_IDS] += 1
            load_id, share = n[fl.LOAD_IDS], self.loads[row, fl.SHARE :]
            self.times[row] = acting.begin_ns, -1, acting.kind, acting.slot, acting.end_ns, load_id
            self.loads[row, :LOAD] = acting.load.row
            share_of(self.loads[row, :LOAD], f[fl.BODY : fl.BODY + BODY], share)
        if segment is not None:
            f[fl.ROW : fl.ROW + 13] = f[fl.START : fl.START + 13] = segment.row
            n[fl.NOW_NS] = n[fl.START_NS] = segment.time_ns
        n[fl.SEGMENTS] = 0
        self._begin(self._at)
        if segment is None:
            return True
        reached = self.fly(0)
        n[fl.STEPS_BEFORE], n[fl.EVALUATIONS_BEFORE] = -self.steps, -self.evaluations
        f[fl.WORK_BEFORE], f[fl.LOST_BEFORE] = -f[fl.WORK], -f[fl.LOST]
        return reached

    def tie(self, tied: Tied | None) -> None:
        """The string is tied like this, or not at all, from the next segment on."""
        self.n[fl.TIED] = tied is not None
        if tied is not None:
            self.f[fl.STRING : fl.STRING + STRING] = tied.row
            self.n[fl.STRING_BEGIN_NS], self.n[fl.STRING_END_NS] = tied.begin_ns, tied.end_ns

    # Commands

    def put(self, due: list[Pending]) -> None:
        """Put commands into the tables, behind the loads that act, as those that act next."""
        head = self.integers
        first = self.first_due = head[_ACTING]
        last, rows = first + len(due), head[TABLE_ROWS]
        if last > rows:
            rows = 2 * last
            self._make_tables(rows)
        tables = self._table_bytes
        at = _TIMES_BYTES * rows + _LOAD_BYTES * first
        row_at = _TIMES_BYTES * first
        for pending in due:
            bytes_of_load = pending.row
            _pack(tables, row_at, pending.time_ns, pending.duration_ns, pending.kind, pending.slot, 0, 0)
            tables[at : at + len(bytes_of_load)] = bytes_of_load
            row_at += _TIMES_BYTES
            at += _LOAD_BYTES
        head[_DUE], head[_DUE_END] = first, last

    @property
    def waiting(self) -> int:
        """How many of the commands put last haven't acted yet."""
        return self.integers[fl.DUE_END] - self.integers[fl.DUE]

    def fly(self, until_ns: int) -> bool:
        """Advance to ``until_ns``; False when the motion failed."""
        while (came := self._fly(self._at, until_ns)) != _REACHED:
            if came == fl.FAILED:
                return False
            provide_kernel(self.integrator, self.methods, self.integers[fl.METHOD])
        return True

    def apply(self) -> None:
        """Apply the commands put last, at the time of the flight."""
        self._apply(self._at)

    def end_due(self) -> bool:
        """End what ends at the time of the flight; whether anything did."""
        self.n[fl.EVENTS], self.n[fl.TIMEOUTS] = 0, 0
        return fl.end_due(self.n, self.times, self.loads, self.events)

    def end_all(self) -> None:
        """End the held wrench and the pulses."""
        self.integers[fl.EVENTS] = self.integers[fl.TIMEOUTS] = 0
        if self.integers[fl.ACTING]:
            fl.end_all(self.n, self.times, self.events)

    def last_events(self) -> list[list[int]]:
        """What the last call began and ended: rows (ATTITUDE,)."""
        return self.events[: self.n[fl.EVENTS], : fl.ATTITUDE].tolist()

    def attitude_at(self, number: int) -> np.ndarray:
        """The body's attitude (4,) xyzw when a command acted, by the number of its event among the last."""
        return self.events[number, fl.ATTITUDE :].view(np.float64).copy()

    # Segments

    def cut_segment(self) -> None:
        """End the segment at the time of the flight by the step that sampling there took, and begin another."""
        fl.cut_segment(self.f, self.n, self.loads, self.methods)

    def finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        fl.finish_segment(self.f, self.n, self.loads, self.methods)

    # Readings

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.integers[fl.NOW_NS]

    @property
    def state(self) -> State:
        """The state now."""
        return State(self.integers[fl.NOW_NS], self.row.copy())

    def accelerations(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the COM (3,) [m/s², world] and angular (3,) [rad/s², body axes], now."""
        six = np.array(fl.accelerations_now(self.f, self.n))
        return six[:3], six[3:]

    @property
    def acts(self) -> bool:
        """Whether any load acts."""
        return bool(self.integers[fl.ACTING])

    def acting(self) -> Iterator[ActingLoad]:
        """The loads that act, in the order in which they began."""
        for row in range(self.n[fl.ACTING]):
            begin_ns, _, kind, slot, end_ns, load_id = self.times[row].tolist()
            yield ActingLoad(load_of_row(self.loads[row, :LOAD]), begin_ns, end_ns, load_id, kind, slot)

    @property
    def sums(self) -> np.ndarray:
        """All of them summed (LOADS_SIZE,), as motion/loads.py lays them out."""
        return self.f[fl.SUMS : fl.SUMS + LOADS_SIZE].copy()

    @property
    def steps(self) -> int:
        """Steps committed since time 0."""
        return int(self.n[fl.STEPS_BEFORE] + fl.steps_of_segment(self.f, self.n))

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in them."""
        return int(self.n[fl.EVALUATIONS_BEFORE] + fl.evaluations_of_segment(self.f, self.n, self.methods))

    @property
    def hand_work(self) -> float:
        """Of the string's hand since time 0 [J]."""
        return float(self.f[fl.WORK_BEFORE] + self.f[fl.WORK])

    @property
    def heat(self) -> float:
        """In the string's damper since time 0 [J]."""
        return float(self.f[fl.LOST_BEFORE] + self.f[fl.LOST])

    @property
    def floors(self) -> list[float]:
        """What has held the motion to less than its accuracy since time 0, by kind (flight.FLOOR_KINDS)."""
        floors = self.f[fl.FLOORS : fl.FLOORS + fl.FLOOR_KINDS].copy()
        fl.note_floors(self.f, self.n, self.methods, floors)
        return floors.tolist()

    @property
    def method(self) -> Method:
        """How the segment is stepped."""
        return self.integrator.methods[int(self.n[fl.METHOD])]

    # Memory

    def _make_room(self, room: int) -> None:
        """Integers and doubles, with so much workspace that begins a line of the processor's cache."""
        doubles = fl.ROOM + room
        whole = np.empty(INTEGERS + doubles + LINE)
        at = address_of_array(whole)
        first = -(at // 8 + INTEGERS + fl.ROOM) % LINE
        self._at = at + 8 * first
        own = whole[first : first + INTEGERS].view(np.int64)
        self.integers = own.data
        self.integers[DOUBLES], self.integers[fl.ACTING], self.integers[fl.LOAD_IDS] = doubles, 0, 0
        self.n = own[: fl.INTEGERS]
        self.f = whole[first + INTEGERS : first + INTEGERS + doubles]
        self.row = self.f[fl.ROW : fl.ROW + 13]

    def _make_tables(self, rows: int) -> None:
        """Tables of so many rows; what acts goes on."""
        kept = self.integers[fl.ACTING]
        before = (self.times[:kept], self.loads[:kept]) if kept else None
        self._tables = np.zeros(sum(_sizes(rows)), np.int64)
        self._table_bytes = self._tables.data.cast("B")
        self.integers[TABLES_AT], self.integers[TABLE_ROWS] = address_of_array(self._tables), rows
        if before is not None:
            self.times[:kept], self.loads[:kept] = before

    @property
    def times(self) -> np.ndarray:
        """(rows, TIMES)"""
        times, _, _ = _sizes(self.integers[TABLE_ROWS])
        return self._tables[:times].reshape(-1, fl.TIMES)

    @property
    def loads(self) -> np.ndarray:
        """(rows, LOAD_ROW)"""
        times, loads, _ = _sizes(self.integers[TABLE_ROWS])
        return self._tables[times : times + loads].view(np.float64).reshape(-1, fl.LOAD_ROW)

    @property
    def events(self) -> np.ndarray:
        """(4 rows + 4, EVENT)"""
        times, loads, _ = _sizes(self.integers[TABLE_ROWS])
        return self._tables[times + loads :].reshape(-1, fl.EVENT)
