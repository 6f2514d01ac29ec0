# SPDX-License-Identifier: MIT
"""What we need of the Rerun SDK that it offers no public way to.

Tried with rerun-sdk 0.41.0; test_rerun_internals.py says which of these names another version lacks.

* ``rr.send_blueprint`` keeps a stream of every layout for ever: two threads and a third of a megabyte each.
* The SDK keeps threads and memory of recordings that are closed until the process ends, and offers nothing to let go
  of them.
"""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun_bindings
from rerun.recording_stream import RecordingStream

# ruff: noqa: SLF001 (what this module is for)


def send_blueprint(application_id: str, blueprint: Any, recording: rr.RecordingStream) -> None:
    """Make a blueprint the layout of a recording, in force and default."""
    stream = RecordingStream._from_native(
        rerun_bindings.new_blueprint(
            application_id=application_id, make_default=False, make_thread_default=False, default_enabled=True
        )
    )
    stream.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(stream)
    messages = stream.memory_recording().storage
    rerun_bindings.send_blueprint(messages, True, True, recording=recording.to_native())
    stream.disconnect()


def forget_closed_recordings() -> None:
    """Give back threads and memory of recordings that are closed. Waits for all others to take what they were sent."""
    users_own = rr.get_global_data_recording()
    try:
        rerun_bindings.flush_and_cleanup_orphaned_recordings()
    except RuntimeError:
        # Some other recording of this process can't be flushed; another time.
        pass
    if users_own is not None:
        rr.set_global_data_recording(users_own)
