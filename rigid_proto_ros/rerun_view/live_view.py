# SPDX-License-Identifier: MIT
"""The live view of a running flight, for viewers on this machine."""

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
"""Memory limit of the server's buffer for viewers that connect late, a minute at 1 kHz; the oldest data is dropped
first. The process uses about twice as much.
"""

REPEATED_ROWS = 16384
"""Number of states after which long-lived data is sent again, a fourth of the server's buffer."""

START_TIMEOUT_S = 5.0

LEAVE_S = 2.0
"""How long the end of a run waits for live streams [s], so that a viewer that doesn't read can't block it."""


class LiveView(RerunObserver):
    """Shows a running flight. viewer: ``web`` serves the web viewer, ``native`` opens the viewer's window. rerun_port
    and web_port: None for the first free port from the default on; a number is used or refused. report(line) is called
    for every address and warning.

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
                # Without --connect, rerun would treat the server at its usual port as a viewer and send the stream back
                # to it.
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
        if before is not self._host:  # the host's server must persist
            before.leave()
        return stream

    def _end(self, stream: Stream) -> None:
        # Includes the streams of earlier runs.
        leaving = [thread for thread in threading.enumerate() if thread.name == "rerun leaving"]
        leaving += [each.leave() for each in {stream, self._host}]
        deadline = time.monotonic() + LEAVE_S
        for thread in leaving:
            thread.join(max(0.0, deadline - time.monotonic()))
        if any(thread.is_alive() for thread in leaving):
            # Otherwise the library waits at the end of the process, without limit, until every recording is taken.
            rr.unregister_shutdown()

    def _write(self, events: list[TimedEvent]) -> None:
        """Write events, and from time to time send long-lived data again, since the server drops the oldest data, which
        viewers that connect late would lack.
        """
        super()._write(events)
        self._rows_since_repeat += len(events)
        if self._rows_since_repeat >= REPEATED_ROWS and self._stream is not None:
            self._rows_since_repeat = 0
            if not self._stream.behind:
                self._describe(self._stream)

    def close(self) -> None:
        """Close the stream, and stop the viewer if it was started here."""
        super().close()
        if self._process is not None:
            self._process.stop()


def host(port: int, recording_id: str, name: str) -> tuple[Stream, str]:
    """A stream with a gRPC server on loopback, which ends with the stream, and its address for other streams and
    viewers. Raises PortTakenError if another process listens on the port.
    """
    stream = Stream(rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=LIVE_MEMORY_LIMIT), recording_id, name)
    stream.forgets = True
    deadline = time.monotonic() + START_TIMEOUT_S
    try:
        # The library reports a server that can't listen only as a failed flush, and with delay.
        while time.monotonic() < deadline:
            stream.recording.flush(timeout_sec=START_TIMEOUT_S)
            if listens(os.getpid(), port):
                return stream, f"rerun+http://{LOOPBACK}:{port}/proxy"
            time.sleep(0.02)
        raise RuntimeError(f"nothing serves on port {port}")
    except RuntimeError as error:
        stream.recording.disconnect()
        raise PortTakenError(last_line(error)) from error
