# SPDX-License-Identifier: MIT
"""How a process that waits for a signal ends: by request from outside or of one of its threads, and never
by hanging.
"""

from __future__ import annotations

import faulthandler
import signal
import socket
import sys
import threading
from typing import NoReturn

from ..base.interrupts import leave

CLOSING_S = 40.0
"""Longer than every wait for the physics thread and for recordings, added up."""

TEARDOWN_S = 3.0
"""What the middleware gets to say goodbye in; 0.1 s is usual. Nothing of ours waits for it any more."""


class Shutdown:
    """Waited for by the main thread; requested by SIGINT, SIGTERM or ``request`` of any thread.

    The wait is for a file descriptor that the interpreter's own signal handler writes to: it ends whichever thread the
    system delivers the signal to, and, unlike an Event set in a Python handler, takes no lock that the interrupted code
    could be holding.
    """

    def __init__(self) -> None:
        self._waited, self._request = socket.socketpair()
        self._request.setblocking(False)

    def __enter__(self) -> Shutdown:
        self._wakeup_before = signal.set_wakeup_fd(self._request.fileno(), warn_on_full_buffer=False)
        self._handlers_before = {n: signal.signal(n, lambda *_: None) for n in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers_before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup_before)

    def request(self) -> None:
        """End the wait, from any thread."""
        self._request.send(b"\0")

    def wait(self) -> int:
        """Return when the shutdown was requested: the number of the signal that did it, or 0."""
        return self._waited.recv(1, socket.MSG_PEEK)[0]


def begin_closing() -> None:
    """Leave with status 1 and every thread's stack on stderr, should closing what is ours take longer
    than CLOSING_S.
    """
    faulthandler.dump_traceback_later(CLOSING_S, exit=True)


def begin_teardown(status: int) -> None:
    """All that is ours is closed: leave with ``status`` after TEARDOWN_S, whatever the middleware still does then."""
    faulthandler.dump_traceback_later(TEARDOWN_S + 2.0, exit=True)
    watch = threading.Timer(TEARDOWN_S, _leave_stuck, (status,))
    watch.daemon = True
    watch.start()


def _leave_stuck(status: int) -> NoReturn:
    print(
        f"rigid_body_node: the middleware did not end within {TEARDOWN_S:g} s; the process ends without it",
        file=sys.stderr,
    )
    leave(status)
