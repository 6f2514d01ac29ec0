# SPDX-License-Identifier: MIT
"""What was once read or computed of a file's bytes, kept in the user's cache folder under their hash.

Entries carry the hash of the code that made them, so that a newer version never serves an older one's numbers. A cache
that can't be written or read is no error: the work is then done again. ``RIGID_PROTO_CACHE=off`` turns it off.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO

import numpy as np

from ..base.compilation import INTERPRETED

SIZE_LIMIT = 4_000_000_000
"""Bytes that the folder may hold; the entries longest unused go first."""

PASSING = "rigid_proto_upload_"
"""Folders named so hold files that are gone tomorrow: nothing of them is kept."""


def is_passing(path: str | Path) -> bool:
    """Whether a file lies in such a folder, or in one of its own."""
    return any(folder.name.startswith(PASSING) for folder in Path(path).parents)


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
    digest = hashlib.sha256()
    sources = [
        *(package / "mesh").glob("*.py"),
        *(package / "mass").glob("moments*.py"),
        *(package / "mass" / name for name in ("from_mesh.py", "verdict.py", "repair.py")),
        *(package / "base" / name for name in ("exact_arithmetic.py", "simd.py")),
    ]
    for path in sorted(sources):
        digest.update(path.read_bytes())
    digest.update(b"interpreted" if INTERPRETED else b"")
    return digest.hexdigest()[:16]


def _store(name: str, save: Callable[[IO[bytes]], object]) -> None:
    """Write to a file beside the entry and move it there, so that a reader never sees half an entry."""
    base = folder()
    if base is None:
        return
    path = base / name
    try:
        base.mkdir(parents=True, exist_ok=True)
        handle, new = tempfile.mkstemp(dir=path.parent, prefix=".new-")
        try:
            with os.fdopen(handle, "wb") as stream:
                save(stream)
            os.replace(new, path)
        except BaseException:
            os.unlink(new)
            raise
        _prune(path.parent)
    except OSError:
        pass


def _prune(base: Path) -> None:
    entries = sorted(((p.stat().st_mtime, p.stat().st_size, p) for p in base.iterdir()), reverse=True)
    total = 0
    for _, size, path in entries:
        total += size
        if total > SIZE_LIMIT:
            path.unlink(missing_ok=True)


def load_arrays(key: str) -> dict[str, np.ndarray] | None:
    """The arrays kept under ``key``, or None."""
    base = folder()
    try:
        if base is not None:
            path = base / f"{key}-{code_tag()}.npz"
            with np.load(path, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
            os.utime(path)
            return arrays
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        pass
    return None


def store_arrays(key: str, **arrays: np.ndarray) -> None:
    """Keep arrays under ``key``."""
    _store(f"{key}-{code_tag()}.npz", lambda stream: np.savez(stream, allow_pickle=False, **arrays))


def load_json(key: str) -> dict | None:
    """The JSON object kept under ``key``, or None."""
    base = folder()
    try:
        value = json.loads((base / f"{key}-{code_tag()}.json").read_bytes()) if base else None
    except (OSError, ValueError):
        return None
    return value if isinstance(value, dict) else None


def store_json(key: str, value: dict) -> None:
    """Keep a JSON object under ``key``; floats keep all their digits."""
    _store(f"{key}-{code_tag()}.json", lambda stream: stream.write(json.dumps(value).encode()))
