# SPDX-License-Identifier: MIT
"""The page's ghost: that of the run as ``replay`` computes it anew, from the events that the page hears.

It is the body under another tensor or integrator. It begins at the state that the page knows, and gets every event
since.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..mesh.reading import Mesh
from ..motion.state import State
from ..scene.ghost import GHOST
from ..scene.scenario import Scenario
from ..session.replay import Resimulation
from ..simulation.observer import Event, GhostPublished, Observer, Refused
from ..simulation.setup import Setup

PORTION_NS = 1_000_000_000
"""[ns] That it is advanced at most between two pictures: whoever draws waits for it."""


class _GhostObserver(Observer):
    """Receives the ghost of a run that is computed anew; on_refusal(reason) hears of refused commands."""

    takes = frozenset({GhostPublished, Refused})

    def __init__(self, on_refusal: Callable[[str], None]) -> None:
        self._on_refusal = on_refusal
        self.row: np.ndarray | None = None

    def on(self, event: Event) -> None:
        """Where it is, which isn't told while the scene asks for none; or a command was refused."""
        if isinstance(event, GhostPublished):
            self.row = event.row.copy()
        elif isinstance(event, Refused) and event.reason == GHOST:
            self._on_refusal(event.message)


class PageGhost:
    """Follows one run of a node. ``begin`` with each reset, or where the page comes in; ``take`` each event. on_refusal
    as above; it may be told the same more than once.
    """

    def __init__(self, node_name: str, on_refusal: Callable[[str], None]) -> None:
        self._node_name = node_name
        self._on_refusal = on_refusal
        self._observer = _GhostObserver(on_refusal)
        self._run: Resimulation | None = None
        self._scenario: Scenario | None = None
        self._offset_ns = 0

    @property
    def began_ns(self) -> int:
        """The node's time at which it was where the body was."""
        return self._offset_ns

    @property
    def center_of_mass(self) -> np.ndarray | None:
        """Of its own tensor (3,) [m, scaled mesh coordinates]; None while there is none."""
        ghost = None if self._run is None else self._run.ghost
        return None if ghost is None else ghost.simulation.setup.body.center_of_mass

    def begin(self, scenario: Scenario, state: State) -> None:
        """Beside the body, at ``state``; nowhere, where the scene asks for no ghost."""
        self._scenario = scenario
        self._offset_ns = state.time_ns
        self._run = None
        ghost = scenario.ghost
        if ghost is None:
            return
        if state.time_ns:
            setup = replace(scenario.setup, initial=state.row)
            ghost = replace(ghost, initial=_beside(scenario, ghost, state))
            scenario = replace(scenario, setup=setup, ghost=ghost)
        self._observer = _GhostObserver(self._on_refusal)
        self._run = Resimulation(scenario, [], self._observer, self._mesh, self._node_name)
        self._run.begin_ghost()

    def changed(self, scenario: Scenario, state: State) -> None:
        """Parameters changed, ``state`` being the last one heard: a ghost that is asked for from now on begins there. A
        run that has one knows by its events.
        """
        had_none, self._scenario = self._run is None, scenario
        if scenario.ghost is None:
            self._run = None
        elif had_none:
            self.begin(scenario, state)

    def take(self, time_ns: int, kind: str, content: dict) -> None:
        """An event of the node's log; raises InputError for one that can't be decoded."""
        if self._run is not None and time_ns >= self._offset_ns:
            self._run.take(time_ns - self._offset_ns, kind, content)

    def row(self, time_ns: int) -> np.ndarray | None:
        """Its state (13,) at the node's ``time_ns``; None while there is none, and where it is behind: it catches up by
        PORTION_NS a call."""
        run, until_ns = self._run, time_ns - self._offset_ns
        if run is None or run.ghost is None or until_ns < run.simulation.time_ns:
            return None
        next_ns = min(until_ns, run.simulation.time_ns + PORTION_NS)
        try:
            run.advance(next_ns)
        except CommandRefused as refusal:
            self._on_refusal(f"the ghost continues without a command: {refusal}")
            return None
        except InputError as error:
            self._on_refusal(f"the ghost ends here: {error}")
            self._run = None
            return None
        self._observer.row = None
        run.ghost.advance(next_ns)
        return self._observer.row if next_ns == until_ns else None

    def _mesh(self, name: str) -> Mesh | None:
        """The mesh of a change: the one that the page shows, where that bears its name already."""
        scenario = self._scenario
        if scenario is None or scenario.body_mesh is None or scenario.parameters.mesh != name:
            return None
        return scenario.body_mesh.mesh


def _beside(scenario: Scenario, ghost: Setup, state: State) -> np.ndarray:
    """The state of a body whose mesh lies where the first one's does, and moves alike: its COM may be
    another point of it.
    """
    apart = state.rotation @ (ghost.body.center_of_mass - scenario.setup.body.center_of_mass)
    row = state.row.copy()
    row[0:3] += apart
    row[7:10] += np.cross(state.angular_velocity, apart)
    return row
