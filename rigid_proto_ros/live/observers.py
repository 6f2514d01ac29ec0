# SPDX-License-Identifier: MIT
"""Who observes one body: viewers, topics of events, and a recording that can be changed in flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..scene.offline import notify_start
from ..scene.scenario import Scenario
from ..simulation.observer import Observer, Observers, SceneChanged
from .simulation_loop import SimulationLoop


class LiveObservers:
    """observer: all of them as one. recording_error: why the last recording has stopped by itself; empty while there is
    one, and where none was asked for. on_error(message) is called, from any thread, when a recording stops because its
    file can't be written.
    """

    def __init__(self, name: str, observers: Sequence[Observer], on_error: Callable[[str], None]) -> None:
        self._name = name
        self._others = tuple(observers)
        self._on_error = on_error
        self._recorder: Observer | None = None
        self.recording_error = ""
        self._join()

    def _join(self) -> None:
        self.observer = Observers(*self._others, *filter(None, (self._recorder,)))

    def open_recorder(self, scenario: Scenario) -> Observer | None:
        """The recorder that ``record`` asks for; raises InputError when its file can't be written."""
        path = scenario.parameters.record
        if not path:
            return None
        from ..rerun_view.session_files import make_recorder

        return make_recorder(path, self._name, scenario.parameters, self._on_error)

    def record_to(self, recorder: Observer | None) -> None:
        """Before the start: this recorder, or none, is told what happens."""
        self.recording_error = getattr(self._recorder, "error", "") if recorder is None else ""
        self._recorder = recorder
        self._join()

    def switch_recording(self, loop: SimulationLoop, recorder: Observer | None) -> Observer | None:
        """On the physics thread: the new recorder is told what flies. Returns the old one, to be closed
        by whom nobody waits for.
        """
        finished = self._recorder
        loop.simulation.notify_end()
        self.record_to(recorder)
        loop.watch(self.observer)
        if recorder is not None:
            _introduce(loop, recorder)
        return finished

    def add(self, loop: SimulationLoop, observer: Observer) -> None:
        """On the physics thread: another observer, which is told what flies."""
        self._others = (*self._others, observer)
        self._join()
        loop.watch(self.observer)
        _introduce(loop, observer)

    def remove(self, loop: SimulationLoop, observer: Observer) -> None:
        """On the physics thread: this observer is told nothing more."""
        self._others = tuple(other for other in self._others if other is not observer)
        self._join()
        loop.watch(self.observer)

    @property
    def recording_trouble(self) -> str:
        """Why the last recording has stopped, or that the present one takes nothing; empty when all is well."""
        return self.recording_error or getattr(self._recorder, "stalled", "")

    @property
    def has_failed_recording(self) -> bool:
        """Whether there is a recorder that records no longer."""
        return self._recorder is not None and bool(getattr(self._recorder, "error", ""))

    def close(self) -> None:
        """No more calls follow; whatever is buffered goes out."""
        self.observer.close()


def _introduce(loop: SimulationLoop, observer: Observer) -> None:
    notify_start(observer, loop.scenario)
    observer.on(SceneChanged(loop.simulation.time_ns, loop.scenario.text))
    loop.simulation.introduce(observer)
