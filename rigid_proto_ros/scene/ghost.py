# SPDX-License-Identifier: MIT
"""The ghost: a second body that gets the same commands under another tensor or integrator, to be seen beside the first.

True against box, exact against rk4: where the two part is the lesson. It never acts back, and a run without a viewer
has none.
"""

from __future__ import annotations

from collections.abc import Callable

from ..base.errors import InputError
from ..simulation.commands import Change, Command, Listed
from ..simulation.observer import Event, GhostChanged, GhostPublished, Observer, Refused
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation
from .scenario import Scenario

GHOST = "ghost"
"""The reason of a refusal that is the ghost's alone."""


class Refusals(Observer):
    """Hears of commands that a ghost's simulation refused when they came to act: on_refusal(text)."""

    def __init__(self, on_refusal: Callable[[str], None]) -> None:
        self._on_refusal = on_refusal

    takes = frozenset({Refused})

    def on(self, event: Event) -> None:
        """A command was refused."""
        if isinstance(event, Refused):
            self._on_refusal(event.message)


class GhostRefusals(Observer):
    """Says what a ghost goes without, to whoever flies it."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say

    takes = frozenset({Refused})

    def on(self, event: Event) -> None:
        """A command was refused, by the ghost alone where the reason says so."""
        if isinstance(event, Refused) and event.reason == GHOST:
            self._say(f"at {event.time_ns / 1e9:.9g} s {event.message}")


class Ghost:
    """The simulation of ``Scenario.ghost``; follows another one's commands (Simulation.follower). The observer is told
    of what the ghost doesn't support, once until the next reset.
    """

    def __init__(self, setup: Setup, observer: Observer) -> None:
        self.simulation = Simulation(setup, Refusals(self._goes_without))
        self._observer = observer
        self._shown = True
        self._refused = False

    def announce(self) -> None:
        """Tell the observer what the ghost is."""
        self._observer.on(GhostChanged(self.simulation.time_ns, self.simulation.snapshot()))

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
        if self._shown and not self._refused:
            self._refused = True
            text = f"the ghost continues without a command: {reason}"
            self._observer.on(Refused(self.simulation.time_ns, GHOST, text))

    def change(self, time_ns: int, scenario: Scenario, listed: Listed | None = None) -> None:
        """The followed scenario changed at ``time_ns``, at this place in a list; one without a ghost leaves this one
        out of sight.
        """
        setup = scenario.ghost
        self._shown = setup is not None
        if setup is not None:
            self.simulation.submit(Change({}, lambda: setup), max(time_ns, self.simulation.time_ns), listed)
            self._observer.on(GhostChanged(time_ns, self.simulation.snapshot(setup)))

    def reset(self, scenario: Scenario) -> None:
        """Time 0 and the initial state."""
        self.simulation.reset(scenario.ghost)
        self._refused = False
        self.announce()

    def advance(self, until_ns: int) -> None:
        """Advance the ghost and tell the observer where it is."""
        state = self.simulation.advance(until_ns)
        if self._shown and not self.simulation.failure:
            self._observer.on(GhostPublished(until_ns, state.row))


def ghost_of(scenario: Scenario, simulation: Simulation, observer: Observer | None) -> Ghost | None:
    """The ghost that a scenario asks for, following the simulation; None when nobody would see it."""
    if scenario.ghost is None or observer is None:
        return None
    ghost = Ghost(scenario.ghost, observer)
    simulation.follower = ghost
    ghost.announce()
    return ghost
