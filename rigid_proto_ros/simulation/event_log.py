# SPDX-License-Identifier: MIT
"""The log of everything that happened to the body, each line chained to those before it.

A line is a JSON object with ``time_ns`` (simulated), ``kind``, ``content`` and ``sha256``: the hash of all lines since
the start or the last reset, this one included, each taken without its own ``sha256`` and ended by a newline.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from .commands import Command

MOST_NOTED = 10_000
"""Events that may wait to be chained: some megabytes."""


class EventLog:
    """Counts and chains the events of one run. Those that nobody reads as they happen are chained when somebody
    asks.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start a new chain."""
        self.count = 0
        self._hash = hashlib.sha256()
        self._noted: list[tuple[int, Command | tuple[str, dict[str, Any]]]] = []

    @property
    def sha256(self) -> str:
        """Hash of the chain so far, in hex."""
        self._chain_noted()
        return self._hash.hexdigest()

    def append(self, time_ns: int, kind: str, content: Mapping[str, Any]) -> str:
        """Add an event and return its line."""
        self._chain_noted()
        self.count += 1
        line = self._chain(time_ns, kind, content)
        return f'{line[:-1]}, "sha256": "{self._hash.hexdigest()}"}}'

    def note(self, time_ns: int, event: Command | tuple[str, dict[str, Any]]) -> None:
        """Add an event whose line nobody wants now: a command that has acted, or kind and content of another one."""
        self._noted.append((time_ns, event))
        self.count += 1
        if len(self._noted) >= MOST_NOTED:
            self._chain_noted()

    def _chain_noted(self) -> None:
        noted, self._noted = self._noted, []
        for time_ns, event in noted:
            kind, content = event if isinstance(event, tuple) else (event.kind, event.content)
            self._chain(time_ns, kind, content)

    def _chain(self, time_ns: int, kind: str, content: Mapping[str, Any]) -> str:
        line = json.dumps({"time_ns": time_ns, "kind": kind, "content": content})
        self._hash.update((line + "\n").encode())
        return line
