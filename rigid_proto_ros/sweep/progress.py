# SPDX-License-Identifier: MIT
"""How far a sweep is: a bar with rate and time left on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time

BAR = 30
TERMINAL_S, LINES_S = 0.2, 10.0
"""[s] Between two signs of life."""


class Progress:
    """rows: in all; done: before this run began."""

    def __init__(self, rows: int, done: int, stream=None) -> None:
        self.rows = rows
        self.done = done
        self._before = done
        self._stream = stream or sys.stderr
        self._start = time.monotonic()
        self._shown = self._start
        self._terminal = self._stream.isatty()

    def add(self, rows: int) -> None:
        """So many more rows are done."""
        self.done += rows
        now = time.monotonic()
        if now - self._shown >= (TERMINAL_S if self._terminal else LINES_S):
            self._shown = now
            start, end = ("\r", "\033[K") if self._terminal else ("", "\n")
            print(f"{start}{self.text(now)}", end=end, file=self._stream, flush=True)

    def text(self, now: float) -> str:
        """The line as it stands at monotonic time ``now`` [s]."""
        part = self.done / self.rows
        rate = (self.done - self._before) / max(now - self._start, 1e-9)
        left = (self.rows - self.done) / rate if rate > 0.0 else float("inf")
        bar = "#" * int(BAR * part)
        return f"[{bar:<{BAR}}] {self.done} of {self.rows} rows, {rate:.4g} rows/s, {_span(left)} left"

    def end(self) -> None:
        """Leave the terminal's line clean."""
        if self._terminal and self._shown > self._start:
            print("\r\033[K", end="", file=self._stream, flush=True)


def _span(seconds: float) -> str:
    if seconds == float("inf"):
        return "unknown time"
    hours, rest = divmod(int(seconds + 0.5), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}"
