# SPDX-License-Identifier: MIT
"""Meshes from files: by path, ``package://`` URI or bundled name. The only module that may import trimesh."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.bounded_file import read_bounded
from ..base.bundled import PACKAGE_FOLDER
from ..base.compilation import njit
from ..base.errors import MeshError
from ..base.nearest_name import did_you_mean
from . import cache as mesh_cache
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .stl import is_ascii_stl, read_stl

BODIES = PACKAGE_FOLDER / "bodies"
"""Folder of the bundled meshes."""
OWN_FORMATS = ("obj", "off", "ply", "stl")
"""Formats read here: trimesh 5.2 misreads some of them (interleaved negative .obj indices, tab-separated .obj, quad
.off, strips in .ply), joins polygons' triangles, and takes several times as long."""
FORMATS = (*OWN_FORMATS, "glb", "gltf", "3mf", "dae")
"""All readable formats; those beyond OWN_FORMATS go through trimesh, which may ask for further packages."""
MAX_TRIANGLES = 20_000_000
"""Default limit: about 1.5 GB of arrays."""
BYTES_PER_TRIANGLE = 400
"""A file larger than this a triangle of the limit is refused unread; .obj text with normals takes about 150."""
CACHED_SIZE = 1_000_000
"""Files from this many bytes on are kept parsed: below, parsing takes a few milliseconds."""


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
        except (PackageNotFoundError, ValueError, OSError):  # OSError: no ROS environment is set up
            pass
    except ImportError:
        pass
    return PACKAGE_FOLDER if package == "rigid_proto_ros" else None


def resolve_mesh(name: str) -> Path:
    """The file that ``name`` (a path, ``package://package/path`` or a bundled name) stands for.

    Raises MeshError when there is none, with the bundled names and the one most like it.
    """
    try:
        return _found_mesh(name)
    except (OSError, RuntimeError) as error:  # a name too long, a folder that may not be read, a user's home unknown
        reason = getattr(error, "strerror", None) or str(error).rstrip(".")
        raise MeshError(
            "mesh", name, f"a file that can be read, package://<package>/<path>, or a bundled name ({reason})"
        ) from None


def _found_mesh(name: str) -> Path:
    if name.startswith("package://"):
        package, _, inside = name[len("package://") :].partition("/")
        folder = _package_folder(package)
        if folder is None:
            raise MeshError("mesh", f"the package {package!r} of {name!r} was not found")
        candidates = [folder / inside]
        if package == "rigid_proto_ros":
            candidates.append(PACKAGE_FOLDER / inside)
        for path in candidates:
            if path.is_file():
                return path.resolve()
        raise MeshError("mesh", f"there is no file {str(candidates[0])!r} in the package")
    name = name.removeprefix("file://")
    path = Path(name).expanduser()
    if path.is_file():
        return path.resolve()
    bundled = BODIES / f"{name}.obj"
    if name and "/" not in name and bundled.is_file():
        return bundled.resolve()
    if path.is_dir():
        raise MeshError("mesh", f"{name!r} is a folder, not a mesh file")
    names = bundled_names()
    siblings = [p.name for p in path.parent.iterdir() if p.is_file()] if path.parent.is_dir() and "/" in name else []
    hint = did_you_mean(path.name, [*names, *siblings])
    known = f"the bundled meshes are {', '.join(names)}"
    raise MeshError("mesh", f"there is no file and no bundled mesh {name!r}; {' '.join(filter(None, [hint, known]))}")


@njit(cache=True, nogil=True)
def _fan(corners: np.ndarray, starts: np.ndarray, triangles: np.ndarray, polygon_starts: np.ndarray) -> None:
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


def _sniff(data: bytes) -> str:
    """The format that a file's first bytes betray: ``ply``, ``off``, ``stl``, ``glb``, ``zip``, or "" for unknown."""
    head = data[:400].lstrip()
    if head.startswith(b"ply") and data[3:4] in (b"\n", b"\r"):
        return "ply"
    if re.match(rb"(ST)?C?N?4?n?OFF\b", head):
        return "off"
    if head.startswith(b"glTF"):
        return "glb"
    if head.startswith(b"PK\x03\x04"):
        return "zip"
    if is_ascii_stl(data):
        return "stl"
    if len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return "stl"
    return ""


def _read(data: bytes, path: Path, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, triangles and polygon starts of a file's bytes, by its extension."""
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise MeshError("mesh", f"{path.name!r} has none of the endings .{', .'.join(FORMATS)}")
    if not data.strip():
        raise MeshError(path.name, "the file is empty")
    found = _sniff(data)
    if found and found != suffix and suffix in OWN_FORMATS:
        raise MeshError(path.name, f"the content looks like .{found}, not .{suffix}; rename the file")
    if suffix == "stl":
        vertices, triangles = read_stl(data, path.name, max_triangles)
        return vertices, triangles, None
    if suffix not in OWN_FORMATS:
        return *_read_with_trimesh(path, max_triangles), None
    reader = {"obj": read_obj, "off": read_off, "ply": read_ply}[suffix]
    vertices, corners, starts = reader(data, path.name, max_triangles)
    if len(corners) - 2 * (len(starts) - 1) > max_triangles:
        count = len(corners) - 2 * (len(starts) - 1)
        raise MeshError(path.name, f"{count} triangles are more than {max_triangles}; --max-triangles raises the limit")
    return vertices, *fan_polygons(corners, starts)


def _read_with_trimesh(path: Path, max_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the scene in a file that trimesh reads, its nodes' transforms applied."""
    try:
        import trimesh
    except ImportError:
        raise MeshError("mesh", path.name, "trimesh installed for this format: pip install trimesh") from None
    try:
        mesh = trimesh.load(path, process=False, maintain_order=True, skip_materials=True, force="mesh")
        vertices = np.array(mesh.vertices, dtype=np.float64)
        triangles = np.array(mesh.faces, dtype=np.int64)
    except Exception as error:  # noqa: BLE001 - a foreign reader fails in as many ways as files are broken
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise MeshError(path.name, f"trimesh {trimesh.__version__} can't read the file ({reason})") from None
    if len(triangles) > max_triangles:
        raise MeshError(
            path.name, f"{len(triangles)} triangles are more than {max_triangles}; --max-triangles raises the limit"
        )
    return vertices, triangles


def load_mesh(name: str, *, max_triangles: int = MAX_TRIANGLES) -> Mesh:
    """The mesh that ``name`` stands for, exactly as the file has it.

    ``max_triangles`` guards against files that would fill the memory. A large file is parsed once and then read from
    the cache by its content's hash. Raises MeshError naming the file and what is wrong with it.
    """
    path = resolve_mesh(name)
    kind = f"a mesh of {max_triangles} triangles (--max-triangles raises the limit)"
    data = read_bounded(path, BYTES_PER_TRIANGLE * max_triangles, "mesh", kind)
    sha256 = hashlib.sha256(data).hexdigest()
    key = f"{sha256}-{path.suffix.lower().lstrip('.')}"
    cached = len(data) >= CACHED_SIZE and not mesh_cache.is_passing(path)
    kept = mesh_cache.load_arrays(key) if cached else None
    if kept is not None and len(kept["triangles"]) <= max_triangles:
        vertices, triangles, polygon_starts = kept["vertices"], kept["triangles"], kept.get("polygon_starts")
    else:
        vertices, triangles, polygon_starts = _read(data, path, max_triangles)
        if cached:
            polygons = {} if polygon_starts is None else {"polygon_starts": polygon_starts}
            mesh_cache.store_arrays(key, vertices=vertices, triangles=triangles, **polygons)
    if len(triangles) == 0:
        raise MeshError(path.name, "the file has no faces")
    return Mesh(path.stem, str(path), vertices, triangles, polygon_starts, sha256)
