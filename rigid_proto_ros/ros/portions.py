# SPDX-License-Identifier: MIT
"""How far a simulation may be advanced at a time, so that whoever waits for the physics thread never waits long.

The motion doesn't depend on the portions (simulation/segment.py), so they may follow the wall clock.
"""

from __future__ import annotations

import time

from ..simulation.simulation import Simulation

WORK_NS = 8_000_000
"""[ns of wall time] A tick advances no longer than this before it lets commands and requests in."""

FIRST_STEPS, FIRST_NS = 1000, 1_000_000
"""The first portion has room for so many fixed steps, at 0.1 to 10 µs each, and isn't longer than this [ns]: integrators that
choose their own steps take up to some thousands in it.
"""

GROWTH = 4


class Portions:
    """Portions of simulated time that grow while they are cheap and shrink when they turn out dear."""

    def __init__(self) -> None:
        self._portion_ns = 0
        self._events = -1
        self._end_ns = 0

    def begin_tick(self) -> None:
        """The time for this tick's work begins."""
        self._end_ns = time.monotonic_ns() + WORK_NS

    def advance(self, simulation: Simulation, until_ns: int) -> bool:
        """Carry the simulation towards ``until_ns``, as far as the tick's time allows; whether it came there or failed."""
        while simulation.time_ns < until_ns and not simulation.failure:
            if self._events != simulation.events.count:
                # Whatever happened may have changed what a second costs.
                self._events = simulation.events.count
                self._portion_ns = min(FIRST_STEPS * simulation.setup.step_ns, FIRST_NS)
            rest_ns = until_ns - simulation.time_ns
            began_ns = time.monotonic_ns()
            if began_ns >= self._end_ns:
                return False
            simulation.advance(simulation.time_ns + min(rest_ns, self._portion_ns))
            took_ns = time.monotonic_ns() - began_ns
            if GROWTH * GROWTH * took_ns < WORK_NS:
                if rest_ns > self._portion_ns:
                    self._portion_ns *= GROWTH
            elif took_ns > WORK_NS // 2:
                self._portion_ns = max(1, min(rest_ns, self._portion_ns) * (WORK_NS // 4) // took_ns)
        return True
