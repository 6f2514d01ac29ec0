# SPDX-License-Identifier: MIT
"""How far a simulation is advanced, and when: by the clock that simulated time follows, and by the time that a tick may
take.

Simulated time follows its clock from an anchor, never by adding up periods, so that a late wake-up isn't carried on.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from ..simulation.simulation import Simulation

WORK_NS = 8_000_000
"""[ns of wall time] A tick advances no longer than this before it lets commands and requests in."""

FIRST_STEPS, FIRST_NS = 1000, 1_000_000
"""The first slice has room for so many fixed steps, at 0.1 to 10 µs each, and isn't longer than this [ns]: integrators
that choose their own steps take up to some thousands in it.
"""

GROWTH = 4

TICK_NS = 10_000_000
"""A loop with nothing else to do wakes this often [ns of wall time], and takes its commands."""

LAST_STAMP_NS = (2**31 - 1) * 1_000_000_000
"""A message's stamp counts seconds in 32 bits."""

LONGEST_NS = 1e18
"""Thirty years [ns of wall time], for which nobody waits: a small enough factor asks for infinity."""

JUMP_NS, JUMP_SPACINGS = 1_000_000_000, 10
"""A followed clock that goes ahead by more than this [ns], and by more than so many of its usual steps, has jumped."""

MAX_LAG_NS = 250_000_000
"""A thread further behind than this [ns of wall time] gives the time up instead of racing after it."""


@dataclass
class Stamps:
    """What messages are stamped by. clock() gives nanoseconds of a clock that simulated time follows instead of the
    wall's; offset_ns: how far stamps are ahead of simulated time, 0 without such a clock.
    """

    clock: Callable[[], int] | None = None
    offset_ns: int = 0

    def of(self, time_ns: int) -> tuple[int, int]:
        """Seconds and nanoseconds that stamp a simulated time."""
        return divmod(time_ns + self.offset_ns, 1_000_000_000)


class WorkBudget:
    """The time that one tick may spend on the motion, which is advanced in slices: they grow while they are cheap and
    shrink when they turn out expensive. The motion doesn't depend on them, so they may follow the wall clock.
    """

    def __init__(self) -> None:
        self._slice_ns = 0
        self._events = -1
        self._end_ns = 0

    def begin_tick(self) -> None:
        """The time for this tick's work begins."""
        self._end_ns = time.monotonic_ns() + WORK_NS

    def advance(self, simulation: Simulation, until_ns: int) -> bool:
        """Advance towards ``until_ns``, as far as the tick's time allows; whether it came there or failed."""
        while simulation.time_ns < until_ns and not simulation.failure:
            if self._events != simulation.events.count:
                # Whatever happened may have changed what a second costs.
                self._events = simulation.events.count
                self._slice_ns = min(FIRST_STEPS * int(simulation.flight.step_ns), FIRST_NS)
            rest_ns = until_ns - simulation.time_ns
            began_ns = time.monotonic_ns()
            if began_ns >= self._end_ns:
                return False
            simulation.advance(simulation.time_ns + min(rest_ns, self._slice_ns))
            took_ns = time.monotonic_ns() - began_ns
            if GROWTH * GROWTH * took_ns < WORK_NS:
                if rest_ns > self._slice_ns:
                    self._slice_ns *= GROWTH
            elif took_ns > WORK_NS // 2:
                self._slice_ns = max(1, min(rest_ns, self._slice_ns) * (WORK_NS // 4) // took_ns)
        return True


class Pace:
    """The simulated time that a clock asks for: the wall clock times ``factor``, or ``followed()``, a clock in
    nanoseconds that isn't the wall's. factor 0: as fast as it goes. anchored_ns: what the clock showed at the anchor.
    overruns: publications more than a period late. real_time_lost_s: time given up rather than caught up. jumps: how
    often the followed clock has jumped.
    """

    def __init__(self, factor: float, followed: Callable[[], int] | None = None) -> None:
        self.factor = factor
        self.followed = followed
        self.overruns = 0
        self.real_time_lost_s = 0.0
        self.jumps = 0
        self._spacing_ns = 0.0
        self.present_before_ns = 0
        self.anchor(0)

    def anchor(self, simulated_ns: int) -> None:
        """From now on simulated time goes on from ``simulated_ns``."""
        self.anchored_ns = self.followed() if self.followed else time.monotonic_ns()
        self._last_reading_ns = self.anchored_ns
        self._anchor_simulated_ns = simulated_ns

    @property
    def offset_ns(self) -> int:
        """How far the followed clock was ahead of simulated time at the anchor; 0 while there is none."""
        return self.anchored_ns - self._anchor_simulated_ns if self.followed and self.anchored_ns else 0

    def present_ns(self, reached_ns: int, next_publication_ns: int, idle: bool = False) -> int:
        """Simulated time asked for now; time lost beyond MAX_LAG_NS is given up and counted, unless nobody waits for
        it (``idle``). Call ``jump`` before.
        """
        if self.followed:
            return self._followed_present_ns(reached_ns)
        if self.factor == 0.0:
            return next_publication_ns
        elapsed_ns = max(0, time.monotonic_ns() - self.anchored_ns)
        present_ns = self._anchor_simulated_ns + int(elapsed_ns * self.factor)
        expected_ns = max(reached_ns, next_publication_ns)
        lag_ns = (present_ns - expected_ns) / self.factor
        if lag_ns > MAX_LAG_NS and not idle:
            self.real_time_lost_s += lag_ns * 1e-9
            self.overruns += 1
            self.anchor(expected_ns)
            present_ns = expected_ns
        return present_ns

    def _followed_present_ns(self, reached_ns: int) -> int:
        if self.anchored_ns == 0:
            # It hasn't begun before: its steps count from here.
            self.anchor(reached_ns)
        return max(reached_ns, self._anchor_simulated_ns + self._last_reading_ns - self.anchored_ns)

    def jump(self) -> int:
        """Read the followed clock; by how much it has jumped since the last reading [ns], below 0 for back, or 0.
        ``present_before_ns`` is the simulated time that it asked for until then.
        """
        if not self.followed or not self.anchored_ns:
            return 0
        self.present_before_ns = self._followed_present_ns(0)
        before_ns, self._last_reading_ns = self._last_reading_ns, self.followed()
        step_ns = self._last_reading_ns - before_ns
        spacing_ns = self._spacing_ns
        if step_ns < 0 or (spacing_ns and step_ns > max(JUMP_NS, JUMP_SPACINGS * spacing_ns)):
            self.jumps += 1
            return step_ns
        if step_ns:
            self._spacing_ns += (step_ns - spacing_ns) * (0.1 if spacing_ns else 1.0)
        return 0

    def wall_ns(self, simulated_ns: int) -> int:
        """When the wall clock gets to a simulated time, or in LONGEST_NS where it is later."""
        rest_ns = (simulated_ns - self._anchor_simulated_ns) / self.factor
        return self.anchored_ns + int(min(rest_ns, LONGEST_NS)) + 1


# Time slices

SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""Number of this system call, which Python has no function for."""

SLICE_NS = 100_000
"""The shortest that Linux gives."""


def ask_for_short_slices() -> None:
    """Ask Linux for short time slices of the processor for the calling thread; elsewhere do nothing.

    A thread that wakes up on a processor where another one runs waits for the end of that one's slice, 3 ms, unless its
    own would end before (man 2 sched_setattr; Linux 6.12 and later, earlier ones do nothing). A policy or a priority
    that somebody has set stays.
    """
    call = SCHED_SETATTR.get(platform.machine())
    if call is None or sys.platform != "linux" or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    # struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period.
    attributes = struct.pack("IIQiIQQQ", 48, os.SCHED_OTHER, 0, nice, 0, SLICE_NS, 0, 0)
    ctypes.CDLL(None).syscall(call, 0, attributes, 0)
