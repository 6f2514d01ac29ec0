# SPDX-License-Identifier: MIT
"""The observer that records a flight as an MCAP file: the node's topics, as in a bag, and the mesh file as an
attachment.

The stepping thread only queues events; a writing thread writes them, and ends a chunk each time, so that it is on disk.
All runs are in one file: a reset starts the next one, as in a bag of the topics.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.files import file_for_one_writer
from ..base.provenance import cpu, versions
from ..mesh.locate import resolve_mesh
from ..motion.body import Body
from ..parameters.declarations import Parameters
from ..scene import cdr
from ..scene.command_codec import frame_names
from ..scene.scenario import mesh_file, mesh_sha256_of
from ..scene.scene_file import read_scene_text
from ..simulation.observer import (
    AccuracyFloor,
    Applied,
    BodyChanged,
    Event,
    Logged,
    Published,
    Reset,
    SceneChanged,
    Started,
)
from .mailbox import WritingObserver
from .messages import (
    DEFINITIONS,
    FLOOR,
    MADE_WITH,
    PROJECTIONS,
    TOPICS,
    TRANSFORM_NS,
    applied_bytes,
    description,
    inertia_bytes,
    offered_qos,
    transform_bytes,
)

if TYPE_CHECKING:
    from mcap.writer import Writer

DRAWN = (".obj", ".stl", ".glb", ".gltf", ".dae")
"""Suffixes of mesh files that viewers of bags can read."""

CHUNK_NS = 500_000_000
"""Largest simulated time in a chunk [ns], which is lost if the file is truncated inside it; for runs faster than real
time.
"""


class McapObserver(WritingObserver):
    """Records to ``path``, with the topic and frame names of the node.

    Messages are logged at wall time, as in bags, or with ``simulated_log`` at simulated time, each run after the one
    before. files: (name, bytes) of available meshes, whose own files may be gone. Raises InputError if the file can't
    be opened.
    """

    period_s = 0.4  # the part of a recording that kill -9 loses
    takes = frozenset({Published, Logged, Applied, BodyChanged, SceneChanged, Started, Reset, AccuracyFloor})

    def __init__(
        self,
        path: str | Path,
        node_name: str = "rigid_body",
        parameters: Parameters | None = None,
        on_error: Callable[[str], None] | None = None,
        simulated_log: bool = False,
        files: Sequence[tuple[str, bytes]] = (),
    ) -> None:
        super().__init__(str(path), on_error)
        self._path = path
        self._simulated_log = simulated_log
        self._run_begins_ns = self._latest_log_ns = self._chunk = self._run = 0
        self._world, self._body_frame = frame_names(parameters or Parameters(), node_name)
        self._scene = self._mesh_sha256 = self._mesh = self._description = ""
        self._body: Body | None = None
        self._next_transform_ns = 0
        self._files = files
        self._attached: set[str] = set()
        self._writer: Writer | None = None
        try:
            self._stream = file_for_one_writer("record", path)  # closed by the thread
            self._writer = self._begin(node_name)
        except OSError as error:
            accepted = f"a file that can be written ({error.strerror})"
            raise InputError("record", str(path), accepted) from None
        self._thread.start()

    def _begin(self, node_name: str) -> Writer:
        """Start the file and declare its topics; raises OSError."""
        from mcap.writer import Writer  # imported only when recording

        writer = Writer(self._stream)
        writer.start(profile="ros2")
        began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        writer.add_metadata(MADE_WITH, {"cpu": cpu(), **versions("mcap"), "began": began})
        schemas = {
            message_type: writer.register_schema(message_type, "ros2msg", definition.encode())
            for message_type, definition in DEFINITIONS.items()
        }
        self._channels = {
            name: writer.register_channel(
                name if name.startswith("/") else f"/{node_name.strip('/')}/{name}",
                "cdr",
                schemas[message_type],
                {"offered_qos_profiles": offered_qos(name)},
            )
            for name, message_type in TOPICS.items()
        }
        self._stream.flush()
        return writer

    # The writing thread

    def _write_waiting(self) -> None:
        for events in self._mailbox.take():
            if self._writer is not None:
                for wall_ns, event in events:
                    self._write(self._writer, wall_ns, event)
        if self._writer is not None:
            self._writer.flush()
            if not os.path.samestat(os.stat(self._path), os.fstat(self._stream.fileno())):
                raise OSError(errno.ESTALE, "another file took its place")

    def _finish(self) -> None:
        if self._writer is not None:
            self._writer.finish()
            self._stream.close()

    def _give_up(self, error: Exception) -> None:
        if self._writer is not None:
            self._writer = None
            with suppress(OSError):
                self._stream.close()
            self._report_failure(getattr(error, "strerror", None) or f"{type(error).__name__}: {error}")

    def _write(self, writer: Writer, wall_ns: int, event: Event) -> None:
        if isinstance(event, Reset):
            self._run_begins_ns = self._latest_log_ns + 1
            self._run += 1
            self._scene = ""
            self._next_transform_ns = 0
            return
        log_time = self._run_begins_ns + event.time_ns if self._simulated_log else wall_ns
        self._latest_log_ns = max(self._latest_log_ns, log_time)
        messages: list[tuple[str, bytes]] = []
        match event:
            case Published(time_ns, state):
                if time_ns // CHUNK_NS != self._chunk:
                    self._chunk = time_ns // CHUNK_NS
                    writer.flush()
                row = state.tolist()
                messages = [
                    (name, cdr.stamped_doubles(time_ns, self._world, PROJECTIONS[name](row)))
                    for name in ("pose", "twist")
                ]
                if time_ns >= self._next_transform_ns:
                    self._next_transform_ns = time_ns + TRANSFORM_NS
                    frames = (self._world, self._body_frame)
                    messages.append(("/tf", transform_bytes(time_ns, frames, row[:7])))
            case Logged(_, line):
                messages = [("events", cdr.string(line))]
            case Applied(time_ns, _, load, body, attitude):
                messages = [("applied", applied_bytes(time_ns, self._body_frame, load, body, attitude))]
            case BodyChanged(time_ns, setup):
                self._body = setup.body
                messages = [("inertia", inertia_bytes(time_ns, self._body_frame, setup.body)), *self._described()]
            case AccuracyFloor(time_ns, floor):
                # The floor only rises within a run, so the last value is kept.
                writer.flush()
                writer.add_metadata(FLOOR.format(self._run), {"time_ns": str(time_ns), "floor": floor})
            case Started(scene=scene) | SceneChanged(scene=scene) if scene != self._scene:
                self._scene = scene
                self._find_mesh(scene)
                messages = [("scene", cdr.string(scene)), *self._described()]
        for name, data in messages:
            writer.add_message(self._channels[name], log_time, data, log_time)
        if isinstance(event, Started | SceneChanged):
            self._attach_mesh(writer, log_time, event.scene)

    def _find_mesh(self, scene: str) -> None:
        """Keep the URI of the scene's mesh if viewers can read it."""
        sha256 = mesh_sha256_of(scene)
        if sha256 == self._mesh_sha256:
            return
        self._mesh_sha256, self._mesh = sha256, ""
        with suppress(InputError, OSError):
            path = resolve_mesh(str(read_scene_text(scene).values.get("mesh", "")))
            if path.suffix.lower() in DRAWN:
                self._mesh = path.absolute().as_uri()

    def _described(self) -> list[tuple[str, bytes]]:
        """The message of the body's description if it has changed."""
        text = "" if self._body is None else description(self._body_frame, self._body, self._mesh)
        if text == self._description:
            return []
        self._description = text
        return [("robot_description", cdr.string(text))]

    def _attach_mesh(self, writer: Writer, log_time: int, scene: str) -> None:
        """Attach the file of the scene's mesh, once."""
        sha256 = mesh_sha256_of(scene)
        if not sha256 or sha256 in self._attached:
            return
        self._attached.add(sha256)
        found = mesh_file(scene, self._files)
        if found is not None:
            # Ends the first chunk, which declares the topics, so that a file truncated later can be read.
            writer.flush()
            writer.add_attachment(0, log_time, found[0], "application/octet-stream", found[1])
