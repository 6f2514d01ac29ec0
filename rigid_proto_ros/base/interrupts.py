# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end a command, quietly, with 128 + their number; a second one changes nothing. And a process that
this one starts ends when this one has ended.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

NUMBERS = (signal.SIGINT, signal.SIGTERM)

CLOSING_S = 10.0
"""Signals that come so soon after the first one change nothing, so that what is being closed is closed [s]."""

PR_SET_PDEATHSIG = 1
"""From linux/prctl.h."""


def end_at_once(status: int | None = None) -> None:
    """From now on a signal ends the process right away, with this status: for as long as there is nothing to close, as
    while modules are imported.
    """
    for number in NUMBERS:
        signal.signal(number, lambda got, _: os._exit(128 + got if status is None else status))


class Interrupt:
    """From now on a signal raises KeyboardInterrupt in the main thread. number: the signal's, 0 before the first."""

    def __init__(self) -> None:
        self.number = 0
        self._again_s = 0.0
        for number in NUMBERS:
            signal.signal(number, self._handle)

    def _handle(self, number: int, _: object) -> None:
        if time.monotonic() < self._again_s:
            return
        self.number, self._again_s = number, time.monotonic() + CLOSING_S
        raise KeyboardInterrupt


def run(work: Callable[[], int], tell: Callable[[Exception], int]) -> int:
    """What ``work`` returns, or ``tell`` of what it raises, or 128 + the number of the signal that interrupted it."""
    interrupt = Interrupt()
    try:
        status = work()
    except KeyboardInterrupt:
        status = 128 + interrupt.number
    except Exception as error:
        # A library takes an interrupt for an error of its own, as numpy does when it is imported.
        status = 128 + interrupt.number if interrupt.number else tell(error)
    done()
    return status


def done() -> None:
    """From now on no signal changes anything: the exit status is decided, and the interpreter ends.

    Python itself forgets its handlers before it ends, and would be killed by the signal then.
    """
    for number in NUMBERS:
        signal.signal(number, signal.SIG_IGN)


def leave(status: int) -> NoReturn:
    """End the process without the interpreter's own teardown: everything is closed, and unloading libraries takes
    longer than all the closing did, while threads of theirs still run. One that hangs in a file on a full disk aborts
    the process when Python ends it.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # nobody reads any more; the stream was closed
            stream.flush()
    os._exit(status)


# Processes that this one starts


def with_this_package() -> dict[str, str]:
    """This process's environment in which ``python -m rigid_proto_ros...`` finds this very package, from any folder."""
    folder = str(Path(__file__).resolve().parents[2])
    paths = [folder, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def end_with_this_thread() -> Callable[[], None] | None:
    """``preexec_fn`` of a child that gets SIGTERM when the thread that starts it ends, and so also when this process is
    killed; None where the system can't do that (Linux can).

    The kernel takes the end of that thread for the parent's: call it in the main thread, or in one that waits for the
    child. Asked for before the child's program is loaded, so that no end of the parent comes too early for it.
    """
    if not sys.platform.startswith("linux"):
        return None
    import ctypes

    # Loaded before the fork: between fork and exec nothing may be imported.
    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
