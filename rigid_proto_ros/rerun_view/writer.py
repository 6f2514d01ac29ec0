# SPDX-License-Identifier: MIT
"""One run as Rerun logs it: the picture, the exact states, and what happened as text and as a timeline."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from ..picture import style
from ..picture.picture import Picture, skewed
from ..session.mailbox import Block, Note
from ..simulation.observer import (
    AccuracyFloor,
    BodyChanged,
    BodySnapshot,
    Effort,
    GhostChanged,
    LoadBegan,
    LoadEnded,
    Logged,
    MeshChanged,
    Refused,
    SceneChanged,
    Started,
    StatusChanged,
    StringChanged,
)
from . import entities as e
from .backend import RerunBackend, scalar_columns, time_columns
from .layout import Finished, Subject
from .streams import LiveStream, Stream

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""

LIVE_NUMBERS_MAX = 4_000_000
"""[bytes] of a mesh's exact numbers that viewers are sent too; larger ones would push the flight out of
the live server.
"""

VIEW_PER_REACH = 1.7
"""A body that turns about an end needs more room than one that turns about its middle, where this would be 2."""


ALONG_WITH_STATES = (
    *(LoadBegan, LoadEnded, StringChanged, SceneChanged),
    *(StatusChanged, AccuracyFloor, Effort, Logged, Refused),
)
"""Events that are told at their times, without regard to the states around them."""

BETWEEN_STATES = (Started, MeshChanged, BodyChanged, GhostChanged)
"""Events that change what the states after them mean."""


class SceneWriter:
    """What one run has shown so far, and the columns that show what comes next.

    ``streams`` receive everything; ``attach`` brings a new one up to date. Not for several threads.
    """

    def __init__(self) -> None:
        self.streams: list[Stream] = []
        self._backend = RerunBackend()
        self._picture = Picture(self._backend)
        self._scene = self._scene_in_force = ""
        self._mesh: tuple[np.ndarray | None, np.ndarray | None, str] = None, None, ""
        self._view_size = 0.0
        self._rows_since_repeat = 0
        self.restart()

    # What holds for a whole run

    def restart(self) -> None:
        """A new run: simulated time starts again at 0; the parameters in force, mesh and body stay."""
        self._scene = self._scene_in_force or self._scene
        self.moved = False
        self._last_time_ns = 0
        self._picture.restart()
        self._backend.plotted = {}
        self._between = BetweenStates()
        self._commanded = False
        if self._picture.body is not None:
            self._tell_body(0, time.time_ns(), self._picture.body)
            self._loads_changed(0, time.time_ns())
        self._effort_before: Effort | None = None
        self._efforts: list[tuple[int, int, float, float]] = []

    def attach(self, stream: Stream) -> None:
        """Send a stream what holds at all times, and the body as it is now; then it gets whatever follows."""
        self.streams.append(stream)
        self._send_scene([stream])
        self.catch_up(stream)

    def catch_up(self, stream: Stream) -> None:
        """Tell a stream that knows nothing yet, or that has missed something, how things are now."""
        stream.missed = False
        self._backend.streams = [stream]
        self._at(self._last_time_ns, time.time_ns())
        self._picture.describe(self._backend)
        self._between.repeat(self._last_time_ns, time.time_ns(), stream.send)
        if self._picture.body is not None:
            self._send_view()
            self._backend.send(e.SESSION_BODY, _numbers(self._picture.body))
            stream.send_layout(self._subject())

    def finish(self, stream: Stream) -> None:
        """Give a run that is complete the layout for what it holds."""
        if self._picture.body is None:
            return
        finished = Finished(1e-9 * self._last_time_ns, self._backend.plotted, self._commanded)
        stream.send_layout(self._subject(), finished)

    # What happens in it

    def write(self, block: Block, on_note: Callable[[Note], None]) -> None:
        """Send a block; notes that aren't about the scene (a reset, a stream that comes or goes) go to ``on_note``."""
        sent = 0
        for note in block.notes:
            event = note.event
            time_ns = getattr(event, "time_ns", 0)
            self._note_time(time_ns)
            if isinstance(event, ALONG_WITH_STATES):
                self._tell(event, note.wall_ns)
                continue
            self._write_upto(block, sent, note.after_rows)
            sent = note.after_rows
            self._backend.streams = self._listening()
            self._at(time_ns, note.wall_ns)
            if isinstance(event, BETWEEN_STATES):
                self._change(event, note.wall_ns)
            else:
                on_note(note)
        self._write_upto(block, sent, block.count)
        self._rows_since_repeat += block.count
        if self._rows_since_repeat >= REPEATED_ROWS:
            # The live server drops the oldest, so what was said long ago is lost on viewers that come late.
            self._rows_since_repeat = 0
            for stream in self._listening():
                if isinstance(stream, LiveStream):
                    self.catch_up(stream)

    def _write_upto(self, block: Block, begin: int, end: int) -> None:
        """Exact states and picture of rows begin..end, which all belong to the present body, and what happened."""
        # What happened comes first: a file that is cut behind it has every line that acted on its states.
        self._between.send(self._send)
        streams = self._backend.streams = self._listening()
        for ghost in (False, True):
            chosen = block.ghosts[begin:end] == ghost
            if not chosen.any():
                continue
            times_ns, walls, rows = (own[begin:end][chosen] for own in (block.times, block.walls, block.rows))
            self._note_time(int(times_ns[-1]))
            self._backend.clock(times_ns, walls)
            if ghost:
                self._picture.draw_ghost(times_ns, rows)
                continue
            self._backend.begin(times_ns)
            self._backend.send(e.STATE, scalar_columns(rows))
            self._picture.draw(times_ns, rows)
        if self._efforts:
            times, wall_times, *rates = zip(*self._efforts, strict=True)
            self._backend.clock(np.array(times), np.array(wall_times))
            self._backend.begin(np.array(times))
            self._backend.scalars(style.EFFORT, np.column_stack(rates))
            self._efforts.clear()
        if begin < end and self._picture.body is not None:
            for stream in streams:
                stream.send_layout(self._subject())

    def _at(self, time_ns: int, wall_ns: int) -> None:
        """What follows is of this moment."""
        self._backend.clock(np.array([time_ns]), np.array([wall_ns]))
        self._backend.begin(np.array([time_ns]))

    def _note_time(self, time_ns: int) -> None:
        self.moved = self.moved or time_ns > 0
        self._last_time_ns = max(self._last_time_ns, time_ns)

    def _listening(self) -> list[Stream]:
        """The streams that take what they are sent; the others must be told later how things are then."""
        for stream in self.streams:
            stream.missed = stream.missed or stream.behind
        return [stream for stream in self.streams if not stream.behind]

    def _send(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self._listening():
            stream.send(entity, times, columns)

    def _tell(self, event: Any, wall_ns: int) -> None:
        """What doesn't concern the states before it."""
        match event:
            case LoadBegan(time_ns=time_ns) | LoadEnded(time_ns=time_ns):
                self._picture.on(event)
                self._loads_changed(time_ns, wall_ns)
            case StringChanged():
                self._picture.on(event)
            case SceneChanged(time_ns, scene):
                self._change_scene(time_ns, wall_ns, scene)
            case StatusChanged(time_ns, track, value):
                self._between.state(time_ns, wall_ns, track, value)
            case AccuracyFloor(time_ns, floor):
                self._between.state(time_ns, wall_ns, "accuracy", floor)
            case Effort():
                self._add_effort(event, wall_ns)
            case Logged(time_ns, line):
                self._commanded = True
                self._between.line(e.EVENTS, time_ns, wall_ns, line)
                self._between.line(e.COMMAND_LOG, time_ns, wall_ns, readable(line))
            case Refused(time_ns, reason, message):
                self._commanded = True
                self._between.line(e.REFUSAL_LOG, time_ns, wall_ns, f"refused ({reason}): {message}", "WARN")

    def _loads_changed(self, time_ns: int, wall_ns: int) -> None:
        self._between.state(time_ns, wall_ns, "loads", " + ".join(self._picture.loads.kinds) or "none")

    def _change_scene(self, time_ns: int, wall_ns: int, scene: str) -> None:
        self._scene_in_force = scene
        if scene != self._scene:
            self._backend.streams = self._listening()
            self._at(time_ns, wall_ns)
            document = rr.TextDocument.columns(text=[scene], media_type=["text/plain"])
            self._backend.send(e.SCENE_IN_FORCE, document)

    def _add_effort(self, effort: Effort, wall_ns: int) -> None:
        """What the motion has cost up to now; plotted as rates since it was told before."""
        before, self._effort_before = self._effort_before, effort
        if before is not None and effort.time_ns > before.time_ns:
            seconds = 1e-9 * (effort.time_ns - before.time_ns)
            steps, evaluations = effort.steps - before.steps, effort.force_evaluations - before.force_evaluations
            self._efforts.append((effort.time_ns, wall_ns, steps / seconds, evaluations / seconds))

    def _change(self, event: Any, wall_ns: int) -> None:
        """What changes the meaning of states."""
        first_body, first_ghost = self._picture.body is None, self._picture.ghost is None
        self._picture.on(event)
        match event:
            case Started(scene, vertices, triangles, mesh_sha256):
                self._scene = scene
                self._mesh = vertices, triangles, mesh_sha256
                self._send_scene(self._listening())
            case MeshChanged(_, vertices, triangles, mesh_sha256):
                self._mesh = vertices, triangles, mesh_sha256
            case BodyChanged(time_ns, body):
                self._fit_view()
                self._backend.send(e.SESSION_BODY, _numbers(body))
                self._tell_body(time_ns, wall_ns, body)
                if first_body:
                    self._loads_changed(time_ns, wall_ns)
            case GhostChanged() if first_ghost:
                self._view_size = 0.0
                self._fit_view()

    def _send_scene(self, streams: list[Stream]) -> None:
        """What holds for a run: the scene as text, the mesh's exact numbers."""
        if not self._scene:
            return
        vertices, triangles, sha256 = self._mesh
        for stream in streams:
            stream.log_static(style.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
            stream.log_static(style.POINSOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
            stream.log_static(e.SCENE, rr.TextDocument(self._scene, media_type="text/plain"))
            if vertices is None or triangles is None:
                continue
            if isinstance(stream, LiveStream) and vertices.nbytes + triangles.nbytes > LIVE_NUMBERS_MAX:
                continue
            numbers = rr.AnyValues(
                sha256=sha256,
                vertices=np.ascontiguousarray(vertices, dtype=np.float64).ravel(),
                triangles=np.ascontiguousarray(triangles, dtype=np.int64).ravel(),
            )
            stream.log_static(e.SESSION_MESH, numbers)

    def _tell_body(self, time_ns: int, wall_ns: int, body: BodySnapshot) -> None:
        integrator = body.integrator + ("" if body.gyroscopic else ", not gyroscopic")
        self._between.state(time_ns, wall_ns, "inertia_model", body.inertia_model)
        self._between.state(time_ns, wall_ns, "integrator", integrator)

    def _fit_view(self) -> None:
        """Growing is seen as such, until the body no longer suits the views: they keep this length [m] in sight around
        the COM, wherever it lies.
        """
        shape = self._picture.shape
        if shape is None:
            return
        reach = 0.0 if shape.tip is None else float(np.linalg.norm(shape.tip))
        if self._subject().boxed and shape.centre is not None and shape.half_sizes is not None:
            reach = float(np.linalg.norm(np.abs(shape.centre) + shape.half_sizes))
        size = max(shape.size, VIEW_PER_REACH * reach)
        if not self._view_size or not 0.5 <= size / self._view_size <= 2.0:
            self._view_size = size
            self._send_view()

    def _send_view(self) -> None:
        self._backend.send(e.VIEW, rr.Transform3D.columns(scale=[[self._view_size] * 3]))

    def _subject(self) -> Subject:
        """What the flight is about."""
        picture = self._picture
        body, tied = picture.body, picture.string.was_tied
        if body is None:
            return Subject()
        return Subject(
            ghost=picture.ghost is not None,
            falls=bool(np.any(body.gravity)) and not tied,
            tied=tied,
            dropped_term=not body.gyroscopic,
            skewed=skewed(np.asarray(body.inertia)),
        )


def _numbers(body: BodySnapshot) -> list[Any]:
    """The body as columns of one row."""
    numbers: dict[str, Any] = {
        "mass": [float(body.mass)],
        "center_of_mass": np.asarray(body.center_of_mass, dtype=np.float64),
        "inertia": np.asarray(body.inertia, dtype=np.float64).ravel(),
        "scale": np.asarray(body.scale, dtype=np.float64),
        "gravity": np.asarray(body.gravity, dtype=np.float64),
        "inertia_model": [body.inertia_model],
        "integrator": [body.integrator],
        "gyroscopic": [bool(body.gyroscopic)],
    }
    return [c for name, v in numbers.items() for c in rr.AnyValues.columns(**{name: v}).partition([len(v)])]


# Beside the states

Send = Callable[[str, list[Any], Any], None]
"""Sends (entity, time columns, component columns) to whoever is to get them."""


class BetweenStates:
    """What happens between states, by entity: collected, and sent together."""

    def __init__(self) -> None:
        self._rows: dict[str, list[tuple[int, int, str, str]]] = {}
        self._states: dict[str, str] = {}

    def line(self, entity: str, time_ns: int, wall_ns: int, text: str, level: str = "INFO") -> None:
        """A line of text."""
        self._rows.setdefault(entity, []).append((time_ns, wall_ns, text, level))

    def state(self, time_ns: int, wall_ns: int, track: str, value: str) -> None:
        """From ``time_ns`` on the track has this value; what is undone at the same instant never shows."""
        entity = f"{e.STATUS}/{track}"
        changes = self._rows.setdefault(entity, [])
        if changes and changes[-1][0] == time_ns:
            changes.pop()
        before = changes[-1][2] if changes else self._states.get(entity)
        if value != before:
            changes.append((time_ns, wall_ns, value, ""))

    def send(self, send: Send) -> None:
        """Send what was collected so far."""
        for entity, rows in self._rows.items():
            if not rows:
                continue
            times_ns, walls, texts, levels = zip(*rows, strict=True)
            columns = rr.TextLog.columns(text=texts, level=levels)
            if entity.startswith(e.STATUS):
                self._states[entity] = texts[-1]
                columns = rr.StateChange.columns(state=texts)
            send(entity, time_columns(np.array(times_ns), np.array(walls)), columns)
        self._rows.clear()

    def repeat(self, time_ns: int, wall_ns: int, send: Send) -> None:
        """Send the present states to a stream that knows none."""
        times = time_columns(np.array([time_ns]), np.array([wall_ns]))
        for entity, value in self._states.items():
            send(entity, times, rr.StateChange.columns(state=[value]))


def readable(line: str) -> str:
    """An event line for people: what it says, without its stamp, zero vectors and hash."""
    try:
        event = json.loads(line)
        kind, content = event["kind"], event.get("content", {})
    except (ValueError, KeyError, TypeError):
        return line
    if not isinstance(content, dict):
        return f"{kind} {content}"
    said = []
    for key, value in content.items():
        if key == "stamp_ns" or value in ("", None) or (isinstance(value, list) and not any(value)):
            continue
        said.append(_short(value) if key == "frame_id" else f"{key} {_short(value)}")
    return " ".join([str(kind), ", ".join(said)]).strip()


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return str(value)
