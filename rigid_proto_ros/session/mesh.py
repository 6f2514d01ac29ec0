# SPDX-License-Identifier: MIT
"""The mesh that a session flew, found again by the hash of its file."""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ..base.errors import InputError, MeshError
from ..mesh.locate import bundled_names
from ..mesh.reading import Mesh, load_mesh

_HASH = re.compile(r"^# mesh_sha256: ([0-9a-f]{64})$", re.MULTILINE)


def scene_sha256(scene: str) -> str:
    """The hash of the mesh's file that a scene's text names in a comment, or ""."""
    found = _HASH.search(scene)
    return found.group(1) if found else ""


def file_sha256(data: bytes) -> str:
    """SHA-256 of a file's bytes, in hex."""
    return hashlib.sha256(data).hexdigest()


def find_mesh(
    name: str, sha256: str, attachments: Iterable[tuple[str, bytes]] = (), folder: Path | None = None
) -> Mesh:
    """The mesh whose file has this hash: by its name, from the session's attachments, beside the session, or among the
    bundled bodies. Raises MeshError naming it.
    """
    places = [name]
    if folder is not None:
        places.append(str(folder / Path(name).name))
    for place in (*places, *bundled_names()):
        try:
            mesh = load_mesh(place)
        except InputError:
            continue
        if mesh.sha256 == sha256:
            return mesh
    for file_name, data in attachments:
        if file_sha256(data) == sha256:
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
