# SPDX-License-Identifier: MIT
"""The end of a process that waits for a signal: asked for from outside or by one of its threads, and never a hang."""

from __future__ import annotations

import faulthandler
import select
import signal
import socket

TEARDOWN_S = 18.0
"""Longer than every wait for a thread, a recording and the middleware at the end, added up."""


class Ending:
    """Waited for by the main thread; asked for by SIGINT, SIGTERM or ``ask`` of any thread.

    The wait is one on a file descriptor that the interpreter's own signal handler writes to: it ends whichever thread the
    system hands the signal to, and, unlike an Event set in a Python handler, takes no lock that the interrupted code could
    be holding.
    """

    def __init__(self) -> None:
        self._waited, self._asked = socket.socketpair()
        self._asked.setblocking(False)

    def __enter__(self) -> Ending:
        self._wakeup_before = signal.set_wakeup_fd(self._asked.fileno(), warn_on_full_buffer=False)
        self._handlers_before = {n: signal.signal(n, lambda *_: None) for n in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers_before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup_before)

    def ask(self) -> None:
        """End the wait, from any thread."""
        self._asked.send(b"\0")

    @property
    def asked(self) -> bool:
        """Whether the end was asked for."""
        return bool(select.select([self._waited], [], [], 0.0)[0])

    def wait(self) -> None:
        """Return when the end was asked for."""
        select.select([self._waited], [], [])

    @staticmethod
    def must_be_over_soon() -> None:
        """Leave with status 1 and every thread's stack on stderr, should what follows still run after TEARDOWN_S."""
        faulthandler.dump_traceback_later(TEARDOWN_S, exit=True)
