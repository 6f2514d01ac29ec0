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


def test_a_layout_that_is_kept_is_sent_whole_and_then_by_its_changes() -> None:
    from rigid_proto_ros.rerun_view.rerun_internals import BlueprintStream

    for owner, name in ((rr.RecordingStream, "_from_native"), (rrb.Blueprint, "_log_to_stream")):
        assert hasattr(owner, name), f"no {owner.__name__}.{name} in {HINT}"
    view = rrb.TimeSeriesView(origin="/x")
    stream = BlueprintStream("test", rrb.Blueprint(view))
    recording = rr.RecordingStream("test")
    memory = recording.memory_recording()
    sizes = []
    for _ in range(2):
        stream.send(recording)
        recording.flush()
        sizes.append(len(memory.drain_as_bytes()))
        stream.log(f"{view.blueprint_path()}/ScalarAxis", rrb.ScalarAxis(range=(0.0, 1.0)))
    stream.close()
    assert sizes[0] > sizes[1] > 0, f"{sizes} bytes with {HINT}"
