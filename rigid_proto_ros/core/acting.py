# SPDX-License-Identifier: MIT
"""The loads that act on the body now: one held wrench, any number of pulses, and when each ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .body import Body
from .loads import LOADS_SIZE, Load

NEVER = 1 << 62
"""Later than any simulated time [ns], and an int64."""


@dataclass(slots=True, eq=False)
class Acting:
    """A load that acts from begin_ns until end_ns; what it adds to the sums holds for the body it was computed for."""

    load: Load
    begin_ns: int
    end_ns: int
    load_id: int
    body: Body | None = None
    share: np.ndarray | None = None

    def share_of(self, body: Body) -> np.ndarray:
        """What the load adds to the sums (LOADS_SIZE,), computed once for each body."""
        if self.body is not body or self.share is None:
            self.body, self.share = body, self.load.share(body)
        return self.share


class ActingLoads:
    """All in the order in which they began to act, which is that of every sum. held: that of the last held command, if it
    still acts. next_end_ns: when the first of them ends.
    """

    def __init__(self) -> None:
        self.held: Acting | None = None
        self._parts: list[Acting] = []
        self.next_end_ns = NEVER

    def __iter__(self) -> Iterator[Acting]:
        return iter(self._parts)

    def __bool__(self) -> bool:
        return bool(self._parts)

    def hold(self, acting: Acting) -> None:
        """Take a held wrench; the one before must have been ended."""
        self.held = acting
        self.add(acting)

    def add(self, acting: Acting) -> None:
        """Take a pulse."""
        self._parts.append(acting)
        self.next_end_ns = min(self.next_end_ns, acting.end_ns)

    def hold_until(self, end_ns: int) -> None:
        """Give the held wrench another end."""
        if self.held is not None:
            self.held.end_ns = end_ns
            self._find_next_end()

    def end_held(self) -> list[Acting]:
        """End the held wrench; returns what ended."""
        if self.held is None:
            return []
        ended, self.held = self.held, None
        self._parts.remove(ended)
        self._find_next_end()
        return [ended]

    def end_due(self, now_ns: int) -> list[Acting]:
        """End what ends at ``now_ns`` or should have before; returns it."""
        if now_ns < self.next_end_ns:
            return []
        ended = [part for part in self._parts if part.end_ns <= now_ns]
        self._parts = [part for part in self._parts if part.end_ns > now_ns]
        if self.held in ended:
            self.held = None
        self._find_next_end()
        return ended

    def end_all(self) -> list[Acting]:
        """End everything; returns it."""
        ended, self._parts = self._parts, []
        self.held, self.next_end_ns = None, NEVER
        return ended

    def sum(self, body: Body) -> np.ndarray:
        """All of them summed afresh in their order (LOADS_SIZE,), as core/loads.py lays them out."""
        total = np.zeros(LOADS_SIZE)
        for acting in self:
            total += acting.share_of(body)
        return total

    def _find_next_end(self) -> None:
        self.next_end_ns = min((part.end_ns for part in self._parts), default=NEVER)
