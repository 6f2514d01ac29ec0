# SPDX-License-Identifier: MIT
"""Meshes that come as bytes through a page: checked as ``inspect`` checks files, kept as one file while they are flown.

The node reads a mesh by path, so the file must be there; it lies in a folder of this process alone, under a name made
here. The next upload replaces it, and the folder goes with the process; one that was killed is swept up by the next.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import re
import shutil
import struct
import tempfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np

from ..base.errors import MeshError
from ..mass.from_mesh import mesh_body
from ..mass.inspection import Inspection, as_json, inspect_mesh
from ..mesh.cache import PASSING
from ..mesh.reading import BYTES_PER_TRIANGLE, MAX_TRIANGLES, OWN_FORMATS, load_mesh

MAX_BYTES = 256_000_000
"""Of one upload: it comes over the page's socket and stands in memory whole. Larger files are named by path."""

ACCEPTED = (*OWN_FORMATS, "glb")
"""Endings of files that hold all of the mesh: .gltf and .dae may name other files, .3mf is a zip. A .glb
that names others is refused.
"""

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres, by the name of what a file's numbers may be in."""

HALF = math.sqrt(0.5)
UPRIGHT = {"z": [0.0, 0.0, 0.0, 1.0], "y": [HALF, 0.0, 0.0, HALF], "x": [0.0, -HALF, 0.0, HALF]}
"""Attitudes xyzw that turn a file's up axis to the world's z."""

ROOM_SIZE = 20.0
"""A file whose longest side is more than this isn't in metres: meshes are of things, and most of these
are in millimetres.
"""

SENSIBLE_DENSITY = 1000.0
"""[kg/m³] Water's, the node's own default."""


@dataclass(frozen=True)
class Upload:
    """name: as shown. path: for the parameter ``mesh``. inspection: what is known of it; report: as
    ``inspect --json``.
    """

    name: str
    path: str
    inspection: Inspection
    report: dict

    @property
    def sides(self) -> np.ndarray:
        """Sides (3,) of its bounding box, in the file's numbers."""
        lower, upper = self.inspection.lower, self.inspection.upper
        return np.zeros(3) if lower is None or upper is None else upper - lower

    @property
    def likely_unit(self) -> str:
        """Which of UNITS it is most likely in."""
        return "m" if self.name.endswith(".glb") or float(self.sides.max()) <= ROOM_SIZE else "mm"

    @property
    def likely_up(self) -> str:
        """Which of its axes points up most likely: glTF says y."""
        return "y" if self.name.endswith(".glb") else "z"

    def size_and_mass(self, unit: str) -> str:
        """Its size and mass in one line, its numbers being in this unit and its density SENSIBLE_DENSITY."""
        metres = UNITS[unit]
        sides = " × ".join(f"{side * metres:.3g}" for side in self.sides)
        volume = self.report["volume"]
        if volume is None:
            return f"{sides} m"
        return f"{sides} m, {SENSIBLE_DENSITY * volume * metres**3:.3g} kg at {SENSIBLE_DENSITY:g} kg/m³"

    def flight(self, unit: str, up: str) -> dict[str, object]:
        """Parameters to fly it with: what another body left behind, its mass, spin or stand-in, isn't its own."""
        at_rest = {f"initial.{name}": [0.0, 0.0, 0.0] for name in ("position", "linear_velocity", "angular_velocity")}
        return {
            "mesh": self.path,
            "scale": [UNITS[unit]] * 3,
            "mass": 0.0,
            "density": SENSIBLE_DENSITY,
            "inertia_model": "solid",
            "mesh_repair": False,
            "mesh_fallback": "",
            "initial.orientation_xyzw": UPRIGHT[up],
            **at_rest,
        }

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

        A readable mesh that bounds no solid is kept too; its ``refusal`` says why. Raises MeshError for what is no
        mesh, and keeps nothing of it.
        """
        name, suffix = shown_name(file_name)
        if suffix not in ACCEPTED:
            raise MeshError("upload", name, f"a file named .{', .'.join(ACCEPTED)}")
        if len(data) > self._limit:
            raise MeshError(
                "upload",
                f"{name} has {len(data)} bytes; at most {self._limit} are accepted, so name a larger file by its path",
            )
        self._remove_all_but(self._flown)
        self._count += 1
        if suffix == "glb":
            refuse_other_files(name, data)
        # Another folder each time: a node that is told the same path again sees no change.
        path = self._home() / str(self._count) / name
        try:
            path.parent.mkdir()
            path.write_bytes(data)
            body = mesh_body(load_mesh(str(path), max_triangles=self._max_triangles), repair=repair, fallback=fallback)
            inspection = inspect_mesh(body)
            return Upload(name, str(path), inspection, as_json(inspection))
        except OSError as error:
            shutil.rmtree(path.parent, ignore_errors=True)
            raise MeshError("upload", name, f"free space for it ({error.strerror})") from None
        except BaseException:
            shutil.rmtree(path.parent, ignore_errors=True)
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
        for folder in self._folder.iterdir() if self._folder else ():
            if kept is None or folder != kept.parent:
                shutil.rmtree(folder, ignore_errors=True)


def refuse_other_files(name: str, data: bytes) -> None:
    """Raise MeshError for a .glb that isn't one, or that has parts in other files: they would be read
    from this machine.
    """
    try:
        magic, _, _, length, kind = struct.unpack_from("<4sIII4s", data)
        parts: Any = json.loads(data[20 : 20 + length]) if (magic, kind) == (b"glTF", b"JSON") else None
        named = [part.get("uri") for part in (*parts.get("buffers", ()), *parts.get("images", ()))]
    except (struct.error, ValueError, AttributeError, TypeError) as error:
        raise MeshError("upload", name, "a binary glTF file") from error
    if any(uri is not None and not str(uri).startswith("data:") for uri in named):
        raise MeshError("upload", name, "a .glb that contains all of its data")


def shown_name(file_name: str) -> tuple[str, str]:
    """What is left of a file's name: its last part, plain letters, at most 40 before the ending; and the
    ending itself.
    """
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
