# SPDX-License-Identifier: MIT
"""Progress of long work: how far and how long, on a terminal alone, and nothing for short work."""

import io
import sys
import threading

import pytest

from rigid_proto_ros.base import progress as module
from rigid_proto_ros.base.progress import Progress


class Stream(io.StringIO):
    """Says that it is a terminal, or not, and when something was written to it that holds a text."""

    def __init__(self, terminal: bool, awaited: str) -> None:
        super().__init__()
        self.terminal, self.awaited, self.came = terminal, awaited, threading.Event()

    def isatty(self) -> bool:
        return self.terminal

    def write(self, text: str) -> int:
        if self.awaited in text:
            self.came.set()
        return super().write(text)


@pytest.mark.parametrize("terminal", [True, False])
def test_short_work_shows_nothing_and_long_work_a_line_on_a_terminal_that_is_left_clean(terminal, monkeypatch) -> None:
    stream = Stream(terminal, "long: 40 %, 0 s")
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("short"):
        pass
    assert stream.getvalue() == ("\r\033[K" if terminal else "")
    monkeypatch.setattr(module, "FIRST_S", 0.0)
    monkeypatch.setattr(module, "EVERY_S", 0.01)
    with Progress("long") as shown:
        shown.fraction(200, 500)
        assert not terminal or stream.came.wait(60.0)
    assert stream.getvalue().endswith("\r\033[K") if terminal else stream.getvalue() == ""
