# SPDX-License-Identifier: MIT
"""Watchdogs of shutdown, so that a process that ends never hangs."""

from __future__ import annotations

import faulthandler
import sys
import threading
from typing import NoReturn

from ..base.interrupts import leave

CLOSING_S = 40.0
"""Timeout of closing our own objects [s], longer than the sum of all waits for the physics thread and recordings."""

TEARDOWN_S = 3.0
"""Timeout of the middleware's shutdown [s], which usually takes 0.1 s; by then everything of ours is closed."""


def begin_closing() -> None:
    """Exit with status 1 and every thread's stack on stderr if closing our own objects takes longer than CLOSING_S."""
    faulthandler.dump_traceback_later(CLOSING_S, exit=True)


def begin_teardown(status: int) -> None:
    """Once everything of ours is closed: exit with ``status`` after TEARDOWN_S even if the middleware hangs."""
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
