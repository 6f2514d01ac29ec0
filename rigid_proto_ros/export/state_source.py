# SPDX-License-Identifier: MIT
"""A flight that is simulated again to be looked at between its published states."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.errors import InputError
from ..scene.offline import OfflineRun
from ..scene.scenario import Scenario
from ..scene.script import ScriptCommand
from ..session.recorded_session import RecordedSession
from ..session.replay import Resimulation, resimulation
from ..simulation.observer import Event, GhostPublished, Observer

POSE = 7
"""Numbers of a state row that are its pose: position and attitude xyzw."""


class StateSource(Observer):
    """A flight that can be made anew and looked at; keeps where its ghost is."""

    takes = frozenset({GhostPublished})

    def __init__(self, make: Callable[[Observer], OfflineRun | Resimulation]) -> None:
        self._make = make
        self._ghost = np.full(POSE, np.nan)

    def on(self, event: Event) -> None:
        """One state of the ghost."""
        if isinstance(event, GhostPublished):
            self._ghost = event.row[:POSE].copy()

    def at(self, times_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """State rows (n, 13) of the body and poses (n, 7) of its ghost; NaN from where the motion stopped."""
        run = self._make(self)
        rows, ghosts = np.full((len(times_ns), 13), np.nan), np.full((len(times_ns), POSE), np.nan)
        for k, time_ns in enumerate(times_ns.tolist()):
            try:
                run.advance(time_ns)
            except InputError:
                break  # a recorded command that can't be taken: what was recorded goes on without it
            if run.simulation.failure:
                break
            rows[k] = run.simulation.state.row
            if run.ghost is not None:
                self._ghost[:] = np.nan
                run.ghost.advance(time_ns)
                ghosts[k] = self._ghost
        return rows, ghosts


def source_of_scene(scenario: Scenario, script: list[ScriptCommand]) -> StateSource:
    """The flight of a scene and its script."""
    return StateSource(lambda observer: OfflineRun(scenario, script, observer))


def source_of_session(session: RecordedSession, given: Scenario | None = None) -> StateSource | None:
    """The flight of a session; None for one that lacks what it would take to simulate it again."""
    if given is not None or session.missing:
        return None

    def again(observer: Observer) -> Resimulation:
        flight = resimulation(session, observer)
        flight.begin_ghost()
        return flight

    return StateSource(again)
