# SPDX-License-Identifier: MIT
"""The observer that shows and records a flight with Rerun.

The stepping thread only copies a row into a buffer. One thread of our own empties it every half second and sends
columns: into a file, to viewers on this machine, or both.

Runs. A reset starts simulated time again at 0, and rows of two runs on one timeline could not be told apart, so every
run is a recording of its own. Viewers show them side by side. In files, FILE.rrd always holds the newest run; at a
reset the one before is kept beside it as FILE.run1.rrd, FILE.run2.rrd and so on, unless its time never left 0.
"""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..simulation.observer import BodySnapshot, Observer, ShownLoad, ShownString
from .ports import serve_on_port

if TYPE_CHECKING:
    from .flusher import Flusher
    from .viewers import ViewerProcess

VIEWERS = ("none", "web", "native", "serve")
INITIAL_VIEWS = ("lesson", "debugging", "plain")
"""Tabs of the layout; the others are a click away."""

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

_REMEMBERED = ("started", "mesh_changed", "body_changed", "scene_changed", "string_changed", "ghost_began")
"""What a recording that is switched on later must know."""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. initial_view: the tab of the layout that is in front. open_ended: the recording may go on for hours, and
    memory must not grow; its file then has no index. ``report`` gets one line for every address and
    every warning, ``on_error`` one line when recording has stopped because the file can't be written; both may be
    called from another thread.

    Raises InputError for a file that can't be written, a port that is taken, an unknown viewer, and without rerun-sdk.
    """

    def __init__(  # noqa: PLR0913 (each has a default, and callers name them)
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
        open_ended: bool = False,
    ) -> None:
        if viewer not in VIEWERS:
            raise InputError("viewer", viewer, "one of " + ", ".join(VIEWERS))
        if initial_view not in INITIAL_VIEWS:
            raise InputError("initial_view", initial_view, "one of " + ", ".join(INITIAL_VIEWS))
        if (record or viewer != "none") and importlib.util.find_spec("rerun") is None:
            raise InputError("record" if record else "viewer", is_missing("rerun-sdk", "rerun"))
        self.live_address = ""
        self.web_address = ""
        self._name = name
        self._initial_view = initial_view
        self._open_ended = open_ended
        self._report = report or _logger.info
        self._on_error = on_error or _logger.error
        self._flusher: Flusher | None = None
        self._processes: list[ViewerProcess] = []
        self._remembered: list[tuple[Any, ...]] = []
        self._closed = False
        try:
            if viewer != "none":
                self._open_server(viewer, rerun_port, web_port, live_memory_limit)
            if record:
                self.start_recording(record)
        except InputError:
            # Nobody has it yet, so nobody else would end its thread.
            self.close()
            raise

    # The Observer's interface: called from the stepping thread

    def started(self, scene: str, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str) -> None:
        """Take copies of the scene and the mesh; they are logged once a run."""
        copies = [None if a is None else np.array(a) for a in (vertices, triangles)]
        self._mark(-1, "started", scene, *copies, mesh_sha256)
        if self._flusher is not None:
            self._flusher.mailbox.hurry()

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        """Note the body from ``time_ns`` on."""
        self._mark(time_ns, "body_changed", body)

    def mesh_changed(
        self, time_ns: int, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str
    ) -> None:
        """Take copies of another mesh; it is logged once too."""
        copies = [None if a is None else np.array(a) for a in (vertices, triangles)]
        self._mark(time_ns, "mesh_changed", *copies, mesh_sha256)

    def state(self, time_ns: int, row: np.ndarray) -> None:
        """Copy one state row (13,)."""
        if self._flusher is not None:
            self._flusher.mailbox.put(time_ns, row)

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
        """Note that a track of the state timeline changes."""
        self._mark(time_ns, "status", track, value)

    def effort(self, time_ns: int, steps: int, force_evaluations: int) -> None:
        """Note what the motion has cost."""
        self._mark(time_ns, "effort", steps, force_evaluations)

    def ghost_began(self, time_ns: int, ghost: BodySnapshot) -> None:
        """Note the ghost from ``time_ns`` on."""
        self._mark(time_ns, "ghost_began", ghost)

    def ghost_state(self, time_ns: int, row: np.ndarray) -> None:
        """Copy one state row (13,) of the ghost."""
        if self._flusher is not None:
            self._flusher.ghosts.put(time_ns, row)

    def reset(self) -> None:
        """Begin a new run."""
        if self._flusher is not None:
            self._flusher.ghosts.mark(-1, "reset")
            self._flusher.mailbox.mark(-1, "reset")
            self._flusher.mailbox.hurry()

    def close(self) -> None:
        """Send what is buffered, finish the file, end the viewers that were started here."""
        if self._closed:
            return
        self._closed = True
        if self._flusher is not None:
            self._flusher.close()
        for process in self._processes:
            process.stop()

    # Recording on and off

    @property
    def recording(self) -> str:
        """Path of the file that is being written, or ""."""
        file = self._flusher.file if self._flusher is not None else None
        return str(file.path) if file is not None else ""

    @property
    def error(self) -> str:
        """Why the last recording stopped, or ""."""
        return self._flusher.error if self._flusher is not None else ""

    def start_recording(self, path: str) -> None:
        """Record to this file from now on; one that was being written is finished first.

        Raises InputError where the file can't be written. A recording that begins in flight shows everything from then
        on.
        """
        self._begin().open_file(Path(path))

    # Inside

    def _mark(self, time_ns: int, kind: str, *content: Any) -> None:
        if self._flusher is not None:
            self._flusher.mailbox.mark(time_ns, kind, *content)
        elif kind in _REMEMBERED:
            self._remembered = [kept for kept in self._remembered if kept[1] != kind]
            self._remembered.append((time_ns, kind, *content))

    def _begin(self) -> Flusher:
        """The flusher, started once there is something to flush to."""
        if self._flusher is None:
            from .flusher import Flusher

            self._flusher = Flusher(self._name, self._initial_view, self._on_error, self._open_ended)
            for remembered in self._remembered:
                self._flusher.mailbox.mark(*remembered)
            self._remembered.clear()
        return self._flusher

    def _open_server(self, viewer: str, rerun_port: int | None, web_port: int | None, memory_limit: str) -> None:
        flusher = self._begin()
        self.live_address = serve_on_port(
            "rerun_port", rerun_port, DEFAULT_RERUN_PORT, lambda port: flusher.serve(port, memory_limit)
        )
        self._report(f"live stream: {self.live_address}")
        self._open_viewer(viewer, web_port)

    def _open_viewer(self, viewer: str, web_port: int | None) -> None:
        from . import viewers

        try:
            if viewer == "web":
                process, self.web_address = serve_on_port(
                    "web_port", web_port, DEFAULT_WEB_PORT, lambda port: viewers.serve_web(port, self.live_address)
                )
                self._processes.append(process)
                self._report(f"viewer: {self.web_address}")
            elif viewer == "native" and viewers.has_display():
                self._processes.append(viewers.open_native(self.live_address))
            elif viewer == "native":
                # Without --connect the program takes the server at its usual port for a viewer, and feeds the stream
                # back into itself.
                command = f"rerun --connect {self.live_address}"
                self._report(f"no display for the viewer; open one elsewhere on this machine: {command}")
        except OSError as error:
            self.web_address = ""
            self._report(f"no viewer: {error}")
