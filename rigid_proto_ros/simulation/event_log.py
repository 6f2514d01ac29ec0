# SPDX-License-Identifier: MIT
"""The log of everything that happened to the body, each line chained to those before it.

A line is a JSON object with ``time_ns`` (simulated), ``kind``, ``content`` and ``sha256``: the hash of all lines since
the start or the last reset, this one included, each taken without its own ``sha256`` and ended by a newline.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from .commands import Command, Pending, WrenchCommand

MOST_NOTED = 10_000
"""Events that may wait to be chained: some megabytes."""


class OtherEvent(NamedTuple):
    """An event that is no command, or not any more."""

    kind: str
    content: dict[str, Any]


class EventLog:
    """Counts and chains the events of one run. Those that nobody reads as they happen are chained when
    somebody asks.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start a new chain."""
        self.count = 0
        self._hash = hashlib.sha256()
        self._noted: list[tuple[int, Command | OtherEvent]] = []

    @property
    def sha256(self) -> str:
        """Hash of the chain so far, in hex."""
        self._chain_noted()
        return self._hash.hexdigest()

    def append(self, time_ns: int, kind: str, content: dict[str, Any]) -> str:
        """Add an event and return its line."""
        self._chain_noted()
        line = json.dumps({"time_ns": time_ns, "kind": kind, "content": content})
        self._hash.update((line + "\n").encode())
        self.count += 1
        return f'{line[:-1]}, "sha256": "{self._hash.hexdigest()}"}}'

    def note(self, time_ns: int, event: Command | OtherEvent) -> None:
        """Add an event whose line nobody wants now."""
        self._noted.append((time_ns, event))
        self.count += 1
        if len(self._noted) >= MOST_NOTED:
            self._chain_noted()

    def note_all(self, acted: Sequence[Pending]) -> None:
        """Add commands that acted, likewise."""
        noted = self._noted
        for pending in acted:
            noted.append((pending.time_ns, pending.command))
        self.count += len(acted)
        if len(noted) >= MOST_NOTED:
            self._chain_noted()

    def _chain_noted(self) -> None:
        if self._noted:
            noted, self._noted = self._noted, []
            self._hash.update("".join([_line(time_ns, command) for time_ns, command in noted]).encode())


_quoted = lru_cache(maxsize=256)(json.dumps)
"""Frames come again and again."""


def _line(time_ns: int, command: Command | OtherEvent) -> str:
    """The line of a command, as ``json.dumps`` writes it."""
    if isinstance(command, WrenchCommand):
        try:
            force, torque = ", ".join(map(_written, command.force)), ", ".join(map(_written, command.torque))
        except TypeError:
            pass  # not all of them floats
        else:
            return (
                f'{{"time_ns": {time_ns}, "kind": "{command.kind}", "content": {{"stamp_ns": {command.stamp_ns}, '
                f'"frame_id": {_quoted(command.frame_id)}, "force": [{force}], "torque": [{torque}]}}}}\n'
            )
    return json.dumps({"time_ns": time_ns, "kind": command.kind, "content": command.content}) + "\n"


_written = float.__repr__
"""Of a finite float what JSON writes too; no other command acts."""
