# SPDX-License-Identifier: MIT
"""Where logged data goes: a file, viewers on this machine, or both, each with a recording stream of its own.

Two streams rather than one with two sinks: replacing a stream's sinks shuts its server down, so a file could not be
opened or closed while somebody watches.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rerun as rr

from ..core.errors import InputError
from .ports import LOOPBACK

APPLICATION_ID = "rigid_proto_ros"
FLUSH_TIMEOUT_S = 5.0
"""A disk that takes longer than this to take half a second of data counts as lost."""


class RecordingLostError(OSError):
    """The file can't be written any more: full disk, lost folder, file taken away."""


class Stream:
    """A Rerun recording: one run of the simulation, with simulated time from 0."""

    may_skip = False
    """Whether states may be left out when the machine doesn't keep up."""

    framed: tuple[float, bool] | None = None
    """Size of the view and presence of a ghost that the layout was last sent for."""

    def __init__(self, recording_id: str, sink: Any, name: str) -> None:
        self.recording = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id)
        rr.set_sinks(sink, recording=self.recording)
        self.recording.send_recording_name(name)
        self.recording.send_property(
            "made_with",
            rr.AnyValues(
                versions=[f"{package} {version}" for package, version in _versions()],
                cpu=platform.processor() or platform.machine(),
            ),
        )

    def send(self, entity: str, times: Iterable[Any], columns: Iterable[Any]) -> None:
        """Log columns of an entity at the given time columns."""
        rr.send_columns(entity, indexes=times, columns=columns, recording=self.recording)

    def log_static(self, entity: str, *values: Any) -> None:
        """Log values that hold at all times."""
        rr.log(entity, *values, static=True, recording=self.recording)

    def is_framed_for(self, size: float, ghost: bool) -> bool:
        """Whether the layout sent last still fits: each that is sent costs two threads that the SDK never gives back."""
        return self.framed is not None and self.framed[1] == ghost and 0.5 <= size / self.framed[0] <= 2.0

    def send_blueprint(self, blueprint: Any) -> None:
        """Make this the layout that a viewer opens with."""
        rr.send_blueprint(blueprint, recording=self.recording)

    def flush(self) -> None:
        """Hand everything on to where it goes."""
        self.recording.flush(timeout_sec=0.0)

    def close(self) -> None:
        """Finish and let go of the sink."""
        self.recording.disconnect()


class FileStream(Stream):
    """One run in one .rrd file, complete on disk (in the system's cache) after each ``flush``."""

    def __init__(self, path: Path, recording_id: str, name: str) -> None:
        self.path = path
        if path.suffix != ".rrd":
            raise InputError("record", str(path), "the path of an .rrd file")
        try:
            super().__init__(recording_id, rr.FileSink(path), name)
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
            self._inode = path.stat().st_ino
        except (RuntimeError, OSError) as error:
            raise InputError(
                "record", str(path), f"a file in an existing folder with space left ({_last_line(error)})"
            ) from error

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
        finally:
            super().close()

    def abandon(self) -> None:
        """Let go of a file that can't be written."""
        super().close()


class LiveStream(Stream):
    """One run for viewers; the first one hosts the server, later ones send to it."""

    may_skip = True

    def flush(self) -> None:
        """Nothing to do: the stream sends by itself, and a viewer that doesn't take it must hold nobody up."""


class LiveServer:
    """A gRPC server on loopback with bounded memory; viewers come and go without the sender noticing."""

    def __init__(self, port: int, memory_limit: str) -> None:
        self._sink = rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=memory_limit)
        self._host: LiveStream | None = None
        self.address = f"rerun+http://{LOOPBACK}:{port}/proxy"

    def open_run(self, recording_id: str, name: str) -> LiveStream:
        """A stream for a new run. The server lives as long as the first one, which is therefore kept."""
        if self._host is None:
            self._host = LiveStream(recording_id, self._sink, name)
            return self._host
        stream = LiveStream(recording_id, rr.GrpcSink(self.address), name)
        # Viewers keep the layout from run to run.
        stream.framed = self._host.framed
        return stream

    def end_run(self, stream: LiveStream) -> None:
        """Finish a run that no more data follows; the server stays."""
        if stream is not self._host:
            stream.close()

    def close(self) -> None:
        """Shut the server down."""
        if self._host is not None:
            self._host.close()


def _versions() -> list[tuple[str, str]]:
    packages = ["rigid_proto_ros", "numpy", "numba", "rerun-sdk"]
    found = [("python", platform.python_version())]
    for package in packages:
        try:
            found.append((package, importlib.metadata.version(package)))
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


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
