# SPDX-License-Identifier: MIT
"""Who watches one body: the topics of its events, a live view, and a recording that can be changed in flight."""

from __future__ import annotations

from collections.abc import Callable

from ..scene.offline import notify_start
from ..scene.scenario import Scenario
from ..simulation.observer import Observer, Observers
from .event_publisher import EventPublisher
from .simulation_loop import SimulationLoop


class Watchers:
    """observer: all of them as one. viewer: shows the body live, or None. recording_error: why the last recording has
    stopped by itself; empty while there is one, and where none was asked for. on_error(message) is called, from any
    thread, when a recording stops because its file can't be written.
    """

    def __init__(
        self, node_name: str, events: EventPublisher, viewer: Observer | None, on_error: Callable[[str], None]
    ) -> None:
        self._node_name = node_name
        self._events = events
        self._viewer = viewer
        self._on_error = on_error
        self._recorder: Observer | None = None
        self.recording_error = ""
        self.observer = Observers(*filter(None, (events, viewer)))

    def open_recorder(self, scenario: Scenario) -> Observer | None:
        """The recorder that ``record`` asks for; raises InputError when its file can't be written."""
        path = scenario.parameters.record
        if not path:
            return None
        from ..rerun_view.session_files import make_recorder

        return make_recorder(path, self._node_name, scenario.parameters, self._on_error)

    def switch_recording(self, loop: SimulationLoop, recorder: Observer | None) -> Observer | None:
        """On the physics thread: the new recorder is told what flies. Returns the old one, to be closed
        by whom nobody waits for.
        """
        finished = self._recorder
        self.record_to(recorder)
        loop.watch(self.observer)
        if recorder is not None:
            notify_start(recorder, loop.scenario)
            recorder.scene_changed(loop.simulation.time_ns, loop.scenario.text)
            loop.simulation.introduce(recorder)
        return finished

    def record_to(self, recorder: Observer | None) -> None:
        """Before the start: this recorder, or none, is told what happens."""
        self.recording_error = getattr(self._recorder, "error", "") if recorder is None else ""
        self._recorder = recorder
        self.observer = Observers(*filter(None, (self._events, self._viewer, recorder)))

    @property
    def are_there(self) -> bool:
        """Whether a viewer or a recording takes the states."""
        return self._viewer is not None or self._recorder is not None

    @property
    def has_failed_recording(self) -> bool:
        """Whether there is a recorder that records no longer."""
        return self._recorder is not None and bool(getattr(self._recorder, "error", ""))

    def close(self) -> None:
        """No more calls follow; whatever is buffered goes out."""
        self.observer.close()
