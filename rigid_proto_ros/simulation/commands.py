# SPDX-License-Identifier: MIT
"""The commands: one union, as scripts, messages and event lines say them and as the simulation takes them; without
numba, which who only sends commands has no use for.

``order_of`` says in which order those of equal times act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any

from ..base.errors import CommandRefused
from ..base.vectors import Vector
from ..motion.frames import Frame

if TYPE_CHECKING:
    from .setup import Setup

NO_SLOT, UNNAMED_SLOT = 0, 1
HELD_WRENCH, PULSE, IMPULSE, CLEAR = range(4)
"""What a command is to a flight, as its tables hold it."""

FARTHEST = 1e100
"""Metres: a place beyond it has no squared distance in a double."""


def nanoseconds(seconds: float) -> int:
    """Seconds to whole nanoseconds, to the nearest."""
    return round(seconds * 1e9)


class Rank(IntEnum):
    """Order of single messages at one instant."""

    CHANGE = 0  # parameter changes and services
    INERTIA = 1
    STRING_ATTACH = 2
    STRING_TARGET = 3
    WRENCH = 4
    THRUSTERS = 5
    POKE = 6


@dataclass(slots=True, kw_only=True)
class Stamped:
    """What all commands have; none is ever changed.

    stamp_ns: when they act, or as their messages were stamped. entry: of a script that they come from, counted from 1.
    """

    stamp_ns: int = 0
    entry: int = field(default=0, compare=False)


@dataclass(slots=True)
class WrenchCommand(Stamped):
    """One message of the wrench topic (``held``) or the poke topic.

    force [N], torque [N m] as sent (N s and N m s for an impulse). sent: the frame as a message said it; None where it
    wasn't one.
    """

    held: bool
    frame: Frame
    force: Vector
    torque: Vector
    sent: str | None = field(default=None, compare=False)

    @property
    def frame_id(self) -> str:
        """The frame as sent, or written out."""
        return self.frame.text if self.sent is None else self.sent

    @property
    def rank(self) -> Rank:
        """Its place among commands of one time."""
        return Rank.WRENCH if self.held else Rank.POKE

    @property
    def kind(self) -> str:
        """As events name it."""
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

    @property
    def duration_ns(self) -> int:
        """Of a command that says how long it lasts, else −1."""
        seconds = self.frame.duration_s
        return -1 if seconds is None else nanoseconds(seconds)

    @property
    def flight_kind(self) -> int:
        """What it is to a flight: a held wrench that says how long it lasts is a pulse in its slot."""
        if self.frame.impulse:
            return IMPULSE
        return HELD_WRENCH if self.held and self.frame.duration_s is None else PULSE

    @property
    def slot(self) -> int:
        """By which a flight knows what it replaces."""
        if self.frame.slot:
            return slot_number(self.frame.slot)
        return UNNAMED_SLOT if self.held else NO_SLOT

    def __post_init__(self) -> None:
        if self.held and self.frame.impulse:
            raise CommandRefused("frame", "frame_id", self.frame_id, "on the wrench topic no ;impulse: that is a poke")


@dataclass(slots=True)
class ThrusterCommand(Stamped):
    """What the thrusters push with [N], in the alphabetical order of their names."""

    forces: tuple[float, ...]
    kind = "thrusters"
    rank = Rank.THRUSTERS

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {"forces": list(self.forces)}


STATE_VALUES = {"position": 3, "orientation_xyzw": 4, "linear_velocity": 3, "angular_velocity": 3}
"""What a SetState may set, world axes, and how many numbers it has."""


@dataclass(slots=True)
class SetState(Stamped):
    """Put the body elsewhere at once: any of STATE_VALUES [m, m/s, rad/s, world axes]; the others stay."""

    values: Mapping[str, tuple[float, ...]]
    kind = "state"
    rank = Rank.CHANGE

    def __post_init__(self) -> None:
        for name, numbers in self.values.items():
            if name not in STATE_VALUES or len(numbers) != STATE_VALUES[name]:
                accepted = ", ".join(f"{name} of {count} numbers" for name, count in STATE_VALUES.items())
                raise CommandRefused("state", "state", f"{name} of {len(numbers)} numbers", accepted)
            _check_point(f"state, {name}", numbers)
        if not any(self.values.get("orientation_xyzw", (1.0,))):
            raise CommandRefused("state", "state, orientation_xyzw", [0.0] * 4, "four numbers, not all zero")

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {name: list(numbers) for name, numbers in self.values.items()}


@dataclass(slots=True)
class ClearWrench(Stamped):
    """End the held wrench and the running pulses; scheduled commands stay."""

    kind = "clear_wrench"
    rank = Rank.CHANGE

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {}


@dataclass(slots=True)
class Change(Stamped):
    """A change of parameters (kind ``set``) or of the whole inertia by message (``inertia``).

    content: as the event log keeps it. apply() gives the new Setup from the values in force then, or raises InputError;
    without it the simulation's ``setup_of`` does.
    """

    content: Mapping[str, Any]
    apply: Callable[[], Setup] | None = field(default=None, compare=False)
    kind: str = "set"

    @property
    def rank(self) -> Rank:
        """Its place among commands of one time."""
        return Rank.INERTIA if self.kind == "inertia" else Rank.CHANGE


@dataclass(slots=True)
class TieString(Stamped):
    """Where on the body the string is, or will be, tied.

    axes: ``mesh`` (mesh coordinates, unscaled), ``body`` (metres from the COM) or ``world``; the point is taken onto
    the surface, nearest to it, when the command takes effect. frame_id as sent. contact: the one whose point it is to
    be, for whoever knows the body's.
    """

    axes: str
    point: Vector
    frame_id: str = ""
    contact: str = ""
    kind = "string_attach"
    rank = Rank.STRING_ATTACH

    def __post_init__(self) -> None:
        if self.axes not in ("mesh", "body", "world"):
            raise CommandRefused("frame", "frame_id", self.frame_id or self.axes, "axes mesh, body or world")
        _check_point("string attach", self.point)

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {"stamp_ns": self.stamp_ns, "frame_id": self.frame_id, "axes": self.axes, "point": list(self.point)}


@dataclass(slots=True)
class MoveString(Stamped):
    """Where the string's free end goes, point (3,) [m, world]; the first one ties the string."""

    point: Vector
    frame_id: str = ""
    kind = "string_target"
    rank = Rank.STRING_TARGET

    def __post_init__(self) -> None:
        _check_point("string target", self.point)

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {"stamp_ns": self.stamp_ns, "frame_id": self.frame_id, "point": list(self.point)}


@dataclass(slots=True)
class ReleaseString(Stamped):
    """Let the string go."""

    kind = "string_release"
    rank = Rank.CHANGE

    @property
    def content(self) -> dict[str, Any]:
        """What an event line holds of it."""
        return {}


_SLOT_CHARACTERS = "abcdefghijklmnopqrstuvwxyz0123456789_"


def slot_number(name: str) -> int:
    """A slot's name as an integer: digits of base 38, above the number of the unnamed slot."""
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


def _check_point(field: str, point: Sequence[float]) -> None:
    if not all(math.isfinite(x) for x in point):
        raise CommandRefused("nonfinite", field, list(point), "three finite numbers")
    if not all(abs(x) <= FARTHEST for x in point):
        raise CommandRefused("magnitude", field, list(point), f"at most {FARTHEST:g} m")


def order_of(command: Command, listed: Listed | None, arrival: int) -> tuple[int, int, int, int]:
    """What decides among commands of one instant: first the entries of lists, lists as they arrived and each list's in
    its own order; then single messages by rank, those of one rank as they arrived.
    """
    return (0, *listed, arrival) if listed is not None else (1, command.rank, 0, arrival)


Listed = tuple[int, int]
"""The number of the list that a command is an entry of, in the order of arrival, and the entry's place there."""

Command = WrenchCommand | ThrusterCommand | SetState | ClearWrench | Change | TieString | MoveString | ReleaseString


@dataclass(slots=True)
class Pending:
    """A command waiting for its time: its place among those of the same time (``order_of``) and in a list, if it is an
    entry of one; kind, duration_ns, slot and row as the flight's tables hold them, the row empty until its load is
    resolved, and the setup under which that was.
    """

    time_ns: int
    command: Command
    order: tuple[int, int, int, int] = (0, 0, 0, 0)
    listed: Listed | None = None
    resolved_for: Setup | None = None
    kind: int = CLEAR
    duration_ns: int = -1
    slot: int = NO_SLOT
    row: bytes = b""

    def set_load(self, command: WrenchCommand, row: bytes, setup: Setup) -> None:
        """The load of the command, a wrench or poke, was resolved under this setup."""
        self.resolved_for, self.row = setup, row
        self.kind, self.duration_ns, self.slot = command.flight_kind, command.duration_ns, command.slot


Waiting = tuple[int, tuple[int, int, int, int], Pending]
"""A command in a heap."""
