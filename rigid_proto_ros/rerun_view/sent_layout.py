# SPDX-License-Identifier: MIT
"""The layout that viewers were sent, kept so that a body of another size costs three cameras and not a whole layout.

A layout costs two threads of the SDK and a third of a megabyte that a live server never drops.
"""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from rerun.recording_stream import RecordingStream

from .layout import Layout, Subject, camera, layout


class SentLayout:
    """For all the recordings that the same viewers see."""

    def __init__(self, application_id: str) -> None:
        self._application_id = application_id
        self._size = 0.0
        self._subject = Subject()
        self._layout: Layout | None = None
        self._stream: RecordingStream | None = None
        self._messages: Any = None

    def fit(self, recording: rr.RecordingStream, size: float, initial_view: str, subject: Subject) -> None:
        """Send what is needed for a body of this size [m]; nothing while the size is similar.

        A ghost that comes or goes brings another layout; the rest of what a flight is about is that of its beginning, for a
        viewer's own arrangement isn't to be taken away in mid-flight.
        """
        if self._layout is not None and subject.ghost == self._subject.ghost and 0.5 <= size / self._size <= 2.0:
            return
        if self._layout is None or subject.ghost != self._subject.ghost:
            self._begin(layout(size, initial_view, subject))
            self._subject = subject
        else:
            for view in self._layout.flights:
                self._stream.log(f"{view.blueprint_path()}/EyeControls3D", camera(size, self._subject))
        self._size = size
        self._send(recording)

    def fit_axes(self, recording: rr.RecordingStream, axes: dict[str, tuple[float, float]]) -> None:
        """Give plots axes from and to, by entity, in a recording that is complete."""
        if self._layout is None:
            return
        for entity, ends in axes.items():
            for view in self._layout.plots.get(entity, ()):
                self._stream.log(f"{view.blueprint_path()}/ScalarAxis", rrb.ScalarAxis(range=ends))
        self._send(recording)

    def _send(self, recording: rr.RecordingStream) -> None:
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
