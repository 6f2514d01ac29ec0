# SPDX-License-Identifier: MIT
"""A recorded flight as plain arrays and text, whatever file it was read from, and the mesh that it flew,
found by its hash.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..base.errors import InputError, MeshError
from ..mesh.reading import Mesh, load_mesh


@dataclass(frozen=True)
class StampedRows:
    """What one topic published: times (n,) int64 [ns, simulated] and rows (n, k) float64."""

    times: np.ndarray
    rows: np.ndarray

    def __len__(self) -> int:
        return len(self.times)


@dataclass
class RecordedSession:
    """One run, as its recording holds it.

    scene: the parameters at the run's start as a params file. events: (time_ns, JSON line) in order, lines as logged.
    refusals: (time_ns, text). times (n,) int64 [ns, simulated] and rows (n, 13) float64, exactly the published states
    in ``simulation/observer.py``'s ``STATE_FIELDS`` order. vertices (p, 3) float64 and triangles (m, 3) int64 as
    loaded, None without a mesh; mesh_sha256 of the mesh file; mesh_chunks counts how often the drawn mesh was logged.
    complete: the file was finished properly.

    A bag holds no state rows but what the node published of them: ``published``, by topic; ``rows`` are then found from
    those, for the eye. scenes: every text of the scene topic, in order. node_name: what stands before the topics'
    names. missing: topics that a check would need. attachments: (name, bytes) of files inside; made_with: the
    processor, and versions by package; accuracy_floor: why the motion is held to less than its accuracy, as an .mcap of
    ours says it; folder: where the session lies.
    """

    scene: str = ""
    events: list[tuple[int, str]] = field(default_factory=list)
    refusals: list[tuple[int, str]] = field(default_factory=list)
    times: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))
    rows: np.ndarray = field(default_factory=lambda: np.empty((0, 13)))
    vertices: np.ndarray | None = None
    triangles: np.ndarray | None = None
    mesh_sha256: str = ""
    mesh_chunks: int = 0
    complete: bool = True
    published: dict[str, StampedRows] = field(default_factory=dict)
    scenes: list[str] = field(default_factory=list)
    node_name: str = "rigid_body"
    missing: tuple[str, ...] = ()
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    made_with: dict[str, str] = field(default_factory=dict)
    accuracy_floor: str = ""
    folder: Path | None = None

    @property
    def lines(self) -> list[str]:
        """The event lines as logged."""
        return [line for _, line in self.events]

    @property
    def end_ns(self) -> int:
        """Simulated time [ns] of the last state; 0 without states."""
        return int(self.times[-1]) if len(self.times) else 0


def decode_event(line: str, number: int) -> tuple[int, str, dict]:
    """time_ns, kind and content of a line of the event log; raises InputError naming the event by number."""
    try:
        event = json.loads(line)
        time_ns, kind, content = event["time_ns"], event["kind"], event["content"]
        if type(time_ns) is int and time_ns >= 0 and isinstance(kind, str) and isinstance(content, dict):
            return time_ns, kind, content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError(f"event {number}", line[:80], "a JSON line with time_ns, kind and content")


def find_mesh(
    name: str, sha256: str, attachments: Iterable[tuple[str, bytes]] = (), folder: Path | None = None
) -> Mesh:
    """The mesh whose file has this hash: by its name, beside the session, or from the session's attachments. Raises
    MeshError naming it.
    """
    places = [name]
    if folder is not None:
        places.append(str(folder / Path(name).name))
    for place in places:
        try:
            mesh = load_mesh(place)
        except InputError:
            continue
        if mesh.sha256 == sha256:
            return mesh
    for file_name, data in attachments:
        if hashlib.sha256(data).hexdigest() == sha256:
            return _from_bytes(file_name, data)
    raise MeshError(
        "mesh", name, f"the file with SHA-256 {sha256}, there or beside the session; the recording doesn't hold it"
    )


def _from_bytes(file_name: str, data: bytes) -> Mesh:
    # Loaded through a file: what a mesh is depends on its ending, too.
    with tempfile.TemporaryDirectory(prefix="rigid_proto_") as folder:
        path = Path(folder) / Path(file_name).name
        path.write_bytes(data)
        return load_mesh(str(path))
