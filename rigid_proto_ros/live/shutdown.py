# SPDX-License-Identifier: MIT
"""A process that ends never hangs."""

from __future__ import annotations

import faulthandler
import sys
import threading
from typing import NoReturn

from ..base.interrupts import leave

CLOSING_S = 40.0
"""Longer than every wait for the physics thread and for recordings, added up."""

TEARDOWN_S = 3.0
"""What the middleware gets to say goodbye in; 0.1 s is usual. Nothing of ours waits for it any more."""


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
