# SPDX-License-Identifier: MIT
"""The layout that viewers were sent, kept so that a body of another size costs three cameras and not a whole layout.

A layout costs two threads of the SDK and a third of a megabyte that a live server never drops.
"""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun_bindings
from rerun.recording_stream import RecordingStream

from .layout import Layout, camera, layout


class SentLayout:
    """For all the recordings that the same viewers see."""

    def __init__(self, application_id: str) -> None:
        self._application_id = application_id
        self._size = 0.0
        self._ghost = False
        self._layout: Layout | None = None
        self._stream: RecordingStream | None = None
        self._messages: Any = None

    def fit(self, recording: rr.RecordingStream, size: float, initial_view: str, ghost: bool) -> None:
        """Send what is needed for a body of this size [m], with a ghost or without; nothing while the size is similar."""
        if self._layout is not None and ghost == self._ghost and 0.5 <= size / self._size <= 2.0:
            return
        if self._layout is None or ghost != self._ghost:
            self._begin(layout(size, initial_view, ghost))
        else:
            for view in self._layout.flights:
                self._stream.log(f"{view.blueprint_path()}/EyeControls3D", camera(size))
        self._size, self._ghost = size, ghost
        # What rr.send_blueprint does too, but that keeps a stream of every layout for ever.
        rerun_bindings.send_blueprint(self._messages, True, True, recording=recording.to_native())

    def close(self) -> None:
        """Let go of the SDK's threads."""
        if self._stream is not None:
            self._stream.disconnect()
        self._stream = self._messages = self._layout = None

    def _begin(self, made: Layout) -> None:
        self.close()
        self._layout = made
        self._stream = RecordingStream._from_native(
            rerun_bindings.new_blueprint(
                application_id=self._application_id, make_default=False, make_thread_default=False, default_enabled=True
            )
        )
        self._stream.set_time("blueprint", sequence=0)
        made.blueprint._log_to_stream(self._stream)
        self._messages = self._stream.memory_recording().storage
