# SPDX-License-Identifier: MIT
"""A running scenario: its simulation, its ghost, their observer, and changes of parameters, which reach both.
``OfflineRun`` runs it as fast as possible, without ROS and without a clock.

The ghost is a second body that gets the same commands under another inertia model or integrator and is drawn beside the
first: true against box, exact against rk4. It shows where the two motions part. It never acts on the first body, and a
run without a viewer has no ghost.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from heapq import heappop, heappush
from typing import Any

from ..base.command_line import Progress
from ..base.errors import InputError
from ..base.vectors import StateRow
from ..simulation.commands import Change, Command, Listed, TieString, WrenchCommand
from ..simulation.observer import (
    Event,
    GhostChanged,
    GhostPublished,
    Observer,
    Published,
    Refused,
    SceneChanged,
    Started,
)
from ..simulation.setup import Setup, check_command
from ..simulation.simulation import Simulation
from .scenario import Scenario, check_values, publication_ns, with_inertia
from .script import at_contact


class Ghost(Observer):
    """The simulation of ``Scenario.ghost``, which gets the commands of another simulation. The observer is notified of
    the first command that the ghost doesn't support, once until the next reset; ``refusal`` keeps the message.
    """

    takes = frozenset({Refused})

    def __init__(self, setup: Setup, observer: Observer) -> None:
        self.simulation = Simulation(setup, self)
        self.refusal = ""
        self._observer = observer
        self._shown = True

    def on(self, event: Event) -> None:
        """Report a command that was refused when it was due."""
        if isinstance(event, Refused):
            self._report_skipped(event.message)

    def announce(self) -> None:
        """Notify the observer of the ghost's setup."""
        setup = self.simulation.setup if self._shown else None
        self._observer.on(GhostChanged(self.simulation.time_ns, setup))

    def watch(self, observer: Observer) -> None:
        """Replace the observer and notify it of the ghost's setup."""
        self._observer = observer
        self.announce()

    def submit(self, command: Command, when_ns: int, listed: Listed | None = None) -> None:
        """Submit a command of the followed simulation. A command that the ghost doesn't support is skipped and
        reported.
        """
        if isinstance(command, Change):
            return  # ``change`` submits the ghost's own setup
        try:
            # Unchecked within a list: an earlier change of the list may permit what the present setup refuses.
            self.simulation.submit(command, when_ns, listed, check=listed is None)
        except InputError as error:
            self._report_skipped(str(error))

    def _report_skipped(self, reason: str) -> None:
        if self._shown and not self.refusal:
            self.refusal = f"the ghost continues without a command: {reason}"
            self._observer.on(Refused(self.simulation.time_ns, "ghost", self.refusal))

    def change(self, time_ns: int, scenario: Scenario, listed: Listed | None = None) -> None:
        """Follow a change of the scenario at ``time_ns``, at this place in a list. A scenario without a ghost hides
        this one.
        """
        setup = scenario.ghost
        self._shown = setup is not None
        if setup is not None:
            self.simulation.submit(Change({}, lambda: setup), max(time_ns, self.simulation.time_ns), listed)
        self._observer.on(GhostChanged(time_ns, setup))

    def act(self, now_ns: int) -> None:
        """Apply the commands that are due now."""
        self.simulation.advance(now_ns)
        self.simulation.act()

    def advance(self, until_ns: int) -> None:
        """Advance the ghost and notify the observer of its state."""
        state = self.simulation.advance(until_ns)
        if self._shown and not self.simulation.failure:
            self._observer.on(GhostPublished(until_ns, state.row))


class Publications:
    """The times of publications at ``rate`` per simulated second; ``next_ns`` is the next one."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._number = 0

    @property
    def next_ns(self) -> int:
        """Simulated time of the next publication [ns]."""
        return publication_ns(self._number, self.rate)

    def restart(self) -> None:
        """Start again at time 0."""
        self._number = 0

    def find_after(self, now_ns: int) -> None:
        """Make the next publication the first after ``now_ns``."""
        self._number = 0
        self.pass_over(now_ns)

    def pass_over(self, present_ns: int) -> None:
        """Skip publications up to the present; a later next one stays."""
        numerator, denominator = self.rate.as_integer_ratio()
        # Start one early, then count up: the estimate is floored, and publications are rounded.
        self._number = max(self._number, present_ns * numerator // (1_000_000_000 * denominator) - 1)
        while self.next_ns <= present_ns:
            self._number += 1


def after_change(scenario: Scenario, change: Change, at_hand: Scenario | None = None) -> Scenario:
    """The scenario that a change makes of this one. Raises InputError. at_hand: as in ``Scenario.with_changes``."""
    if change.kind == "inertia":
        return with_inertia(scenario, change.content)
    return scenario.with_changes(change.content, at_hand=at_hand)


class ScenarioRun:
    """scenario: the present one. ghost: None before ``begin_ghost``, and if the scenario has none."""

    def __init__(self, scenario: Scenario, observer: Observer | None = None) -> None:
        self.scenario = scenario
        self.observer = observer or Observer()
        self.simulation = Simulation(scenario.setup, observer)
        self.publications = Publications(scenario.parameters.publish_rate)
        self.ghost: Ghost | None = None

    def announce(self) -> None:
        """Notify the observer of the scene with its mesh, then of the body."""
        notify_start(self.observer, self.scenario)
        self.simulation.announce()

    def begin_ghost(self) -> None:
        """Start the scenario's ghost, if it has one. It gets all commands that are submitted from now on."""
        self.ghost = None
        if self.scenario.ghost is not None:
            self.ghost = Ghost(self.scenario.ghost, self.observer)
            self.ghost.announce()

    def publish(self, time_ns: int, row: StateRow) -> None:
        """Notify the observer of a state, and of the ghost's state at that time."""
        self.observer.on(Published(time_ns, row))
        self.simulation.notify_floor()
        if self.ghost is not None:
            self.ghost.advance(time_ns)

    def take(
        self,
        command: Command,
        at_ns: int | None = None,
        listed: Listed | None = None,
        at_hand: Scenario | None = None,
    ) -> int:
        """Submit a command to the simulation (see ``Simulation.submit``) and to the ghost. A change applies to the
        parameters at the time when it acts (``setup_of``). at_hand: a scenario whose mesh the change may reuse.
        """
        if isinstance(command, Change):
            command = replace(command, apply=partial(self.setup_of, command, at_hand))
        when_ns = self.simulation.submit(command, at_ns, listed)
        if self.ghost is not None:
            self.ghost.submit(command, when_ns, listed)
        return when_ns

    def check(self, commands: Iterable[Command], anew: bool = False) -> Iterator[tuple[Command, Scenario]]:
        """Yields the commands in order of time, with contacts replaced by their points, each with the scenario in which
        it acts: the present one after all changes up to and including the command. Raises InputError for a command that
        this scenario can't take, unless a change that is already pending may permit it. A reset (``anew``) drops
        pending changes.
        """
        scenario = self.scenario
        for command in commands:
            if isinstance(command, TieString) and command.contact:
                command = at_contact(command, scenario.setup.contacts)
            if isinstance(command, Change) and command.kind == "set":
                check_values(command.content)
            try:
                if isinstance(command, Change):
                    scenario = after_change(scenario, command)
                else:
                    check_command(command, scenario.setup)
            except InputError:
                if anew or not self.simulation.change_waits(max(command.stamp_ns, self.simulation.time_ns)):
                    raise
            yield command, scenario

    def check_change(self, scenario: Scenario) -> None:
        """Raises InputError if this scenario can't follow the present one."""
        self.simulation.check_change(scenario.setup)

    def setup_of(self, command: Change, at_hand: Scenario | None = None) -> Setup:
        """Apply a change that acts now and return the new setup. Raises InputError and then changes nothing. at_hand: a
        scenario whose mesh the change may reuse.
        """
        return self.replace(after_change(self.scenario, command, at_hand))

    def replace(self, scenario: Scenario) -> Setup:
        """Replace the scenario and its publication rate. The ghost follows, and the observer is notified."""
        self.check_change(scenario)
        self.scenario = scenario
        if scenario.parameters.publish_rate != self.publications.rate:
            self.publications.rate = scenario.parameters.publish_rate
            self.publications.find_after(self.simulation.time_ns)
        # A new ghost would have missed all commands so far, so it starts at the next reset.
        if self.ghost is not None:
            self.ghost.change(self.simulation.time_ns, scenario, self.simulation.listed)
        self.notify_scene()
        return scenario.setup

    def notify_scene(self) -> None:
        """Notify the observer of the present parameters."""
        self.observer.on(SceneChanged(self.simulation.time_ns, self.scenario.text))


def notify_start(observer: Observer, scenario: Scenario) -> None:
    """Notify an observer of the scene and the body."""
    mesh = scenario.body_mesh
    if mesh is None:
        observer.on(Started(scenario.text, None, None, ""))
    else:
        observer.on(Started(scenario.text, mesh.surface.vertices, mesh.surface.triangles, mesh.mesh.sha256))


class OfflineRun(ScenarioRun):
    """A simulation with its script submitted, run as fast as possible. ``advance`` runs it from publication to
    publication. submitted: number of commands since time 0.
    """

    def __init__(self, scenario: Scenario, script: Iterable[Command] = (), observer: Observer | None = None) -> None:
        super().__init__(scenario, observer)
        self._is_observed = observer is not None
        self.submitted = 0
        self._rates_ns: list[int] = []  # times at which the publication rate changes; a heap
        if observer is not None:
            self.announce()
            self.begin_ghost()
        self.submit(script)

    def submit(self, script: Iterable[Command]) -> None:
        """Submit the commands of a script. At equal times they act after those submitted before. Each is checked in the
        scene that the earlier commands of the script give. Takes all commands, or none and raises InputError.
        """
        commands = list(script)
        if len(commands) == 1 and isinstance(command := commands[0], WrenchCommand):
            # A single command is taken or refused as a whole anyway.
            try:
                self.take(command, command.stamp_ns, (0, self.submitted + 1))
            except InputError as error:
                raise self._with_place(command, error) from None
            self.submitted += 1
            return
        for command, scenario in self._checked(commands):
            self.submitted += 1
            when_ns = self.take(command, command.stamp_ns, (0, self.submitted), scenario)
            if isinstance(command, Change) and "publish_rate" in command.content:
                heappush(self._rates_ns, when_ns)

    def restart(self, scenario: Scenario | None = None) -> None:
        """Start again at time 0, with another scenario if one is given. Pending commands are dropped."""
        if scenario is not None and scenario is not self.scenario:
            self.scenario = scenario
            self.publications = Publications(scenario.parameters.publish_rate)
        self.publications.restart()
        self.submitted = 0
        self._rates_ns.clear()
        self.simulation.reset(self.scenario.setup)
        if self._is_observed:
            self.announce()
            self.begin_ghost()

    def fly(self, scenario: Scenario, script: Sequence[Command], until_ns: int) -> bool:
        """``restart`` with this scenario, ``submit`` and ``advance`` in one call. Raises InputError."""
        if not self._is_observed and self.simulation.fly(scenario.setup, script, until_ns):
            self.scenario, self.submitted = scenario, len(script)
            self._rates_ns.clear()
            return True
        self.restart(scenario)
        self.submit(script)
        return self.advance(until_ns)

    def _checked(self, commands: Sequence[Command]) -> list[tuple[Command, Scenario]]:
        taken: list[tuple[Command, Scenario]] = []
        try:
            for each in self.check(commands):
                taken.append(each)
        except InputError as error:
            raise self._with_place(commands[len(taken)], error, len(taken)) from None
        return taken

    def _with_place(self, command: Command, error: InputError, taken: int = 0) -> InputError:
        """The error of a command, with its place in the script. taken: number of commands of the script before it."""
        place = f"script, command {self.submitted + taken + 1} at {command.stamp_ns / 1e9:g} s, {error.field}"
        return InputError(place, error.received, error.accepted)

    def advance(self, until_ns: int) -> bool:
        """Advance the body to ``until_ns`` and notify the observer at every publication. Returns False if the motion
        failed.
        """
        while self._rates_ns and self._rates_ns[0] < until_ns:
            # Publications at the new rate are counted from the change, whatever the next one at the old rate was.
            if not self._advance_evenly(heappop(self._rates_ns) + 1):
                return False
        return self._advance_evenly(until_ns)

    def _advance_evenly(self, until_ns: int) -> bool:
        simulation, publications = self.simulation, self.publications
        while self._is_observed and publications.next_ns <= until_ns:
            state = simulation.advance(publications.next_ns)
            if simulation.failure:
                return False
            self.publish(state.time_ns, state.row)
            publications.pass_over(state.time_ns)
        simulation.advance(until_ns)
        return not simulation.failure

    def end(self) -> None:
        """Notify the observer of what has limited the accuracy of the flight."""
        if self._is_observed:
            self.simulation.notify_floor(at_end=True)


def run_with_progress(run: OfflineRun, duration_ns: int) -> float:
    """Advance in steps of a hundredth of the duration and show progress. Returns the wall time [s]."""
    start = time.perf_counter()
    with Progress(f"simulating {duration_ns / 1e9:g} s") as progress:
        for part in range(1, 101):
            if not run.advance(duration_ns * part // 100):
                break
            progress.fraction(part, 100)
    run.end()
    return time.perf_counter() - start


def summary(run: OfflineRun, wall_time: float) -> dict[str, Any]:
    """The output of ``simulate --json``: the final state, energies and costs of the run."""
    simulation = run.simulation
    state = simulation.state
    return {
        "time_ns": state.time_ns,
        "position": state.position.tolist(),
        "orientation_xyzw": state.orientation_xyzw.tolist(),
        "linear_velocity": state.linear_velocity.tolist(),
        "angular_velocity": state.angular_velocity.tolist(),
        "angular_velocity_body": state.angular_velocity_body.tolist(),
        "kinetic_energy": simulation.kinetic_energy,
        "potential_energy": simulation.potential_energy,
        "angular_momentum": simulation.angular_momentum.tolist(),
        "rotor_momentum": simulation.rotor_momentum.tolist(),
        "integrator": simulation.setup.integrator.name,
        "steps": simulation.steps,
        "force_evaluations": simulation.force_evaluations,
        "accuracy_floor": simulation.accuracy_floor,
        "wall_time": wall_time,
        "state_hash": state.sha256(),
    }
