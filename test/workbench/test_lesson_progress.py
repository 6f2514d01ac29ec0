# SPDX-License-Identifier: MIT
"""A step of a lesson isn't marked before the motion was watched for as long as it asks for."""

from __future__ import annotations

import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from rigid_proto_ros.workbench.lesson_course import LessonProgress

PERIOD_NS = 100_000_000


def watched(progress: LessonProgress, begin_s: float, seconds: float) -> None:
    for k in range(round(seconds * 10) + 1):
        progress.watched(round(begin_s * 1e9) + k * PERIOD_NS)


def test_time_that_jumps_was_not_watched_and_another_lesson_begins_without_marks() -> None:
    progress = LessonProgress()
    progress.begin("t_handle")
    for time_s in (0, 10, 20, 5, 30):
        progress.watched(time_s * 10**9)
    assert progress.done == 0
    watched(progress, 30.0, 4.1)
    assert progress.done == 1
    progress.begin("book")
    assert progress.done == 0
    progress.begin("")
    watched(progress, 0.0, 50.0)
    assert progress.done == 0
