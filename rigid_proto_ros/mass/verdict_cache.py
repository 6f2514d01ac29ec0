# SPDX-License-Identifier: MIT
"""Verdicts on files, kept in the user's cache folder under the hash of their bytes.

Entries carry the hash of the code that made them, so that a newer version never serves an older one's verdicts. A cache
that can't be written or read is no error: the work is then done again. ``RIGID_PROTO_CACHE=off`` turns it off.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import tempfile
from pathlib import Path

from ..base.compilation import INTERPRETED
from ..mesh.reading import Mesh
from ..mesh.solids import can_unite
from .verdict import Finding, Verdict, check_surface

PASSING = "rigid_proto_upload_"
"""In the paths of files that are gone tomorrow: nothing of them is kept."""


def folder() -> Path | None:
    """The cache folder, or None when it is turned off or there is no home."""
    if os.environ.get("RIGID_PROTO_CACHE", "").lower() in ("off", "0", "no"):
        return None
    base = os.environ.get("XDG_CACHE_HOME", "")
    try:
        return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "rigid_proto_ros" / "meshes"
    except RuntimeError:
        return None


@functools.cache
def code_tag() -> str:
    """Hash of the modules whose results are kept, and of whether they are compiled: sums may round otherwise."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256(b"interpreted" if INTERPRETED else b"")
    for path in sorted([*(package / "mesh").glob("*.py"), *(package / "mass").glob("*.py")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def check_mesh(mesh: Mesh) -> Verdict:
    """The verdict on a mesh, from the cache or anew."""
    base = None if PASSING in mesh.path else folder()
    if base is None:
        return check_surface(mesh.vertices, mesh.triangles)
    suffix, also = mesh.path.rpartition(".")[2].lower(), "united" if can_unite() else "body"
    path = base / f"{mesh.sha256}-{suffix}-{also}-{code_tag()}.json"
    try:
        kept = json.loads(path.read_bytes())
        findings = [Finding(**finding) for finding in kept.pop("findings")]
        return Verdict(findings=findings, **kept)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass
    verdict = check_surface(mesh.vertices, mesh.triangles)
    try:
        base.mkdir(parents=True, exist_ok=True)
        # Moved to its name once it is whole, so that no reader sees half an entry.
        handle, new = tempfile.mkstemp(dir=base, prefix=".new-")
        with os.fdopen(handle, "w") as stream:
            stream.write(json.dumps(dataclasses.asdict(verdict)))
        os.replace(new, path)
    except OSError:
        pass
    return verdict
