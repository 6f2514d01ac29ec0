# SPDX-License-Identifier: MIT
"""Turns states and marks into logged columns: many rows a call, derived values computed over the batch at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from ..base.errors import InputError
from ..scene.scene_file import read_scene_text
from ..simulation.mailbox import Block, Mark
from ..simulation.observer import BodySnapshot
from . import appearance
from . import entities as e
from .arrows import ArrowScale
from .columns import Ticks, one_time, scalar_columns, time_columns
from .derived import Disturbances
from .ghost_picture import GhostPicture
from .inertia_shapes import skewed
from .layout import Subject
from .load_arrows import LoadArrows
from .motion_picture import MotionPicture, ShownBody
from .plots import Plots, Ranges
from .poinsot_picture import PoinsotPicture
from .run_log import StateTimeline, TextLog
from .statics import (
    Scene,
    drawn_mesh,
    hide_mesh,
    send_body,
    send_mesh,
    send_scene,
    send_styles,
    send_view,
)
from .streams import Stream
from .string_picture import StringPicture

PICTURE_RATE = 250
"""[1/s, simulated] of what is only looked at, plots and arrows: the states themselves are all logged, exactly."""

PICTURES_WAIT_NS = 700_000_000
"""Plots and pictures of a file go out at the first flush after this; a kill -9 loses a second of them at most."""

PICTURES_WAITING = 1000
"""As many of them go out at once."""

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""


class SceneWriter:
    """What one run has shown so far, and the columns that show what comes next.

    ``streams`` receive everything; ``attach`` brings a new one up to date. Not for several threads.
    """

    def __init__(self, initial_view: str) -> None:
        self.streams: list[Stream] = []
        self._initial_view = initial_view
        self._skip_live = False
        self._scene: Scene | None = None
        self._body: BodySnapshot | None = None
        self._ghost_body: BodySnapshot | None = None
        self._scene_in_force = ""
        self._rows_since_repeat = 0
        self._along_with_rows: dict[str, Callable[[Mark], None]] = {
            "load_began": self._load_began,
            "load_ended": self._load_ended,
            "string_changed": self._string_changed,
            "scene_changed": self._scene_changed,
            "status": self._status,
            "effort": self._effort,
            "event": self._event,
            "refused": self._refused,
        }
        self._between_rows: dict[str, Callable[[Mark], None]] = {
            "started": self._started,
            "mesh_changed": self._mesh_changed,
            "body_changed": self._body_changed,
            "ghost_began": self._ghost_began,
        }
        self.restart()

    # What holds for a whole run

    def restart(self) -> None:
        """A new run: simulated time starts again at 0; the parameters in force, mesh and body stay."""
        if self._scene is not None and self._scene_in_force:
            self._scene = self._scene.with_text(self._scene_in_force)
        self.moved = False
        self._last_time_ns = 0
        self._mesh_number = 0
        self._began_wall_ns = time.time_ns()
        self._ticks = Ticks(PICTURE_RATE)
        self._motion = MotionPicture()
        self._ranges = Ranges()
        self._plots = Plots(self._ranges)
        self._poinsot = PoinsotPicture()
        self._loads = LoadArrows()
        self._ghost = GhostPicture(self._ranges)
        self._text_log = TextLog()
        self._string = StringPicture(self._ranges)
        self._state_timeline = StateTimeline()
        self._disturbances = Disturbances()
        self._pictured: list[tuple[np.ndarray, ...]] = []
        self._view_size = 0.0
        self._send_body()

    def attach(self, stream: Stream) -> None:
        """Send a stream what holds at all times, and the body as it is now; then it gets whatever follows."""
        self.streams.append(stream)
        self.catch_up(stream)

    def catch_up(self, stream: Stream) -> None:
        """Tell a stream that knows nothing yet, or that has missed something, how things are now."""
        stream.missed = False
        self._send_scene(stream, self._last_time_ns, time.time_ns())
        if self._body is None:
            return
        self._send_styles(stream)
        if self._ghost_body is not None:
            self._send_ghost_mesh(stream)
        self._repeat(stream)

    def _repeat(self, stream: Stream) -> None:
        """What is only said when it changes."""
        now, wall = self._last_time_ns, time.time_ns()
        if self._body is not None:
            send_view(stream, now, wall, self._view_size)
            send_body(stream, now, wall, self._body, self._scene, self._mesh_number)
            self._poinsot.change_body(now, wall, self._body, stream.send)
        if self._ghost_body is not None:
            self._ghost.change(now, wall, self._ghost_body, stream.send)
        self._state_timeline.repeat(now, wall, stream.send)

    def _repeat_for_viewers(self, rows: int) -> None:
        """The live server drops the oldest, so what was said long ago is lost on viewers that come late."""
        self._rows_since_repeat += rows
        if self._rows_since_repeat < REPEATED_ROWS or self._body is None:
            return
        self._rows_since_repeat = 0
        for stream in self._listening():
            if stream.may_skip:
                self._repeat(stream)

    # What happens in it

    def write(self, block: Block, on_mark: Callable[[Mark], None], skip_live: bool = False) -> None:
        """Send a block; marks that aren't about the scene (a reset, a stream that comes or goes) go to ``on_mark``.

        With ``skip_live`` the states go to files alone: viewers miss some where the machine doesn't keep up.
        """
        self._skip_live = skip_live
        sent = shown = 0
        for mark in block.marks:
            self._show_loads(block, shown, mark.after_rows)
            shown = mark.after_rows
            self._note_time(mark.time_ns)
            handler = self._along_with_rows.get(mark.kind)
            if handler is not None:
                handler(mark)
                continue
            self._send_upto(block, sent, shown)
            self.send_pictures()
            sent = shown
            handler = self._between_rows.get(mark.kind)
            if handler is not None:
                handler(mark)
            else:
                on_mark(mark)
        self._show_loads(block, shown, block.count)
        self._send_upto(block, sent, block.count)
        self._repeat_for_viewers(block.count)

    def write_ghost(self, block: Block, begin: int, end: int) -> None:
        """Send states begin..end of the ghost, after the body's of the same times."""
        self._ghost.rows(block, begin, end, self._send_rows)

    def _show_loads(self, block: Block, begin: int, end: int) -> None:
        self._loads.rows(block, begin, end)
        self._string.rows(block, begin, end)

    def _note_time(self, time_ns: int) -> None:
        self.moved = self.moved or time_ns > 0
        self._last_time_ns = max(self._last_time_ns, time_ns)

    def _send_upto(self, block: Block, begin: int, end: int) -> None:
        self._write_rows(block, begin, end)
        self._loads.send(self._send)
        self._string.send(self._send)
        self._plots.send_effort(self._send)
        self._text_log.send(self._send)
        self._state_timeline.send(self._send)

    # Marks that don't concern the rows before them

    def _load_began(self, mark: Mark) -> None:
        self._loads.began(mark.time_ns, mark.wall_ns, *mark.content)
        self._loads_changed(mark)

    def _load_ended(self, mark: Mark) -> None:
        self._loads.ended(mark.time_ns, mark.wall_ns, *mark.content)
        self._loads_changed(mark)

    def _loads_changed(self, mark: Mark) -> None:
        kinds = self._loads.kinds_acting
        self._disturbances.load_changed(mark.after_rows, bool(kinds) or self._string.tied)
        self._track_changed(mark, "loads", " + ".join(kinds) or "none")

    def _string_changed(self, mark: Mark) -> None:
        (string,) = mark.content
        self._string.change(mark.time_ns, mark.wall_ns, string)
        self._disturbances.load_changed(mark.after_rows, bool(self._loads.kinds_acting) or string is not None)

    def _scene_changed(self, mark: Mark) -> None:
        (self._scene_in_force,) = mark.content
        if self._scene is None or self._scene_in_force != self._scene.text:
            document = rr.TextDocument.columns(text=[self._scene_in_force], media_type=["text/plain"])
            self._send(e.SCENE_IN_FORCE, one_time(mark.time_ns, mark.wall_ns), document)

    def _status(self, mark: Mark) -> None:
        self._track_changed(mark, *mark.content)

    def _effort(self, mark: Mark) -> None:
        self._plots.effort(mark.time_ns, mark.wall_ns, *mark.content)

    def _event(self, mark: Mark) -> None:
        self._text_log.event(mark.time_ns, mark.wall_ns, *mark.content)

    def _refused(self, mark: Mark) -> None:
        self._text_log.refusal(mark.time_ns, mark.wall_ns, *mark.content)

    def _track_changed(self, mark: Mark, track: str, value: str) -> None:
        self._state_timeline.change(mark.time_ns, mark.wall_ns, track, value)

    # Marks that change what rows mean

    def _started(self, mark: Mark) -> None:
        self._scene = Scene(*mark.content)
        for stream in self._listening():
            stream.mesh_number = None
            self._send_scene(stream, 0, self._began_wall_ns)
        self._send_body()

    def _mesh_changed(self, mark: Mark) -> None:
        self._scene = (self._scene or Scene("", None, None, "")).with_mesh(*mark.content)
        self._mesh_number += 1
        for stream in self._listening():
            self._send_scene(stream, mark.time_ns, mark.wall_ns)

    def _send_scene(self, stream: Stream, time_ns: int, wall_ns: int) -> None:
        """The scene with its mesh, or another mesh from ``time_ns`` on, unless the stream knows it."""
        known, stream.mesh_number = stream.mesh_number, self._mesh_number
        if self._scene is None or known == self._mesh_number:
            return
        if known is None:
            send_scene(stream, self._scene, self._mesh_number)
            return
        hide_mesh(stream, time_ns, wall_ns, known)
        hide_mesh(stream, 0, self._began_wall_ns, self._mesh_number)
        send_mesh(stream, self._scene, self._mesh_number)

    def _body_changed(self, mark: Mark) -> None:
        before, seen_before = self._size if self._body is not None else None, self._view_size
        (self._body,) = mark.content
        self._send_body()
        for stream in self._listening():
            if self._size != before:
                self._send_styles(stream)
            if self._view_size != seen_before:
                send_view(stream, mark.time_ns, mark.wall_ns, self._view_size)
            send_body(stream, mark.time_ns, mark.wall_ns, self._body, self._scene, self._mesh_number)
        self._poinsot.change_body(mark.time_ns, mark.wall_ns, self._body, self._send)
        self._plots.disturbed()
        if before is None:
            self._track_changed(mark, "loads", "none")
        self._track_changed(mark, "inertia_model", self._body.inertia_model)
        self._track_changed(
            mark, "integrator", self._body.integrator + ("" if self._body.gyroscopic else ", not gyroscopic")
        )

    def _send_body(self) -> None:
        if self._body is None:
            return
        self._size = self._scene.size(self._body) if self._scene is not None else 1.0
        self._tip = self._scene.farthest_point(self._body) if self._scene is not None else None
        self._loads.scale = ArrowScale.of(self._body.mass, self._size)
        self._string.size, self._string.gravity = self._size, self._body.gravity
        self._fit_view()

    def _fit_view(self) -> None:
        """Growing is seen as such, until the body no longer suits the views."""
        size = self._size
        if self._scene is not None and self._body is not None:
            size = self._scene.view_size(self._body, self._subject().boxed)
        if not self._view_size or not 0.5 <= size / self._view_size <= 2.0:
            self._view_size = size

    def _ghost_began(self, mark: Mark) -> None:
        first = self._ghost_body is None
        (self._ghost_body,) = mark.content
        if first and self._body is not None:
            self._view_size = 0.0
            self._fit_view()
        for stream in self._listening() if first else ():
            self._send_ghost_mesh(stream)
            if self._body is not None:
                self._send_styles(stream)
                send_view(stream, mark.time_ns, mark.wall_ns, self._view_size)
        self._ghost.change(mark.time_ns, mark.wall_ns, self._ghost_body, self._send)

    def _send_styles(self, stream: Stream) -> None:
        send_styles(stream, self._size)
        stream.send_layout(self._initial_view, self._subject())

    def _subject(self) -> Subject:
        """What the flight is about."""
        body = self._body
        tied = False
        if self._scene is not None and self._scene.text:
            try:
                tied = bool(read_scene_text(self._scene.text).values.get("string.attached"))
            except InputError:
                pass  # a scene of another program's, in a test or a recording: its flight is shown all the same
        falls = body is not None and bool(np.any(body.gravity)) and not tied
        dropped_term = body is not None and not body.gyroscopic
        is_skewed = body is not None and skewed(np.asarray(body.inertia))
        return Subject(self._ghost_body is not None, falls, tied, dropped_term, is_skewed)

    def fit_axes(self, stream: Stream) -> None:
        """Tell a stream that nobody watches yet how large its plotted values have been, and how long the run."""
        stream.layout.fit_axes(stream.recording, self._ranges.axes(), 1e-9 * self._last_time_ns)

    def _send_axis_ends(self, times: list[Any]) -> None:
        """Viewers of a flight that goes on fit axes to what is plotted: unseen points widen them. An axis given by the
        layout would undo, at each of its changes, whatever somebody has arranged.
        """
        viewers = [stream for stream in self._row_streams() if stream.may_skip]
        if viewers:
            for entity, ends in self._ranges.axes().items():
                for stream in viewers:
                    stream.send(e.axis_ends(entity), times, scalar_columns(np.array([ends])))

    def _send_ghost_mesh(self, stream: Stream) -> None:
        if self._scene is not None and self._scene.surface is not None and not stream.knows_ghost:
            stream.knows_ghost = True
            stream.log_static(e.GHOST_MESH, drawn_mesh(self._scene.surface, (*appearance.GHOST_COLOUR, e.GHOST_ALPHA)))

    # Rows

    def _write_rows(self, block: Block, begin: int, end: int) -> None:
        """Pose, exact state, plots and pictures of rows begin..end, which all belong to the present body."""
        disturbed = self._disturbances.rows(begin, end)
        if begin == end:
            return
        times_ns, walls, rows = block.times[begin:end], block.walls[begin:end], block.rows[begin:end]
        self._note_time(int(times_ns[-1]))
        if self._ghost_body is not None:
            self._ghost.body_rows(times_ns, rows)
        if not self._row_streams():
            return
        times = time_columns(times_ns, walls)
        self._send_rows(e.STATE, times, scalar_columns(rows))
        self._send_rows(e.BODY, times, rr.Transform3D.columns(translation=rows[:, 0:3], quaternion=rows[:, 3:7]))
        self._send_rows(e.CENTRE, times, rr.Transform3D.columns(translation=rows[:, 0:3]))
        if self._body is None:
            return
        chosen = self._ticks.choose(times_ns)
        disturbed = self._disturbances.gathered(disturbed, chosen)
        if len(chosen):
            self._pictured.append((times_ns[chosen], walls[chosen], rows[chosen], disturbed))
        if self._pictured and self._pictures_are_due():
            self.send_pictures()

    def _pictures_are_due(self) -> bool:
        """Viewers get them at once; to a file fewer and longer columns cost less."""
        waits_ns = self._pictured[-1][1][-1] - self._pictured[0][1][0]
        many = sum(len(times) for times, *_ in self._pictured) >= PICTURES_WAITING
        return many or waits_ns >= PICTURES_WAIT_NS or any(stream.may_skip for stream in self._row_streams())

    def send_pictures(self) -> None:
        """Plots, arrows and Poinsot's picture of the states since they were sent before, all of the present body."""
        body = self._body
        if not self._pictured or body is None:
            return
        times_ns, walls, rows, disturbed = (np.concatenate(columns) for columns in zip(*self._pictured, strict=True))
        self._pictured.clear()
        times = time_columns(times_ns, walls)
        L = self._plots.rows(times, rows, body, disturbed, self._send_rows)
        self._send_axis_ends(one_time(times_ns[-1], walls[-1]))
        self._poinsot.rows(times_ns, walls, rows, L, self._send_rows)
        shown = ShownBody(self._size, float(np.trace(body.inertia)) / 3.0, self._tip)
        self._motion.rows(times, times_ns, rows, L, shown, self._send_rows)

    def _row_streams(self) -> list[Stream]:
        return [s for s in self._listening() if not (self._skip_live and s.may_skip)]

    def _listening(self) -> list[Stream]:
        """The streams that take what they are sent; the others must be told later how things are then."""
        for stream in self.streams:
            stream.missed = stream.missed or stream.behind
        return [stream for stream in self.streams if not stream.behind]

    def _send_rows(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self._row_streams():
            stream.send(entity, times, columns)

    def _send(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self._listening():
            stream.send(entity, times, columns)
