# SPDX-License-Identifier: MIT
"""What stands at the head of the page, and what diagnostics say: what went wrong, how many times, and what to do."""

from __future__ import annotations

import pytest

from rigid_proto_ros.live.diagnostics import warnings_since
from rigid_proto_ros.workbench.status import SHOWN_S, SILENT_S, Status

CALM = {
    "state": "flying",
    "integrator": "auto",
    "integrator_choice": "auto: sleeping",
    "warning": "",
    "refused_total": "0",
    "refused_frame": "0",
    "refused_stamp": "0",
    "overruns": "0",
    "real_time_lost_s": "0.0",
    "sequence_gaps": "0",
    "queue_full": "0",
}


def after(**changes: object) -> str:
    """The page's line when this came up between two reports."""
    status = Status("/rigid_body")
    status.report(CALM, 0.0)
    status.report({**CALM, **{name: str(value) for name, value in changes.items()}}, 1.0)
    return status.text(1.0)


def test_why_a_body_sleeps_is_told_once() -> None:
    line = after(state="sleeping", integrator_choice="auto: sleeping, nothing moves or acts")
    assert line == "`/rigid_body` is sleeping, nothing moves or acts"
    assert after(integrator_choice="auto: free_body") == "`/rigid_body` is simulating, method auto: free_body"


def test_states_published_late_are_no_matter_of_the_pages_user() -> None:
    assert "⚠" not in after(overruns=30, real_time_lost_s=0.05)
    assert warnings_since(CALM, {**CALM, "overruns": "30"}) == ["30 states published late"]


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"refused_total": 3, "refused_frame": 2, "refused_stamp": 1}, "3 commands refused (frame 2, stamp 1)"),
        ({"sequence_gaps": 1}, "1 message lost on the way"),
        (
            {"overruns": 9, "real_time_lost_s": 0.4},
            "this machine is too slow: in the last 1 s it fell 0.4 s behind real time",
        ),
        ({"warning": "step too coarse"}, "step too coarse"),
    ],
)
def test_what_matters_is_said_with_its_number(changes: dict, said: str) -> None:
    assert f"⚠ {said}" in after(**changes) or f"here: {said}" in after(**changes)


def test_a_trouble_is_shown_long_enough_to_be_read_and_then_no_more() -> None:
    status = Status("/rigid_body")
    refused = {**CALM, "refused_total": "1"}
    for second, report in enumerate([CALM, refused, *[refused] * 20]):
        status.report(report, float(second))
        assert ("1 command refused" in status.text(float(second))) == (1 <= second < 1 + SHOWN_S)


def test_a_trouble_that_goes_on_is_one_line_with_its_sum() -> None:
    status = Status("/rigid_body")
    for second in range(21):
        lost = {"real_time_lost_s": str(0.3 * second), "refused_total": str(second), "refused_frame": str(second)}
        status.report({**CALM, **lost}, float(second))
    lines = status.text(20.0).splitlines()
    assert [line.strip() for line in lines[1:]] == [
        "⚠ 20 commands refused (frame 20)",
        "⚠ this machine is too slow: in the last 20 s it fell 6 s behind real time",
    ]


def test_a_node_that_is_gone_is_said_with_what_to_do_until_it_is_back() -> None:
    status = Status("/rigid_body")
    assert "waiting" in status.text(0.0)
    status.report(CALM, 0.0)
    assert "is simulating" in status.text(1.0)
    text = status.text(1.0 + SILENT_S)
    assert "is simulating" not in text and "has ended" in text and "Start it again" in text
    # Another one begins to count from 0: nothing went wrong with it.
    status.report({**CALM, "state": "paused"}, 20.0)
    assert status.text(20.0).startswith("`/rigid_body` is paused") and "⚠" not in status.text(20.0)


def test_a_first_start_says_how_long_it_has_taken_and_what_is_done() -> None:
    status = Status("/rigid_body")
    status.received(0.0)  # a browser has connected; the node has said nothing yet
    assert status.text(0.0) == "waiting for `/rigid_body` …"
    assert "since 12 s" in status.text(12.0) and "compiles its kernels" in status.text(12.0)
    status.report(CALM, 13.0)
    assert "is simulating" in status.text(13.0)
