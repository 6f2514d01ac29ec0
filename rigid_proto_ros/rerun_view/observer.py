# SPDX-License-Identifier: MIT
"""The observer that shows and records a flight with Rerun.

The stepping thread only copies a row into a buffer. One thread of our own empties it every half second and sends
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
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..session.mailbox import BATCH, Mailbox
from ..simulation.observer import (
    AccuracyFloor,
    BodyChanged,
    Event,
    GhostChanged,
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
from .ports import serve_on_port
from .streams import FileStream, LiveServer, LiveStream, Stream, end_without_waiting, forget_closed_recordings
from .writer import SceneWriter

if TYPE_CHECKING:
    from .viewers import ViewerProcess

VIEWERS = ("none", "web", "native", "serve")

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

FLUSH_PERIOD_S = 0.5
"""What a kill -9 loses at most, and how far viewers lag; every flush costs about 5 ms and 20 kB of overhead."""

STALLED_S = 0.9
"""A flush that takes longer is told of: a report comes once a second, and a stalled file is to be told within two."""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. ``report`` gets one line for every address and every warning, ``on_error`` one line when recording has
    stopped because the file can't be written; both may be called from another thread. error: why it has, or "".

    Raises InputError for a file that can't be written, a port that is taken, and an unknown viewer.
    """

    takes = frozenset(
        {
            *(Started, MeshChanged, BodyChanged, SceneChanged, GhostChanged, Published, GhostPublished, Reset),
            *(LoadBegan, LoadEnded, StringChanged, Logged, Refused, AccuracyFloor),
        }
    )

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
        self._writer = SceneWriter()
        self._mailbox = Mailbox(lambda: self._lost("recording stopped: nothing can be written to the disk any more"))
        self._path: Path | None = None
        self._server: LiveServer | None = None
        self._viewer: ViewerProcess | None = None
        self._flushing_since_s: float | None = None
        self._thread = threading.Thread(target=self._flush_until_closed, name="rerun", daemon=True)
        try:
            if viewer != "none":
                self._server = serve_on_port(
                    "rerun_port",
                    rerun_port,
                    DEFAULT_RERUN_PORT,
                    lambda port: LiveServer(port, live_memory_limit, self._run_id, name),
                )
                self._writer.streams.append(self._server.host)
                self.live_address = self._server.address
                self._report(f"live stream: {self.live_address}")
                self._open_viewer(viewer, web_port)
            if record:
                self._writer.streams.append(FileStream(Path(record), self._run_id, name))
                self._path = Path(record)
        except InputError:
            # Nobody has it yet, so nobody else would end what was started.
            self.close()
            raise
        self._thread.start()

    def _open_viewer(self, viewer: str, web_port: int | None) -> None:
        from . import viewers

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
                command = f"rerun --connect {self.live_address}"
                self._report(f"no display for the viewer; open one elsewhere on this machine: {command}")
        except OSError as error:
            self._report(f"no viewer: {error}")

    def on(self, event: Event) -> None:
        """Take an event from the stepping thread; states and meshes are copied."""
        if type(event) in self.takes:
            if isinstance(event, (Started, MeshChanged)):
                vertices, triangles = (None if a is None else np.array(a) for a in (event.vertices, event.triangles))
                event = event._replace(vertices=vertices, triangles=triangles)
            self._mailbox.put(event)

    @property
    def stalled(self) -> str:
        """Says that the file hasn't taken what was sent for longer than STALLED_S; empty while it does."""
        since_s = self._flushing_since_s
        if since_s is None or self._path is None or time.monotonic() < since_s + STALLED_S:
            return ""
        return f"recording {self._path}: nothing could be written for {time.monotonic() - since_s:.1f} s"

    def close(self) -> None:
        """Send what is buffered, finish the file, end the viewer that was started here."""
        if self._mailbox.closed:
            return
        self._mailbox.close()
        if self._thread.ident is None:
            self._finish()
        elif not self._mailbox.emptied_by(self._thread):
            end_without_waiting()
            self._lost("recording stopped: the last states could not be written")
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
                self._lost(f"recording stopped: {type(error).__name__}: {error}")
                self._finish_files()
                self._writer.streams.clear()
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
            self._writer.write(events, self._next_run, self._mailbox.moved)
        for stream in list(self._writer.streams):
            try:
                stream.flush()
            except OSError as error:
                self._give_up(stream, error)
            self._mailbox.moved()
            if stream.missed and not stream.behind:
                self._writer.catch_up(stream)

    def _next_run(self) -> None:
        """A reset: another run, in a recording of its own."""
        moved, streams = self._writer.moved, list(self._writer.streams)
        self._run += moved
        self._run_id = uuid.uuid4().hex
        name = self._name if self._run == 1 else f"{self._name}, run {self._run}"
        self._finish_files()
        self._writer.streams.clear()
        self._writer.restart()
        for stream in streams:
            if isinstance(stream, LiveStream) and self._server is not None:
                self._writer.attach(self._server.next_run(stream, self._run_id, name))
            elif isinstance(stream, FileStream) and not self.error:
                path = stream.path
                try:
                    if moved:
                        path.rename(path.with_name(f"{path.stem}.run{self._run - 1}{path.suffix}"))
                    self._writer.attach(FileStream(path, self._run_id, name))
                except (OSError, InputError) as error:
                    self._lost(str(error))
        if not any(stream.behind for stream in self._writer.streams):
            forget_closed_recordings()

    def _finish(self) -> None:
        self._finish_files()
        if self._server is None:
            return
        for stream in self._writer.streams:
            if isinstance(stream, LiveStream):
                self._server.end_run(stream)
        if not self._server.close():
            end_without_waiting()

    def _finish_files(self) -> None:
        for stream in [stream for stream in self._writer.streams if isinstance(stream, FileStream)]:
            try:
                self._writer.finish(stream)
                stream.close()
                self._mailbox.moved()
                self._writer.streams.remove(stream)
            except OSError as error:
                self._give_up(stream, error)

    def _give_up(self, stream: Stream, error: OSError) -> None:
        # Told first: what the library does with a file that it can't write may take for ever.
        self._lost(f"recording stopped: {error}")
        end_without_waiting()
        self._writer.streams.remove(stream)
        stream.leave()

    def _lost(self, message: str) -> None:
        self._path = None
        self.error = message
        self._on_error(message)
