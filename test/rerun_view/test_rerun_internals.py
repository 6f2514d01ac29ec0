# SPDX-License-Identifier: MIT
"""What we use of the Rerun SDK beyond what it promises is there."""

from __future__ import annotations

import inspect

import pytest

rr = pytest.importorskip("rerun", reason="rerun-sdk is not installed: no recordings")

import rerun.blueprint as rrb
import rerun_bindings


@pytest.mark.parametrize(
    "owner, name, parameters",
    [
        (rerun_bindings, "new_blueprint", {"application_id", "make_default", "make_thread_default", "default_enabled"}),
        (rerun_bindings, "send_blueprint", {"recording"}),
        (rerun_bindings, "flush_and_cleanup_orphaned_recordings", set()),
        (rr.RecordingStream, "_from_native", set()),
        (rrb.Blueprint, "_log_to_stream", set()),
    ],
)
def test_the_sdk_has_what_layouts_and_closed_recordings_need(owner, name: str, parameters: set[str]) -> None:
    function = getattr(owner, name, None)
    assert function is not None, f"no {name} in rerun-sdk {rr.__version__}: see rerun_view/streams.py"
    assert parameters <= set(inspect.signature(function).parameters)
