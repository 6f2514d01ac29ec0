# SPDX-License-Identifier: MIT
"""Commands as the simulation takes them, and the order in which equal times act.

Commands that act at the same nanosecond act in the order of ``Rank``, then by the bytes of their message, never by arrival:
four publishers in any order give one trajectory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum

from .errors import CommandRefused
from .frames import Frame


class Rank(IntEnum):
    """Order of commands at one instant."""

    CHANGE = 0  # parameter changes and services
    INERTIA = 1
    STRING = 2
    WRENCH = 3
    POKE = 4


@dataclass(frozen=True)
class WrenchCommand:
    """One message of the wrench topic (``held``) or the poke topic.

    force [N], torque [N m] as sent (N s and N m s for an impulse), frame already read; stamp_ns and frame_id as sent;
    message: its serialized bytes, which settle the order among equal times.
    """

    held: bool
    frame: Frame
    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    stamp_ns: int
    frame_id: str
    message: bytes

    @property
    def rank(self) -> Rank:
        return Rank.WRENCH if self.held else Rank.POKE

    @property
    def kind(self) -> str:
        return "wrench" if self.held else "poke"

    @property
    def content(self) -> dict:
        """The message as the event log keeps it."""
        return {
            "stamp_ns": self.stamp_ns,
            "frame_id": self.frame_id,
            "force": list(self.force),
            "torque": list(self.torque),
        }

    def __post_init__(self) -> None:
        if self.held and (self.frame.impulse or self.frame.duration_s is not None):
            raise CommandRefused(
                "frame", "frame_id", self.frame_id, "on the wrench topic no ;duration or ;impulse: those are pokes"
            )


@dataclass(frozen=True)
class ClearWrench:
    """End the held wrench and the running pulses; scheduled commands stay."""

    message: bytes = b""
    kind = "clear_wrench"
    rank = Rank.CHANGE

    @property
    def content(self) -> dict:
        return {}


@dataclass(frozen=True)
class Change:
    """A change of parameters; ``apply`` gives the new Setup from the values in force then, or raises InputError."""

    changes: dict
    apply: Callable
    message: bytes = b""
    kind = "set"
    rank = Rank.CHANGE

    @property
    def content(self) -> dict:
        return self.changes


Command = WrenchCommand | ClearWrench | Change


@dataclass(order=True)
class Pending:
    """A command waiting for its time: ordered by time, rank, message bytes; arrival decides only between equals."""

    time_ns: int
    rank: int
    message: bytes
    arrival: int
    command: Command = field(compare=False)
    load: tuple | None = field(compare=False, default=None)
