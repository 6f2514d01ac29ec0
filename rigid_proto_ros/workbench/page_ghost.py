# SPDX-License-Identifier: MIT
"""The page's ghost: the very one that ``simulate`` and ``replay`` have, given what the page hears.

It is the body under another tensor or integrator. It begins at the state that the page knows, and takes every event
since, in the order of the log.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..motion.state import State
from ..scene.ghost import Ghost, Refusals
from ..scene.scenario import Scenario
from ..simulation.commands import Command, Listed
from ..simulation.setup import Setup

PORTION_NS = 1_000_000_000
"""[ns] That it is advanced at most between two pictures: whoever draws waits for it."""


class PageGhost:
    """Follows one run. ``begin`` with each reset, or where the page comes in. on_refusal(reason) hears of what it can't
    follow, once in a run.
    """

    def __init__(self, on_refusal: Callable[[str], None]) -> None:
        self._observer = Refusals(on_refusal)
        self._ghost: Ghost | None = None
        self._setup: Setup | None = None
        self._offset_ns = 0
        self._number = 0

    @property
    def began_ns(self) -> int:
        """The node's time at which it was where the body was."""
        return self._offset_ns

    @property
    def center_of_mass(self) -> np.ndarray | None:
        """Of its own tensor (3,) [m, scaled mesh coordinates]; None while there is none."""
        return None if self._ghost is None else self._ghost.simulation.setup.body.center_of_mass

    def begin(self, scenario: Scenario, state: State) -> None:
        """Beside the body, at ``state``; nowhere, where the scene asks for no ghost."""
        setup = self._setup = scenario.ghost
        self._offset_ns = state.time_ns
        self._ghost = None
        if setup is not None:
            initial = setup.initial if state.time_ns == 0 else _beside(scenario, setup, state)
            self._ghost = Ghost(replace(setup, initial=initial), self._observer)

    def changed(self, scenario: Scenario, state: State) -> None:
        """Parameters changed at ``state``."""
        if self._ghost is None or scenario.ghost is None:
            if scenario.ghost is not self._setup:
                self.begin(scenario, state)
            return
        self._setup = scenario.ghost
        self._ghost.change(state.time_ns - self._offset_ns, scenario, self._listed())

    def event(self, command: Command, time_ns: int) -> None:
        """A command acted."""
        if self._ghost is not None:
            when_ns = max(time_ns - self._offset_ns, self._ghost.simulation.time_ns)
            self._ghost.submit(command, when_ns, self._listed())

    def _listed(self) -> Listed:
        """What acted at one instant acts in the order of the log, whatever rule made it."""
        self._number += 1
        return b"", self._number

    def row(self, time_ns: int) -> np.ndarray | None:
        """Its state (13,) at the node's ``time_ns``; None while there is none, and where it is behind: it catches up by
        PORTION_NS a call."""
        until_ns = time_ns - self._offset_ns
        if self._ghost is None:
            return None
        simulation = self._ghost.simulation
        if simulation.failure or until_ns < simulation.time_ns:
            return None
        state = simulation.advance(min(until_ns, simulation.time_ns + PORTION_NS))
        return state.row if simulation.time_ns == until_ns and not simulation.failure else None


def _beside(scenario: Scenario, ghost: Setup, state: State) -> np.ndarray:
    """The state of a body whose mesh lies where the first one's does, and moves alike: its COM may be
    another point of it.
    """
    apart = state.rotation @ (ghost.body.center_of_mass - scenario.setup.body.center_of_mass)
    row = state.row.copy()
    row[0:3] += apart
    row[7:10] += np.cross(state.angular_velocity, apart)
    return row
