# SPDX-License-Identifier: MIT
"""Progress of long work: how far, how long, how long yet; a bar on a terminal alone, and nothing for short work."""

import io
import time

import pytest

from rigid_proto_ros.base import progress as module
from rigid_proto_ros.base.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_line_says_how_far_it_is_and_how_long_the_rest_takes_at_the_rate_so_far() -> None:
    shown = Progress("sweep", unit="rows", stream=io.StringIO())
    shown.fraction(200, 1000)  # done by an earlier run: no part of the rate
    began = shown._first[0]
    assert "time left unknown" in shown.text(began + 1.0)
    shown.fraction(400, 1000)
    line = shown.text(began + 100.0)
    # 200 rows in 100 s: 600 more take 300 s.
    assert line.startswith("sweep: [############                  ]  40 %, 400 of 1000 rows, 2 a second")
    assert line.endswith("0:05:00 left")
    shown.fraction(1000, 1000)
    assert shown.text(began + 200.0).endswith("0:00:00 left")


@pytest.mark.parametrize("stream", [Terminal(), io.StringIO()])
def test_short_work_shows_nothing_and_long_work_leaves_a_terminals_line_clean(stream, monkeypatch) -> None:
    with Progress("short", stream=stream):
        pass
    assert stream.getvalue() in ("", "\r\033[K")
    for name in ("TERMINAL_FIRST_S", "TERMINAL_EVERY_S", "LINES_EVERY_S"):
        monkeypatch.setattr(module, name, 0.01)
    with Progress("long", stream=stream) as shown:
        shown.fraction(0.0)
        shown.fraction(0.5)
        deadline = time.monotonic() + 10.0
        while "50 %" not in stream.getvalue() and time.monotonic() < deadline:
            time.sleep(0.01)
    text = stream.getvalue()
    assert "long: [###############               ]  50 %" in text
    assert text.endswith("\r\033[K") if stream.isatty() else text.endswith("\n")
