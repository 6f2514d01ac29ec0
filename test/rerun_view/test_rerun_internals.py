# SPDX-License-Identifier: MIT
"""What we use of the Rerun SDK beyond what it promises is there, and does what recordings need."""

from __future__ import annotations

import inspect

import pytest

rr = pytest.importorskip("rerun", reason="rerun-sdk is not installed: no recordings")

import rerun.blueprint as rrb
import rerun_bindings

HINT = f"rerun-sdk {rr.__version__}: see rerun_view/rerun_internals.py"


@pytest.mark.parametrize(
    "name, parameters",
    [
        ("new_blueprint", {"application_id", "make_default", "make_thread_default", "default_enabled"}),
        ("send_blueprint", {"recording"}),
        ("flush_and_cleanup_orphaned_recordings", set()),
    ],
)
def test_the_sdk_has_the_functions_that_layouts_and_closed_recordings_need(name: str, parameters: set[str]) -> None:
    function = getattr(rerun_bindings, name, None)
    assert function is not None, f"no rerun_bindings.{name} in {HINT}"
    missing = parameters - set(inspect.signature(function).parameters)
    assert not missing, f"rerun_bindings.{name} takes no {', '.join(missing)} in {HINT}"


def test_a_layout_is_sent_as_often_as_wanted() -> None:
    from rigid_proto_ros.rerun_view.rerun_internals import send_blueprint

    for owner, name in ((rr.RecordingStream, "_from_native"), (rrb.Blueprint, "_log_to_stream")):
        assert hasattr(owner, name), f"no {owner.__name__}.{name} in {HINT}"
    recording = rr.RecordingStream("test")
    memory = recording.memory_recording()
    for _ in range(2):
        send_blueprint("test", rrb.Blueprint(rrb.TimeSeriesView(origin="/x")), recording)
        recording.flush()
        assert len(memory.drain_as_bytes()) > 1000, HINT
