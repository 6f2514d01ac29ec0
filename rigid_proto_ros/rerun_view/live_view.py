# SPDX-License-Identifier: MIT
"""A flight as viewers on this machine show it while it goes on."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from functools import partial

import rerun as rr

from ..base.errors import InputError
from ..base.ports import LOOPBACK
from ..session.mailbox import TimedEvent
from . import viewers
from .backend import Stream, last_line
from .observer import RerunObserver
from .ports import PortTakenError, listens, serve_on_port

DEFAULT_RERUN_PORT = 9876
DEFAULT_WEB_PORT = 9090

LIVE_MEMORY_LIMIT = "32MiB"
"""What the server keeps for viewers that come late, a minute at 1 kHz; the oldest is dropped first. It takes about
twice that of this process's memory.
"""

REPEATED_ROWS = 16384
"""After as many states viewers are told again what holds since long: a fourth of what the live server keeps."""

START_TIMEOUT_S = 5.0

LEAVE_S = 2.0
"""How long the end of a run waits for live streams; a viewer that doesn't read holds nobody up."""


class LiveView(RerunObserver):
    """viewer: ``web`` serves the web viewer, ``native`` opens the viewer's window. rerun_port and web_port: None takes
    the first free port from the default on; a number is used or refused. ``report`` gets one line for every address
    and every warning.

    Raises InputError for a port that is taken.
    """

    purpose = "live view"

    def __init__(
        self,
        viewer: str,
        rerun_port: int | None = None,
        web_port: int | None = None,
        name: str = "rigid_body",
        report: Callable[[str], None] = print,
        on_error: Callable[[str], None] | None = None,
    ) -> None:
        self.live_address = self.web_address = ""
        self._viewer, self._ports, self._report = viewer, (rerun_port, web_port), report
        self._process: viewers.ViewerProcess | None = None
        self._rows_since_repeat = 0
        super().__init__(name, "", on_error)

    def _open(self, run_id: str, name: str) -> Stream:
        rerun_port, web_port = self._ports
        serve = partial(host, recording_id=run_id, name=name)
        self._host, self.live_address = serve_on_port("rerun_port", rerun_port, DEFAULT_RERUN_PORT, serve)
        self._report(f"live stream: {self.live_address}")
        try:
            if self._viewer == "web":
                self._process, self.web_address = serve_on_port(
                    "web_port", web_port, DEFAULT_WEB_PORT, lambda port: viewers.serve_web(port, self.live_address)
                )
                self._report(f"viewer: {self.web_address}")
            elif viewers.has_display():
                self._process = viewers.open_native(self.live_address)
            else:
                # Without --connect the program takes the server at its usual port for a viewer, and feeds the stream
                # back into itself.
                self._report(
                    f"no display for the viewer; elsewhere on this machine: rerun --connect {self.live_address}"
                )
        except InputError:
            self._host.leave()
            raise
        except OSError as error:
            self._report(f"no viewer: {error}")
        return self._host

    def _open_next(self, before: Stream, run_id: str, name: str) -> Stream:
        stream = Stream(rr.GrpcSink(self.live_address), run_id, name)
        stream.forgets = True
        stream.arranged = before.arranged  # viewers keep their layout
        if before is not self._host:  # whose server stays
            before.leave()
        return stream

    def _end(self, stream: Stream) -> None:
        # Also of runs before.
        leaving = [thread for thread in threading.enumerate() if thread.name == "rerun leaving"]
        leaving += [each.leave() for each in {stream, self._host}]
        deadline = time.monotonic() + LEAVE_S
        for thread in leaving:
            thread.join(max(0.0, deadline - time.monotonic()))
        if any(thread.is_alive() for thread in leaving):
            # At the end of the process the library would wait, without limit, for every recording to be taken.
            rr.unregister_shutdown()

    def _write(self, events: list[TimedEvent]) -> None:
        """Now and then what was said long ago again: the server drops the oldest, so viewers that come late lack it."""
        super()._write(events)
        self._rows_since_repeat += len(events)
        if self._rows_since_repeat >= REPEATED_ROWS and self._stream is not None:
            self._rows_since_repeat = 0
            if not self._stream.behind:
                self._describe(self._stream)

    def close(self) -> None:
        """With the viewer that was started here."""
        super().close()
        if self._process is not None:
            self._process.stop()


def host(port: int, recording_id: str, name: str) -> tuple[Stream, str]:
    """A stream with a gRPC server on loopback, which lives as long as it does, and the address to which other streams
    send and viewers come. Raises PortTakenError where another process listens on the port.
    """
    stream = Stream(rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=LIVE_MEMORY_LIMIT), recording_id, name)
    stream.forgets = True
    deadline = time.monotonic() + START_TIMEOUT_S
    try:
        # A server that can't listen says so to nobody but who waits for what was sent, and not at once.
        while time.monotonic() < deadline:
            stream.recording.flush(timeout_sec=START_TIMEOUT_S)
            if listens(os.getpid(), port):
                return stream, f"rerun+http://{LOOPBACK}:{port}/proxy"
            time.sleep(0.02)
        raise RuntimeError(f"nothing serves on port {port}")
    except RuntimeError as error:
        stream.recording.disconnect()
        raise PortTakenError(last_line(error)) from error
