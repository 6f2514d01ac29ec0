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

import numpy as np

from ..base.errors import InputError, is_missing
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
from . import viewers
from .ports import serve_on_port

VIEWERS = ("none", "web", "native", "serve")

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. ``report`` gets one line for every address and every warning, ``on_error`` one line when recording has
    stopped because the file can't be written; both may be called from another thread.

    Raises InputError for a file that can't be written, a port that is taken, an unknown viewer, and without rerun-sdk.
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
        report: Callable[[str], None] | None = None,
        on_error: Callable[[str], None] | None = None,
        live_memory_limit: str = LIVE_MEMORY_LIMIT,
    ) -> None:
        if viewer not in VIEWERS:
            raise InputError("viewer", viewer, "one of " + ", ".join(VIEWERS))
        if importlib.util.find_spec("rerun") is None:
            raise InputError("record" if record else "viewer", is_missing("rerun-sdk", "rerun"))
        from .flusher import Flusher

        self.live_address = ""
        self.web_address = ""
        self._report = report or _logger.info
        self._flusher = flusher = Flusher(name, on_error or _logger.error)
        self._viewer: viewers.ViewerProcess | None = None
        self._closed = False
        try:
            if viewer != "none":
                self.live_address = serve_on_port(
                    "rerun_port", rerun_port, DEFAULT_RERUN_PORT, lambda port: flusher.serve(port, live_memory_limit)
                )
                self._report(f"live stream: {self.live_address}")
                self._open_viewer(viewer, web_port)
            if record:
                flusher.open_file(Path(record))
        except InputError:
            # Nobody has it yet, so nobody else would end what was started.
            self.close()
            raise
        flusher.start()

    def on(self, event: Event) -> None:
        """Take an event from the stepping thread; states and meshes are copied."""
        mailbox = self._flusher.mailbox
        if isinstance(event, Published):
            mailbox.put(event.time_ns, event.row)
        elif isinstance(event, GhostPublished):
            mailbox.put(event.time_ns, event.row, ghost=True)
        elif type(event) in self.takes:
            if isinstance(event, (Started, MeshChanged)):
                vertices, triangles = (None if a is None else np.array(a) for a in (event.vertices, event.triangles))
                event = event._replace(vertices=vertices, triangles=triangles)
            mailbox.note(event)
            if isinstance(event, (Started, Reset)):
                mailbox.hurry()

    def close(self) -> None:
        """Send what is buffered, finish the file, end the viewer that was started here."""
        if self._closed:
            return
        self._closed = True
        self._flusher.close()
        if self._viewer is not None:
            self._viewer.stop()

    @property
    def error(self) -> str:
        """Why the recording stopped, or ""."""
        return self._flusher.error

    @property
    def stalled(self) -> str:
        """Says that the file takes nothing at present, or ""."""
        return self._flusher.stalled

    def _open_viewer(self, viewer: str, web_port: int | None) -> None:
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
