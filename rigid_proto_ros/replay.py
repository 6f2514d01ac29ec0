# SPDX-License-Identifier: MIT
"""A recorded session computed anew from its scene and its events, and compared with what was recorded."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from . import cdr
from .core.commands import Change, ClearWrench, Command, Rank, ReleaseString, WrenchCommand
from .core.errors import InputError
from .core.frames import parse_frame
from .core.observer import Observer
from .core.simulation import Simulation
from .mesh_io import Mesh, load_mesh
from .parameters import convert_all
from .poke_script import string_attach, string_target
from .recorded_session import RecordedSession
from .scenario import Scenario, check_inertia, make_scenario
from .scene_file import read_scene_text

_TOUCH_NO_MOTION = ("reset", "pause", "step")
"""Events that stand in the log and don't act on the body."""


@dataclass(frozen=True)
class Difference:
    """The first place where the recording and the new computation part."""

    time_ns: int
    what: str

    def __str__(self) -> str:
        return f"at {self.time_ns / 1e9:.9g} s: {self.what}"


def session_scenario(session: RecordedSession) -> Scenario:
    """The scenario that the session began with; the mesh by name if its content is the same, else the recorded one."""
    if not session.scene:
        raise InputError("session", "no scene", "a recording that holds its scene")
    values = read_scene_text(session.scene, "the recorded scene").values
    if not session.mesh_sha256:
        return make_scenario(values)
    name = str(values.get("mesh", ""))
    try:
        mesh = load_mesh(name)
    except InputError:
        mesh = None
    if mesh is None or mesh.sha256 != session.mesh_sha256:
        mesh = Mesh(name, name, session.vertices, session.triangles, None, session.mesh_sha256)
    return make_scenario(values, mesh)


class _Lines(Observer):
    def __init__(self) -> None:
        self.lines: list[str] = []

    def event(self, time_ns: int, line: str) -> None:
        self.lines.append(line)


class Resimulation:
    """A session's simulation, its commands submitted; ``advance`` also writes the events that touch no motion."""

    def __init__(self, scenario: Scenario, event_lines: Sequence[str], observer: Observer | None = None) -> None:
        self.scenario = scenario
        self.simulation = Simulation(scenario.setup, observer)
        self._marks: list[tuple[int, str, dict]] = []
        for number, line in enumerate(event_lines, 1):
            time_ns, kind, content = _decoded(line, number)
            if kind in _TOUCH_NO_MOTION:
                self._marks.append((time_ns, kind, content))
            else:
                self.simulation.submit(self._command(kind, content, number), time_ns)

    def advance(self, until_ns: int) -> np.ndarray:
        """Carry the body to ``until_ns``; returns its state row."""
        while self._marks and self._marks[0][0] <= until_ns:
            time_ns, kind, content = self._marks.pop(0)
            self.simulation.advance(max(time_ns, self.simulation.time_ns))
            self.simulation.log(kind, content)
        return self.simulation.advance(until_ns).row

    def _command(self, kind: str, content: dict, number: int) -> Command:
        try:
            if kind in ("wrench", "poke"):
                stamp_ns, frame_id = content["stamp_ns"], content["frame_id"]
                force, torque = tuple(content["force"]), tuple(content["torque"])
                frame = parse_frame(frame_id, self.scenario.setup.contacts, *self._frame_names())
                message = cdr.wrench_stamped(stamp_ns, frame_id, force, torque)
                return WrenchCommand(kind == "wrench", frame, force, torque, stamp_ns, frame_id, message)
            if kind == "set":
                convert_all(content)
                return Change(content, lambda: self._change(content))
            if kind == "clear_wrench":
                return ClearWrench()
            if kind == "string_release":
                return ReleaseString()
            if kind in ("string_target", "string_attach"):
                names = self._frame_names()
                read = string_target if kind == "string_target" else string_attach
                names = names[:1] if kind == "string_target" else names
                return read(content["stamp_ns"], content["frame_id"], content["point"], *names)
            if kind == "inertia":
                return Change(
                    content, lambda: self._take_on(check_inertia(self.scenario, content)), b"", kind, Rank.INERTIA
                )
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"event {number}", content, "the content of a recorded event") from None
        raise InputError(
            f"event {number}, kind",
            kind,
            "wrench, poke, string_target, string_attach, string_release, inertia, set, clear_wrench, reset, pause, step",
        )

    def _frame_names(self) -> tuple[str, str]:
        values = self.scenario.values
        return values["world_frame"], values["body_frame"] or "rigid_body"

    def _change(self, changes: dict):
        return self._take_on(self.scenario.with_changes(changes))

    def _take_on(self, scenario: Scenario):
        self.scenario = scenario
        return scenario.setup


def _decoded(line: str, number: int) -> tuple[int, str, dict]:
    try:
        event = json.loads(line)
        time_ns, kind, content = event["time_ns"], event["kind"], event["content"]
        if isinstance(time_ns, int) and time_ns >= 0 and isinstance(kind, str) and isinstance(content, dict):
            return time_ns, kind, content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError(f"event {number}", line[:80], "a JSON line with time_ns, kind and content")


def verify(session: RecordedSession, progress: Callable[[float], None] = lambda done: None) -> Difference | None:
    """Compute the session anew and compare its chain of events and every state, bit for bit.

    Returns the first difference, or None. Raises InputError for a session that can't be decoded.
    """
    recorded = [line for _, line in session.events]
    lines = _Lines()
    again = Resimulation(session_scenario(session), recorded, lines)
    order = np.argsort(session.times, kind="stable")
    for count, k in enumerate(order):
        time_ns = int(session.times[k])
        row = again.advance(time_ns)
        if again.simulation.failure:
            return Difference(time_ns, again.simulation.failure)
        difference = _line_difference(recorded, lines.lines)
        if difference is not None:
            return difference
        if row.tobytes() != session.rows[k].tobytes():
            worst = int(np.argmax(np.abs(row - session.rows[k])))
            return Difference(time_ns, f"state differs: {session.rows[k][worst]!r} recorded, {row[worst]!r} computed")
        if count % 1000 == 0:
            progress(count / len(order))
    if recorded:
        again.advance(max(again.simulation.time_ns, _decoded(recorded[-1], len(recorded))[0] + 1))
    difference = _line_difference(recorded, lines.lines)
    if difference is None and len(lines.lines) < len(recorded):
        missing = len(lines.lines)
        difference = Difference(_decoded(recorded[missing], missing + 1)[0], f"command {missing + 1} did not act")
    return difference


def _line_difference(recorded: Sequence[str], computed: Sequence[str]) -> Difference | None:
    for number, (ours, theirs) in enumerate(zip(computed, recorded, strict=False), 1):
        if ours != theirs:
            return Difference(
                _decoded(theirs, number)[0], f"command {number} differs: {theirs} recorded, {ours} computed"
            )
    if len(computed) > len(recorded):
        line = computed[len(recorded)]
        return Difference(_decoded(line, len(recorded) + 1)[0], f"a command that wasn't recorded: {line}")
    return None
