# SPDX-License-Identifier: MIT
"""A scenario in motion: its simulation and its ghost, and the one place where a change of parameters reaches both.

The ghost is a second body that gets the same commands under another tensor or integrator, to be seen beside the first:
true against box, exact against rk4, where the two part is the lesson. It never acts back, and a run without a viewer
has none.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..base.errors import InputError
from ..mesh.reading import Mesh
from ..simulation.commands import Change, Command, Listed
from ..simulation.observer import Event, GhostChanged, GhostPublished, Observer, Refused, SceneChanged, snapshot
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation
from .scenario import BodyMesh, Scenario, check_inertia


class Ghost(Observer):
    """The simulation of ``Scenario.ghost``; follows another one's commands (Simulation.follower). The observer is told
    of what the ghost doesn't support, once until the next reset; ``refusal`` keeps it.
    """

    takes = frozenset({Refused})

    def __init__(self, setup: Setup, observer: Observer) -> None:
        self.simulation = Simulation(setup, self)
        self.refusal = ""
        self._observer = observer
        self._shown = True

    def on(self, event: Event) -> None:
        """A command was refused when it came to act."""
        if isinstance(event, Refused):
            self._goes_without(event.message)

    def announce(self) -> None:
        """Tell the observer what the ghost is."""
        self._observer.on(GhostChanged(self.simulation.time_ns, snapshot(self.simulation.setup)))

    def watch(self, observer: Observer) -> None:
        """Tell another observer from now on."""
        self._observer = observer
        self.announce()

    def submit(self, command: Command, when_ns: int, listed: Listed | None = None) -> None:
        """Take a command of the followed simulation; what the ghost doesn't support it goes without, and the observer
        is told.
        """
        if isinstance(command, Change):
            return  # ``change`` brings its own setup
        # A change before it in its list may allow what the present setup doesn't: then it is checked when it acts.
        checked = None if listed is None else (b"", self.simulation.setup)
        try:
            self.simulation.submit(command, when_ns, listed, checked)
        except InputError as error:
            self._goes_without(str(error))

    def _goes_without(self, reason: str) -> None:
        if self._shown and not self.refusal:
            self.refusal = f"the ghost continues without a command: {reason}"
            self._observer.on(Refused(self.simulation.time_ns, "ghost", self.refusal))

    def change(self, time_ns: int, scenario: Scenario, listed: Listed | None = None) -> None:
        """The followed scenario changed at ``time_ns``, at this place in a list; one without a ghost leaves this one
        out of sight.
        """
        setup = scenario.ghost
        self._shown = setup is not None
        if setup is not None:
            self.simulation.submit(Change({}, lambda: setup), max(time_ns, self.simulation.time_ns), listed)
            self._observer.on(GhostChanged(time_ns, snapshot(setup)))

    def reset(self, scenario: Scenario) -> None:
        """Time 0 and the initial state."""
        self.simulation.reset(scenario.ghost)
        self.refusal = ""
        self.announce()

    def advance(self, until_ns: int) -> None:
        """Advance the ghost and tell the observer where it is."""
        state = self.simulation.advance(until_ns)
        if self._shown and not self.simulation.failure:
            self._observer.on(GhostPublished(until_ns, state.row))


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
        self.ghost = Ghost(self.scenario.ghost, self.observer) if self.scenario.ghost is not None else None
        if self.ghost is not None:
            self.simulation.follower = self.ghost.submit
            self.ghost.announce()

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
