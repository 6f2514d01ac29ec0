# SPDX-License-Identifier: MIT
"""A sign of life on stderr for work that takes longer than a second, and none for work that doesn't."""

from __future__ import annotations

import sys
import threading
import time

FIRST_S = 1.0
"""[s] Silence before the first line."""
EVERY_S = 2.0
"""[s] Between lines."""


class Progress:
    """``with Progress("reading cow.obj"):`` tells every two seconds what is under way, and how far it is if the work
    calls ``fraction``. A thread tells it, so that work inside one long call is seen, too. ``large`` False keeps quiet: what
    is small is done before anybody wonders, and a slow start of the interpreter is no news."""

    def __init__(self, what: str, large: bool = True) -> None:
        self.what = what
        self.large = large
        self._done: tuple[int, int] | None = None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True)

    def fraction(self, done: int, total: int) -> None:
        """``done`` of ``total`` units are finished."""
        self._done = (done, total)

    def _tell(self) -> None:
        started = time.monotonic()
        wait = FIRST_S
        while not self._end.wait(wait):
            wait = EVERY_S
            far = "" if self._done is None else f", {100 * self._done[0] // max(1, self._done[1])} %"
            print(f"{self.what}{far} ... {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        if self.large:
            self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._end.set()
        if self.large:
            self._thread.join()
