# SPDX-License-Identifier: MIT
"""The observer that shows and records a flight with Rerun: the picture, the exact states, and what happened as text.

The stepping thread only copies a row into a mailbox. One thread of our own empties it every half second and sends
columns: into a file, to viewers on this machine, or both.

Runs. A reset starts simulated time again at 0, and rows of two runs on one timeline could not be told apart, so every
run is a recording of its own. Viewers show them side by side. In files, FILE.rrd always holds the newest run; at a
reset the one before is kept beside it as FILE.run1.rrd, FILE.run2.rrd and so on, unless its time never left 0.
"""

from __future__ import annotations

import logging
import threading
import time
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
import rerun as rr

from ..base.errors import InputError
from ..picture import style
from ..picture.picture import Picture
from ..session.mailbox import BATCH, Mailbox, Noted
from ..simulation.observer import (
    AccuracyFloor,
    Applied,
    Event,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    Logged,
    MeshChanged,
    Observer,
    Published,
    Refused,
    Reset,
    SceneChanged,
    Started,
    StringChanged,
)
from . import rrd_file as e
from .layout import Finished, Subject, blueprint
from .ports import serve_on_port
from .streams import FileStream, RerunBackend, Stream, forget_closed_recordings, host, scalar_columns

if TYPE_CHECKING:
    from .viewers import ViewerProcess

VIEWERS = ("none", "web", "native", "serve")

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""

FLUSH_PERIOD_S = 0.5
"""What a kill -9 loses at most, and how far viewers lag; every flush costs about 5 ms and 20 kB of overhead."""

STALLED_S = 0.9
"""A flush that takes longer is told of: a report comes once a second, and a stalled file is to be told within two."""

LEAVE_S = 2.0
"""How long the end of a run waits for live streams; a viewer that doesn't read holds nobody up."""

REACH_PER_TIP = 1.7
"""A body that turns about an end needs more room than one that turns about its middle, where this would be 2."""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. ``report`` gets one line for every address and every warning, ``on_error`` one line when recording has
    stopped because the file can't be written; both may be called from another thread. error: why it has, or "".

    Raises InputError for a file that can't be written, a port that is taken, and an unknown viewer.
    """

    takes = frozenset(get_args(Event)) - {Applied}

    def __init__(
        self,
        record: str = "",
        viewer: str = "none",
        rerun_port: int | None = None,
        web_port: int | None = None,
        name: str = "rigid_body",
        report: Callable[[str], None] = _logger.info,
        on_error: Callable[[str], None] | None = None,
        live_memory_limit: str = LIVE_MEMORY_LIMIT,
    ) -> None:
        if viewer not in VIEWERS:
            raise InputError("viewer", viewer, "one of " + ", ".join(VIEWERS))
        self.live_address = self.web_address = self.error = ""
        self._name = name
        self._report, self._on_error = report, on_error or _logger.error
        self._run, self._run_id = 1, uuid.uuid4().hex
        self._host: Stream | None = None
        self._live: Stream | None = None
        self._file: FileStream | None = None
        self._viewer: ViewerProcess | None = None
        self._backend = RerunBackend()
        self._picture = Picture(self._backend)
        self._started: Started | None = None
        self._last_time_ns = self._rows_since_repeat = 0
        self._lines: dict[str, list[tuple[int, int, str]]] = {}
        self._commanded = False
        self._flushing_since_s: float | None = None
        self._mailbox = Mailbox(lambda: self._lost("nothing can be written to the disk any more"))
        self._thread = threading.Thread(target=self._flush_until_closed, name="rerun", daemon=True)
        try:
            if viewer != "none":
                self._serve(viewer, rerun_port, web_port, live_memory_limit)
            if record:
                self._file = FileStream(Path(record), self._run_id, name)
        except InputError:
            # Nobody has it yet, so nobody else would end what was started.
            self.close()
            raise
        self._thread.start()

    def _serve(self, viewer: str, rerun_port: int | None, web_port: int | None, memory_limit: str) -> None:
        from . import viewers

        serve = partial(host, memory_limit=memory_limit, recording_id=self._run_id, name=self._name)
        self._host, self.live_address = serve_on_port("rerun_port", rerun_port, DEFAULT_RERUN_PORT, serve)
        self._live = self._host
        self._report(f"live stream: {self.live_address}")
        try:
            if viewer == "web":
                self._viewer, self.web_address = serve_on_port(
                    "web_port", web_port, DEFAULT_WEB_PORT, lambda port: viewers.serve_web(port, self.live_address)
                )
                self._report(f"viewer: {self.web_address}")
            elif viewer == "native" and viewers.has_display():
                self._viewer = viewers.open_native(self.live_address)
            elif viewer == "native":
                # Without --connect the program takes the server at its usual port for a viewer, and feeds the stream
                # back into itself.
                self._report(
                    f"no display for the viewer; elsewhere on this machine: rerun --connect {self.live_address}"
                )
        except OSError as error:
            self._report(f"no viewer: {error}")

    def on(self, event: Event) -> None:
        """Take an event from the stepping thread; states and meshes are copied."""
        if isinstance(event, (Started, MeshChanged)):
            vertices, triangles = (None if a is None else np.array(a) for a in (event.vertices, event.triangles))
            event = event._replace(vertices=vertices, triangles=triangles)
        if type(event) in self.takes:
            self._mailbox.put(event)

    @property
    def stalled(self) -> str:
        """Says that the file hasn't taken what was sent for longer than STALLED_S; empty while it does."""
        since_s, file = self._flushing_since_s, self._file
        if since_s is None or file is None or time.monotonic() < since_s + STALLED_S:
            return ""
        return f"recording {file.path}: nothing could be written for {time.monotonic() - since_s:.1f} s"

    def close(self) -> None:
        """Send what is buffered, finish the file, end the viewer that was started here."""
        if self._mailbox.closed:
            return
        self._mailbox.close()
        if self._thread.ident is None:
            self._finish()
        elif not self._mailbox.emptied_by(self._thread):
            rr.unregister_shutdown()
            self._lost("the last states could not be written")
        if self._viewer is not None:
            self._viewer.stop()

    # The thread

    def _flush_until_closed(self) -> None:
        while True:
            closing = self._mailbox.closed
            self._flushing_since_s = time.monotonic()
            try:
                self._flush()
            except Exception as error:
                # Whatever goes wrong here must not reach the flight: go on without a recording.
                file, self._live = self._file, None
                self._lost(f"{type(error).__name__}: {error}")
                self._end_file(file)
            self._flushing_since_s = None
            if closing:
                break
            self._mailbox.wait(FLUSH_PERIOD_S)
        self._finish()

    def _flush(self) -> None:
        """Send what waits; not what arrives meanwhile, a few rows a time."""
        more = True
        while more:
            events = self._mailbox.take()
            more = len(events) == BATCH
            self._write(events)
        for stream in self._streams:
            try:
                stream.flush()
            except OSError as error:
                self._give_up(stream, error)
            self._mailbox.moved()
            if stream.missed and not stream.behind:
                self._describe(stream)

    def _finish(self) -> None:
        self._end_file(self._file)
        # Also of runs before.
        leaving = [thread for thread in threading.enumerate() if thread.name == "rerun leaving"]
        leaving += [stream.leave() for stream in {self._live, self._host} if stream is not None]
        deadline = time.monotonic() + LEAVE_S
        for thread in leaving:
            thread.join(max(0.0, deadline - time.monotonic()))
        if any(thread.is_alive() for thread in leaving):
            # At the end of the process the library would wait, without limit, for every recording to be taken.
            rr.unregister_shutdown()

    def _end_file(self, file: FileStream | None) -> None:
        """Finish the file of a run that is complete, with the layout for what it holds."""
        if file is None:
            return
        try:
            self._arrange(file, Finished(1e-9 * self._last_time_ns, self._backend.plotted, self._commanded))
            file.close()
            self._mailbox.moved()
            self._file = None
        except OSError as error:
            self._give_up(file, error)

    def _give_up(self, stream: Stream, error: OSError) -> None:
        # Told first: what the library does with a file that it can't write may take for ever.
        self._lost(str(error))
        rr.unregister_shutdown()
        stream.leave()

    def _lost(self, reason: str) -> None:
        self._file = None
        self.error = f"recording stopped: {reason}"
        self._on_error(self.error)

    @property
    def _streams(self) -> list[Stream]:
        return [stream for stream in (self._live, self._file) if stream is not None]

    # What holds for a run

    def _next_run(self) -> None:
        """A reset: another run, in a recording of its own; the parameters in force, mesh and body stay."""
        moved, live, file = self._last_time_ns > 0, self._live, self._file
        self._end_file(file)
        self._run += moved
        self._run_id = uuid.uuid4().hex
        self._last_time_ns = 0
        self._lines, self._commanded = {}, False
        self._picture.restart()
        self._backend.plotted, self._backend.paths = {}, {}
        name = self._name if self._run == 1 else f"{self._name}, run {self._run}"
        if live is not None:
            self._live = Stream(rr.GrpcSink(self.live_address), self._run_id, name)
            self._live.arranged = live.arranged  # viewers keep their layout
            if live is not self._host:  # whose server stays
                live.leave()
        if file is not None and not self.error:
            try:
                if moved:
                    file.path.rename(file.path.with_name(f"{file.path.stem}.run{self._run - 1}{file.path.suffix}"))
                self._file = FileStream(file.path, self._run_id, name)
            except (OSError, InputError) as error:
                self._lost(str(error))
        for stream in self._streams:
            self._send_scene(stream)
            self._describe(stream)
        if live is None or not live.behind:
            forget_closed_recordings()

    def _send_scene(self, stream: Stream) -> None:
        """What a run begins with: the scene as text, in files the mesh's exact numbers."""
        began = self._started
        if began is None:
            return
        stream.log_static(style.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        stream.log_static(style.POINSOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        stream.log_static(e.SCENE, rr.TextDocument(began.scene, media_type="text/plain"))
        if stream is self._file and began.vertices is not None and began.triangles is not None:
            numbers = rr.AnyValues(
                sha256=began.mesh_sha256,
                vertices=np.ascontiguousarray(began.vertices, dtype=np.float64).ravel(),
                triangles=np.ascontiguousarray(began.triangles, dtype=np.int64).ravel(),
            )
            stream.log_static(e.SESSION_MESH, numbers)

    def _describe(self, stream: Stream) -> None:
        """Tell a stream that knows nothing yet, or that has missed something, how things are now."""
        stream.missed = False
        self._backend.streams = [stream]
        self._backend.begin(np.array([self._last_time_ns]), np.array([time.time_ns()]))
        self._picture.describe(self._backend)
        self._arrange(stream)

    def _arrange(self, stream: Stream, finished: Finished | None = None) -> None:
        """Send the layout for what the flight is about: once, and again when it is finished; nothing that somebody has
        arranged is undone in between.
        """
        picture, tied = self._picture, self._picture.string.was_tied
        body, shape = picture.body, picture.shape
        if body is None or shape is None or (stream.arranged and finished is None):
            return
        tip = 0.0 if shape.tip is None else float(np.linalg.norm(shape.tip))
        subject = Subject(
            reach=max(shape.size, REACH_PER_TIP * tip),
            ghost=picture.ghost is not None,
            falls=bool(np.any(body.gravity)) and not tied,
            tied=tied,
            dropped_term=not body.gyroscopic,
        )
        stream.send_layout(blueprint(subject, finished))

    # What happens in it

    def _write(self, events: list[Noted]) -> None:
        """Send what happened."""
        states: list[Noted] = []
        for wall_ns, event in events:
            self._mailbox.moved()  # there may be thousands
            time_ns = event.time_ns
            self._last_time_ns = max(self._last_time_ns, time_ns)
            match event:
                case Published() | GhostPublished():
                    states.append((wall_ns, event))
                case LoadBegan() | LoadEnded() | StringChanged():
                    self._picture.on(event)
                case SceneChanged(_, scene) if self._started is not None:
                    self._started = self._started._replace(scene=scene)
                case Logged(_, line):
                    self._lines.setdefault(e.EVENTS, []).append((time_ns, wall_ns, line))
                case Refused(_, reason, message):
                    self._lines.setdefault(e.REFUSALS, []).append((time_ns, wall_ns, f"refused ({reason}): {message}"))
                case AccuracyFloor(_, floor):
                    self._lines.setdefault(e.ACCURACY, []).append((time_ns, wall_ns, floor))
                case _:
                    # What changes the meaning of the states that follow.
                    self._write_states(states)
                    states = []
                    self._change(event, wall_ns)
        self._write_states(states)
        if self._live is not None and self._rows_since_repeat >= REPEATED_ROWS:
            # The live server drops the oldest, so what was said long ago is lost on viewers that come late.
            self._rows_since_repeat = 0
            if not self._live.behind:
                self._describe(self._live)

    def _change(self, event: Event, wall_ns: int) -> None:
        if isinstance(event, Reset):
            self._next_run()
            return
        self._backend.streams = self._listening()
        self._backend.begin(np.array([event.time_ns]), np.array([wall_ns]))
        self._picture.on(event)
        if isinstance(event, Started):
            self._started = event
            for stream in self._backend.streams:
                self._send_scene(stream)
        elif isinstance(event, MeshChanged) and self._started is not None:
            vertices, triangles, sha256 = event.vertices, event.triangles, event.mesh_sha256
            self._started = self._started._replace(vertices=vertices, triangles=triangles, mesh_sha256=sha256)

    def _listening(self) -> list[Stream]:
        """The streams that take what they are sent; the others must be told later how things are then."""
        for stream in self._streams:
            stream.missed = stream.missed or stream.behind
        return [stream for stream in self._streams if not stream.behind]

    def _write_states(self, states: list[Noted]) -> None:
        """Exact states and picture, which all belong to the present body, and what happened."""
        self._rows_since_repeat += len(states)
        self._backend.streams = self._listening()
        # What happened comes first: a file that is cut behind it has every line that acted on its states.
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
            self._backend.begin(times, walls)
            if kind is GhostPublished:
                self._picture.draw_ghost(times, rows)
            else:
                self._backend.send(e.STATE, scalar_columns(rows))
                self._picture.draw(times, rows)
        if states:
            for stream in self._backend.streams:
                self._arrange(stream)
