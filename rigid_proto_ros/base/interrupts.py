# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end a command at any moment, quietly, with 128 + their number; a second one changes nothing."""

from __future__ import annotations

import os
import signal

NUMBERS = (signal.SIGINT, signal.SIGTERM)

_received = signal.SIGINT


def end_at_once() -> None:
    """From now on a signal ends the process right away: for as long as there is nothing to close, as while modules are
    imported, and when all is closed.
    """
    for number in NUMBERS:
        signal.signal(number, lambda got, _: os._exit(128 + got))


def interrupt_once() -> None:
    """From now on the first signal raises KeyboardInterrupt in the main thread, and those that follow change nothing,
    so that what is being closed is closed.
    """

    def interrupt(got: int, _: object) -> None:
        global _received
        for number in NUMBERS:
            signal.signal(number, signal.SIG_IGN)
        _received = signal.Signals(got)
        raise KeyboardInterrupt

    for number in NUMBERS:
        signal.signal(number, interrupt)


def status() -> int:
    """The exit status of a command that a KeyboardInterrupt has ended."""
    return 128 + _received
