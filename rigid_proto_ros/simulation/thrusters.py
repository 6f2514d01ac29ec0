# SPDX-License-Identifier: MIT
"""Thrusters fixed to the body: their forces after a command, with force limit, minimum on-time and timeout."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from ..base.errors import InputError
from ..base.rotation import norm
from ..base.vectors import Vector
from ..motion.loads import Load
from .flight import NEVER

_NO_TORQUE = (0.0, 0.0, 0.0)


class Thruster(NamedTuple):
    """point (3,) of the force in mesh coordinates and its direction (3,), a unit vector in mesh axes. The force is
    between ``least`` (0 unless bidirectional) and ``most`` [N]; once on, it stays on for at least minimum_on_ns.
    """

    point: Vector
    direction: Vector
    least: float
    most: float
    minimum_on_ns: int

    def within(self, force: float) -> float:
        """The force [N], clamped to the thruster's limits."""
        return max(self.least, min(self.most, force))

    def load(self, force: float) -> Load:
        """The load on the body at this force [N]."""
        x, y, z = self.direction
        return Load("body", self.point, (force * x, force * y, force * z), _NO_TORQUE)


def make_thruster(name: str, numbers: Sequence[float], bidirectional: bool, minimum_on_ns: int) -> Thruster:
    """A thruster from point, direction and, optionally, the force limit; raises InputError."""
    x, y, z, dx, dy, dz, limit = (*numbers, 0.0)[:7]
    largest = max(abs(dx), abs(dy), abs(dz))
    if not largest > 0.0 or limit < 0.0:
        accepted = "x, y, z, a direction that isn't zero, and behind them if wanted limit >= 0 [N]"
        raise InputError(f"thrusters.{name}", list(numbers), accepted)
    dx, dy, dz = dx / largest, dy / largest, dz / largest
    size = norm(dx, dy, dz)
    most = limit or math.inf
    return Thruster((x, y, z), (dx / size, dy / size, dz / size), -most if bidirectional else 0.0, most, minimum_on_ns)


class Push(NamedTuple):
    """Force of a thruster [N] since on_ns. off_ns: time of a stop delayed by the minimum on-time, or NEVER."""

    force: float = 0.0
    on_ns: int = 0
    off_ns: int = NEVER


OFF = Push()
"""Of a thruster that is off."""


class ThrusterControl:
    """The thrusters of a running simulation. pushes: the force of each, in the order of their names. due_ns: the next
    time at which a force changes without a command.
    """

    def __init__(self, thrusters: Mapping[str, Thruster]) -> None:
        self.thrusters = thrusters
        self.last_ns = 0
        self.clear()

    def clear(self) -> None:
        """Switch all thrusters off at once."""
        self.pushes = [OFF] * len(self.thrusters)
        self.due_ns, self.times_out = NEVER, False

    @property
    def pushing(self) -> bool:
        """Whether any thruster is on."""
        return any(push.force for push in self.pushes)

    def command(self, forces: Iterable[float], now_ns: int, timeout_ns: int) -> list[tuple[int, Load]]:
        """Apply commanded forces; returns the new load of each thruster with its number, except for thrusters that must
        stay on until their minimum on-time is over.
        """
        self.last_ns = now_ns
        loads = []
        for number, (thruster, force) in enumerate(zip(self.thrusters.values(), forces, strict=True)):
            force, before = thruster.within(force), self.pushes[number]
            off_ns = before.on_ns + thruster.minimum_on_ns
            if before.force and not force and now_ns < off_ns:
                self.pushes[number] = before._replace(off_ns=off_ns)
                continue
            self.pushes[number] = Push(force, before.on_ns if before.force else now_ns)
            loads.append((number, thruster.load(force)))
        self._find_due(timeout_ns)
        return loads

    def end_due(self, now_ns: int, timeout_ns: int) -> tuple[list[tuple[int, Load]], bool]:
        """Loads of thrusters, by number, that change now by themselves, and whether the last command has timed out."""
        loads = []
        for number, (thruster, push) in enumerate(zip(self.thrusters.values(), self.pushes, strict=True)):
            if push.off_ns <= now_ns:
                self.pushes[number] = OFF
                loads.append((number, thruster.load(0.0)))
        timed_out = self.times_out and now_ns >= self.last_ns + timeout_ns
        if timed_out:
            loads += self.command([0.0] * len(self.pushes), now_ns, timeout_ns)
        self._find_due(timeout_ns)
        return loads, timed_out

    def change(self, timeout_ns: int, now_ns: int) -> None:
        """Apply a changed timeout."""
        self._find_due(timeout_ns)
        self.due_ns = max(self.due_ns, now_ns)

    def _find_due(self, timeout_ns: int) -> None:
        self.due_ns = min((push.off_ns for push in self.pushes), default=NEVER)
        self.times_out = timeout_ns > 0 and any(push.force and push.off_ns == NEVER for push in self.pushes)
        if self.times_out:
            self.due_ns = min(self.due_ns, self.last_ns + timeout_ns)
