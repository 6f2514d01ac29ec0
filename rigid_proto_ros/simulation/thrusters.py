# SPDX-License-Identifier: MIT
"""Thrusters fixed to the body: what they push with after a command, within limit, least on-time and timeout."""

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
    """point (3,) and direction (3,) of the force, a unit vector, in mesh coordinates. Its force lies between ``least``,
    0 unless it pushes both ways, and ``most`` [N]; once on it pushes for minimum_on_ns at least.
    """

    point: Vector
    direction: Vector
    least: float
    most: float
    minimum_on_ns: int

    def within(self, force: float) -> float:
        """The force [N] that its limits leave of this one."""
        return max(self.least, min(self.most, force))

    def load(self, force: float) -> Load:
        """Its load on the body at this force [N]."""
        x, y, z = self.direction
        return Load("body", self.point, (force * x, force * y, force * z), _NO_TORQUE)


def make_thruster(name: str, numbers: Sequence[float], bidirectional: bool, minimum_on_ns: int) -> Thruster:
    """From point, direction, and where given the limit; raises InputError."""
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
    """What a thruster pushes with [N] since on_ns; off_ns: when it stops, kept on by its least on-time, or NEVER."""

    force: float = 0.0
    on_ns: int = 0
    off_ns: int = NEVER


class ThrusterControl:
    """The thrusters of a running simulation. pushes: what each pushes with, in the order of their names. due_ns: when
    something becomes of them by itself.
    """

    def __init__(self, thrusters: Mapping[str, Thruster]) -> None:
        self.thrusters = thrusters
        self.last_ns = 0
        self.clear()

    def clear(self) -> None:
        """Nothing pushes any more, at once."""
        self.pushes = [Push()] * len(self.thrusters)
        self.due_ns, self.times_out = NEVER, False

    def command(self, forces: Iterable[float], now_ns: int, timeout_ns: int) -> list[tuple[int, Load]]:
        """Push with these forces; returns what each pushes with from now on, by its number, but for those that have to
        stay on for a while.
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
        """What pushes otherwise from now on by itself, and whether it is that the last command has timed out."""
        loads = []
        for number, (thruster, push) in enumerate(zip(self.thrusters.values(), self.pushes, strict=True)):
            if push.off_ns <= now_ns:
                self.pushes[number] = Push()
                loads.append((number, thruster.load(0.0)))
        timed_out = self.times_out and now_ns >= self.last_ns + timeout_ns
        if timed_out:
            loads += self.command([0.0] * len(self.pushes), now_ns, timeout_ns)
        self._find_due(timeout_ns)
        return loads, timed_out

    def change(self, timeout_ns: int, now_ns: int) -> None:
        """The timeout is another one from now on."""
        self._find_due(timeout_ns)
        self.due_ns = max(self.due_ns, now_ns)

    def _find_due(self, timeout_ns: int) -> None:
        self.due_ns = min((push.off_ns for push in self.pushes), default=NEVER)
        self.times_out = timeout_ns > 0 and any(push.force and push.off_ns == NEVER for push in self.pushes)
        if self.times_out:
            self.due_ns = min(self.due_ns, self.last_ns + timeout_ns)
