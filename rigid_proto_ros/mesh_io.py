# SPDX-License-Identifier: MIT
"""Meshes from files: by path, ``package://`` URI or bundled name. The only module that may import trimesh."""

from __future__ import annotations

import difflib
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from rigid_proto_ros.core.errors import MeshError
from rigid_proto_ros.mesh_obj import read_obj

BODIES = Path(__file__).parent / "bodies"
"""Folder of the bundled meshes."""


@dataclass(frozen=True)
class Mesh:
    """A surface in mesh coordinates, as its file has it.

    vertices (n, 3) float64 in the file's order, unreferenced ones counted. triangles (m, 3) int64; a polygon's fan
    triangles follow each other: polygon k is triangles[polygon_starts[k]:polygon_starts[k + 1]]; polygon_starts is
    None when every face is a triangle. sha256 is the hex digest of the file's bytes, path its absolute path.
    """

    name: str
    path: str
    vertices: np.ndarray
    triangles: np.ndarray
    polygon_starts: np.ndarray | None
    sha256: str

    @property
    def polygons(self) -> int:
        """Number of faces in the file."""
        return len(self.triangles) if self.polygon_starts is None else len(self.polygon_starts) - 1


def bundled_names() -> tuple[str, ...]:
    """Names of the meshes that come with the package."""
    return tuple(sorted(path.stem for path in BODIES.glob("*.obj")))


def _package_folder(package: str) -> Path | None:
    """Share folder of a ROS package, or this package's own folder for its own name."""
    try:
        from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

        try:
            return Path(get_package_share_directory(package))
        except (PackageNotFoundError, ValueError):
            pass
    except ImportError:
        pass
    return Path(__file__).parent if package == "rigid_proto_ros" else None


def resolve_mesh(name: str) -> Path:
    """The file that ``name`` (a path, ``package://package/path`` or a bundled name) stands for.

    Raises MeshError when there is none, with the bundled names and the one most like it.
    """
    if name.startswith("package://"):
        package, _, inside = name[len("package://") :].partition("/")
        folder = _package_folder(package)
        if folder is None:
            raise MeshError("mesh", name, f"package:// of an installed package; {package!r} was not found")
        candidates = [folder / inside]
        if package == "rigid_proto_ros":
            candidates.append(Path(__file__).parent / inside)
        for path in candidates:
            if path.is_file():
                return path.resolve()
        raise MeshError("mesh", name, f"a file in the package; there is no {candidates[0]}")
    if name.startswith("file://"):
        name = name[len("file://") :]
    path = Path(name).expanduser()
    if path.is_file():
        return path.resolve()
    bundled = BODIES / f"{name}.obj"
    if name and "/" not in name and bundled.is_file():
        return bundled.resolve()
    if path.is_dir():
        raise MeshError("mesh", name, "a mesh file; this is a folder")
    names = bundled_names()
    siblings = [p.name for p in path.parent.iterdir() if p.is_file()] if path.parent.is_dir() and "/" in name else []
    near = difflib.get_close_matches(path.name, [*names, *siblings], n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise MeshError(
        "mesh", name, f"an existing file, package://<package>/<path>, or a bundled name ({', '.join(names)}){hint}"
    )


@njit(cache=True, nogil=True)
def _fan(corners, starts, triangles, polygon_starts):
    t = 0
    for polygon in range(starts.shape[0] - 1):
        first = starts[polygon]
        polygon_starts[polygon] = t
        for k in range(first + 1, starts[polygon + 1] - 1):
            triangles[t, 0] = corners[first]
            triangles[t, 1] = corners[k]
            triangles[t, 2] = corners[k + 1]
            t += 1
    polygon_starts[starts.shape[0] - 1] = t


def fan_polygons(corners: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Triangles (m, 3), fanned from each polygon's first corner, and the polygons' starts among them (p + 1,).

    corners (c,) vertex numbers, polygon k being corners[starts[k]:starts[k + 1]], each of three or more. The starts are
    None when all polygons are triangles.
    """
    polygons = len(starts) - 1
    if len(corners) == 3 * polygons:
        return corners.reshape(-1, 3), None
    triangles = np.empty((len(corners) - 2 * polygons, 3), np.int64)
    polygon_starts = np.empty(polygons + 1, np.int64)
    _fan(corners, starts, triangles, polygon_starts)
    return triangles, polygon_starts


def load_mesh(name: str) -> Mesh:
    """The mesh that ``name`` stands for, exactly as the file has it.

    Raises MeshError naming the file and what is wrong with it.
    """
    path = resolve_mesh(name)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError("mesh", str(path), f"a readable file ({error.strerror})") from None
    if path.suffix.lower() != ".obj":
        raise MeshError("mesh", path.name, "a .obj file")
    vertices, corners, starts = read_obj(data, path.name)
    if len(corners) == 0:
        raise MeshError(path.name, "no faces", "a surface: at least one face")
    triangles, polygon_starts = fan_polygons(corners, starts)
    return Mesh(path.stem, str(path), vertices, triangles, polygon_starts, hashlib.sha256(data).hexdigest())
