# SPDX-License-Identifier: MIT
"""The ghost that a scene asks for: the body under another tensor or integrator, given the same commands, beside the first.

It is computed here, from what the page hears: the state that it begins with, and every event since.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..motion.state import State
from ..scene.ghost import Refusals
from ..scene.scenario import Scenario
from ..simulation.commands import Change, Command
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation

PORTION_NS = 1_000_000_000
"""[ns] That it is carried at most between two pictures: whoever draws waits for it."""


class Shadow:
    """Follows one flight. ``begin`` with each reset, or where the page comes in. on_refusal(reason) hears of a command that was
    refused when it came to act."""

    def __init__(self, on_refusal: Callable[[str], None]) -> None:
        self._refusals = Refusals(on_refusal)
        self._simulation: Simulation | None = None
        self._setup: Setup | None = None
        self._offset_ns = 0

    @property
    def center_of_mass(self) -> np.ndarray | None:
        """Of its own tensor (3,) [m, scaled mesh coordinates]; None while there is none."""
        return None if self._simulation is None else self._simulation.setup.body.center_of_mass

    def begin(self, scenario: Scenario, state: State) -> None:
        """Beside the body, at ``state``; nowhere, where the scene asks for no ghost."""
        self._setup = scenario.ghost
        self._offset_ns = state.time_ns
        self._simulation = None
        if scenario.ghost is not None:
            at_start = state.time_ns == 0
            initial = scenario.ghost.initial if at_start else _beside(scenario, state)
            self._simulation = Simulation(replace(scenario.ghost, initial=initial), self._refusals)

    def changed(self, scenario: Scenario, state: State) -> None:
        """Parameters changed at ``state``."""
        if self._simulation is None or scenario.ghost is None:
            if scenario.ghost is not self._setup:
                self.begin(scenario, state)
            return
        setup = self._setup = scenario.ghost
        self._submit(Change({}, lambda: setup), state.time_ns)

    def event(self, command: Command, time_ns: int) -> None:
        """A command acted; raises InputError where the ghost can't carry it, which then passes it by."""
        if self._simulation is not None:
            self._submit(command, time_ns)

    def _submit(self, command: Command, time_ns: int) -> None:
        self._simulation.submit(command, max(time_ns - self._offset_ns, self._simulation.time_ns))

    def row(self, time_ns: int) -> np.ndarray | None:
        """Its state (13,) at the node's ``time_ns``; None while there is none, and where it is behind: it catches up by
        PORTION_NS a call."""
        simulation = self._simulation
        until_ns = time_ns - self._offset_ns
        if simulation is None or simulation.failure or until_ns < simulation.time_ns:
            return None
        state = simulation.advance(min(until_ns, simulation.time_ns + PORTION_NS))
        return state.row if simulation.time_ns == until_ns and not simulation.failure else None


def _beside(scenario: Scenario, state: State) -> np.ndarray:
    """The state of a body whose mesh lies where the first one's does, and moves alike: its COM may be another point of it."""
    apart = state.rotation @ (scenario.ghost.body.center_of_mass - scenario.setup.body.center_of_mass)
    row = state.row.copy()
    row[0:3] += apart
    row[7:10] += np.cross(state.angular_velocity, apart)
    return row
