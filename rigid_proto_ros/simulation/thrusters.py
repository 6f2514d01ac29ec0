# SPDX-License-Identifier: MIT
"""Thrusters fixed to the body: what they push with after a command, through limit, lag and timeout.

A lag is of first order: u' = (target − u)/lag. Loads are constant within a segment, so the force goes in stairs, each
with the mean of u over it: the impulse is exact, and what the body is displaced by errs by the square of a stair.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from ..base.errors import CommandRefused, InputError
from ..base.rotation import Vector
from ..motion.body import Body
from ..motion.loads import Load
from .flight import NEVER

STAIRS = 16
"""Of one lag."""

SETTLED = 16 * STAIRS
"""Stairs after which the force is what was asked for: 1e-7 of the change is left then."""

_NO_TORQUE = (0.0, 0.0, 0.0)


class Thruster(NamedTuple):
    """point (3,) and direction (3,) of the force, a unit vector, in mesh coordinates; limit [N] of either sign, inf for
    none; lag_s: time constant.
    """

    point: Vector
    direction: Vector
    limit: float
    lag_s: float

    def within(self, force: float) -> float:
        """The force [N] that its limit leaves of this one."""
        return max(-self.limit, min(self.limit, force))

    def load(self, force: float) -> Load:
        """Its load on the body at this force [N]."""
        x, y, z = self.direction
        return Load("body", self.point, (force * x, force * y, force * z), _NO_TORQUE)


def make_thruster(name: str, numbers: Sequence[float]) -> Thruster:
    """From point, direction, and where given limit and lag; raises InputError."""
    x, y, z, dx, dy, dz, limit, lag_s = (*numbers, 0.0, 0.0)[:8]
    largest = max(abs(dx), abs(dy), abs(dz))
    if not largest > 0.0 or limit < 0.0 or not 0.0 <= lag_s <= 1e9:
        accepted = "x, y, z, a direction that isn't zero, and behind them if wanted limit >= 0 [N] and lag >= 0 [s]"
        raise InputError(f"thrusters.{name}", list(numbers), accepted)
    dx, dy, dz = dx / largest, dy / largest, dz / largest
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    return Thruster((x, y, z), (dx / size, dy / size, dz / size), limit or math.inf, lag_s)


def check_forces(thrusters: Mapping[str, Thruster], forces: Sequence[float], body: Body) -> None:
    """Raises CommandRefused unless there is a force [N] that the body can take for each thruster."""
    if len(forces) != len(thrusters):
        names = ", ".join(thrusters) or "none is declared by thrusters.<name>"
        accepted = f"{len(thrusters)} numbers, one a thruster ({names})"
        raise CommandRefused("frame", "thrusters", f"{len(forces)} numbers", accepted)
    if not all(map(math.isfinite, forces)):
        raise CommandRefused("nonfinite", "thrusters", list(forces), "finite numbers")
    for thruster, force in zip(thrusters.values(), forces, strict=True):
        thruster.load(thruster.within(force)).check_magnitude(body)


class Push(NamedTuple):
    """What a thruster is at. target: what it was told to push with, within its limit [N]; value: u at since_ns;
    until_ns: when its stair ends, NEVER where the target is reached; stairs: since the last command.
    """

    target: float
    value: float
    since_ns: int
    until_ns: int
    stairs: int


@dataclass
class Working:
    """One thruster at work; the numbers as ``Push`` has them."""

    thruster: Thruster
    target: float = 0.0
    value: float = 0.0
    since_ns: int = 0
    until_ns: int = NEVER
    stairs: int = 0

    def aim(self, force: float, now_ns: int) -> float:
        """Go for another force from now on; returns that of the first stair [N]."""
        if self.until_ns != NEVER:
            self._pass(now_ns)
        self.target, self.stairs = self.thruster.within(force), 0
        return self.next_stair(now_ns)

    def next_stair(self, now_ns: int) -> float:
        """Begin another stair; returns its mean force [N]."""
        if self.until_ns == now_ns:
            self._pass(now_ns)
        lag_ns = round(self.thruster.lag_s * 1e9)
        if lag_ns < STAIRS or self.value == self.target or self.stairs == SETTLED:
            self.value, self.until_ns = self.target, NEVER
            return self.target
        self.stairs, self.since_ns = self.stairs + 1, now_ns
        self.until_ns = now_ns + lag_ns // STAIRS
        mean = _mean_of_decay((self.until_ns - now_ns) / lag_ns)
        return self.target + (self.value - self.target) * mean

    @property
    def load(self) -> Load:
        """What it pushes with now: the mean of its stair."""
        force = self.target
        if self.until_ns != NEVER:
            lag_ns = round(self.thruster.lag_s * 1e9)
            mean = _mean_of_decay((self.until_ns - self.since_ns) / lag_ns) if lag_ns else 0.0
            force = self.target + (self.value - self.target) * mean
        return self.thruster.load(force)

    def push(self, now_ns: int) -> Push:
        """What it is at, times from ``now_ns`` on."""
        if self.until_ns == NEVER:
            return Push(self.target, self.target, 0, NEVER, 0)
        return Push(self.target, self.value, self.since_ns - now_ns, self.until_ns - now_ns, self.stairs)

    def _pass(self, now_ns: int) -> None:
        decay = _decay((now_ns - self.since_ns) / (self.thruster.lag_s * 1e9))
        self.value, self.since_ns = self.target + (self.value - self.target) * decay, now_ns


@lru_cache(maxsize=64)
def _mean_of_decay(x: float) -> float:
    """(1 − exp(−x))/x for 0 <= x <= 1/STAIRS, by its series: the same bits everywhere."""
    value = 1.0
    for k in range(12, 1, -1):
        value = 1.0 - x / k * value
    return value


def _decay(x: float) -> float:
    """exp(−x), of the same x."""
    return 1.0 - x * _mean_of_decay(x)


@dataclass
class ThrusterControl:
    """The thrusters of a running simulation. due_ns: when something becomes of them by itself."""

    thrusters: Mapping[str, Thruster]
    due_ns: int = NEVER
    last_ns: int = 0
    times_out: bool = False
    _working: list[Working] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._working = [Working(thruster) for thruster in self.thrusters.values()]

    @property
    def targets(self) -> list[float]:
        """What they were last told to push with [N]."""
        return [working.target for working in self._working]

    @property
    def lags(self) -> bool:
        """Whether some force is still on its way."""
        return any(working.until_ns != NEVER for working in self._working)

    def pushes(self, now_ns: int) -> dict[str, Push]:
        """What those at work are at, by name, times from ``now_ns`` on."""
        named = zip(self.thrusters, self._working, strict=True)
        return {name: working.push(now_ns) for name, working in named if working.target or working.until_ns != NEVER}

    def go_on(self, pushes: Mapping[str, Push], last_ns: int, timeout_ns: int) -> None:
        """Be at these at time 0, the others at rest."""
        self._working = [
            Working(thruster, *pushes[name]) if name in pushes else Working(thruster)
            for name, thruster in self.thrusters.items()
        ]
        self.last_ns = last_ns
        self.change(timeout_ns, 0)

    def load(self, name: str) -> tuple[int, Load]:
        """The number of the thruster of this name, and what it pushes with now."""
        number = list(self.thrusters).index(name)
        return number, self._working[number].load

    def command(self, forces: Iterable[float], now_ns: int, timeout_ns: int) -> list[tuple[int, Load]]:
        """Go for these forces; returns what each pushes with from now on, by its number."""
        self.last_ns = now_ns
        loads = [
            (number, working.thruster.load(working.aim(force, now_ns)))
            for number, (working, force) in enumerate(zip(self._working, forces, strict=True))
        ]
        self.times_out = timeout_ns > 0 and any(working.target for working in self._working)
        self._find_due(timeout_ns)
        return loads

    def end_due(self, now_ns: int, timeout_ns: int) -> tuple[list[tuple[int, Load]], bool]:
        """What pushes otherwise from now on by itself, and whether it is that the last command has timed out."""
        if now_ns < self.due_ns:
            return [], False
        if self.times_out and now_ns >= self.last_ns + timeout_ns:
            return self.command([0.0] * len(self._working), now_ns, timeout_ns), True
        loads = [
            (number, working.thruster.load(working.next_stair(now_ns)))
            for number, working in enumerate(self._working)
            if working.until_ns == now_ns
        ]
        self._find_due(timeout_ns)
        return loads, False

    def clear(self) -> None:
        """Nothing pushes any more, without a lag."""
        self._working = [Working(working.thruster) for working in self._working]
        self.due_ns, self.times_out = NEVER, False

    def change(self, timeout_ns: int, now_ns: int) -> None:
        """The timeout is another one from now on."""
        self.times_out = timeout_ns > 0 and any(working.target for working in self._working)
        self._find_due(timeout_ns)
        self.due_ns = max(self.due_ns, now_ns)

    def _find_due(self, timeout_ns: int) -> None:
        self.due_ns = min((working.until_ns for working in self._working), default=NEVER)
        if self.times_out:
            self.due_ns = min(self.due_ns, self.last_ns + timeout_ns)
