# SPDX-License-Identifier: MIT
"""The observer that shows and records a flight with Rerun.

The stepping thread only copies a row into a buffer. One thread of our own empties it every half second and sends
columns: into a file, to viewers on this machine, or both.

Runs. A reset starts simulated time again at 0, and rows of two runs on one timeline could not be told apart, so every run is
a recording of its own. Viewers show them side by side. In files, FILE.rrd always holds the newest run; at a reset the one
before is kept beside it as FILE.run1.rrd, FILE.run2.rrd and so on, unless its time never left 0.
"""

from __future__ import annotations

import logging
import threading
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError
from ..core.observer import BodySnapshot, Observer, ShownLoad, ShownString
from .mailbox import BLOCK_ROWS, Block, Mailbox, Mark
from .ports import choose_port

if TYPE_CHECKING:
    from .streams import FileStream, LiveServer, LiveStream
    from .viewers import ViewerProcess

FLUSH_PERIOD_S = 0.5
"""What a kill -9 loses at most, and how far viewers lag; every flush costs about 10 ms and 10 kB of overhead."""

CLOSE_TIMEOUT_S = 10.0
"""A disk that doesn't take the rest in this time is given up."""

VIEWERS = ("none", "web", "native", "serve")
INITIAL_VIEWS = ("lesson", "debugging", "plain")
"""Tabs of the layout; the others are a click away."""

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "256MiB"
"""What the server keeps for viewers that come late; the oldest is dropped first."""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. initial_view: the tab of the layout that is in front. ``report`` gets one line for every address and every warning, ``on_error`` one line when recording has
    stopped because the file can't be written; both may be called from another thread.

    Raises InputError for a file that can't be written, a port that is taken, an unknown viewer.
    """

    def __init__(
        self,
        record: str = "",
        viewer: str = "none",
        rerun_port: int | None = None,
        web_port: int | None = None,
        name: str = "rigid_body",
        report: Callable[[str], None] | None = None,
        on_error: Callable[[str], None] | None = None,
        live_memory_limit: str = LIVE_MEMORY_LIMIT,
        initial_view: str = "lesson",
    ) -> None:
        if viewer not in VIEWERS:
            raise InputError("viewer", viewer, "one of " + ", ".join(VIEWERS))
        if initial_view not in INITIAL_VIEWS:
            raise InputError("initial_view", initial_view, "one of " + ", ".join(INITIAL_VIEWS))
        self.name = name
        self._initial_view = initial_view
        self.live_address = ""
        self.web_address = ""
        self.error = ""
        self._report = report or _logger.info
        self._on_error = on_error or _logger.error
        self._mailbox: Mailbox | None = None
        self._ghosts = Mailbox()
        self._ghost_block: Block | None = None
        self._ghost_sent = 0
        self._writer: Any = None
        self._run = 1
        self._run_id = uuid.uuid4().hex
        self._file: FileStream | None = None
        self._live: LiveStream | None = None
        self._server: LiveServer | None = None
        self._processes: list[ViewerProcess] = []
        self._thread: threading.Thread | None = None
        self._remembered: list[tuple[Any, ...]] = []
        self._passed: list[threading.Event] = []
        self._closed = False
        if viewer != "none":
            self._open_server(viewer, rerun_port, web_port, live_memory_limit)
        if record:
            self.start_recording(record)

    # The Observer's interface: called from the stepping thread

    def started(self, scene: str, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str) -> None:
        """Take copies of the scene and the mesh; they are logged once a run."""
        copies = [None if a is None else np.array(a) for a in (vertices, triangles)]
        self._mark(-1, "started", scene, *copies, mesh_sha256)

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        """Note the body from ``time_ns`` on."""
        self._mark(time_ns, "body_changed", body)

    def state(self, time_ns: int, row: np.ndarray) -> None:
        """Copy one state row (13,)."""
        if self._mailbox is not None:
            self._mailbox.put(time_ns, row)

    def load_began(self, time_ns: int, load_id: int, load: ShownLoad) -> None:
        """Note a load that begins to act."""
        self._mark(time_ns, "load_began", load_id, load)

    def load_ended(self, time_ns: int, load_id: int) -> None:
        """Note a load that acts no longer."""
        self._mark(time_ns, "load_ended", load_id)

    def scene_changed(self, time_ns: int, scene: str) -> None:
        """Note the parameters in force from ``time_ns`` on; the next run starts from them."""
        self._mark(time_ns, "scene_changed", scene)

    def string_changed(self, time_ns: int, string: ShownString | None) -> None:
        """Note how the string is tied from ``time_ns`` on."""
        self._mark(time_ns, "string_changed", string)

    def event(self, time_ns: int, line: str) -> None:
        """Note a line of the event log."""
        self._mark(time_ns, "event", line)

    def refused(self, time_ns: int, reason: str, message: str) -> None:
        """Note a refusal."""
        self._mark(time_ns, "refused", reason, message)

    def status(self, time_ns: int, track: str, value: str) -> None:
        """Note that a lane of the state line changes."""
        self._mark(time_ns, "status", track, value)

    def ghost_began(self, time_ns: int, ghost: BodySnapshot) -> None:
        """Note the ghost from ``time_ns`` on."""
        self._mark(time_ns, "ghost_began", ghost)

    def ghost_state(self, time_ns: int, row: np.ndarray) -> None:
        """Copy one state row (13,) of the ghost."""
        if self._mailbox is not None:
            self._ghosts.put(time_ns, row)

    def reset(self) -> None:
        """Begin a new run."""
        if self._mailbox is not None:
            self._ghosts.mark(-1, "reset")
        self._mark(-1, "reset")

    def close(self) -> None:
        """Send what is buffered, finish the file, end the viewers that were started here."""
        if self._closed:
            return
        self._closed = True
        if self._mailbox is not None and self._thread is not None:
            self._mailbox.close()
            self._ghosts.close()
            self._thread.join(CLOSE_TIMEOUT_S)
            if self._thread.is_alive():
                self._lost(f"{self.recording}: the disk did not take the last states")
        for process in self._processes:
            process.stop()

    # Recording on and off

    @property
    def recording(self) -> str:
        """Path of the file that is being written, or ""."""
        file = self._file
        return str(file.path) if file is not None else ""

    def start_recording(self, path: str) -> None:
        """Record to this file from now on; one that was being written is finished first.

        Raises InputError where the file can't be written. A recording that begins in flight shows everything from there on.
        """
        from .streams import FileStream

        # Finished first: it may be the same file.
        self.stop_recording()
        file = FileStream(Path(path), self._run_id, self._run_name)
        self.error = ""
        self._file = file
        self._begin()
        self._mark(-1, "record", file, threading.Event())

    def stop_recording(self) -> None:
        """Finish the file; returns when it is whole."""
        if self._file is None:
            return
        self._file = None
        self._wait_for("record", None)

    # Inside

    def _flush_now(self) -> None:
        """Return when everything so far was handed to the file and the viewers."""
        self._wait_for("pass", None)

    def _wait_for(self, kind: str, content: Any) -> None:
        done = threading.Event()
        self._mark(-1, kind, content, done)
        self._mailbox.wake()
        done.wait(CLOSE_TIMEOUT_S)

    @property
    def _run_name(self) -> str:
        return self.name if self._run == 1 else f"{self.name}, run {self._run}"

    def _mark(self, time_ns: int, kind: str, *content: Any) -> None:
        if self._mailbox is not None:
            self._mailbox.mark(time_ns, kind, *content)
        elif kind in ("started", "body_changed", "scene_changed", "string_changed", "ghost_began"):
            # Kept for a recording that is switched on later.
            self._remembered = [kept for kept in self._remembered if kept[1] != kind]
            self._remembered.append((time_ns, kind, *content))

    def _begin(self) -> None:
        """Start the flushing thread, once there is something to flush to."""
        if self._mailbox is not None:
            return
        from .writer import SceneWriter

        self._writer = SceneWriter(self._initial_view)
        self._mailbox = Mailbox()
        for remembered in self._remembered:
            self._mailbox.mark(*remembered)
        self._remembered.clear()
        self._thread = threading.Thread(target=self._flush_until_closed, name="rerun", daemon=True)
        self._thread.start()

    def _open_server(self, viewer: str, rerun_port: int | None, web_port: int | None, memory_limit: str) -> None:
        from .streams import LiveServer

        port = choose_port("rerun_port", rerun_port, DEFAULT_RERUN_PORT)
        web = choose_port("web_port", web_port, DEFAULT_WEB_PORT) if viewer == "web" else 0
        self._server = LiveServer(port, memory_limit)
        self.live_address = self._server.address
        self._live = self._server.open_run(self._run_id, self._run_name)
        self._begin()
        self._mark(-1, "live", self._live)
        self._report(f"live stream: {self.live_address}")
        self._open_viewer(viewer, web)

    def _open_viewer(self, viewer: str, web_port: int) -> None:
        from . import viewers

        try:
            if viewer == "web":
                process, self.web_address = viewers.serve_web(web_port, self.live_address)
                self._processes.append(process)
                self._report(f"viewer: {self.web_address}")
            elif viewer == "native" and viewers.has_display():
                self._processes.append(viewers.open_native(self.live_address))
            elif viewer == "native":
                self._report(
                    f"no display for the viewer; open one elsewhere on this machine: rerun {self.live_address}"
                )
        except OSError as error:
            self.web_address = ""
            self._report(f"no viewer: {error}")

    def _flush_until_closed(self) -> None:
        mailbox = self._mailbox
        while True:
            closing = mailbox.closed
            try:
                self._flush()
            except Exception as error:  # noqa: BLE001
                # Whatever goes wrong here must not reach the flight: go on without a recording.
                self._lost(f"recording stopped: {type(error).__name__}: {error}")
                self._writer.streams.clear()
            if closing:
                break
            mailbox.wait(FLUSH_PERIOD_S)
        self._finish_file()
        if self._server is not None:
            self._server.close()

    def _flush(self) -> None:
        """Send the full blocks that wait and what has been put since; not what arrives meanwhile, a few rows a time."""
        full = True
        while full:
            block, waiting = self._mailbox.take()
            if block is None:
                break
            full = block.count == BLOCK_ROWS
            self._writer.write(block, self._on_mark, skip_live=waiting > 1)
            self._mailbox.give_back(block)
        self._flush_ghost()
        for stream in list(self._writer.streams):
            try:
                stream.flush()
            except OSError as error:
                self._give_up_file(error)
        while self._passed:
            self._passed.pop().set()

    def _flush_ghost(self, upto_reset: bool = False) -> None:
        """Send the ghost's states that wait, or those of the run that ends."""
        while True:
            if self._ghost_block is None:
                self._ghost_block, _ = self._ghosts.take()
                self._ghost_sent = 0
            block = self._ghost_block
            if block is None:
                return
            reset = block.marks[0] if block.marks else None
            end = reset.after_rows if reset else block.count
            self._writer.write_ghost(block, self._ghost_sent, end)
            self._ghost_sent = end
            if reset is not None:
                if not upto_reset:
                    # The body's own reset hasn't come yet: what follows belongs to the next run.
                    return
                block.marks.pop(0)
                return
            self._ghost_block = None
            self._ghosts.give_back(block)

    def _on_mark(self, mark: Mark) -> None:
        if mark.kind == "reset":
            self._flush_ghost(upto_reset=True)
            self._next_run()
        elif mark.kind == "record":
            file, finished = mark.content
            self._finish_file()
            if file is not None:
                self._writer.attach(file)
            finished.set()
        elif mark.kind == "pass":
            self._passed.append(mark.content[1])
        elif mark.kind == "live":
            self._writer.attach(*mark.content)

    def _next_run(self) -> None:
        from .streams import FileStream, LiveStream

        writer = self._writer
        moved = writer.moved
        streams = list(writer.streams)
        if moved:
            self._run += 1
        self._run_id = uuid.uuid4().hex
        writer.streams.clear()
        writer.restart()
        for stream in streams:
            if isinstance(stream, LiveStream):
                self._live = self._server.open_run(self._run_id, self._run_name)
                self._server.end_run(stream)
                writer.attach(self._live)
            else:
                try:
                    stream.close()
                    if moved:
                        kept = f"{stream.path.stem}.run{self._run - 1}{stream.path.suffix}"
                        stream.path.rename(stream.path.with_name(kept))
                    file = FileStream(stream.path, self._run_id, self._run_name)
                except (OSError, InputError) as error:
                    self._lost(str(error))
                    continue
                if self._file is stream:
                    self._file = file
                writer.attach(file)

    def _finish_file(self) -> None:
        from .streams import FileStream

        for stream in [s for s in self._writer.streams if isinstance(s, FileStream)]:
            self._writer.streams.remove(stream)
            try:
                stream.close()
            except OSError as error:
                self._lost(str(error))

    def _give_up_file(self, error: OSError) -> None:
        from .streams import FileStream

        for stream in [s for s in self._writer.streams if isinstance(s, FileStream)]:
            self._writer.streams.remove(stream)
            stream.abandon()
        self._lost(f"recording stopped: {error}")

    def _lost(self, message: str) -> None:
        self._file = None
        self.error = message
        self._on_error(message)
