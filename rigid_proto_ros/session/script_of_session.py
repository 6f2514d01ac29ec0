# SPDX-License-Identifier: MIT
"""What was done by hand as a scene and a poke script that give the same motion again, bit for bit.

The events of a run say all that acted on the body, and when. The run is computed anew, and each event becomes a script
entry as it acts. Entries of one time act in the order in which the script lists them, so what was done in one instant
acts again as it did.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..base.errors import InputError
from ..base.vectors import vector
from ..motion.body import Body
from ..motion.frames import Frame
from ..motion.loads import Load
from ..scene.command_codec import MARKS, frame_names, of_event
from ..scene.parameters import PARAMETERS
from ..scene.scenario import Scenario, nanoseconds, scene_text
from ..scene.script import entry_of
from ..scene.yaml_text import flow
from ..simulation.commands import TieString, WrenchCommand
from ..simulation.observer import Applied, Event, Logged, Observer
from ..simulation.string_control import mesh_point
from .recorded_session import RecordedSession, decode_event
from .replay import Resimulation, resimulation

NOT_OF_THE_MOTION = frozenset({"record", "viewer", "rerun_port", "web_port", "workbench_port", "start_paused"})
"""Parameters of a running node that a scene to keep or to send doesn't carry."""


@dataclass(frozen=True)
class SavedScript:
    """scene: parameter-file text; script: poke script text; commands: how many; last_ns: when the last one acts;
    notes: what a replay can't have as it was, one line each.
    """

    scene: str
    script: str
    commands: int
    last_ns: int
    notes: list[str]


def script_of_session(session: RecordedSession) -> SavedScript:
    """The run as a scene and a script; ``simulate --script`` and ``poke_client --reset`` fly it again.

    Raises InputError for events that can't be decoded or taken, which is what an incomplete record of the run gives.
    """
    writer = _Writer()
    again = writer.again = resimulation(session, writer)
    scenario = writer.last = again.scenario
    if session.events:
        again.advance(max(time_ns for time_ns, _ in session.events) + 1)
    if writer.lines != session.lines:
        raise InputError("events", f"{len(session.lines)} lines", "all lines of the log since the start or a reset")
    entries, notes = writer.entries, []
    scene = kept_scene(scenario)
    head = "# Done by hand. Reproduce it with: rigid_proto simulate SCENE --script THIS, or poke_client THIS --reset\n"
    script = head + "".join(f"- {flow(entry)}\n" for entry in entries)
    mesh = scenario.parameters.mesh
    if scenario.body_mesh is not None and scenario.body_mesh.mesh.path == mesh:
        notes.append(f"the scene names the mesh file {mesh}: keep it with the scene")
    last_ns = nanoseconds(entries[-1]["t"]) if entries else 0
    return SavedScript(scene, script, len(entries), last_ns, notes)


def kept_scene(scenario: Scenario) -> str:
    """A scenario as a parameter file of what differs from the defaults, without what belongs to the running node."""
    values = {
        name: value
        for name, value in scenario.parameters.named().items()
        if name not in NOT_OF_THE_MOTION and (name not in PARAMETERS or value != PARAMETERS[name].default)
    }
    values["mesh"] = scenario.parameters.mesh
    return scene_text(values, scenario.body_mesh.mesh.sha256 if scenario.body_mesh else "")


class _Writer(Observer):
    """Turns what acts on a body computed anew into script entries.

    lines: the log's lines as they come out again. entries: of a script, in the order of acting. again: the simulation;
    last: its scenario before the latest change.
    """

    takes = frozenset({Applied, Logged})

    again: Resimulation
    last: Scenario
    _applied: tuple[WrenchCommand, Load, Body]

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.entries: list[dict] = []

    def on(self, event: Event) -> None:
        """A wrench or poke takes effect, and its line follows; or anything else has acted."""
        if isinstance(event, Applied):
            self._applied = event.command, event.load, event.body
        elif isinstance(event, Logged):
            self._write(event.time_ns, event.line)

    def _write(self, time_ns: int, line: str) -> None:
        self.lines.append(line)
        _, kind, content = decode_event(line, len(self.lines))
        if kind in MARKS:
            return
        if kind in ("set", "inertia"):
            self._change(time_ns, content if kind == "set" else {})
            return
        again = self.again
        frames = frame_names(again.scenario.parameters, again.node_name)
        command = of_event(kind, content, frames)
        assert command is not None
        if isinstance(command, WrenchCommand):
            command = _forward(command, self._applied)
        elif isinstance(command, TieString):
            # In mesh coordinates, not yet taken onto the surface: that happens again.
            simulation = again.simulation
            point = mesh_point(command, simulation.setup.body, simulation.state)
            command = replace(command, axes="mesh", point=vector(point))
        self.entries.append({"t": time_ns / 1e9, **entry_of(command)})

    def _change(self, time_ns: int, content: dict) -> None:
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


def _forward(command: WrenchCommand, applied: tuple[WrenchCommand, Load, Body]) -> WrenchCommand:
    """The command as an entry can say it: a push is a force, so an impulse along a normal is given in body axes."""
    _, load, body = applied
    if command.frame.axes != "normal" or not command.frame.impulse:
        return command
    frame = Frame("body", ("point", load.mesh_point), impulse=True)
    return replace(command, frame=frame, force=vector(load.own_force(body)))
