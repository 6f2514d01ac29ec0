# SPDX-License-Identifier: MIT
"""Where logged data goes: a file, viewers on this machine, or both, each with a recording stream of its own.

Two streams rather than one with two sinks: replacing a stream's sinks shuts its server down, so a file could not be
opened or closed while somebody watches.
"""

from __future__ import annotations

import os
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rerun as rr

from ..base.errors import InputError
from ..base.files import output_file
from ..base.provenance import cpu, versions
from ..picture.backend import DrawnMesh
from .layout import Finished, Layout, Subject
from .ports import LOOPBACK, PortTakenError, listens
from .rerun_internals import send_blueprint
from .rrd_file import end_without_index

APPLICATION_ID = "rigid_proto_ros"
"""Of live streams: viewers keep one layout for all recordings of an application."""
FLUSH_TIMEOUT_S = 5.0
"""A disk that takes longer than this to take half a second of data counts as lost."""

TAKEN_S = 0.05
"""A live stream that hasn't taken half a second of data in this time is behind: some viewer doesn't read."""

LEAVE_S = 2.0
"""How long the end of a run waits for live streams; a viewer that doesn't read holds nobody up."""


class RecordingLostError(OSError):
    """The file can't be written any more: full disk, lost folder, file taken away."""


class Stream(ABC):
    """A Rerun recording: one run of the simulation, with simulated time from 0."""

    behind = False
    """Whether what was sent hasn't been taken yet, so that nothing more should be."""

    missed = False
    """Whether something was left out while it was behind: kept by who sends."""

    shown_from_start = True
    """Whether somebody may look at it before it is finished: otherwise it has one layout, that of a finished run."""

    subject: Subject | None = None
    """What the layout is for that its viewers were sent."""

    def __init__(self, recording_id: str, sink: Any, name: str, application_id: str = APPLICATION_ID) -> None:
        self.application_id = application_id
        self.meshes: dict[str, tuple[int, DrawnMesh]] = {}
        """By part the mesh that it was sent last, and how many before it, from 1."""
        self.styled: dict[str, float] = {}
        """By entity what its style was sent for: a size, or a number of columns."""
        self.recording = rr.RecordingStream(application_id, recording_id=recording_id)
        rr.set_sinks(sink, recording=self.recording)
        self.recording.send_recording_name(name)
        self.recording.send_property(
            "made_with",
            rr.AnyValues(
                versions=[f"{package} {version}" for package, version in versions("rerun-sdk").items()],
                cpu=cpu(),
            ),
        )

    def send(self, entity: str, times: Iterable[Any], columns: Iterable[Any]) -> None:
        """Log columns of an entity at the given time columns."""
        rr.send_columns(entity, indexes=times, columns=columns, recording=self.recording)

    def log_static(self, entity: str, *values: Any) -> None:
        """Log values that hold at all times. They arrive before what is sent after them: rr.log would put them aside
        until a flush, and columns would overtake them.
        """
        batches = [batch for value in values for batch in value.as_component_batches()]
        self.send(entity, [], [batch.partition([len(batch.as_arrow_array())]) for batch in batches])

    def send_layout(self, subject: Subject, finished: Finished | None = None) -> None:
        """Make a viewer open with the layout for what the flight is about.

        A run that begins with a ghost, after one without, or the other way round, brings another layout; within a run,
        and at other resets, the layout stays, so that nothing that somebody has arranged is undone.
        """
        if finished is None and self.subject is not None and self.subject.ghost == subject.ghost:
            return
        if finished is None and not self.shown_from_start:
            return
        self.subject = subject
        send_blueprint(self.application_id, Layout(subject, finished).blueprint(), self.recording)

    @abstractmethod
    def flush(self) -> None:
        """Hand on what was sent, and see whether it arrives."""

    def close(self) -> None:
        """Finish and let go of the sink."""
        self.recording.disconnect()


class FileStream(Stream):
    """One run in one .rrd file, complete on disk (in the system's cache) after each ``flush``.

    open_ended: nobody knows how long the run will be, so the file is written without an index: the library would gather
    that in memory, 3 kB for each piece that it writes, 200 MB an hour. ``replay --repair`` makes a copy with one.
    """

    def __init__(self, path: Path, recording_id: str, name: str, open_ended: bool = False) -> None:
        self.path = path
        self.open_ended = self.shown_from_start = open_ended
        if path.suffix != ".rrd":
            raise InputError("record", str(path), "a path that ends in .rrd or .mcap")
        output_file("record", path)
        try:
            # An application of its own: in a viewer that shows another recording, too, it has its own layout.
            application_id = f"{APPLICATION_ID}_{recording_id[:8]}"
            super().__init__(recording_id, rr.FileSink(path, write_footer=not open_ended), name, application_id)
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
            self._inode = path.stat().st_ino
        except (RuntimeError, OSError) as error:
            raise InputError("record", str(path), f"a file that can be written ({_last_line(error)})") from error

    def flush(self) -> None:
        """Write out; raises RecordingLostError where the data would not arrive in the file of this name."""
        try:
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            raise RecordingLostError(f"{self.path}: {_reason_on_disk(self.path) or _last_line(error)}") from error
        reason = _reason_gone(self.path, self._inode)
        if reason:
            raise RecordingLostError(f"{self.path}: {reason}")

    def close(self) -> None:
        """Write the rest and the footer; raises RecordingLostError as ``flush`` does."""
        try:
            self.flush()
        except RecordingLostError:
            self.abandon()
            raise
        super().close()
        if self.open_ended:
            end_without_index(self.path)

    def abandon(self) -> None:
        """Let go of a file that can't be written, on a thread of its own: the library sometimes waits without limit for
        its writer, which is gone.
        """
        threading.Thread(target=super().close, name="rerun leaving", daemon=True).start()


class LiveStream(Stream):
    """One run for viewers; the first one hosts the server, later ones send to it."""

    def flush(self) -> None:
        """Ask whether the server has taken everything. It waits for its slowest viewer, and so would all
        that is sent.
        """
        try:
            self.recording.flush(timeout_sec=TAKEN_S)
            self.behind = False
        except RuntimeError:
            self.behind = True

    def leave(self) -> threading.Thread:
        """Close on a thread of its own: the library waits without limit for a viewer that doesn't read."""
        leaving = threading.Thread(target=self.close, name="rerun leaving", daemon=True)
        leaving.start()
        return leaving


class LiveServer:
    """A gRPC server on loopback with bounded memory; viewers come and go without the sender noticing."""

    def __init__(self, port: int, memory_limit: str) -> None:
        self._port = port
        self._sink = rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=memory_limit)
        self._host: LiveStream | None = None
        self._leaving: list[threading.Thread] = []
        self.address = f"rerun+http://{LOOPBACK}:{port}/proxy"

    def open_run(self, recording_id: str, name: str) -> LiveStream:
        """A stream for a new run. The server lives as long as the first one, which is therefore kept.

        Raises PortTakenError where the first one finds that another process listens on the server's port.
        """
        if self._host is None:
            host = LiveStream(recording_id, self._sink, name)
            deadline = time.monotonic() + FLUSH_TIMEOUT_S
            try:
                # A server that can't listen says so to nobody but who waits for what was sent, and not at once.
                while True:
                    host.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
                    if listens(os.getpid(), self._port):
                        break
                    if time.monotonic() > deadline:
                        raise RuntimeError(f"nothing serves on port {self._port}")
                    time.sleep(0.02)
            except RuntimeError as error:
                host.close()
                raise PortTakenError(_last_line(error)) from error
            self._host = host
            return host
        return LiveStream(recording_id, rr.GrpcSink(self.address), name)

    def end_run(self, stream: LiveStream) -> None:
        """Finish a run that no more data follows; the server stays."""
        if stream is not self._host:
            self._leaving = [thread for thread in self._leaving if thread.is_alive()]
            self._leaving.append(stream.leave())

    def close(self) -> bool:
        """Shut the server down; returns whether that is done, or whether some viewer doesn't read what was sent."""
        deadline = time.monotonic() + LEAVE_S
        if self._host is not None:
            self._leaving.append(self._host.leave())
        for thread in self._leaving:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in self._leaving)


def end_without_waiting() -> None:
    """What the library does at the end of the process is to wait, without limit, for every recording to be taken."""
    rr.unregister_shutdown()


def _last_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


def _reason_gone(path: Path, inode: int) -> str:
    try:
        return "" if path.stat().st_ino == inode else "another file took its place"
    except OSError as error:
        return error.strerror or "the file is gone"


def _reason_on_disk(path: Path) -> str:
    try:
        disk = os.statvfs(path.parent)
    except OSError as error:
        return error.strerror or "the folder is gone"
    return "no space left on the disk" if disk.f_bavail * disk.f_frsize < 1_000_000 else ""
