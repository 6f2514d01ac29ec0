# SPDX-License-Identifier: MIT
"""The arrays of one compiled flight (simulation/flight.py): allocation, initialization from a setup, and access."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.compilation import bound, new_record, place_of
from ..base.errors import CommandRefused
from ..base.simd import aligned
from ..base.vectors import Attitude, FloatArray
from ..motion.integrators.stepping import ROOM
from ..motion.loads import Load, load_of_bytes
from ..motion.problem import PROBLEM, VARIABLES
from ..motion.string import StringState, string_of
from . import flight as fl
from .commands import HELD_WRENCH, NO_SLOT, Pending, Row, WrenchCommand, row_of
from .effects import BEGIN, CUT, FINISH, FLY, change, check_change, check_load, command, operate
from .flight import EVENT, FLIGHT, LOAD_ROW, NOT_BEGUN, accelerations_now, note_floors
from .refusals import REFUSAL, refused_command
from .setup import Setup, packed_of, refused_load

FIRST_ROWS = 8
"""Initial number of rows of the tables, which grow as needed."""

_pack = struct.Struct("=6q").pack_into
_ROW_BYTES, _EVENT_BYTES = LOAD_ROW.itemsize, EVENT.itemsize
_FLIGHT_BYTES, _STATE_AT = FLIGHT.itemsize, place_of(FLIGHT, "row")
_LOAD_AT = place_of(LOAD_ROW, "load")
_STRING_AT, _STRING_END = place_of(FLIGHT, "string"), place_of(FLIGHT, "sums")
_TIED_IN_STRING = place_of(FLIGHT, "tied") - _STRING_AT


# Indices of integers in the flight's memory that are accessed at every advance or reset: the fastest access to single
# numbers in Python.
def _numbers(*names: str) -> list[int]:
    return [place_of(FLIGHT, name) // 8 for name in names]


NOW_NS, _START_NS, _ACTING, _DUE, _DUE_END, _EVENTS, _ROTOR_NS = _numbers(
    "now_ns", "start_ns", "acting", "due", "due_end", "events", "rotor_ns"
)
NOTEWORTHY, _LOAD_IDS, _METHOD = _numbers("noteworthy", "load_ids", "method")
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


class FlightArrays:
    """Arrays of one flight; all other logic is in Simulation. integers: the memory of the flight's record. row (13,):
    its current state.
    """

    def __init__(self) -> None:
        self.first_due = 0
        self._allocate(FIRST_ROWS)
        self.integers[_LOAD_IDS] = 0

    def _allocate(self, rows: int) -> None:
        """Memory for the flight, tables with this number of rows and a workspace."""
        self._rows = rows
        # In one piece: allocating five arrays of records takes twice as long.
        events = 4 * rows + 4
        loads_at = _FLIGHT_BYTES
        events_at = loads_at + rows * _ROW_BYTES
        room_at = events_at + events * _EVENT_BYTES
        numbers = aligned(room_at // 8 + ROOM, before=room_at // 8)
        memory = numbers.view(np.int64).data
        self.integers = memory[: _FLIGHT_BYTES // 8]
        self.row = numbers[_STATE_AT // 8 : _STATE_AT // 8 + 13]
        self._flight: np.record = np.ndarray(1, FLIGHT, numbers)[0]
        self._loads = np.ndarray(rows, LOAD_ROW, numbers, loads_at)
        self._events = np.ndarray(events, EVENT, numbers, events_at)
        self._room = numbers[room_at // 8 :]
        as_bytes = memory.cast("B")
        self._table = as_bytes[loads_at:events_at]
        self._bytes = as_bytes
        self._string = as_bytes[_STRING_AT:_STRING_END]
        self.call = bound(operate, self._flight, self._loads, self._events, self._room)
        """Perform an operation, by its number and a time [ns]; returns its result: of END_DUE, whether anything ended.
        """

    @cached_property
    def _refusal(self) -> np.record:
        """The last refusal."""
        return new_record(REFUSAL)

    def _grow(self, rows: int) -> None:
        """Have at least this number of rows; what is there is kept."""
        if rows <= self._rows:
            return
        numbers, loads, before = self.integers, self._loads, self._room
        self._allocate(rows)
        self.integers[:] = numbers
        self._loads[: len(loads)] = loads
        self._room[:] = before

    def start_over(self, setup: Setup) -> None:
        """Restart at time 0 as the flight of a setup begins. Its first segment begins with the next operation."""
        numbers = self.integers
        load_ids = numbers[_LOAD_IDS]
        numbers[:] = setup.integers
        numbers[_LOAD_IDS] = load_ids

    @property
    def flight(self) -> np.record:
        """The record of the flight, its segment begun."""
        if self.integers[_METHOD] == NOT_BEGUN:
            self.call(BEGIN, 0)
        return self._flight

    def change(self, old: Setup, new: Setup) -> None:
        """Go on as the flight of another setup; raises CommandRefused."""
        same_mesh = old.mesh_sha256 == new.mesh_sha256
        if not change(old.scene, new.scene, new.mesh, same_mesh, self.flight, self._loads, self._room, self._refusal):
            raise refused_command(self._refusal)

    def check_change(self, old: Setup, new: Setup) -> None:
        """Raises CommandRefused where the flight can't go on as that of another setup."""
        if not check_change(old.scene, new.scene, new.mesh, self.flight, self._loads, self._refusal):
            raise refused_command(self._refusal)

    def leap(self, to_ns: int) -> None:
        """Go on at a later time in the same state, with what acts; what is due by then hasn't ended yet."""
        self.call(CUT, 0)
        self.integers[_ROTOR_NS] += to_ns - self.integers[NOW_NS]  # a flywheel keeps its momentum
        self.integers[NOW_NS] = self.integers[_START_NS] = to_ns
        self.call(FINISH, 0)

    # Commands

    def put(self, rows: Iterable[Row]) -> None:
        """Put commands into the table, after the active loads, to be applied next."""
        first = last = self.first_due = self.integers[_ACTING]
        table, room = self._table, self._rows
        for time_ns, duration_ns, kind, slot, load in rows:
            if last == room:
                self._grow(2 * room + 2)
                table, room = self._table, self._rows
            at = _ROW_BYTES * last
            _pack(table, at, time_ns, duration_ns, kind, slot, 0, 0)
            table[at + _LOAD_AT : at + _LOAD_AT + len(load)] = load
            last += 1
        self.integers[_DUE], self.integers[_DUE_END] = first, last

    @property
    def next_end_ns(self) -> int:
        """When the next load ends or the string is released [ns]; NEVER where neither is known to be."""
        ends: list[int] = [fl.NEVER, *self._loads["end_ns"][: self.integers[_ACTING]].tolist()]
        if self.flight.tied:
            ends.append(int(self.flight.string_release_ns))
        return min(ends)

    @property
    def waiting(self) -> int:
        """Number of the commands put last that haven't been applied yet."""
        return self.integers[_DUE_END] - self.integers[_DUE]

    def apply(self, pending: Pending, setup: Setup) -> None:
        """Apply a command of any kind but thrusters and changes of parameters now; raises CommandRefused."""
        sent, surface = pending.command, (setup.mesh, setup.vertices, setup.triangles)
        if isinstance(sent, WrenchCommand) and pending.resolved_on is not setup.surface:
            pending.row, _ = packed_of(sent, setup)
        self.put([row_of(pending)])
        if not command(setup.scene, *surface, self.flight, self._loads, self._events, self._refusal):
            raise refused_load(self._refusal, sent, setup)
        if pending.row:
            pending.row = self._loads[self.first_due].load.tobytes()  # resolved

    def refusal_of(self, pending: Pending, setup: Setup) -> CommandRefused:
        """Why body or integrator couldn't take the resolved load of a command."""
        kind, load = pending.command.flight_kind, np.frombuffer(bytearray(pending.row))
        check_load(self.flight, setup.mesh, setup.vertices, setup.triangles, kind, load, self._refusal)
        return refused_command(self._refusal)

    def fly(self, until_ns: int) -> bool:
        """Advance to ``until_ns``; returns False when the motion failed."""
        reached: bool = self.call(FLY, until_ns) == _REACHED
        return reached

    def accelerations(self) -> FloatArray:
        """Accelerations now (6,): of the COM [m/s², world], angular [rad/s², body axes]."""
        return np.array(accelerations_now(self.flight, np.zeros(1, PROBLEM), np.zeros(VARIABLES)))

    def floors(self) -> FloatArray:
        """Error floors by kind (FLOOR_KINDS,); 0 where rounding isn't the limit."""
        floors: FloatArray = self.flight.floors.copy()
        note_floors(self.flight, floors)
        return floors

    @property
    def string_bytes(self) -> bytes:
        """All that is known of a tied string, to be compared; empty without one."""
        return bytes(self._string) if self._string[_TIED_IN_STRING] else b""

    @property
    def string(self) -> StringState | None:
        """The tied string, or None."""
        flight = self.flight
        return string_of(flight, fl.NEVER) if flight.tied else None

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
    def memory(self) -> bytes:
        """A copy of the flight and the rows of the active loads, which lie behind it."""
        if self.integers[_METHOD] == NOT_BEGUN:
            self.call(BEGIN, 0)
        return bytes(self._bytes[: _FLIGHT_BYTES + _ROW_BYTES * self.integers[_ACTING]])

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self.integers[NOW_NS]

    def acting(self) -> Iterator[ActingLoad]:
        """The active loads, in the order in which they began."""
        for row in self._loads[: self.integers[_ACTING]]:
            load = load_of_bytes(row.load.tobytes())
            yield ActingLoad(load, int(row.at_ns), int(row.end_ns), int(row.id), int(row.kind), int(row.slot))
