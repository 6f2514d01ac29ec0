# SPDX-License-Identifier: MIT
"""A session as a scene and a poke script: the whole run, which reproduces its motion bit for bit, or a branch that
starts at a given time of it.

The events of a run record everything that acted on the body, with its time. The run is simulated again, and each event
becomes a script entry when it acts. Entries of the same time act in the order of the script, so the order of events
within one instant is kept. A branch is a new session: its time and its integration steps start at 0, so it follows the
original session within ``accuracy``, but not bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.vectors import StateRow, vector
from ..motion.body import Body
from ..motion.frames import Frame
from ..motion.loads import Load
from ..parameters.declarations import PARAMETERS
from ..scene.command_codec import MARKS, of_event
from ..scene.scenario import Scenario, make_scenario, scene_text
from ..scene.script import entry_of, script_text
from ..simulation.commands import HELD_WRENCH, TIE_AXES, UNNAMED_SLOT, TieString, WrenchCommand, slot_name
from ..simulation.flight import NEVER
from ..simulation.observer import Applied, Event, Logged, Observer
from ..simulation.simulation import Simulation
from ..simulation.string_control import mesh_point_of
from .messages import PROJECTIONS
from .recorded_session import RecordedSession, Resimulation, decode_event, resimulation

NOT_OF_THE_MOTION = frozenset(
    {"record", "viewer", "rerun_port", "web_port", "workbench_port", "workbench_host", "start_paused"}
)
"""Parameters of a running node that don't affect the motion; exported scenes leave them out."""

Entry = dict[str, object]


@dataclass(frozen=True)
class SceneAndScript:
    """scene: text of a parameter file; entries: the entries of a poke script."""

    scene: str
    entries: list[Entry]

    @property
    def script(self) -> str:
        """The poke script as text; an empty list without entries."""
        return script_text(self.entries)


# The whole run


def script_of_session(session: RecordedSession) -> SceneAndScript:
    """The run as a scene and a script, which ``simulate --script`` and ``poke_client --reset`` reproduce.

    Raises InputError for events that can't be decoded or applied, as in an incomplete recording of the run.
    """
    writer = _Writer()
    again = writer.again = resimulation(session, writer)
    scenario = writer.last = again.scenario
    again.finish()
    if writer.lines != session.lines:
        raise InputError("events", f"{len(session.events)} lines", "all lines of the log since the start or a reset")
    # Parameters that differ from their defaults, without those of the running node.
    values = {
        name: value
        for name, value in scenario.parameters.named().items()
        if name not in NOT_OF_THE_MOTION and (name not in PARAMETERS or value != PARAMETERS[name].default)
    }
    values["mesh"] = scenario.parameters.mesh
    mesh_sha256 = scenario.body_mesh.mesh.sha256 if scenario.body_mesh else ""
    return SceneAndScript(scene_text(values, mesh_sha256), writer.entries)


class _Writer(Observer):
    """Converts the events of a resimulation to script entries.

    lines: lines of the resimulation's event log. entries: script entries in the order in which they act. again: the
    resimulation; last: its scenario before the latest change.
    """

    takes = frozenset({Applied, Logged})

    again: Resimulation
    last: Scenario
    _applied: tuple[Load, Body]

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.entries: list[Entry] = []

    def on(self, event: Event) -> None:
        """Keep the load of a wrench or poke, whose log line follows; convert each log line."""
        if isinstance(event, Applied):
            self._applied = event.load, event.body
        elif isinstance(event, Logged):
            self._write(event.time_ns, event.line)

    def _write(self, time_ns: int, line: str) -> None:
        self.lines.append(line)
        _, kind, content = decode_event(line, len(self.lines))
        if kind == "jump" and content.get("by_ns", 0) > 0:
            raise InputError("script", f"a jump of /clock at {time_ns / 1e9:.9g} s", "a run whose time goes on evenly")
        if kind in MARKS:
            return
        if kind in ("set", "inertia"):
            self._change(time_ns, content if kind == "set" else {})
            return
        command = of_event(kind, content, self.again.frames)
        assert command is not None
        if isinstance(command, WrenchCommand):
            command = _forward(command, *self._applied)
        elif isinstance(command, TieString):
            # In mesh coordinates, not yet projected onto the surface: the script's run projects it again.
            simulation = self.again.simulation
            point = np.zeros(3)
            mesh_point_of(TIE_AXES.index(command.axes), np.array(command.point), simulation.flight, point)
            command = replace(command, axes="mesh", point=vector(point))
        self.entries.append({"t": time_ns / 1e9, **entry_of(command)})

    def _change(self, time_ns: int, content: dict[str, Any]) -> None:
        before, after = self.last, self.again.scenario
        self.last = after
        changes = {name: value for name, value in content.items() if name not in NOT_OF_THE_MOTION}
        if not content:
            earlier = before.parameters.named()
            changes = {name: value for name, value in after.parameters.named().items() if value != earlier.get(name)}
        if not changes:
            # A change without effect still ends an integration step, so an entry must do so, too.
            changes = {"poke_duration": after.parameters.poke_duration}
        self.entries.append({"t": time_ns / 1e9, "set": changes})


def _forward(command: WrenchCommand, load: Load, body: Body) -> WrenchCommand:
    """The command in a form that script entries have: they push with forces only, so an impulse along a normal is
    converted to body axes.
    """
    if command.frame.axes != "normal" or not command.frame.impulse:
        return command
    frame = Frame("body", ("point", load.mesh_point), impulse=True)
    return replace(command, frame=frame, force=vector(load.own_force(body)))


# Branches


def branch_at(session: RecordedSession, time_ns: int) -> SceneAndScript:
    """The scene that starts with the session's state at ``time_ns``, bit for bit, and a script of the commands that
    still act then, with their remaining durations.

    Commands that act at ``time_ns`` or later are left out. Raises InputError if the session doesn't reach that time.
    """
    last_ns = max([session.end_ns, *(event_ns for event_ns, _ in session.events)])
    if not 0 <= time_ns <= last_ns:
        raise InputError("--at", time_ns / 1e9, f"a time of the session, 0 to {last_ns / 1e9:.9g} s")
    again = resimulation(session)
    row = again.advance(time_ns)
    simulation = again.simulation
    if simulation.failure:
        raise InputError("--at", time_ns / 1e9, f"a time before the motion failed: {simulation.failure}")
    entries = [*_load_entries(simulation), *_thruster_entries(simulation), *_string_entries(simulation)]
    changes = {**_string_values(simulation), "rotor.momentum": simulation.rotor_momentum.tolist()}
    return SceneAndScript(_scene(again.scenario, row, changes).text, entries)


def recorded_branch(session: RecordedSession, scenario: Scenario, time_ns: int) -> tuple[SceneAndScript, int]:
    """The branch of a session without scene or events, whose scene is given: it starts with the recorded state at
    ``time_ns`` or the last one before. Returns the branch, without script since loads are unknown, and the state's time
    [ns].
    """
    before = np.flatnonzero(session.times <= time_ns)
    if not len(before) or time_ns > session.end_ns:
        states = session.states
        span = f"{states.first_ns / 1e9:.9g} to {states.end_ns / 1e9:.9g} s" if states.count else "none"
        raise InputError("--at", time_ns / 1e9, f"a time of the recorded states, {span}")
    row, at_ns, rotor = session.rows[before[-1]], int(session.times[before[-1]]), scenario.parameters.rotor
    driven = [h + 1e-9 * at_ns * torque for h, torque in zip(rotor.momentum, rotor.torque, strict=True)]
    return SceneAndScript(_scene(scenario, row, {"rotor.momentum": driven}).text, []), at_ns


def _scene(scenario: Scenario, row: StateRow, changes: dict[str, object]) -> Scenario:
    """The scene that starts with this state."""
    numbers = row.tolist()
    velocities = PROJECTIONS["twist"](numbers)
    values = {
        **scenario.parameters.named(),
        "initial.position": numbers[0:3],
        "initial.orientation_xyzw": numbers[3:7],
        "initial.linear_velocity": velocities[:3],
        "initial.angular_velocity": velocities[3:],
        "record": "",
        **changes,
    }
    mesh = scenario.body_mesh.mesh if scenario.body_mesh else None
    try:
        return make_scenario(values, mesh)
    except InputError as error:
        if error.field != "ghost.integrator":
            raise
        # The ghost's integrator doesn't support the string, and the recorded ghost had none; a scene can't express
        # that.
        return make_scenario({**values, "ghost.integrator": ""}, mesh)


def _string_values(simulation: Simulation) -> dict[str, object]:
    """The parameters that start a scene with the present string."""
    tied = simulation.string
    if tied is None:
        return {"string.attached": False, "string.attach": list(simulation.attach)}
    return {
        "string.attached": True,
        "string.attach": list(tied.attach),
        "string.target": tied.free_end(simulation.time_ns).tolist(),
        "initial.string_mass": tied.effective_mass,
    }


def _string_entries(simulation: Simulation) -> Iterator[Entry]:
    tied, now_ns = simulation.string, simulation.time_ns
    if tied is None:
        return
    if tied.end_ns > now_ns:
        # The free end takes as long to reach a target as has passed since the target before, here since time 0. Set at
        # half the remaining time, the target is reached at the original time. As a parameter, since a target message
        # would start a timeout.
        yield {"t": (tied.end_ns - now_ns) // 2 / 1e9, "set": {"string.target": tied.target.tolist()}}
    if tied.release_ns is not None:
        yield {"t": (tied.release_ns - now_ns) / 1e9, "string": "release"}


def _load_entries(simulation: Simulation) -> Iterator[Entry]:
    timeout_ns, now_ns = int(simulation.flight.timeout_ns), simulation.time_ns
    for acting in simulation.acting:
        endless = acting.kind == HELD_WRENCH and not timeout_ns
        if acting.thruster >= 0 or not (endless or acting.end_ns > now_ns):
            continue
        load = acting.load
        entry: Entry = {"at": "com" if load.mesh_point is None else {"point": list(load.mesh_point)}}
        surface = simulation.setup.surface
        if load.axes != "normal":
            entry |= {"force": list(load.force), "torque": list(load.torque), "axes": load.axes}
        elif surface and load.mesh_point and vector(surface.inward_normal(load.mesh_point)) == load.mesh_normal:
            entry["push"] = load.force[0]
        else:
            # Along the normal of a mesh that was replaced since.
            entry |= {"force": load.own_force(simulation.setup.body).tolist(), "axes": "body"}
        if acting.slot > UNNAMED_SLOT:
            entry["slot"] = slot_name(acting.slot)
        if not endless:
            entry["duration"] = (acting.end_ns - now_ns) / 1e9
        held = acting.kind == HELD_WRENCH or acting.slot == UNNAMED_SLOT
        yield {"t": 0.0, "wrench": entry} if held else {"t": 0.0, **entry}


def _thruster_entries(simulation: Simulation) -> Iterator[Entry]:
    """The present thruster forces, and an entry at each time at which some stop by minimum on-time or timeout."""
    control, now_ns = simulation.thrusters, simulation.time_ns
    pushes = control.pushes
    if not any(push.force for push in pushes):
        return
    ends = [push.off_ns for push in pushes]
    if control.times_out:
        timeout_ns, thrusters = control.last_ns + int(simulation.flight.timeout_ns), control.thrusters.values()
        least_ns = [push.on_ns + thruster.minimum_on_ns for push, thruster in zip(pushes, thrusters, strict=True)]
        ends = [min(end_ns, max(timeout_ns, on_ns)) for end_ns, on_ns in zip(ends, least_ns, strict=True)]
    for time_ns in (now_ns, *sorted({end_ns for end_ns in ends if end_ns != NEVER})):
        forces = [push.force if end_ns > time_ns else 0.0 for push, end_ns in zip(pushes, ends, strict=True)]
        yield {"t": (time_ns - now_ns) / 1e9, "thrusters": forces}
