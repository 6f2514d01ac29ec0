# SPDX-License-Identifier: MIT
"""The commands: one union type for scripts, messages, event lines and the simulation. Importing it loads no kernel,
which a program that only sends commands doesn't need.

``order_of`` defines the order of commands with equal times.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Literal

from ..base.errors import CommandRefused, InputError
from ..base.vectors import Vector
from ..motion.frames import Frame

if TYPE_CHECKING:
    from ..motion.surface import Surface
    from .setup import Setup

NO_SLOT, UNNAMED_SLOT = 0, 1
HELD_WRENCH, PULSE, IMPULSE, CLEAR, TIE_STRING, MOVE_STRING, RELEASE_STRING, SET_STATE = range(8)
"""Kinds of commands in the tables of a flight."""

TIE_AXES = ("mesh", "body", "world")
"""Coordinates in which a point to tie the string at is given, in the order of their numbers."""

_ROW = struct.Struct("=14d")

FARTHEST = 1e100
"""Largest coordinate of a point [m], or number of a state; its square still fits a double."""


def _point_row(axes: int, point: Sequence[float]) -> bytes:
    return _ROW.pack(axes, 0.0, *point, *(0.0,) * 9)


def nanoseconds(seconds: float) -> int:
    """Seconds, rounded to whole nanoseconds."""
    return round(seconds * 1e9)


class Rank(IntEnum):
    """Order of single messages with equal times."""

    CHANGE = 0  # parameter changes and services
    INERTIA = 1
    STRING_ATTACH = 2
    STRING_TARGET = 3
    WRENCH = 4
    THRUSTERS = 5
    POKE = 6


@dataclass(slots=True, kw_only=True)
class Stamped:
    """Fields of all commands; a command is never modified.

    stamp_ns: time at which it acts, or stamp of its message. entry: its number in a script, the first being 1.
    """

    stamp_ns: int = 0
    entry: int = field(default=0, compare=False)

    duration_ns = -1
    """Duration that the command states [ns], or −1."""
    flight_kind = CLEAR
    """Kind in the flight's tables."""
    slot = NO_SLOT
    """Number of the slot whose load it replaces."""

    @property
    def numbers(self) -> bytes:
        """The command's numbers as the flight's tables have them (LOAD,); a wrench's are resolved on a body first."""
        return b""


@dataclass(slots=True)
class WrenchCommand(Stamped):
    """One message of the wrench topic (``held``) or the poke topic.

    force [N], torque [N m] as sent (N s and N m s for an impulse). sent: the frame_id of the message; None if the
    command wasn't a message.
    """

    held: bool
    frame: Frame
    force: Vector
    torque: Vector
    sent: str | None = field(default=None, compare=False)
    duration_ns: int = field(init=False, compare=False, repr=False)
    flight_kind: int = field(init=False, compare=False, repr=False)
    slot: int = field(init=False, compare=False, repr=False)
    packed: tuple[bytes, float, Mapping[str, Vector]] | None = field(
        init=False, default=None, compare=False, repr=False
    )
    """Row and weight of its load (``packed_load``), once they are known, and the contacts for which they are."""

    def __post_init__(self) -> None:
        frame = self.frame
        if self.held and frame.impulse:
            raise CommandRefused("frame", "frame_id", self.frame_id, "on the wrench topic no ;impulse: that is a poke")
        # Computed once: a command may act many times.
        self.duration_ns = -1 if frame.duration_s is None else nanoseconds(frame.duration_s)
        # A held wrench with a duration is a pulse in its slot.
        held = HELD_WRENCH if self.held and frame.duration_s is None else PULSE
        self.flight_kind = IMPULSE if frame.impulse else held
        self.slot = slot_number(frame.slot) if frame.slot else UNNAMED_SLOT if self.held else NO_SLOT

    @property
    def frame_id(self) -> str:
        """The frame as sent, or written out in full."""
        return self.frame.text if self.sent is None else self.sent

    @property
    def rank(self) -> Rank:
        """Order among commands with equal times."""
        return Rank.WRENCH if self.held else Rank.POKE

    @property
    def kind(self) -> str:
        """Name of the command in events."""
        return "wrench" if self.held else "poke"

    @property
    def content(self) -> dict[str, Any]:
        """The message as the event log keeps it."""
        return {
            "stamp_ns": self.stamp_ns,
            "frame_id": self.frame_id,
            "force": list(self.force),
            "torque": list(self.torque),
        }


@dataclass(slots=True)
class ThrusterCommand(Stamped):
    """Forces of the thrusters [N], in the alphabetical order of the thrusters' names."""

    forces: tuple[float, ...]
    kind = "thrusters"
    rank = Rank.THRUSTERS

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {"forces": list(self.forces)}


def _no_setup() -> Setup:
    raise InputError("change", "no setup", "a change with a setup: there are no parameters here")


STATE_VALUES = {"position": 3, "orientation_xyzw": 4, "linear_velocity": 3, "angular_velocity": 3}
"""Values that SetState can set, in world axes, and how many numbers each has."""


@dataclass(slots=True)
class SetState(Stamped):
    """Set the state of the body at once: any of STATE_VALUES [m, m/s, rad/s, world axes]; the others stay unchanged."""

    values: Mapping[str, tuple[float, ...]]
    kind = "state"
    rank = Rank.CHANGE
    flight_kind = SET_STATE

    def __post_init__(self) -> None:
        for name, numbers in self.values.items():
            if name not in STATE_VALUES or len(numbers) != STATE_VALUES[name]:
                accepted = ", ".join(f"{name} of {count} numbers" for name, count in STATE_VALUES.items())
                raise CommandRefused("state", "state", f"{name} of {len(numbers)} numbers", accepted)
            _check_numbers(f"state, {name}", numbers)
        if not any(self.values.get("orientation_xyzw", (1.0,))):
            raise CommandRefused("state", "state, orientation_xyzw", [0.0] * 4, "four numbers, not all zero")

    @property
    def numbers(self) -> bytes:
        """See Stamped: bits of the values that there are, then all of them."""
        bits = sum(1 << k for k, name in enumerate(STATE_VALUES) if name in self.values)
        given = [self.values.get(name, (0.0,) * count) for name, count in STATE_VALUES.items()]
        return _ROW.pack(bits, *(number for numbers in given for number in numbers))

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {name: list(numbers) for name, numbers in self.values.items()}


@dataclass(slots=True)
class ClearWrench(Stamped):
    """End all held wrenches, pulses and thruster forces; scheduled commands stay."""

    kind = "clear_wrench"
    rank = Rank.CHANGE

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {}


@dataclass(slots=True)
class Change(Stamped):
    """A change of parameters (kind ``set``) or of the whole inertia by message (``inertia``).

    content: as the event log keeps it. apply() returns the new Setup, based on the values in force at that time, or
    raises InputError; a scenario's run provides it (scene/scenario_run.py) where the command was read without it.
    """

    content: Mapping[str, Any]
    apply: Callable[[], Setup] = field(default=_no_setup, compare=False)
    kind: str = "set"

    @property
    def rank(self) -> Rank:
        """Order among commands with equal times."""
        return Rank.INERTIA if self.kind == "inertia" else Rank.CHANGE


@dataclass(slots=True)
class TieString(Stamped):
    """Set the point of the body at which the string is, or will be, tied.

    axes: ``mesh`` (mesh coordinates, unscaled), ``body`` (metres from the COM) or ``world``; when the command takes
    effect the point is projected to the nearest point of the surface. frame_id: as sent. contact: name of the contact
    to tie to, resolved by a caller that knows the body's contacts.
    """

    axes: str
    point: Vector
    frame_id: str = ""
    contact: str = ""
    kind = "string_attach"
    flight_kind = TIE_STRING
    rank = Rank.STRING_ATTACH

    def __post_init__(self) -> None:
        if self.axes not in TIE_AXES:
            raise CommandRefused("frame", "frame_id", self.frame_id or self.axes, "axes mesh, body or world")
        _check_numbers("string attach", self.point)

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {"stamp_ns": self.stamp_ns, "frame_id": self.frame_id, "axes": self.axes, "point": list(self.point)}

    @property
    def numbers(self) -> bytes:
        """See Stamped: the axes and the point."""
        return _point_row(TIE_AXES.index(self.axes), self.point)


@dataclass(slots=True)
class MoveString(Stamped):
    """Move the string's free end to point (3,) [m, world]; the first such command ties the string."""

    point: Vector
    frame_id: str = ""
    kind = "string_target"
    flight_kind = MOVE_STRING
    rank = Rank.STRING_TARGET

    def __post_init__(self) -> None:
        _check_numbers("string target", self.point)

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {"stamp_ns": self.stamp_ns, "frame_id": self.frame_id, "point": list(self.point)}

    @property
    def numbers(self) -> bytes:
        """See Stamped: the point."""
        return _point_row(0, self.point)


@dataclass(slots=True)
class ReleaseString(Stamped):
    """Release the string."""

    kind = "string_release"
    flight_kind = RELEASE_STRING
    rank = Rank.CHANGE

    @property
    def content(self) -> dict[str, Any]:
        """The command as an event line keeps it."""
        return {}


_SLOT_CHARACTERS = "abcdefghijklmnopqrstuvwxyz0123456789_"


def slot_number(name: str) -> int:
    """Integer for a slot's name: digits of base 38, plus the number of the unnamed slot."""
    number = 0
    for character in name:
        number = 38 * number + _SLOT_CHARACTERS.index(character) + 1
    return number + UNNAMED_SLOT


def slot_name(number: int) -> str:
    """The name of the slot with this number, empty for the unnamed one."""
    name, number = "", number - UNNAMED_SLOT
    while number:
        number, digit = divmod(number, 38)
        name = _SLOT_CHARACTERS[digit - 1] + name
    return name


def _check_numbers(field: str, numbers: Sequence[float]) -> None:
    if not all(math.isfinite(x) for x in numbers):
        raise CommandRefused("nonfinite", field, list(numbers), f"{len(numbers)} finite numbers")
    if not all(abs(x) <= FARTHEST for x in numbers):
        raise CommandRefused("magnitude", field, list(numbers), f"numbers of at most {FARTHEST:g}")


def order_of(command: Command, listed: Listed | None, arrival: int) -> tuple[int, int, int, int]:
    """Sort key of commands with equal times: first the entries of lists, in the order in which the lists arrived and in
    each list's own order; then single messages by rank, and by arrival within a rank.
    """
    return (0, *listed, arrival) if listed is not None else (1, command.rank, 0, arrival)


Listed = tuple[int, int]
"""The number of a list of commands, in the order of arrival, and the place of an entry in that list."""

Command = WrenchCommand | ThrusterCommand | SetState | ClearWrench | Change | TieString | MoveString | ReleaseString


Row = tuple[int, int, int, int, bytes]
"""A command as the flight's tables have it: time [ns], duration [ns], kind, slot and load, as in LOAD_ROW
(simulation/flight.py).
"""


@dataclass(slots=True)
class Pending:
    """A command waiting for its time. order: sort key among commands with equal times (``order_of``). listed: its place
    in a list, if it is an entry of one. row: of a wrench or poke whose load is resolved, that load (LOAD,).
    resolved_on: the surface that it holds for, None of a body without a mesh; False where it isn't resolved.
    """

    time_ns: int
    command: Command
    order: tuple[int, int, int, int] = (0, 0, 0, 0)
    listed: Listed | None = None
    row: bytes = b""
    resolved_on: Surface | None | Literal[False] = False


def row_of(pending: Pending) -> Row:
    """A command as the flight's tables have it."""
    command = pending.command
    numbers = pending.row or command.numbers
    return pending.time_ns, command.duration_ns, command.flight_kind, command.slot, numbers


Waiting = tuple[int, tuple[int, int, int, int], Pending]
"""An entry of the heap of pending commands."""
