# SPDX-License-Identifier: MIT
"""One run as Rerun logs it: the picture, the exact states, and what happened as text."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import rerun as rr

from ..picture import style
from ..picture.picture import Picture
from ..session.mailbox import Noted
from ..simulation.observer import (
    AccuracyFloor,
    Event,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    Logged,
    MeshChanged,
    Published,
    Refused,
    Reset,
    SceneChanged,
    Started,
    StringChanged,
)
from . import rrd_file as e
from .backend import RerunBackend, scalar_columns
from .layout import Finished, Subject
from .streams import LiveStream, Stream

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""

REACH_PER_TIP = 1.7
"""A body that turns about an end needs more room than one that turns about its middle, where this would be 2."""

Line = tuple[int, int, str, str]
"""Simulated and wall clock time [ns], text and level."""


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
        self._rows_since_repeat = 0
        self.restart()

    # What holds for a whole run

    def restart(self) -> None:
        """A new run: simulated time starts again at 0; the parameters in force, mesh and body stay."""
        self._scene = self._scene_in_force or self._scene
        self._last_time_ns = 0
        self._picture.restart()
        self._backend.plotted, self._backend.paths = {}, {}
        self._lines: dict[str, list[Line]] = {}
        self._commanded = False

    @property
    def moved(self) -> bool:
        """Whether the run's time has left 0."""
        return self._last_time_ns > 0

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
        if self._picture.body is not None:
            stream.send_layout(self._subject())

    def finish(self, stream: Stream) -> None:
        """Give a run that is complete the layout for what it holds."""
        if self._picture.body is not None:
            finished = Finished(1e-9 * self._last_time_ns, self._backend.plotted, self._commanded)
            stream.send_layout(self._subject(), finished)

    # What happens in it

    def write(self, events: list[Noted], next_run: Callable[[], None], moved: Callable[[], None]) -> None:
        """Send what happened; at a reset ``next_run`` is called, ``moved`` at every event: there may be thousands."""
        states: list[Noted] = []
        for wall_ns, event in events:
            moved()
            time_ns = event.time_ns
            self._last_time_ns = max(self._last_time_ns, time_ns)
            match event:
                case Published() | GhostPublished():
                    states.append((wall_ns, event))
                case LoadBegan() | LoadEnded() | StringChanged():
                    self._picture.on(event)
                case SceneChanged(_, scene):
                    self._scene_in_force = scene
                case Logged(_, line):
                    self._lines.setdefault(e.EVENTS, []).append((time_ns, wall_ns, line, "INFO"))
                case Refused(_, reason, message):
                    line = f"refused ({reason}): {message}"
                    self._lines.setdefault(e.REFUSALS, []).append((time_ns, wall_ns, line, "WARN"))
                case AccuracyFloor(_, floor):
                    self._lines.setdefault(e.ACCURACY, []).append((time_ns, wall_ns, floor, "WARN"))
                case _:
                    # What changes the meaning of the states that follow.
                    self._write_states(states)
                    states = []
                    self._change(event, time_ns, wall_ns, next_run)
        self._write_states(states)
        if self._rows_since_repeat >= REPEATED_ROWS:
            # The live server drops the oldest, so what was said long ago is lost on viewers that come late.
            self._rows_since_repeat = 0
            for stream in self._listening():
                if isinstance(stream, LiveStream):
                    self.catch_up(stream)

    def _change(self, event: Event, time_ns: int, wall_ns: int, next_run: Callable[[], None]) -> None:
        if isinstance(event, Reset):
            next_run()
            return
        self._backend.streams = self._listening()
        self._at(time_ns, wall_ns)
        self._picture.on(event)
        if isinstance(event, (Started, MeshChanged)):
            self._mesh = event.vertices, event.triangles, event.mesh_sha256
        if isinstance(event, Started):
            self._scene = event.scene
            self._send_scene(self._listening())

    def _write_states(self, states: list[Noted]) -> None:
        """Exact states and picture, which all belong to the present body, and what happened."""
        self._rows_since_repeat += len(states)
        streams = self._backend.streams = self._listening()
        # What happened comes first: a file that is cut behind it has every line that acted on its states.
        self._commanded = self._commanded or bool(self._lines)
        for entity, lines in self._lines.items():
            times_ns, walls, texts, levels = zip(*lines, strict=True)
            self._backend.clock(np.array(times_ns), np.array(walls))
            self._backend.begin(np.array(times_ns))
            self._backend.send(entity, rr.TextLog.columns(text=texts, level=levels))
        self._lines.clear()
        for kind in (Published, GhostPublished):
            chosen = [(state.time_ns, wall_ns, state.row) for wall_ns, state in states if isinstance(state, kind)]
            if not chosen:
                continue
            times, walls, rows = (np.array(column) for column in zip(*chosen, strict=True))
            self._backend.clock(times, walls)
            if kind is GhostPublished:
                self._picture.draw_ghost(times, rows)
                continue
            self._backend.begin(times)
            self._backend.send(e.STATE, scalar_columns(rows))
            self._picture.draw(times, rows)
        if states and self._picture.body is not None:
            for stream in streams:
                stream.send_layout(self._subject())

    def _at(self, time_ns: int, wall_ns: int) -> None:
        """What follows is of this moment."""
        self._backend.clock(np.array([time_ns]), np.array([wall_ns]))
        self._backend.begin(np.array([time_ns]))

    def _listening(self) -> list[Stream]:
        """The streams that take what they are sent; the others must be told later how things are then."""
        for stream in self.streams:
            stream.missed = stream.missed or stream.behind
        return [stream for stream in self.streams if not stream.behind]

    def _send_scene(self, streams: list[Stream]) -> None:
        """What holds for a run: the scene as text, in files the mesh's exact numbers."""
        if not self._scene:
            return
        vertices, triangles, sha256 = self._mesh
        for stream in streams:
            stream.log_static(style.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
            stream.log_static(style.POINSOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
            stream.log_static(e.SCENE, rr.TextDocument(self._scene, media_type="text/plain"))
            if vertices is None or triangles is None or isinstance(stream, LiveStream):
                continue
            numbers = rr.AnyValues(
                sha256=sha256,
                vertices=np.ascontiguousarray(vertices, dtype=np.float64).ravel(),
                triangles=np.ascontiguousarray(triangles, dtype=np.int64).ravel(),
            )
            stream.log_static(e.SESSION_MESH, numbers)

    def _subject(self) -> Subject:
        """What the flight is about."""
        picture, tied = self._picture, self._picture.string.was_tied
        body, shape = picture.body, picture.shape
        assert body is not None and shape is not None
        tip = 0.0 if shape.tip is None else float(np.linalg.norm(shape.tip))
        return Subject(
            reach=max(shape.size, REACH_PER_TIP * tip),
            ghost=picture.ghost is not None,
            falls=bool(np.any(body.gravity)) and not tied,
            tied=tied,
            dropped_term=not body.gyroscopic,
        )
