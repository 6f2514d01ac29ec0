# SPDX-License-Identifier: MIT
"""A session as a scene and a poke script: all of it, which gives the same motion bit for bit, or what goes on from a
moment of it.

The events of a run say all that acted on the body, and when. The run is computed anew, and each event becomes a script
entry as it acts. Entries of one time act in the order in which the script lists them, so what was done in one instant
acts again as it did. A what-if from a moment is a session of its own: its time begins at 0, and its steps with it, so
that it follows the session it left within ``accuracy``, and not to the very bits.
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
"""Parameters of a running node that a scene to keep or to send doesn't carry."""

Entry = dict[str, object]


@dataclass(frozen=True)
class SceneAndScript:
    """scene: parameter-file text; entries: of a poke script."""

    scene: str
    entries: list[Entry]

    @property
    def script(self) -> str:
        """The entries as a poke script's text, an empty list where nothing acts."""
        return script_text(self.entries)


# The whole run


def script_of_session(session: RecordedSession) -> SceneAndScript:
    """The run as a scene and a script; ``simulate --script`` and ``poke_client --reset`` fly it again.

    Raises InputError for events that can't be decoded or taken, which is what an incomplete record of the run gives.
    """
    writer = _Writer()
    again = writer.again = resimulation(session, writer)
    scenario = writer.last = again.scenario
    again.finish()
    if writer.lines != session.lines:
        raise InputError("events", f"{len(session.events)} lines", "all lines of the log since the start or a reset")
    # What differs from the defaults, without what belongs to the running node.
    values = {
        name: value
        for name, value in scenario.parameters.named().items()
        if name not in NOT_OF_THE_MOTION and (name not in PARAMETERS or value != PARAMETERS[name].default)
    }
    values["mesh"] = scenario.parameters.mesh
    mesh_sha256 = scenario.body_mesh.mesh.sha256 if scenario.body_mesh else ""
    return SceneAndScript(scene_text(values, mesh_sha256), writer.entries)


class _Writer(Observer):
    """Turns what acts on a body computed anew into script entries.

    lines: the log's lines as they come out again. entries: of a script, in the order of acting. again: the simulation;
    last: its scenario before the latest change.
    """

    takes = frozenset({Applied, Logged})

    again: Resimulation
    last: Scenario
    _applied: tuple[Load, Body]

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.entries: list[Entry] = []

    def on(self, event: Event) -> None:
        """A wrench or poke takes effect, and its line follows; or anything else has acted."""
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
            # In mesh coordinates, not yet taken onto the surface: that happens again.
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
            # It cut the motion's steps all the same.
            changes = {"poke_duration": after.parameters.poke_duration}
        self.entries.append({"t": time_ns / 1e9, "set": changes})


def _forward(command: WrenchCommand, load: Load, body: Body) -> WrenchCommand:
    """The command as an entry can say it: a push is a force, so an impulse along a normal is given in body axes."""
    if command.frame.axes != "normal" or not command.frame.impulse:
        return command
    frame = Frame("body", ("point", load.mesh_point), impulse=True)
    return replace(command, frame=frame, force=vector(load.own_force(body)))


# From a moment on


def branch_at(session: RecordedSession, time_ns: int) -> SceneAndScript:
    """The scene that begins with the session's state at ``time_ns``, to its last bit, and what still acts there, for
    the time that is left.

    Commands that act at that very time or later are left out. Raises InputError where the session doesn't reach it.
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
    """The same for a session without scene or events, in a scene given with it: the scene that begins with the recorded
    state at ``time_ns`` or the last one before it, and that state's time [ns]. What acts there isn't known.
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
    """The scene that begins with this state."""
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
        # The ghost went without the string, which no scene can say.
        return make_scenario({**values, "ghost.integrator": ""}, mesh)


def _string_values(simulation: Simulation) -> dict[str, object]:
    """The parameters that begin a scene with the string as it is."""
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
        # A target is reached over the time since the one before it, here since time 0: so when it would have been. As a
        # parameter, since a target's message would begin a timeout.
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
            # Along the normal of a mesh that has been changed for another one.
            entry |= {"force": load.own_force(simulation.setup.body).tolist(), "axes": "body"}
        if acting.slot > UNNAMED_SLOT:
            entry["slot"] = slot_name(acting.slot)
        if not endless:
            entry["duration"] = (acting.end_ns - now_ns) / 1e9
        held = acting.kind == HELD_WRENCH or acting.slot == UNNAMED_SLOT
        yield {"t": 0.0, "wrench": entry} if held else {"t": 0.0, **entry}


def _thruster_entries(simulation: Simulation) -> Iterator[Entry]:
    """What the thrusters push with, and again without those that stop by their least on-time or the timeout."""
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
