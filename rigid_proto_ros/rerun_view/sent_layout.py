# SPDX-License-Identifier: MIT
"""The layout that viewers were sent: as seldom as can be, since another one undoes what somebody has arranged.

It costs two threads of the SDK and a third of a megabyte that a live server never drops.
"""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from .layout import Layout, Subject, layout, time_axis
from .rerun_internals import BlueprintStream


class SentLayout:
    """For all the recordings that the same viewers see."""

    def __init__(self, application_id: str) -> None:
        self._application_id = application_id
        self._has_ghost = False
        self._sent: tuple[Layout, BlueprintStream] | None = None

    def fit(self, recording: rr.RecordingStream, initial_view: str, subject: Subject) -> None:
        """Send what is needed for what this flight is about.

        A run that begins with a ghost, after one without, or the other way round, brings another layout; within a run,
        and at other resets, the layout stays, so that nothing that somebody has arranged is undone.
        """
        if self._sent is not None and subject.ghost == self._has_ghost:
            return
        self.close()
        made = layout(initial_view, subject)
        self._sent = made, BlueprintStream(self._application_id, made.blueprint)
        self._has_ghost = subject.ghost
        self._sent[1].send(recording)

    def fit_axes(self, recording: rr.RecordingStream, axes: dict[str, tuple[float, float]], duration_s: float) -> None:
        """Give plots axes from and to, by entity, in a recording that is complete and this long [simulated s]."""
        if self._sent is None:
            return
        made, stream = self._sent
        for entity, views in made.plots.items():
            for view in views:
                stream.log(f"{view.blueprint_path()}/TimeAxis", time_axis(duration_s))
                if entity in axes:
                    stream.log(f"{view.blueprint_path()}/ScalarAxis", rrb.ScalarAxis(range=axes[entity]))
        stream.send(recording)

    def close(self) -> None:
        """Let go of the SDK's threads."""
        if self._sent is not None:
            self._sent[1].close()
        self._sent = None
