# SPDX-License-Identifier: MIT
"""Meshes that come as bytes through a page: judged as ``inspect`` judges files, kept as one file while they are flown.

The node reads a mesh by path, so the file must be there; it lies in a folder of this process alone, under a name made here.
The next upload replaces it, and the folder goes with the process; one that was killed is swept up by the next.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from ..core.errors import MeshError
from ..mesh_body import mesh_body
from ..mesh_cache import PASSING
from ..mesh_inspection import Inspection, as_json, inspect_mesh
from ..mesh_io import BYTES_PER_TRIANGLE, MAX_TRIANGLES, OWN_FORMATS, load_mesh

MAX_BYTES = 256_000_000
"""Of one upload: it comes over the page's socket and stands in memory whole. Larger files are named by path."""

ACCEPTED = OWN_FORMATS
"""Endings of files that are read here and hold all of the mesh: .glb, .gltf and .dae may name other files, .3mf is a zip."""


@dataclass(frozen=True)
class Upload:
    """name: as shown. path: for the parameter ``mesh``. inspection: what is known of it; report: as ``inspect --json``."""

    name: str
    path: str
    inspection: Inspection
    report: dict

    @property
    def verdict(self) -> list[str]:
        """One line a remark, the severity first."""
        return [f"{finding.severity}: {finding.message}" for finding in self.inspection.findings]

    @property
    def refusal(self) -> str:
        """Why it can't fly as a solid as it is, or empty."""
        return "" if self.inspection.refusal is None else str(self.inspection.refusal)


class Uploads:
    """The uploads of one page server; ``close`` leaves nothing on the disk, and so does the end of the process.

    max_bytes, max_triangles: larger files are refused, by their size before anything is written.
    """

    def __init__(self, max_bytes: int = MAX_BYTES, max_triangles: int = MAX_TRIANGLES) -> None:
        self._limit = min(max_bytes, BYTES_PER_TRIANGLE * max_triangles)
        self._max_triangles = max_triangles
        self._folder: Path | None = None
        self._count = 0
        self._flown: Path | None = None
        sweep()
        atexit.register(self.close)

    def take(self, file_name: str, data: bytes, *, repair: bool = False, fallback: str = "") -> Upload:
        """Judge a file and lay it beside the one in flight, in place of any other.

        A readable mesh that bounds no solid is kept too; its ``refusal`` says why. Raises MeshError for what is no mesh,
        and keeps nothing of it.
        """
        name, suffix = shown_name(file_name)
        if suffix not in ACCEPTED:
            raise MeshError("upload", name, f"a file named .{', .'.join(ACCEPTED)}")
        if len(data) > self._limit:
            raise MeshError(
                "upload", f"{name}: {len(data)} bytes", f"at most {self._limit}; name a larger file by path"
            )
        self._remove_all_but(self._flown)
        self._count += 1
        # Another name each time: a node that is told the same path again sees no change.
        path = self._home() / f"{self._count}_{name}"
        try:
            path.write_bytes(data)
            body = mesh_body(load_mesh(str(path), max_triangles=self._max_triangles), repair=repair, fallback=fallback)
            inspection = inspect_mesh(body)
            return Upload(name, str(path), inspection, as_json(inspection))
        except OSError as error:
            path.unlink(missing_ok=True)
            raise MeshError("upload", name, f"room for it ({error.strerror})") from None
        except BaseException:
            path.unlink(missing_ok=True)
            raise

    def fly(self, upload: Upload | None) -> None:
        """Say which one the node has taken on, None when it flies another mesh; all others go."""
        self._flown = None if upload is None else Path(upload.path)
        self._remove_all_but(self._flown)

    def close(self) -> None:
        """Remove all of it."""
        self._flown = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None
        atexit.unregister(self.close)

    def _home(self) -> Path:
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix=f"{PASSING}{os.getpid()}_"))
        return self._folder

    def _remove_all_but(self, kept: Path | None) -> None:
        for path in self._folder.iterdir() if self._folder else ():
            if path != kept:
                path.unlink(missing_ok=True)


def shown_name(file_name: str) -> tuple[str, str]:
    """What is left of a file's name: its last part, plain letters, at most 40 before the ending; and the ending itself."""
    last = PureWindowsPath(PurePosixPath(file_name.replace("\0", "")).name).name
    stem, _, suffix = last.rpartition(".")
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", stem).strip("_")[:40] or "mesh"
    suffix = re.sub(r"[^a-z0-9]+", "", suffix.lower())[:8]
    return f"{stem}.{suffix}", suffix


def sweep() -> None:
    """Remove the folders of processes that were killed."""
    for path in Path(tempfile.gettempdir()).glob(f"{PASSING}*"):
        pid = path.name.removeprefix(PASSING).partition("_")[0]
        if pid.isdigit() and not _runs(int(pid)):
            shutil.rmtree(path, ignore_errors=True)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        pass  # somebody else's
    return True
