# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end a command at any moment, quietly, with 128 + their number; a second one changes nothing. And
a process that this one starts ends when this one has ended.

A signal that comes before Python has run our first line ends the interpreter as Python does: with a traceback.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

NUMBERS = (signal.SIGINT, signal.SIGTERM)

AGAIN_S = 0.5
"""How soon an interrupt is raised anew where a library's code has swallowed it [s]."""

PR_SET_PDEATHSIG = 1
"""From linux/prctl.h."""

_received = 0
_done = False


class Interrupted(KeyboardInterrupt):
    """What the first signal raises.

    A class of its own: where KeyboardInterrupt itself leaves a text that is executed, as when a dataclass is made,
    `python -m` takes it for unhandled, and ends by SIGINT whatever becomes of it (CPython 3.11 to 3.14).
    """


def end_at_once(status: int | None = None) -> None:
    """From now on a signal ends the process right away, with this status: for as long as there is nothing to close, as
    while modules are imported.
    """
    for number in NUMBERS:
        signal.signal(number, lambda got, _: os._exit(128 + got if status is None else status))


def run(work: Callable[[], int], tell: Callable[[Exception], int]) -> int:
    """What ``work`` returns, or ``tell`` of what it raises. The first signal raises KeyboardInterrupt in it, and
    128 + the signal's number is returned; those that follow change nothing, so that what is being closed is closed.
    """
    try:
        _interrupt_once()
        try:
            status = work()
        except Exception as error:
            if _received:
                # A library takes an interrupt for an error of its own, as numpy does when it is imported.
                done()
                return 128 + _received
            status = tell(error)
        done()  # in here: a signal that comes now is handled, too
        return status
    except KeyboardInterrupt:
        done()
        return 128 + _received


def _interrupt_once() -> None:
    unraisable = sys.unraisablehook

    def quiet(ignored: Any) -> None:
        """Where no exception can leave, as from a finalizer, Python prints it and goes on."""
        if not isinstance(ignored.exc_value, Interrupted):
            unraisable(ignored)

    def interrupt(got: int, _: object) -> None:
        global _received
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _received = got
        sys.unraisablehook = quiet
        # Not by threading: what was interrupted may hold a lock of it.
        _thread.start_new_thread(_raise_again, ())
        _raise()

    for number in NUMBERS:
        signal.signal(number, interrupt)


def _raise() -> None:
    """Raise Interrupted, and when SIGTERM is handled once more if nobody handles it: only who does that keeps it."""
    error = Interrupted()
    handled = weakref.ref(error)

    def look(*_: object) -> None:
        if handled() is None:
            _raise()

    signal.signal(signal.SIGTERM, look)
    try:
        raise error
    finally:
        del error  # the traceback holds this frame, which would hold the exception


def _raise_again() -> None:
    """On a thread, until ``done``: have the main thread look whether the interrupt is handled."""
    while not _done:
        time.sleep(AGAIN_S)
        _thread.interrupt_main(signal.SIGTERM)


def done() -> None:
    """From now on no signal changes anything: the exit status is decided, and the interpreter ends.

    Python itself forgets its handlers before it ends, and would be killed by the signal then.
    """
    global _done
    _done = True
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
