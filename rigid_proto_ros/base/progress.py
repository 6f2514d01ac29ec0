# SPDX-License-Identifier: MIT
"""How far long work is, as one line on a terminal; nothing for short work, and nothing where stderr is kept."""

from __future__ import annotations

import sys
import threading
import time

FIRST_S, EVERY_S = 1.0, 0.2
"""[s] Before the first sign of life, and between two."""


class Progress:
    """``with Progress("reading cow.obj") as progress:`` shows what is under way, and how far it is once the work calls
    ``fraction``. A thread shows it, so that work inside one long call is seen, too. shown False shows nothing.
    """

    def __init__(self, what: str, shown: bool = True) -> None:
        self.what = what
        self._shown = shown and sys.stderr.isatty()
        self._started = time.monotonic()
        self._done = ""
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._show, name="progress", daemon=True)

    def fraction(self, done: float, total: float = 1.0) -> None:
        """``done`` of ``total`` is finished."""
        self._done = f" {100.0 * min(1.0, done / total) if total else 100.0:.0f} %,"

    def _show(self) -> None:
        wait = FIRST_S
        while not self._end.wait(wait):
            wait = EVERY_S
            elapsed = time.monotonic() - self._started
            print(f"\r{self.what}:{self._done} {elapsed:.0f} s\033[K", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        if self._shown:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        if self._shown:
            self._thread.join()
            print("\r\033[K", end="", file=sys.stderr, flush=True)
