# SPDX-License-Identifier: MIT
"""The one thread that turns what the mailbox holds into files and live streams, every half second.

A reset starts simulated time again at 0, and rows of two runs on one timeline could not be told apart, so every run is
a recording of its own; see observer.py for what users see of that.
"""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from ..base.errors import InputError
from ..session.mailbox import Mailbox, Note
from ..simulation.observer import Reset
from .streams import FileStream, LiveServer, LiveStream, Stream, end_without_waiting, forget_closed_recordings
from .writer import SceneWriter

FLUSH_PERIOD_S = 0.5
"""What a kill -9 loses at most, and how far viewers lag; every flush costs about 5 ms and 20 kB of overhead."""

TIMEOUT_S = 10.0
"""A disk that doesn't take what waits in this time is given up."""

STALLED_S = 0.9
"""A flush that takes longer is told of: a report comes once a second, and a stalled file is to be told within two."""


class Flusher:
    """Owns the writer and its streams. ``mailbox`` takes rows and events from the stepping thread.

    error says why the recording stopped, and on_error is called with the same. Nothing is sent before ``start``.
    """

    def __init__(self, name: str, on_error: Callable[[str], None]) -> None:
        self.mailbox = Mailbox(lambda: self._lost("recording stopped: nothing can be written to the disk any more"))
        self.error = ""
        self._name = name
        self._run = 1
        self._run_id = uuid.uuid4().hex
        self._on_error = on_error
        self._writer = SceneWriter()
        self._path: Path | None = None
        self._server: LiveServer | None = None
        self._flushing_since_s: float | None = None
        self._thread = threading.Thread(target=self._flush_until_closed, name="rerun", daemon=True)

    # Called from other threads

    @property
    def stalled(self) -> str:
        """Says that the file hasn't taken what was sent for longer than STALLED_S; empty while it does."""
        since_s = self._flushing_since_s
        if since_s is None or self._path is None or time.monotonic() < since_s + STALLED_S:
            return ""
        return f"recording {self._path}: nothing could be written for {time.monotonic() - since_s:.1f} s"

    def open_file(self, path: Path) -> None:
        """Record to ``path``; raises InputError where that can't be written."""
        self._writer.streams.append(FileStream(path, self._run_id, self._name))
        self._path = path

    def serve(self, port: int, memory_limit: str) -> str:
        """Host the live stream; returns its address. Raises PortTakenError."""
        self._server = LiveServer(port, memory_limit, self._run_id, self._name)
        self._writer.streams.append(self._server.host)
        return self._server.address

    def start(self) -> None:
        """Begin to send."""
        self._thread.start()

    def close(self) -> None:
        """Send the rest, finish the file, end the thread."""
        self.mailbox.close()
        if self._thread.ident is None:
            self._finish()
            return
        self._thread.join(TIMEOUT_S)
        if self._thread.is_alive():
            end_without_waiting()
            self._lost("recording stopped: the last states could not be written")

    # The thread

    def _flush_until_closed(self) -> None:
        while True:
            closing = self.mailbox.closed
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
            self.mailbox.wait(FLUSH_PERIOD_S)
        self._finish()

    def _flush(self) -> None:
        """Send the blocks that wait and what has been put since; not what arrives meanwhile, a few rows a time."""
        more = True
        while more:
            block = self.mailbox.take()
            if block is None:
                break
            more = block.handed_over
            self._writer.write(block, self._on_note)
        for stream in list(self._writer.streams):
            try:
                stream.flush()
            except OSError as error:
                self._give_up(stream, error)
            if stream.missed and not stream.behind:
                self._writer.catch_up(stream)

    def _on_note(self, note: Note) -> None:
        """A reset: another run, in a recording of its own."""
        if not isinstance(note.event, Reset):
            return
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
