# SPDX-License-Identifier: MIT
"""The state line: per track the value that holds from a time on, drawn as coloured lanes."""

from __future__ import annotations

import numpy as np
import rerun as rr

from . import entities as e
from .columns import Send, one_time, time_columns


class Lanes:
    """Collects changes and sends them together; what is undone at the same instant never shows."""

    def __init__(self) -> None:
        self._sent: dict[str, str] = {}
        self._changes: dict[str, list[tuple[int, int, str]]] = {}

    def change(self, time_ns: int, wall_ns: int, track: str, value: str) -> None:
        """From ``time_ns`` on the track has this value."""
        changes = self._changes.setdefault(track, [])
        if changes and changes[-1][0] == time_ns:
            changes.pop()
        before = changes[-1][2] if changes else self._sent.get(track)
        if value != before:
            changes.append((time_ns, wall_ns, value))

    def send(self, send: Send) -> None:
        """Send the changes collected so far."""
        for track, changes in self._changes.items():
            if changes:
                times_ns, walls, values = zip(*changes, strict=True)
                columns = rr.StateChange.columns(state=list(values))
                send(f"{e.STATUS}/{track}", time_columns(np.array(times_ns), np.array(walls)), columns)
                self._sent[track] = values[-1]
        self._changes.clear()

    def repeat(self, time_ns: int, wall_ns: int, send: Send) -> None:
        """Send the present values to a stream that knows none."""
        for track, value in self._sent.items():
            send(f"{e.STATUS}/{track}", one_time(time_ns, wall_ns), rr.StateChange.columns(state=[value]))
