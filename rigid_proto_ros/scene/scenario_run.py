# SPDX-License-Identifier: MIT
"""A scenario in motion: its simulation and its ghost, and the one place where a change of parameters reaches both."""

from __future__ import annotations

from collections.abc import Mapping

from ..mesh.reading import Mesh
from ..simulation.commands import Change
from ..simulation.observer import Observer, SceneChanged
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation
from .ghost import Ghost, ghost_of
from .scenario import BodyMesh, Scenario, check_inertia


class ScenarioRun:
    """scenario: the one in force. ghost: None until ``begin_ghost``, and where the scenario asks for none."""

    def __init__(self, scenario: Scenario, observer: Observer | None = None) -> None:
        self.scenario = scenario
        self.observer = observer or Observer()
        self.simulation = Simulation(scenario.setup, observer)
        self.simulation.setup_of = self.setup_of
        self.ghost: Ghost | None = None

    def begin_ghost(self) -> None:
        """Begin the ghost that the scenario asks for; it gets all commands that are submitted from now on."""
        self.ghost = ghost_of(self.scenario, self.simulation, self.observer)

    def check_change(self, scenario: Scenario) -> None:
        """Raises InputError where this scenario can't follow the present one."""
        self.simulation.check_change(scenario.setup)

    def change(self, changes: Mapping[str, object], mesh: Mesh | None = None, at_hand: BodyMesh | None = None) -> Setup:
        """Put changed parameters in force, as ``Scenario.with_changes`` has it; returns the setup, which the
        simulation is given by a command. Raises InputError, and then all stays as it was.
        """
        return self.replace(self.scenario.with_changes(changes, mesh, at_hand))

    def setup_of(self, command: Change) -> Setup:
        """Put in force what a change says that acts now; returns the setup. Raises InputError."""
        if command.kind == "inertia":
            return self.replace(check_inertia(self.scenario, command.content))
        return self.change(command.content)

    def replace(self, scenario: Scenario) -> Setup:
        """Put another scenario in force; the ghost follows, and the observer is notified."""
        self.check_change(scenario)
        self.scenario = scenario
        # One that isn't there would have missed what was commanded so far: it begins at the next reset.
        if self.ghost is not None:
            self.ghost.change(self.simulation.time_ns, scenario, self.simulation.listed)
        self.notify_scene()
        return scenario.setup

    def notify_scene(self) -> None:
        """Tell the observer the parameters in force."""
        self.observer.on(SceneChanged(self.simulation.time_ns, self.scenario.text))
