# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end a command without a traceback, with status 128 + signal number; further signals are ignored.
Child processes end with this process.
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
"""Signals within this time after the first one are ignored, so that closing can complete [s]."""

PR_SET_PDEATHSIG = 1
"""Constant of linux/prctl.h."""


def end_at_once(status: int | None = None) -> None:
    """Make signals end the process at once, with this status or 128 + signal number. For times at which there is
    nothing to close, such as during imports.
    """
    for number in NUMBERS:
        signal.signal(number, lambda got, _: os._exit(128 + got if status is None else status))


class Interrupt:
    """Makes signals raise KeyboardInterrupt in the main thread. number: of the last handled signal, 0
    before the first.
    """

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
    """Call work(). Returns its result, or tell(exception), or 128 + number of the signal that interrupted it."""
    interrupt = Interrupt()
    try:
        status = work()
    except KeyboardInterrupt:
        status = 128 + interrupt.number
    except Exception as error:
        # Some libraries convert KeyboardInterrupt to an error of their own, as numpy does while it is imported.
        status = 128 + interrupt.number if interrupt.number else tell(error)
    done()
    return status


def done() -> None:
    """Ignore signals, once the exit status is decided.

    Python restores the default handlers before it exits, and a signal would kill the process then.
    """
    for number in NUMBERS:
        signal.signal(number, signal.SIG_IGN)


def leave(status: int) -> NoReturn:
    """Exit the process without Python's teardown, once everything is closed. Teardown unloads libraries, which takes
    longer than closing, while their threads still run; a thread blocked by a full disk would abort the process.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # a broken pipe, or a closed stream
            stream.flush()
    os._exit(status)


# Child processes


def with_this_package() -> dict[str, str]:
    """The environment for child processes in which ``python -m rigid_proto_ros...`` runs this package from
    any folder.
    """
    folder = str(Path(__file__).resolve().parents[2])
    paths = [folder, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def end_with_this_thread() -> Callable[[], None] | None:
    """``preexec_fn`` of a child that receives SIGTERM when the thread that starts it ends, even if this process is
    killed; None on systems other than Linux.

    The kernel considers that thread the child's parent, so start the child in the main thread or in one that waits for
    it. The request is made before the child's program is loaded, so it can't come too late.
    """
    if not sys.platform.startswith("linux"):
        return None
    import ctypes

    # Loaded before the fork, because nothing may be imported between fork and exec.
    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
