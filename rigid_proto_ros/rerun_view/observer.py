# SPDX-License-Identifier: MIT
"""The observers that show and record a flight with Rerun: the picture, the plots, and events as text.

The stepping thread only queues events. A writing thread sends columns to one stream, of a file or of viewers
(live_view.py). One stream can't serve both: replacing a stream's sinks shuts its server down, so a reset couldn't start
another file while a viewer is connected.

A reset starts simulated time again at 0, and rows of two runs on one timeline can't be distinguished, so every run is a
recording of its own. Viewers show them side by side. FILE.rrd always holds the newest run; at a reset the previous run
is kept as FILE.run1.rrd, FILE.run2.rrd and so on, unless its time never left 0.

An .rrd file is only a view and is never read back: the .mcap of the same flight is the recording.
"""

from __future__ import annotations

import shutil
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import get_args

import numpy as np
import rerun as rr

from ..base.errors import InputError
from ..base.files import file_for_one_writer
from ..base.rotation import matrix_from_quaternion
from ..base.vectors import StateRow
from ..picture import style
from ..picture.picture import Picture
from ..session.mailbox import BATCH, TimedEvent, WritingObserver
from ..simulation.observer import (
    AccuracyFloor,
    Applied,
    Event,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    Logged,
    Published,
    Refused,
    Reset,
    SceneChanged,
    Started,
    StringChanged,
)
from ..simulation.setup import Setup
from . import backend as e
from .backend import RerunBackend, Stream, forget_closed_recordings, last_line
from .layout import FlightTraits, RunSummary, blueprint, floor
from .words import words_of

FLUSH_TIMEOUT_S = 5.0
"""Timeout of flushing half a second of data to a disk [s], after which the disk is considered lost."""

FULL_BYTES = 1_000_000
"""A disk with less free space [bytes] than this is considered full."""

REACH_PER_TIP = 1.7
"""Smallest reach per distance from the COM to the farthest vertex: a body that turns about an end needs more room than
one that turns about its middle, for which the factor would be 2.
"""

WRITE_S = 5.0
"""Period of writing to a file [s]. Each write makes about 23 chunks, and the library keeps 1.8 kB of index in memory
for each: 30 MB an hour, whereas a period of half a second would take 300.
"""


class RerunObserver(WritingObserver):
    """Draws events into a stream, which FileRecorder and LiveView open."""

    # The delay of viewers; every flush costs about 5 ms and 20 kB of overhead.
    period_s = 0.5
    takes = frozenset(get_args(Event)) - {Applied}

    def __init__(self, name: str, place: str, on_error: Callable[[str], None] | None) -> None:
        super().__init__(place, on_error)
        self._name = name
        self._run, self._last_time_ns = 1, 0
        self._begin_ns: int | None = None
        self._stream: Stream | None = self._open(uuid.uuid4().hex, name)
        # Progress is reported per entity, because a busy machine may take seconds to draw a batch of states.
        self._backend = RerunBackend(on_sent=lambda: self._mailbox.moved())
        self._picture = Picture(self._backend)
        self._scene = ""
        self._rows: dict[type, StateRow] = {}
        self._lines: dict[str, list[tuple[int, int, str]]] = {}
        self._commanded = False
        self._thread.start()

    def close(self) -> None:
        """Send what is buffered, and finish."""
        super().close()
        if self._thread.is_alive():
            rr.unregister_shutdown()

    # The stream

    def _open(self, run_id: str, name: str) -> Stream:
        """The stream of the first run; raises InputError."""
        raise NotImplementedError

    def _open_next(self, before: Stream, run_id: str, name: str) -> Stream:
        """End the stream of a run and open that of the next run; raises OSError and InputError."""
        raise NotImplementedError

    def _end(self, stream: Stream) -> None:
        """End the stream of a run that is complete; raises OSError."""
        raise NotImplementedError

    # The thread

    def _write_waiting(self) -> None:
        for events in self._mailbox.take():
            if self._stream is not None:
                self._write(events)
        if self._stream is not None:
            self._stream.flush()
            self._mailbox.moved()
            if self._stream.missed and not self._stream.behind:
                self._describe(self._stream)

    def _finish(self) -> None:
        if self._stream is not None:
            self._end(self._stream)

    def _give_up(self, error: Exception) -> None:
        stream, self._stream = self._stream, None
        refused = isinstance(error, OSError)
        # Reported first, because closing a file that can't be written may block forever.
        self._report_failure(str(error) if refused else f"{type(error).__name__}: {error}")
        if refused:
            rr.unregister_shutdown()
        if stream is None:
            return
        try:
            if not refused:
                self._end(stream)
                return
        except Exception:  # such as a full disk
            pass
        stream.leave()

    # Runs

    def _next_run(self, stream: Stream) -> None:
        """Start a new run after a reset, in a new recording; parameters, mesh and body are kept."""
        self._run += self._last_time_ns > 0
        name = self._name if self._run == 1 else f"{self._name}, run {self._run}"
        self._stream = self._backend.stream = self._open_next(stream, uuid.uuid4().hex, name)
        self._last_time_ns, self._begin_ns = 0, None
        self._rows, self._lines, self._commanded = {}, {}, False
        self._picture.restart()
        self._backend.restart()
        self._describe(self._stream)
        self._send_scene()
        if not stream.behind:
            forget_closed_recordings()

    def _send_scene(self) -> None:
        """Send the present parameters as text, at the time of the backend's ``begin``."""
        self._backend.send(e.SCENE, rr.TextDocument.columns(text=[self._scene], media_type=["text/plain"]))

    def _describe(self, stream: Stream) -> None:
        """Send the present mesh, body and ghost to a stream that is new or has missed data."""
        stream.missed = False
        self._backend.stream = stream
        self._backend.begin(np.array([self._last_time_ns]), np.array([time.time_ns()]))
        self._picture.describe(self._backend)
        self._arrange(stream)

    def _arrange(self, stream: Stream, finished: RunSummary | None = None) -> None:
        """Send the layout for this flight once, and again when it is finished, so that a user's own arrangement isn't
        reset in between.
        """
        picture, tied = self._picture, self._picture.string.was_tied
        setup, shape = picture.setup, picture.shape
        if setup is None or shape is None or (stream.arranged and finished is None):
            return
        tip = 0.0 if shape.tip is None else float(np.linalg.norm(shape.tip))
        traits = FlightTraits(
            reach=max(shape.size, REACH_PER_TIP * tip),
            mesh=shape.tip is not None,
            ghost=picture.ghost is not None,
            falls=bool(np.any(setup.gravity)) and not tied,
            tied=tied,
            dropped_term=not setup.scene.gyroscopic,
            rotor=bool(setup.flight.has_rotor),
        )
        if not traits.falls:
            # Below a falling body it would look like the ground.
            lines, label = floor(traits, setup.initial[0:3])
            stream.log_static(style.FLOOR, lines)
            stream.log_static(f"{style.FLOOR}/scale", label)
        stream.send_layout(blueprint(traits, finished))

    # Events

    def _write(self, events: list[TimedEvent]) -> None:
        """Send events; nothing to a stream that is behind, which gets the state of things later by ``_describe``."""
        states: list[TimedEvent] = []
        stream = self._stream
        if stream is not None and events:
            stream.missed |= stream.behind
            self._backend.stream = None if stream.behind else stream
        for wall_ns, event in events:
            self._mailbox.moved()  # a batch may have thousands of events
            time_ns = event.time_ns
            self._last_time_ns = max(self._last_time_ns, time_ns)
            match event:
                case Published() | GhostPublished():
                    states.append((wall_ns, event))
                case LoadBegan() | LoadEnded() | StringChanged():
                    self._picture.on(event)
                case SceneChanged(_, scene):
                    self._scene = scene
                    self._backend.begin(np.array([time_ns]), np.array([wall_ns]))
                    self._send_scene()
                case Logged(_, line):
                    self._lines.setdefault(e.EVENTS, []).append((time_ns, wall_ns, words_of(line)))
                case Refused(_, reason, message):
                    self._lines.setdefault(e.REFUSALS, []).append((time_ns, wall_ns, f"refused ({reason}): {message}"))
                case AccuracyFloor(_, floor):
                    self._lines.setdefault(e.ACCURACY, []).append((time_ns, wall_ns, floor))
                case _:
                    # Events that change how the following states are drawn.
                    self._write_states(states)
                    states = []
                    self._change(event, wall_ns)
        self._write_states(states)

    def _change(self, event: Event, wall_ns: int) -> None:
        if isinstance(event, Reset):
            if self._stream is not None:
                self._next_run(self._stream)
            return
        self._backend.begin(np.array([event.time_ns]), np.array([wall_ns]))
        before = self._picture.setup, self._picture.ghost
        self._picture.on(event)
        self._stay_in_place(Published, (style.BODY, style.CENTRE), before[0], self._picture.setup)
        self._stay_in_place(GhostPublished, (style.GHOST,), before[1], self._picture.ghost)
        if isinstance(event, Started):
            self._scene = event.scene
            self._send_scene()

    def _stay_in_place(self, kind: type, frames: tuple[str, ...], before: Setup | None, after: Setup | None) -> None:
        """After a change of the COM within the mesh, move the body's frames so that the mesh stays in place until the
        next state.
        """
        if kind not in self._rows or before is None or after is None or not after.stays_in_place_of(before):
            return
        row, moved = self._rows[kind], after.body.center_of_mass - before.body.center_of_mass
        if moved.any():
            row[0:3] += matrix_from_quaternion(row[3:7]) @ moved
            for frame in frames:
                attitudes = None if frame == style.CENTRE else row[np.newaxis, 3:7]
                self._backend.place(frame, row[np.newaxis, 0:3], attitudes)

    def _write_states(self, states: list[TimedEvent]) -> None:
        """Draw states, which all belong to the present body, and write the lines of events."""
        self._commanded |= bool(self._lines)
        for entity, lines in self._lines.items():
            times_ns, walls_ns, texts = zip(*lines, strict=True)
            self._backend.begin(np.array(times_ns), np.array(walls_ns))
            level = "INFO" if entity == e.EVENTS else "WARN"
            self._backend.send(entity, rr.TextLog.columns(text=texts, level=[level] * len(texts)))
        self._lines = {}
        for kind in (Published, GhostPublished):
            chosen = [(state.time_ns, wall_ns, state.row) for wall_ns, state in states if isinstance(state, kind)]
            if not chosen:
                continue
            times, walls, rows = (np.array(column) for column in zip(*chosen, strict=True))
            self._rows[kind] = rows[-1].copy()
            self._begin_ns = int(times[0]) if self._begin_ns is None else self._begin_ns
            self._backend.begin(times, walls)
            if kind is GhostPublished:
                self._picture.draw_ghost(times, rows)
            else:
                self._picture.draw(times, rows)
        if states and self._backend.stream is not None:
            self._arrange(self._backend.stream)


# Files


class FileRecorder(RerunObserver):
    """Records to a file. Raises InputError for a file that can't be written."""

    def __init__(self, path: str, name: str = "rigid_body", on_error: Callable[[str], None] | None = None) -> None:
        self.path = Path(path)
        self._write_at_s = 0.0
        super().__init__(name, path, on_error)

    def _open(self, run_id: str, name: str) -> Stream:
        return FileStream(self.path, run_id, name)

    def _open_next(self, before: Stream, run_id: str, name: str) -> Stream:
        self._end(before)
        if self._last_time_ns > 0:
            self.path.rename(self.path.with_name(f"{self.path.stem}.run{self._run - 1}{self.path.suffix}"))
        return FileStream(self.path, run_id, name)

    def _end(self, stream: Stream) -> None:
        """Finish the file, with the layout for its content."""
        assert isinstance(stream, FileStream)
        duration_s = 1e-9 * (self._last_time_ns - (self._begin_ns or 0))
        self._arrange(stream, RunSummary(duration_s, self._backend.plotted, self._commanded))
        stream.close()
        self._mailbox.moved()
        self._stream = None

    def _write_waiting(self) -> None:
        """Write every WRITE_S, when a batch is queued, and at the end; in between only check that the file
        is writable.
        """
        now_s, mailbox = time.monotonic(), self._mailbox
        if now_s >= self._write_at_s or mailbox.closed or mailbox.waiting >= BATCH:
            self._write_at_s = now_s + WRITE_S
            super()._write_waiting()
        elif isinstance(self._stream, FileStream):
            self._stream.check()


class FileStream(Stream):
    """One run in one .rrd file, on disk (in the system's cache) after each ``flush``, and complete after ``close``: the
    library writes its index at the end.
    """

    def __init__(self, path: Path, recording_id: str, name: str) -> None:
        self._path = path
        if path.suffix != ".rrd":
            raise InputError("record", str(path), "a path that ends in .rrd or .mcap")
        try:
            self._held = file_for_one_writer("record", path)
            # A separate application ID, so that the file has its own layout in a viewer that shows other recordings.
            application_id = f"{e.APPLICATION_ID}_{recording_id[:8]}"
            super().__init__(rr.FileSink(path), recording_id, name, application_id)
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
            self._inode = path.stat().st_ino
        except (RuntimeError, OSError) as error:
            raise InputError("record", str(path), f"a file that can be written ({last_line(error)})") from error

    def flush(self) -> None:
        """Write buffered data; raises OSError if it would not arrive in the file of this name."""
        try:
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            self.check()
            raise OSError(last_line(error)) from None
        self.check()

    def check(self) -> None:
        """Raise OSError if further data would not arrive in the file of this name."""
        if self._path.stat().st_ino != self._inode:
            raise OSError("another file took its place")
        if shutil.disk_usage(self._path.parent).free < FULL_BYTES:
            raise OSError("no space left on the disk")

    def close(self) -> None:
        """Write the rest and the index; raises OSError as ``flush`` does."""
        self.flush()
        self.recording.disconnect()
        self._held.close()

    def leave(self) -> Thread:
        """Close the file without its index."""
        self._held.close()
        return super().leave()
