# SPDX-License-Identifier: MIT
"""The states of the last minutes in one array of bounded size."""

from __future__ import annotations

import numpy as np

COLUMNS = 13
"""Position (3) [m], orientation xyzw (4), linear and angular velocity (3 + 3) [m/s, rad/s], all in world axes."""


class StateLog:
    """Rows as published, by a time that never goes back; the oldest go when there are more than ``capacity``."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        # Twice the room, so that making room again is a copy once in `capacity` rows.
        self._times = np.empty(2 * capacity, np.int64)
        self._rows = np.empty((2 * capacity, COLUMNS))
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    @property
    def times(self) -> np.ndarray:
        """(n,) int64 [ns]; a view."""
        return self._times[self._begin : self._end]

    @property
    def rows(self) -> np.ndarray:
        """(n, 13); a view."""
        return self._rows[self._begin : self._end]

    def append(self, time_ns: int, row: np.ndarray) -> None:
        """Add a row; one at the last time replaces it. An earlier time is left out."""
        if len(self) and time_ns <= self._times[self._end - 1]:
            if time_ns == self._times[self._end - 1]:
                self._rows[self._end - 1] = row
            return
        if self._end == len(self._times):
            kept = slice(self._end - self._capacity + 1, self._end)
            count = self._capacity - 1
            self._times[:count] = self._times[kept]
            self._rows[:count] = self._rows[kept]
            self._begin, self._end = 0, count
        self._times[self._end] = time_ns
        self._rows[self._end] = row
        self._end += 1
        self._begin = max(self._begin, self._end - self._capacity)

    def drop_before(self, time_ns: int) -> None:
        """Forget what lies before a time."""
        self._begin += int(np.searchsorted(self.times, time_ns))

    def cut_after(self, time_ns: int) -> tuple[np.ndarray, np.ndarray]:
        """Take off everything later than a time; returns copies of it, times and rows."""
        keep = int(np.searchsorted(self.times, time_ns, side="right"))
        taken = self.times[keep:].copy(), self.rows[keep:].copy()
        self._end = self._begin + keep
        return taken

    def at(self, time_ns: int) -> np.ndarray | None:
        """The last row at or before a time, else the first one; None without any."""
        if not len(self):
            return None
        k = int(np.searchsorted(self.times, time_ns, side="right")) - 1
        return self.rows[max(k, 0)].copy()
