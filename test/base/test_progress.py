# SPDX-License-Identifier: MIT
"""Progress of long work: how far and how long, on a terminal alone, and nothing for short work."""

import io
import sys

import pytest

from rigid_proto_ros.base import progress as module
from rigid_proto_ros.base.progress import Progress


@pytest.mark.parametrize("terminal", [True, False])
def test_short_work_shows_nothing_and_long_work_a_line_on_a_terminal_that_is_left_clean(terminal, monkeypatch) -> None:
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("short") as shown:
        shown.fraction(1, 2)
    assert stream.getvalue() == ("\r\033[K" if terminal else "")
    monkeypatch.setattr(module, "FIRST_S", 0.0)
    with Progress("long") as shown:
        shown.fraction(200, 500)
    assert ("long: 40 %, 0 s" in stream.getvalue()) == terminal
    assert stream.getvalue().endswith("\r\033[K") if terminal else stream.getvalue() == ""
