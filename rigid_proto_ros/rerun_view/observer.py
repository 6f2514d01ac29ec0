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
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError, is_missing
from ..simulation.observer import (
    AccuracyFloor,
    BodyChanged,
    Effort,
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
    StatusChanged,
    StringChanged,
)
from .ports import serve_on_port

if TYPE_CHECKING:
    from .flusher import Flusher
    from .viewers import ViewerProcess

VIEWERS = ("none", "web", "native", "serve")

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090
LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

_REMEMBERED = (Started, MeshChanged, BodyChanged, SceneChanged, StringChanged, GhostChanged)
"""What a recording that is switched on later must know."""

_logger = logging.getLogger(__name__)


class RerunObserver(Observer):
    """Records to ``record`` (a path, or "" for no file) and shows to viewers.

    viewer: ``none``; ``serve`` hosts the live stream on loopback; ``web`` serves the web viewer too; ``native`` opens
    the viewer's window. rerun_port and web_port: None takes the first free port from the default on; a number is used
    or refused. open_ended: the recording may go on for hours, and
    memory must not grow; its file then has no index. ``report`` gets one line for every address and
    every warning, ``on_error`` one line when recording has stopped because the file can't be written; both may be
    called from another thread.

    Raises InputError for a file that can't be written, a port that is taken, an unknown viewer, and without rerun-sdk.
    """

    takes = frozenset(
        {
            *(*_REMEMBERED, Published, GhostPublished, Reset),
            *(LoadBegan, LoadEnded, Logged, Refused, StatusChanged, AccuracyFloor, Effort),
        }
    )

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
        open_ended: bool = False,
    ) -> None:
        if viewer not in VIEWERS:
            raise InputError("viewer", viewer, "one of " + ", ".join(VIEWERS))
        if (record or viewer != "none") and importlib.util.find_spec("rerun") is None:
            raise InputError("record" if record else "viewer", is_missing("rerun-sdk", "rerun"))
        self.live_address = ""
        self.web_address = ""
        self._name = name
        self._open_ended = open_ended
        self._report = report or _logger.info
        self._on_error = on_error or _logger.error
        self._flusher: Flusher | None = None
        self._processes: list[ViewerProcess] = []
        self._remembered: dict[type, Event] = {}
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

    def on(self, event: Event) -> None:
        """Take an event from the stepping thread; states and meshes are copied."""
        flusher = self._flusher
        if flusher is None:
            if isinstance(event, _REMEMBERED):
                # What came last comes last.
                self._remembered.pop(type(event), None)
                self._remembered[type(event)] = _with_copies(event)
        elif isinstance(event, Published):
            flusher.mailbox.put(event.time_ns, event.row)
        elif isinstance(event, GhostPublished):
            flusher.mailbox.put(event.time_ns, event.row, ghost=True)
        elif type(event) in self.takes:
            flusher.mailbox.note(_with_copies(event))
            if isinstance(event, (Started, Reset)):
                flusher.mailbox.hurry()

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

    @property
    def stalled(self) -> str:
        """Says that the file takes nothing at present, or ""."""
        return self._flusher.stalled if self._flusher is not None else ""

    def start_recording(self, path: str) -> None:
        """Record to this file from now on; one that was being written is finished first.

        Raises InputError where the file can't be written. A recording that begins in flight shows everything from then
        on.
        """
        self._begin().open_file(Path(path))

    # Inside

    def _begin(self) -> Flusher:
        """The flusher, started once there is something to flush to."""
        if self._flusher is None:
            from .flusher import Flusher

            self._flusher = Flusher(self._name, self._on_error, self._open_ended)
            for event in self._remembered.values():
                self._flusher.mailbox.note(event)
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


def _with_copies(event: Event) -> Event:
    """The event; one that brings a mesh, with copies of its arrays."""
    if not isinstance(event, (Started, MeshChanged)):
        return event
    vertices, triangles = (None if a is None else np.array(a) for a in (event.vertices, event.triangles))
    return event._replace(vertices=vertices, triangles=triangles)
