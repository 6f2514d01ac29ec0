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
from ..picture.plots import plot_range, with_two_ticks
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
from .streams import Stream

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""

LIVE_NUMBERS_MAX = 4_000_000
"""[bytes] of a mesh's exact numbers that viewers are sent too; larger ones would push the flight out of
the live server.
"""

VIEW_PER_REACH = 1.7
"""A body that turns about an end needs more room than one that turns about its middle, where this would be 2."""

LEAST_RANGES = {style.ANGULAR_MOMENTUM_ANGLE: 1.0, style.GHOST_ANGLE: 1.0}
"""[°] That the axis of an angle spans at least: rounding doesn't fill the plot."""


class SceneWriter:
    """What one run has shown so far, and the columns that show what comes next.

    ``streams`` receive everything; ``attach`` brings a new one up to date. Not for several threads.
    """

    def __init__(self, initial_view: str) -> None:
        self.streams: list[Stream] = []
        self._initial_view = initial_view
        self._skip_live = False
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
        self._text_log = TextLog()
        self._state_timeline = StateTimeline()
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
        self._state_timeline.repeat(self._last_time_ns, time.time_ns(), stream.send)
        if self._picture.body is not None:
            self._send_view()
            self._backend.send(e.SESSION_BODY, _numbers(self._picture.body))
            stream.send_layout(self._initial_view, self._subject())

    def finish(self, stream: Stream) -> None:
        """Give a run that is complete the layout for what it holds."""
        if self._picture.body is None:
            return
        axes = {}
        for name, found in self._backend.plotted.items():
            # No curve lies on the frame's edge, and two ticks have numbers.
            suited = plot_range(np.array(found), LEAST_RANGES.get(name, 0.0))
            axes[name] = with_two_ticks(*suited.bounds)
        finished = Finished(1e-9 * self._last_time_ns, axes, self._text_log.used)
        stream.send_layout(self._initial_view, self._subject(), finished)

    # What happens in it

    def write(self, block: Block, on_note: Callable[[Note], None], skip_live: bool = False) -> None:
        """Send a block; notes that aren't about the scene (a reset, a stream that comes or goes) go to ``on_note``.

        With ``skip_live`` the states go to files alone: viewers miss some where the machine doesn't keep up.
        """
        self._skip_live = skip_live
        sent = 0
        for note in block.notes:
            time_ns = getattr(note.event, "time_ns", 0)
            self._note_time(time_ns)
            if self._show_along_with_rows(note):
                continue
            self._write_upto(block, sent, note.after_rows)
            sent = note.after_rows
            self._backend.streams = self._listening()
            self._at(time_ns, note.wall_ns)
            if not self._show_between_rows(note):
                on_note(note)
        self._write_upto(block, sent, block.count)
        self._rows_since_repeat += block.count
        if self._rows_since_repeat >= REPEATED_ROWS:
            # The live server drops the oldest, so what was said long ago is lost on viewers that come late.
            self._rows_since_repeat = 0
            for stream in self._listening():
                if stream.may_skip:
                    self.catch_up(stream)

    def write_ghost(self, block: Block, begin: int, end: int) -> None:
        """Send states begin..end of the ghost, after the body's of the same times."""
        self._backend.streams = self._row_streams()
        self._backend.clock(block.times[begin:end], block.walls[begin:end])
        self._picture.draw_ghost(block.times[begin:end], block.rows[begin:end])

    def _write_upto(self, block: Block, begin: int, end: int) -> None:
        """Exact states and picture of rows begin..end, which all belong to the present body, and what happened."""
        # Lines come first: a file that is cut between them and the states has every line that acted on its states.
        self._text_log.send(self._send)
        if begin < end:
            times_ns, walls, rows = block.times[begin:end], block.walls[begin:end], block.rows[begin:end]
            self._note_time(int(times_ns[-1]))
            self._backend.streams = self._row_streams()
            self._backend.clock(times_ns, walls)
            self._backend.begin(times_ns)
            self._backend.send(e.STATE, scalar_columns(rows))
            self._picture.draw(times_ns, rows)
        streams = self._backend.streams = self._listening()
        if self._efforts:
            times, wall_times, *rates = zip(*self._efforts, strict=True)
            self._backend.clock(np.array(times), np.array(wall_times))
            self._backend.begin(np.array(times))
            self._backend.scalars(style.EFFORT, np.column_stack(rates))
            self._efforts.clear()
        self._state_timeline.send(self._send)
        if begin < end and self._picture.body is not None:
            for stream in streams:
                stream.send_layout(self._initial_view, self._subject())

    def _at(self, time_ns: int, wall_ns: int) -> None:
        """What follows is of this moment."""
        self._backend.clock(np.array([time_ns]), np.array([wall_ns]))
        self._backend.begin(np.array([time_ns]))

    def _note_time(self, time_ns: int) -> None:
        self.moved = self.moved or time_ns > 0
        self._last_time_ns = max(self._last_time_ns, time_ns)

    def _row_streams(self) -> list[Stream]:
        return [s for s in self._listening() if not (self._skip_live and s.may_skip)]

    def _listening(self) -> list[Stream]:
        """The streams that take what they are sent; the others must be told later how things are then."""
        for stream in self.streams:
            stream.missed = stream.missed or stream.behind
        return [stream for stream in self.streams if not stream.behind]

    def _send(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self._listening():
            stream.send(entity, times, columns)

    def _show_along_with_rows(self, note: Note) -> bool:
        """What doesn't concern the rows before it; whether this is such an event."""
        wall_ns = note.wall_ns
        match note.event:
            case LoadBegan(time_ns, load_id, load):
                self._picture.load_began(time_ns, load_id, load)
                self._loads_changed(time_ns, wall_ns)
            case LoadEnded(time_ns, load_id):
                self._picture.load_ended(time_ns, load_id)
                self._loads_changed(time_ns, wall_ns)
            case StringChanged(time_ns, string):
                self._picture.set_string(time_ns, string)
            case SceneChanged(time_ns, scene):
                self._change_scene(time_ns, wall_ns, scene)
            case StatusChanged(time_ns, track, value):
                self._state_timeline.change(time_ns, wall_ns, track, value)
            case AccuracyFloor(time_ns, floor):
                self._state_timeline.change(time_ns, wall_ns, "accuracy", floor)
            case Effort():
                self._add_effort(note.event, wall_ns)
            case Logged(time_ns, line):
                self._text_log.event(time_ns, wall_ns, line)
            case Refused(time_ns, reason, message):
                self._text_log.refusal(time_ns, wall_ns, reason, message)
            case _:
                return False
        return True

    def _loads_changed(self, time_ns: int, wall_ns: int) -> None:
        self._state_timeline.change(time_ns, wall_ns, "loads", " + ".join(self._picture.loads.kinds) or "none")

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

    def _show_between_rows(self, note: Note) -> bool:
        """What changes the meaning of rows; whether this is such an event."""
        match note.event:
            case Started(scene, vertices, triangles, mesh_sha256):
                self._scene = scene
                self._mesh = vertices, triangles, mesh_sha256
                self._picture.set_mesh(0, vertices, triangles)
                self._send_scene(self._listening())
            case MeshChanged(time_ns, vertices, triangles, mesh_sha256):
                self._mesh = vertices, triangles, mesh_sha256
                self._picture.set_mesh(time_ns, vertices, triangles)
            case BodyChanged(time_ns, body):
                self._change_body(time_ns, note.wall_ns, body)
            case GhostChanged(time_ns, body):
                self._change_ghost(time_ns, body)
            case _:
                return False
        return True

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
            if stream.may_skip and vertices.nbytes + triangles.nbytes > LIVE_NUMBERS_MAX:
                continue
            numbers = rr.AnyValues(
                sha256=sha256,
                vertices=np.ascontiguousarray(vertices, dtype=np.float64).ravel(),
                triangles=np.ascontiguousarray(triangles, dtype=np.int64).ravel(),
            )
            stream.log_static(e.SESSION_MESH, numbers)

    def _change_body(self, time_ns: int, wall_ns: int, body: BodySnapshot) -> None:
        first = self._picture.body is None
        self._picture.set_body(time_ns, body)
        self._fit_view()
        self._backend.send(e.SESSION_BODY, _numbers(body))
        tracks = {
            "inertia_model": body.inertia_model,
            "integrator": body.integrator + ("" if body.gyroscopic else ", not gyroscopic"),
        }
        if first:
            tracks["loads"] = "none"
        for track, value in tracks.items():
            self._state_timeline.change(time_ns, wall_ns, track, value)

    def _change_ghost(self, time_ns: int, body: BodySnapshot) -> None:
        first = self._picture.ghost is None
        self._picture.set_ghost(time_ns, body)
        if first:
            self._view_size = 0.0
            self._fit_view()

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


class StateTimeline:
    """Collects changes and sends them together; what is undone at the same instant never shows."""

    def __init__(self) -> None:
        self._sent: dict[str, str] = {}
        self._changes: dict[str, list[tuple[int, int, str]]] = {}

    def change(self, time_ns: int, wall_ns: int, track: str, value: str) -> None:
        """From ``time_ns`` on the track has this value."""
        changes = self._changes.setdefault(track, [])
        if changes and changes[-1][0] == time_ns:
            changes.pop()
        before = changes[-1][2] if changes else self._sent.get(track)
        if value != before:
            changes.append((time_ns, wall_ns, value))

    def send(self, send: Send) -> None:
        """Send the changes collected so far."""
        for track, changes in self._changes.items():
            if changes:
                times_ns, walls, values = zip(*changes, strict=True)
                columns = rr.StateChange.columns(state=list(values))
                send(f"{e.STATUS}/{track}", time_columns(np.array(times_ns), np.array(walls)), columns)
                self._sent[track] = values[-1]
        self._changes.clear()

    def repeat(self, time_ns: int, wall_ns: int, send: Send) -> None:
        """Send the present values to a stream that knows none."""
        times = time_columns(np.array([time_ns]), np.array([wall_ns]))
        for track, value in self._sent.items():
            send(f"{e.STATUS}/{track}", times, rr.StateChange.columns(state=[value]))


class TextLog:
    """Collects lines of text and sends them together."""

    def __init__(self) -> None:
        self._lines: dict[str, list[tuple[int, int, str, str]]] = {}
        self.used = False
        """Whether there was any."""

    def event(self, time_ns: int, wall_ns: int, line: str) -> None:
        """A line of the event log: exactly as it is, and readable."""
        self._add(e.EVENTS, time_ns, wall_ns, line, "INFO")
        self._add(e.COMMAND_LOG, time_ns, wall_ns, readable(line), "INFO")

    def refusal(self, time_ns: int, wall_ns: int, reason: str, message: str) -> None:
        """A command that was refused."""
        self._add(e.REFUSAL_LOG, time_ns, wall_ns, f"refused ({reason}): {message}", "WARN")

    def _add(self, entity: str, *line: Any) -> None:
        self._lines.setdefault(entity, []).append(line)
        self.used = True

    def send(self, send: Send) -> None:
        """Send the lines collected so far."""
        for entity, lines in self._lines.items():
            times_ns, walls, texts, levels = zip(*lines, strict=True)
            columns = rr.TextLog.columns(text=texts, level=levels)
            send(entity, time_columns(np.array(times_ns), np.array(walls)), columns)
        self._lines.clear()


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
