# SPDX-License-Identifier: MIT
"""How far long work is, on stderr: a bar with the time left on a terminal, a line now and then elsewhere,
nothing for short work.
"""

from __future__ import annotations

import sys
import threading
import time
from typing import TextIO

BAR = 30
TERMINAL_FIRST_S, TERMINAL_EVERY_S = 1.0, 0.2
LINES_EVERY_S = 10.0
"""[s] Before the first sign of life and between two: on a terminal, and where lines are kept."""


class Progress:
    """``with Progress("reading cow.obj") as progress:`` shows what is under way, and how far it is once the work calls
    ``fraction``. A thread shows it, so that work inside one long call is seen, too. large False shows nothing: small
    work is done before anybody wonders. unit: of what ``fraction`` counts; without it only the share is shown.
    """

    def __init__(self, what: str, large: bool = True, unit: str = "", stream: TextIO | None = None) -> None:
        self.what = what
        self.large = large
        self._unit = unit
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._started = time.monotonic()
        self._first: tuple[float, float] | None = (
            None  # time and amount at the first report: what was done before is no speed
        )
        self._done: tuple[float, float] | None = None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._show, name="progress", daemon=True)

    def fraction(self, done: float, total: float = 1.0) -> None:
        """``done`` of ``total`` units are finished; the first call may be made before the work begins."""
        if self._first is None:
            self._first = (time.monotonic(), done)
        self._done = (done, total)

    def text(self, now: float) -> str:
        """The line as it stands at monotonic time ``now`` [s]."""
        elapsed = f"{_span(now - self._started)} so far"
        if self._done is None or self._first is None:
            return f"{self.what}: {elapsed}"
        done, total = self._done
        part = min(1.0, done / total) if total else 1.0
        since, before = self._first
        rate = (done - before) / max(now - since, 1e-9)
        left = f"{_span((total - done) / rate)} left" if rate > 0.0 else "time left unknown"
        count = f" {done:g} of {total:g} {self._unit}, {rate:.4g} a second," if self._unit else ""
        return f"{self.what}: [{'#' * int(BAR * part):<{BAR}}] {100.0 * part:3.0f} %,{count} {elapsed}, {left}"

    def _show(self) -> None:
        wait = TERMINAL_FIRST_S if self._terminal else LINES_EVERY_S
        while not self._end.wait(wait):
            wait = TERMINAL_EVERY_S if self._terminal else LINES_EVERY_S
            start, end = ("\r", "\033[K") if self._terminal else ("", "\n")
            print(f"{start}{self.text(time.monotonic())}", end=end, file=self._stream, flush=True)

    def __enter__(self) -> Progress:
        if self.large:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        if self.large:
            self._thread.join()
            if self._terminal:
                print("\r\033[K", end="", file=self._stream, flush=True)


def _span(seconds: float) -> str:
    minutes, rest = divmod(int(seconds + 0.5), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"
