# SPDX-License-Identifier: MIT
"""How far long work is, as one line on a terminal; nothing for short work, and nothing where stderr is kept."""

from __future__ import annotations

import sys
import time

FIRST_S, EVERY_S = 1.0, 0.2
"""[s] Before the first sign of life, and between two."""


class Progress:
    """``with Progress("reading cow.obj") as progress:`` shows how far the work is when it calls ``fraction``. shown
    False shows nothing.
    """

    def __init__(self, what: str, shown: bool = True) -> None:
        self.what = what
        self._shown = shown and sys.stderr.isatty()
        self._started = time.monotonic()
        self._next = self._started + FIRST_S

    def fraction(self, done: float, total: float = 1.0) -> None:
        """``done`` of ``total`` is finished."""
        now = time.monotonic()
        if self._shown and now >= self._next:
            self._next = now + EVERY_S
            percent = 100.0 * min(1.0, done / total) if total else 100.0
            text = f"\r{self.what}: {percent:.0f} %, {now - self._started:.0f} s\033[K"
            print(text, end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
