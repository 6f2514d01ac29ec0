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
from dataclasses import dataclass
from typing import Any

from ..base.errors import InputError
from ..session.mailbox import Mailbox, Note
from ..simulation.observer import Reset
from .rerun_internals import forget_closed_recordings
from .streams import (
    FileStream,
    LiveServer,
    LiveStream,
    end_without_waiting,
)
from .writer import SceneWriter

FLUSH_PERIOD_S = 0.5
"""What a kill -9 loses at most, and how far viewers lag; every flush costs about 5 ms and 20 kB of overhead."""

TIMEOUT_S = 10.0
"""A disk that doesn't take what waits in this time is given up."""

STALLED_S = 0.9
"""A flush that takes longer is told of: a report comes once a second, and a stalled file is to be told within two."""


@dataclass(frozen=True)
class _Record:
    """Asks to record to this file from here on, or to none, and to say when the one before is whole."""

    file: FileStream | None
    finished: threading.Event


@dataclass(frozen=True)
class _Show:
    """Asks to show what follows on this stream."""

    stream: LiveStream


class Flusher:
    """Owns the writer and its streams. ``mailbox`` takes rows and events from the stepping thread.

    file is what is being recorded to; error says why a recording stopped, and on_error is called with the same.
    """

    def __init__(self, name: str, on_error: Callable[[str], None], open_ended: bool = False) -> None:
        self.mailbox = Mailbox(lambda: self._lost("recording stopped: nothing can be written to the disk any more"))
        self.file: FileStream | None = None
        self.server: LiveServer | None = None
        self.run_id = uuid.uuid4().hex
        self.error = ""
        self._name = name
        self._run = 1
        self._on_error = on_error
        self._open_ended = open_ended
        self._writer = SceneWriter()
        self._flushing_since_s: float | None = None
        self._thread = threading.Thread(target=self._flush_until_closed, name="rerun", daemon=True)
        self._thread.start()

    # Called from other threads

    @property
    def run_name(self) -> str:
        """The name of the present run's recording."""
        return self._name if self._run == 1 else f"{self._name}, run {self._run}"

    @property
    def stalled(self) -> str:
        """Says that the file hasn't taken what was sent for longer than STALLED_S; empty while it does."""
        since_s, file = self._flushing_since_s, self.file
        if since_s is None or file is None or time.monotonic() < since_s + STALLED_S:
            return ""
        return f"recording {file.path}: nothing could be written for {time.monotonic() - since_s:.1f} s"

    def open_file(self, path: Any) -> None:
        """Record to ``path`` from now on; raises InputError where that can't be written."""
        self.close_file()
        file = FileStream(path, self.run_id, self.run_name, self._open_ended)
        self.error = ""
        self.file = file
        self.mailbox.note(_Record(file, threading.Event()))
        self.mailbox.hurry()

    def close_file(self) -> None:
        """Finish the file, if there is one; returns when it is whole."""
        if self.file is not None:
            self.file = None
            finished = threading.Event()
            self.mailbox.note(_Record(None, finished))
            self.mailbox.wake()
            finished.wait(TIMEOUT_S)

    def serve(self, port: int, memory_limit: str) -> str:
        """Host the live stream; returns its address. Raises PortTakenError."""
        server = LiveServer(port, memory_limit)
        stream = server.open_run(self.run_id, self.run_name)
        self.server = server
        self.mailbox.note(_Show(stream))
        return server.address

    def close(self) -> None:
        """Send the rest, finish the file, end the thread."""
        self.mailbox.close()
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
                self._finish_file()
                self._writer.streams.clear()
                self._lost(f"recording stopped: {type(error).__name__}: {error}")
            self._flushing_since_s = None
            if closing:
                break
            self.mailbox.wait(FLUSH_PERIOD_S)
        self._finish_file()
        if self.server is not None:
            for stream in self._writer.streams:
                if isinstance(stream, LiveStream):
                    self.server.end_run(stream)
            if not self.server.close():
                end_without_waiting()

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
                self._give_up_file(error)
            if stream.missed and not stream.behind:
                self._writer.catch_up(stream)

    def _on_note(self, note: Note) -> None:
        asked = note.event
        if isinstance(asked, Reset):
            self._next_run()
            self._forget_closed_recordings()
        elif isinstance(asked, _Record):
            self._finish_file()
            if asked.file is not None:
                self._writer.attach(asked.file)
            asked.finished.set()
            self._forget_closed_recordings()
        elif isinstance(asked, _Show):
            self._writer.attach(asked.stream)

    def _next_run(self) -> None:
        writer = self._writer
        moved = writer.moved
        streams = list(writer.streams)
        if moved:
            self._run += 1
        self.run_id = uuid.uuid4().hex
        for stream in streams:
            if isinstance(stream, FileStream):
                writer.finish(stream)
        writer.streams.clear()
        writer.restart()
        for stream in streams:
            if isinstance(stream, LiveStream) and self.server is not None:
                live = self.server.open_run(self.run_id, self.run_name)
                live.subject = stream.subject  # viewers keep the layout from run to run
                self.server.end_run(stream)
                writer.attach(live)
            elif isinstance(stream, FileStream):
                try:
                    stream.close()
                    if moved:
                        kept = f"{stream.path.stem}.run{self._run - 1}{stream.path.suffix}"
                        stream.path.rename(stream.path.with_name(kept))
                    file = FileStream(stream.path, self.run_id, self.run_name, self._open_ended)
                except (OSError, InputError) as error:
                    self._lost(str(error))
                    continue
                if self.file is stream:
                    self.file = file
                writer.attach(file)

    def _forget_closed_recordings(self) -> None:
        if not any(stream.behind for stream in self._writer.streams):
            forget_closed_recordings()

    def _finish_file(self) -> None:
        for stream in [s for s in self._writer.streams if isinstance(s, FileStream)]:
            self._writer.streams.remove(stream)
            try:
                self._writer.finish(stream)
                stream.close()
            except OSError as error:
                self._lost(str(error))

    def _give_up_file(self, error: OSError) -> None:
        # Told first: what the library does with a file that it can't write may take for ever.
        self._lost(f"recording stopped: {error}")
        end_without_waiting()
        for stream in [s for s in self._writer.streams if isinstance(s, FileStream)]:
            self._writer.streams.remove(stream)
            stream.abandon()

    def _lost(self, message: str) -> None:
        self.file = None
        self.error = message
        self._on_error(message)
