# SPDX-License-Identifier: MIT
"""What was done by hand as a scene and a poke script that give the same motion again, bit for bit.

The events of a run say all that acted on the body, and when. The run is computed anew, and each event becomes a script entry
as it acts. An entry acts in a script at its own stamp, so what happened at one instant is put in its order there by
``script_order``; no other thing of the motion hangs on who sent a command, or how.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ..core.body import Body
from ..core.commands import TieString, WrenchCommand
from ..core.errors import InputError
from ..core.frames import Frame
from ..core.loads import Load
from ..core.observer import Observer
from ..core.string_control import mesh_point
from ..offline import OfflineRun
from ..parameters import PARAMETERS, READ_ONLY, parameter_named
from ..poke_script import expand_script
from ..recorded_session import RecordedSession
from ..replay import Resimulation, mesh_finder, session_scenario
from ..scenario import Scenario, scene_text, yaml_double, yaml_value
from ..scene_file import scalar
from ..session_runs import decode_event
from .script_order import Entry, in_order

NOT_OF_THE_MOTION = frozenset({"record", "viewer", "rerun_port", "web_port", "workbench_port", "start_paused"})
"""Parameters of a running node that a scene to keep or to send doesn't carry."""

_WORD = re.compile(r"[a-z_]{3,}\Z")
"""Text that stands in YAML without quotes, unless it reads as true, false or null."""


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


def save_as_script(session: RecordedSession) -> SavedScript:
    """The run as a scene and a script; ``simulate --script`` and ``poke_client --reset`` fly it again.

    Raises InputError for events that can't be decoded or taken, which is what an incomplete record of the run gives.
    """
    scenario = session_scenario(session)
    writer = _Writer(scenario)
    again = Resimulation(scenario, session.lines, writer, mesh_finder(session), session.node_name)
    writer.follow(again)
    if session.events:
        again.advance(max(decode_event(line, number)[0] for number, line in enumerate(session.lines, 1)) + 1)
    if writer.lines != session.lines:
        raise InputError("events", f"{len(session.lines)} lines", "all lines of the log since the start or a reset")
    entries, notes = in_order(writer.entries)
    scene = kept_scene(scenario)
    head = "# Done by hand. Again: rigid_proto simulate SCENE --script THIS, or poke_client THIS --reset\n"
    script = head + "".join(f"- {flow(entry.content(time_ns))}\n" for time_ns, entry in entries)
    try:
        OfflineRun(scenario, expand_script([entry.content(time_ns) for time_ns, entry in entries]))
    except InputError as error:
        # What the first integrator can't carry is refused at the start, though a later one carried it.
        notes.append(f"the scene as it begins refuses the script: {error}")
    mesh = scenario.values["mesh"]
    if scenario.body_mesh is not None and scenario.body_mesh.mesh.path == mesh:
        notes.append(f"the scene names the mesh file {mesh}: keep it with the scene")
    return SavedScript(scene, script, len(entries), entries[-1][0] if entries else 0, notes)


def kept_scene(scenario: Scenario) -> str:
    """A scenario as a parameter file of what differs from the defaults, without what belongs to the running node."""
    values = {
        name: value
        for name, value in scenario.values.items()
        if name not in NOT_OF_THE_MOTION and (name not in PARAMETERS or value != PARAMETERS[name].default)
    }
    values["mesh"] = scenario.values["mesh"]
    return scene_text(values, scenario.body_mesh.mesh.sha256 if scenario.body_mesh else "")


def flow(value: object) -> str:
    """Plain data as YAML on one line; doubles keep all their digits."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(flow(item) for item in value) + "]"
    if isinstance(value, str) and _WORD.match(value) and value != "null" and isinstance(scalar(value), str):
        return value
    return yaml_double(value) if isinstance(value, float) else yaml_value(value)


class _Writer(Observer):
    """Turns what acts on a body computed anew into script entries.

    lines: the log's lines as they come out again. entries: (time_ns, entry) in the order of acting.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.lines: list[str] = []
        self.entries: list[tuple[int, Entry]] = []
        self._first = self._last = scenario
        self._again: Resimulation | None = None
        self._applied: tuple[WrenchCommand, Load, Body] | None = None

    def follow(self, again: Resimulation) -> None:
        """The simulation that this writes of."""
        self._again = again

    def applied(self, time_ns: int, command: WrenchCommand, load: Load, body: Body) -> None:
        """A wrench or poke takes effect; its line follows."""
        self._applied = command, load, body

    def event(self, time_ns: int, line: str) -> None:
        """An event has acted."""
        self.lines.append(line)
        _, kind, content = decode_event(line, len(self.lines))
        if kind in ("wrench", "poke"):
            self._add(time_ns, _load_entry(*self._applied))
        elif kind in ("set", "inertia"):
            self._change(time_ns, content if kind == "set" else {})
        elif kind == "string_attach":
            self._add(time_ns, Entry(kind, {"string": {"attach": self._attach(content)}}))
        elif kind == "string_target":
            self._add(time_ns, Entry(kind, {"string": {"target": content["point"]}}))
        elif kind == "string_release":
            self._add(time_ns, Entry(kind, {"string": "release"}))
        elif kind == "clear_wrench":
            self._add(time_ns, Entry(kind, {"service": "clear_wrench"}))

    def _add(self, time_ns: int, entry: Entry) -> None:
        self.entries.append((time_ns, entry))

    def _attach(self, content: dict) -> list[float]:
        """The point in mesh coordinates, not yet taken onto the surface: that happens again."""
        simulation = self._again.simulation
        command = TieString(content["axes"], tuple(content["point"]))
        return [float(x) for x in mesh_point(command, simulation.setup.body, simulation.state)]

    def _change(self, time_ns: int, content: dict) -> None:
        before, after = self._last, self._again.scenario
        self._last = after
        changes = {name: value for name, value in content.items() if name not in NOT_OF_THE_MOTION}
        if not content:
            changes = {name: value for name, value in after.values.items() if value != before.values.get(name)}
        if not changes:
            # It cut the motion's steps all the same.
            changes = {"poke_duration": after.values["poke_duration"]}
        try:
            self._first.with_changes(changes)
        except InputError:
            # Scripts are checked against the scene they begin with: this one needs what was changed before it.
            earlier = {
                name: value
                for name, value in after.values.items()
                if value != self._first.values.get(name)
                and parameter_named(name).changes != READ_ONLY
                and name not in NOT_OF_THE_MOTION
            }
            changes = {**earlier, **changes}
        self._add(time_ns, Entry("set", {"set": changes}, (before.setup, after.setup)))


def _load_entry(command: WrenchCommand, load: Load, body: Body) -> Entry:
    frame = command.frame
    if frame.axes == "normal" and frame.impulse:
        # A script's push is a force: the settled normal impulse, in body axes, is the same numbers.
        frame = Frame("body", ("point", load.mesh_point), impulse=True)
        force: list[float] = [float(f) for f in load.own_force(body)]
    else:
        force = [float(f) for f in command.force]
    entry: dict = {"at": _at(frame.point)}
    if frame.axes == "normal":
        entry["push"] = force[0]
    elif frame.impulse:
        entry |= _pair("impulse", "angular_impulse", force, command.torque)
    else:
        entry |= _pair("force", "torque", force, command.torque)
    if frame.axes == "body":
        entry["axes"] = "body"
    if frame.duration_s is not None:
        entry["duration"] = frame.duration_s
    return Entry("wrench", {"wrench": entry}) if command.held else Entry("poke", entry)


def _pair(force_word: str, torque_word: str, force, torque) -> dict:
    pair = {force_word: list(force), torque_word: [float(x) for x in torque]}
    if not any(torque):
        del pair[torque_word]
    elif not any(force):
        del pair[force_word]
    return pair


def _at(point: tuple) -> object:
    word, *values = point
    if word in ("com", "origin"):
        return word
    if word == "contact":
        return values[0]
    if word == "vertex":
        return {"vertex": values[0]}
    if word == "point":
        return {"point": list(values[0])}
    return {"ray": {"origin": list(values[0]), "direction": list(values[1])}}
