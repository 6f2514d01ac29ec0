# SPDX-License-Identifier: MIT
"""What is logged of a run beside its states: event lines, for machines and for people, and the timeline
of what holds since when.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from . import entities as e
from .backend import time_columns

Send = Callable[[str, list[Any], Any], None]
"""Sends (entity, time columns, component columns) to whoever is to get them."""


class StateTimeline:
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
        times = time_columns(np.array([time_ns]), np.array([wall_ns]))
        for track, value in self._sent.items():
            send(f"{e.STATUS}/{track}", times, rr.StateChange.columns(state=[value]))


class TextLog:
    """Collects lines of text and sends them together."""

    def __init__(self) -> None:
        self._lines: dict[str, list[tuple[int, int, str, str]]] = {}
        self.used = False
        """Whether there was any."""

    def event(self, time_ns: int, wall_ns: int, line: str) -> None:
        """A line of the event log: exactly as it is, and readable."""
        self._add(e.EVENTS, time_ns, wall_ns, line, "INFO")
        self._add(e.COMMAND_LOG, time_ns, wall_ns, readable(line), "INFO")

    def refusal(self, time_ns: int, wall_ns: int, reason: str, message: str) -> None:
        """A command that was refused."""
        self._add(e.REFUSAL_LOG, time_ns, wall_ns, f"refused ({reason}): {message}", "WARN")

    def _add(self, entity: str, *line: Any) -> None:
        self._lines.setdefault(entity, []).append(line)
        self.used = True

    def send(self, send: Send) -> None:
        """Send the lines collected so far."""
        for entity, lines in self._lines.items():
            times_ns, walls, texts, levels = zip(*lines, strict=True)
            columns = rr.TextLog.columns(text=texts, level=levels)
            send(entity, time_columns(np.array(times_ns), np.array(walls)), columns)
        self._lines.clear()


def readable(line: str) -> str:
    """An event line for people: what it says, without its stamp, zero vectors and hash."""
    try:
        event = json.loads(line)
        kind, content = event["kind"], event.get("content", {})
    except (ValueError, KeyError, TypeError):
        return line
    if not isinstance(content, dict):
        return f"{kind} {content}"
    said = []
    for key, value in content.items():
        if key == "stamp_ns" or value in ("", None) or (isinstance(value, list) and not any(value)):
            continue
        said.append(_short(value) if key == "frame_id" else f"{key} {_short(value)}")
    return " ".join([str(kind), ", ".join(said)]).strip()


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return str(value)
