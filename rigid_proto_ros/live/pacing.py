# SPDX-License-Identifier: MIT
"""Pacing: maps a clock to simulated time, and bounds the work of one tick.

Simulated time is the clock's time since an anchor, never a sum of periods, so a late wake-up causes no drift.
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
"""Longest time [ns of wall time] that a tick spends on the motion; commands and requests are served in between."""

FIRST_STEPS, FIRST_NS = 1000, 1_000_000
"""Largest first slice: this many fixed steps, which take 0.1 to 10 µs each, and this much simulated time [ns], in which
an adaptive integrator takes up to a few thousand steps.
"""

GROWTH = 4
"""Factor by which a cheap slice grows."""

TICK_NS = 10_000_000
"""Longest period [ns of wall time] between two ticks with listeners; each tick takes commands."""

LAST_STAMP_NS = (2**31 - 1) * 1_000_000_000
"""Largest simulated time [ns]: a stamp counts seconds in a signed 32-bit integer."""

LONGEST_NS = 1e18
"""Longest wait [ns of wall time], 30 years; caps the infinite wait of a tiny real-time factor."""

JUMP_NS, JUMP_SPACINGS = 1_000_000_000, 10
"""A followed clock has jumped if it advances by more than JUMP_NS [ns] and more than JUMP_SPACINGS of its usual steps
between two readings.
"""

MAX_LAG_NS = 250_000_000
"""Largest lag behind real time [ns of wall time]; time lost beyond it is given up, not caught up."""


@dataclass
class Stamps:
    """Conversion of simulated time to message stamps. clock(): time [ns] of the clock that simulated time follows
    instead of the wall clock. offset_ns: stamp minus simulated time [ns], 0 without such a clock.
    """

    clock: Callable[[], int] | None = None
    offset_ns: int = 0

    def of(self, time_ns: int) -> tuple[int, int]:
        """Seconds and nanoseconds of the stamp of a simulated time."""
        return divmod(time_ns + self.offset_ns, 1_000_000_000)


class WorkBudget:
    """Limits the wall time that one tick spends on the motion. The motion is advanced in slices, which grow while they
    are cheap and shrink when they are expensive. Slices don't change the motion, so they may depend on the wall clock.
    """

    def __init__(self) -> None:
        self._slice_ns = 0
        self._events = -1
        self._end_ns = 0

    def begin_tick(self) -> None:
        """Start the time budget of this tick."""
        self._end_ns = time.monotonic_ns() + WORK_NS

    def advance(self, simulation: Simulation, until_ns: int) -> bool:
        """Advance towards ``until_ns`` within the time budget. Returns whether the simulation reached it or failed."""
        while simulation.time_ns < until_ns and not simulation.failure:
            if self._events != simulation.events.count:
                # An event may have changed the cost of a simulated second.
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
    """Simulated time as a function of a clock: the wall clock times ``factor``, or the followed clock ``followed()``
    [ns]. factor 0: as fast as possible. anchored_ns: the clock's reading at the anchor. overruns: publications more
    than a period late. real_time_lost_s: real time given up. jumps: number of jumps of the followed clock.
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
        """Set the anchor: simulated time is ``simulated_ns`` at the clock's present reading."""
        self.anchored_ns = self.followed() if self.followed else time.monotonic_ns()
        self._last_reading_ns = self.anchored_ns
        self._anchor_simulated_ns = simulated_ns

    @property
    def offset_ns(self) -> int:
        """The followed clock minus simulated time at the anchor [ns]; 0 without a followed clock or before
        it starts.
        """
        return self.anchored_ns - self._anchor_simulated_ns if self.followed and self.anchored_ns else 0

    def present_ns(self, reached_ns: int, next_publication_ns: int, idle: bool = False) -> int:
        """Simulated time that corresponds to now. A lag beyond MAX_LAG_NS is given up and counted, unless the loop has
        no listeners (``idle``). Call ``jump`` first.
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
            # The followed clock had not started yet: count from its present reading.
            self.anchor(reached_ns)
        return max(reached_ns, self._anchor_simulated_ns + self._last_reading_ns - self.anchored_ns)

    def jump(self) -> int:
        """Read the followed clock. Returns its jump since the last reading [ns], negative for backwards, or 0 for none.
        Sets ``present_before_ns``, the simulated time that corresponds to the previous reading.
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
        """Wall time [ns] at which simulated time reaches ``simulated_ns``, at most LONGEST_NS after the anchor."""
        rest_ns = (simulated_ns - self._anchor_simulated_ns) / self.factor
        return self.anchored_ns + int(min(rest_ns, LONGEST_NS)) + 1


# Time slices

SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""Number of the system call sched_setattr by machine; Python has no function for it."""

SLICE_NS = 100_000
"""Shortest time slice [ns] that Linux grants."""


def ask_for_short_slices() -> None:
    """Request short scheduler time slices for the calling thread; does nothing on systems other than Linux.

    A thread that wakes up on a busy processor waits until the running thread's slice ends, 3 ms, unless its own slice
    would end earlier (man 2 sched_setattr; has an effect since Linux 6.12). A scheduling policy or nice value set by
    the user is kept.
    """
    call = SCHED_SETATTR.get(platform.machine())
    if call is None or sys.platform != "linux" or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    # struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period.
    attributes = struct.pack("IIQiIQQQ", 48, os.SCHED_OTHER, 0, nice, 0, SLICE_NS, 0, 0)
    ctypes.CDLL(None).syscall(call, 0, attributes, 0)
