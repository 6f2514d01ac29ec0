# SPDX-License-Identifier: MIT
"""Where logged data goes: a file, viewers on this machine, or both, each with a recording stream of its own.

Two streams rather than one with two sinks: replacing a stream's sinks shuts its server down, so no file could be begun
anew at a reset while somebody watches.

Two things are done by functions of the SDK that it doesn't promise (tried with rerun-sdk 0.41.0):
``rr.send_blueprint`` keeps a stream of every layout for ever, two threads and a third of a megabyte each, and threads
and memory of closed recordings are kept until the process ends.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rerun as rr
import rerun_bindings
from rerun.recording_stream import RecordingStream

from ..base.errors import InputError
from ..base.files import output_file
from ..base.provenance import cpu, versions
from ..picture.backend import DrawnMesh
from .layout import Finished, Subject, blueprint
from .ports import LOOPBACK, PortTakenError, listens
from .rrd_file import mark_end

APPLICATION_ID = "rigid_proto_ros"
"""Of live streams: viewers keep one layout for all recordings of an application."""

FLUSH_TIMEOUT_S = 5.0
"""A disk that takes longer than this to take half a second of data counts as lost."""

TAKEN_S = 0.05
"""A live stream that hasn't taken half a second of data in this time is behind: some viewer doesn't read."""

LEAVE_S = 2.0
"""How long the end of a run waits for live streams; a viewer that doesn't read holds nobody up."""


class Stream:
    """A Rerun recording: one run of the simulation, with simulated time from 0.

    meshes: by part the mesh that it was sent last, and how many it was sent. styled: by entity what its style was sent
    for, a size or a number of columns. subject: what the layout is for that it was sent. behind: what was sent hasn't
    been taken yet, so that nothing more should be; missed: something was left out meanwhile.
    """

    def __init__(self, recording_id: str, sink: Any, name: str, application_id: str = APPLICATION_ID) -> None:
        self.application_id = application_id
        self.meshes: dict[str, tuple[int, DrawnMesh]] = {}
        self.styled: dict[str, float] = {}
        self.subject: Subject | None = None
        self.behind = self.missed = False
        self.recording = rr.RecordingStream(application_id, recording_id=recording_id)
        rr.set_sinks(sink, recording=self.recording)
        self.recording.send_recording_name(name)
        made_with = [f"{package} {version}" for package, version in versions("rerun-sdk").items()]
        self.recording.send_property("made_with", rr.AnyValues(versions=made_with, cpu=cpu()))

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
        """Make a viewer open with the layout for what the flight is about: once, and again when it is finished; nothing
        that somebody has arranged is undone in between.
        """
        if self.subject is not None and finished is None:
            return
        self.subject = subject
        layout = RecordingStream._from_native(  # noqa: SLF001 (see above)
            rerun_bindings.new_blueprint(
                application_id=self.application_id, make_default=False, make_thread_default=False, default_enabled=True
            )
        )
        layout.set_time("blueprint", sequence=0)
        blueprint(subject, finished)._log_to_stream(layout)  # noqa: SLF001 (see above)
        messages = layout.memory_recording().storage
        rerun_bindings.send_blueprint(messages, True, True, recording=self.recording.to_native())
        layout.disconnect()

    def flush(self) -> None:
        """Hand on what was sent, and see whether it arrives."""
        raise NotImplementedError

    def close(self) -> None:
        """Finish and let go of the sink."""
        self.recording.disconnect()

    def leave(self) -> threading.Thread:
        """Close on a thread of its own: the library waits without limit for a viewer that doesn't read, and at times
        for a writer that has died.
        """
        leaving = threading.Thread(target=self.recording.disconnect, name="rerun leaving", daemon=True)
        leaving.start()
        return leaving


class FileStream(Stream):
    """One run in one .rrd file, complete on disk (in the system's cache) after each ``flush``.

    It has no index: the library would gather that in memory, 3 kB for each piece that it writes, 200 MB an hour.
    """

    def __init__(self, path: Path, recording_id: str, name: str) -> None:
        self.path = path
        if path.suffix != ".rrd":
            raise InputError("record", str(path), "a path that ends in .rrd or .mcap")
        output_file("record", path)
        try:
            # An application of its own: in a viewer that shows another recording, too, it has its own layout.
            application_id = f"{APPLICATION_ID}_{recording_id[:8]}"
            super().__init__(recording_id, rr.FileSink(path, write_footer=False), name, application_id)
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
            self._inode = path.stat().st_ino
        except (RuntimeError, OSError) as error:
            raise InputError("record", str(path), f"a file that can be written ({_last_line(error)})") from error

    def flush(self) -> None:
        """Write out; raises OSError where the data would not arrive in the file of this name."""
        try:
            self.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
            if self.path.stat().st_ino != self._inode:
                raise OSError("another file took its place")
            return
        except RuntimeError as error:
            reason = _reason_on_disk(self.path) or _last_line(error)
        except OSError as error:
            reason = error.strerror or str(error)
        raise OSError(f"{self.path}: {reason}")

    def close(self) -> None:
        """Write the rest and mark the end; raises OSError as ``flush`` does."""
        self.flush()
        super().close()
        mark_end(self.path)


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


class LiveServer:
    """A gRPC server on loopback with bounded memory; viewers come and go without the sender noticing.

    host: the first run's stream. The server lives as long as that, which is therefore kept. Raises PortTakenError where
    another process listens on the port.
    """

    def __init__(self, port: int, memory_limit: str, recording_id: str, name: str) -> None:
        self.address = f"rerun+http://{LOOPBACK}:{port}/proxy"
        self._leaving: list[threading.Thread] = []
        self.host = LiveStream(recording_id, rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=memory_limit), name)
        deadline = time.monotonic() + FLUSH_TIMEOUT_S
        try:
            # A server that can't listen says so to nobody but who waits for what was sent, and not at once.
            while True:
                self.host.recording.flush(timeout_sec=FLUSH_TIMEOUT_S)
                if listens(os.getpid(), port):
                    return
                if time.monotonic() > deadline:
                    raise RuntimeError(f"nothing serves on port {port}")
                time.sleep(0.02)
        except RuntimeError as error:
            self.host.close()
            raise PortTakenError(_last_line(error)) from error

    def next_run(self, before: LiveStream, recording_id: str, name: str) -> LiveStream:
        """A stream for a new run in place of the one before; viewers keep their layout."""
        following = LiveStream(recording_id, rr.GrpcSink(self.address), name)
        following.subject = before.subject
        self.end_run(before)
        return following

    def end_run(self, stream: LiveStream) -> None:
        """Finish a run that no more data follows; the server stays."""
        if stream is not self.host:
            self._leaving = [thread for thread in self._leaving if thread.is_alive()]
            self._leaving.append(stream.leave())

    def close(self) -> bool:
        """Shut the server down; returns whether that is done, or whether some viewer doesn't read what was sent."""
        deadline = time.monotonic() + LEAVE_S
        self._leaving.append(self.host.leave())
        for thread in self._leaving:
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in self._leaving)


def forget_closed_recordings() -> None:
    """Give back threads and memory of recordings that are closed. Waits for all others to take what they were sent."""
    users_own = rr.get_global_data_recording()
    try:
        rerun_bindings.flush_and_cleanup_orphaned_recordings()
    except RuntimeError:
        # Some other recording of this process can't be flushed; another time.
        pass
    if users_own is not None:
        rr.set_global_data_recording(users_own)


def end_without_waiting() -> None:
    """What the library does at the end of the process is to wait, without limit, for every recording to be taken."""
    rr.unregister_shutdown()


def _last_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


def _reason_on_disk(path: Path) -> str:
    try:
        disk = os.statvfs(path.parent)
    except OSError as error:
        return error.strerror or "the folder is gone"
    return "no space left on the disk" if disk.f_bavail * disk.f_frsize < 1_000_000 else ""
