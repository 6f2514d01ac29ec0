# SPDX-License-Identifier: MIT
"""A scene and a script without ROS: the very steps that the node takes, as fast as the machine goes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

from ..base.errors import CommandRefused, InputError
from ..base.progress import Progress
from ..simulation.checks import check_command
from ..simulation.commands import Change, Command
from ..simulation.observer import Observer, Published, Started
from .parameters import is_ros_parameter, parameter_named, with_mass_of_density
from .scenario import Scenario, make_scenario, publication_ns
from .scenario_run import ScenarioRun
from .scene_file import read_scene_file, scene_file
from .script import with_contacts
from .yaml_text import scalar


def read_scene(
    name: str, settings: Mapping[str, object] | None = None, warn: Callable[[str], None] = print
) -> Scenario:
    """The scenario of a scene file, by path or bundled name, with ``settings`` on top.

    An unknown name in a section for this node raises InputError; in ``/**`` it is warned of. A density among the
    settings sets the scene's mass, which would win, to 0, as it does in flight.
    """
    return make_scenario({**scene_values(scene_file(name), warn), **with_mass_of_density(settings or {})})


def scene_values(
    path: str | Path, warn: Callable[[str], None] = print, node_name: str = "rigid_body"
) -> dict[str, object]:
    """The parameters that a scene file gives a node; unknown names as ``read_scene`` has it."""
    scene = read_scene_file(path, node_name)
    if scene.unused and not scene.has_section:
        there = ", ".join(scene.unused[:5])
        warn(f"{path}: no section is for /{node_name.lstrip('/')} (it has {there}); /** is for every node")
    values: dict[str, object] = {}
    for parameter, value in scene.values.items():
        if is_ros_parameter(parameter):
            continue
        try:
            parameter_named(parameter)
        except InputError as error:
            if parameter not in scene.wildcard:
                raise InputError(f"{path}, {parameter}", error.received, error.accepted) from None
            warn(f"{path}: {parameter} under /** is not a parameter of this node; ignored")
            continue
        values[parameter] = value
    return values


def parse_setting(text: str) -> tuple[str, object]:
    """``name=value`` with the value typed as on a ROS command line."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise InputError("--set", text, "name=value")
    return name.strip(), scalar(value.strip())


def notify_start(observer: Observer, scenario: Scenario) -> None:
    """Tell an observer what flies."""
    mesh = scenario.body_mesh
    if mesh is None:
        observer.on(Started(scenario.text, None, None, ""))
    else:
        observer.on(Started(scenario.text, mesh.surface.vertices, mesh.surface.triangles, mesh.mesh.sha256))


class OfflineRun(ScenarioRun):
    """A simulation with its script submitted; ``advance`` takes it from publication to publication."""

    def __init__(
        self, scenario: Scenario, script: list[Command] | None = None, observer: Observer | None = None
    ) -> None:
        super().__init__(scenario, observer)
        self._is_observed = observer is not None
        self._next_publication = 0
        if observer is not None:
            notify_start(observer, scenario)
            self.simulation.announce()
            self.begin_ghost()
        script = with_contacts(script or [], scenario.setup.contacts)
        planned = scenario
        for number, command in enumerate(script):
            try:
                # A command is checked in the scene that the script has made by then.
                if isinstance(command, Change):
                    planned = planned.with_changes(command.content)
                checked = (check_command(command, planned.setup), planned.setup)
                self.simulation.submit(command, command.stamp_ns, (0, number), checked)
            except CommandRefused as refusal:
                raise InputError(
                    f"script, command {number + 1} at {command.stamp_ns / 1e9:g} s", refusal.received, refusal.accepted
                ) from None

    def advance(self, until_ns: int) -> bool:
        """Advance the body to ``until_ns``, notifying the observer every publication; False when the motion failed."""
        if self._is_observed:
            rate = self.scenario.parameters.publish_rate
            while (next_ns := publication_ns(self._next_publication, rate)) <= until_ns:
                state = self.simulation.advance(next_ns)
                if self.simulation.failure:
                    return False
                self.observer.on(Published(next_ns, state.row))
                self.simulation.notify_floor()
                if self.ghost is not None:
                    self.ghost.advance(next_ns)
                self._next_publication += 1
        self.simulation.advance(until_ns)
        return not self.simulation.failure

    def end(self) -> None:
        """Tell the observer what has held the flight to less than its accuracy."""
        if self._is_observed:
            self.simulation.notify_floor(at_end=True)


def run_with_progress(run: OfflineRun, duration_ns: int) -> float:
    """Advance by a hundredth of the duration at a time, and show how far it is; returns the wall time [s]."""
    start = time.perf_counter()
    with Progress(f"simulating {duration_ns / 1e9:g} s") as progress:
        for part in range(1, 101):
            if not run.advance(duration_ns * part // 100):
                break
            progress.fraction(part, 100)
    run.end()
    return time.perf_counter() - start


def summary(run: OfflineRun, wall_time: float) -> dict:
    """What ``simulate --json`` prints: the final state, energies and what the run cost."""
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
        "integrator": simulation.setup.integrator.name,
        "steps": simulation.steps,
        "force_evaluations": simulation.force_evaluations,
        "accuracy_floor": simulation.accuracy_floor,
        "wall_time": wall_time,
        "state_hash": state.sha256(),
    }
