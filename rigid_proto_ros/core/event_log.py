# SPDX-License-Identifier: MIT
"""The log of everything that happened to the body, each line chained to those before it.

A line is a JSON object with ``time_ns`` (simulated), ``kind``, ``content`` and ``sha256``: the hash of all lines since the
start or the last reset, this one included, each taken without its own ``sha256`` and ended by a newline.
"""

from __future__ import annotations

import hashlib
import json


class EventLog:
    """Counts and chains the events of one run."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start a new chain."""
        self.count = 0
        self._hash = hashlib.sha256()

    @property
    def sha256(self) -> str:
        """Hash of the chain so far, in hex."""
        return self._hash.hexdigest()

    def append(self, time_ns: int, kind: str, content: dict) -> str:
        """Add an event and return its line."""
        line = json.dumps({"time_ns": time_ns, "kind": kind, "content": content})
        self._hash.update((line + "\n").encode())
        self.count += 1
        return f'{line[:-1]}, "sha256": "{self.sha256}"}}'
