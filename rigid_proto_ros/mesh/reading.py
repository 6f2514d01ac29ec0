# SPDX-License-Identifier: MIT
"""Meshes from files: which reader takes a file, what its unit is, and what of it is cached."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.files import read_bounded
from . import cache as mesh_cache
from .assembly import Assembly, add_by_trimesh, add_collada, other_formats
from .gltf import add_gltf
from .locate import NOWHERE_ELSE, Search, resolve_mesh
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .stl import is_ascii_stl, read_stl
from .threemf import add_threemf

OWN_FORMATS = ("obj", "off", "ply", "stl")
"""Formats of one surface. trimesh 5.2 misreads some files of each in silence (benchmarks/mesh_readers.py)."""
FORMATS = (*OWN_FORMATS, "glb", "gltf", "3mf", "dae")
"""Formats read as they are specified; those beyond OWN_FORMATS are scenes of placed parts. What else trimesh reads is
taken from it."""
PACKED = ("gz", "bz2", "xz", "zip", "zae")
"""Endings of archives; of those that hold a mesh by definition, .3mf alone is read."""
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
    None when every face is a triangle. sha256 is the hex digest of the file's bytes, and of those of every other file
    that was read with it; path its absolute path. unit: metres that the file says its unit has, by which the vertices
    have been multiplied; 1 when it says nothing.
    """

    name: str
    path: str
    vertices: np.ndarray
    triangles: np.ndarray
    polygon_starts: np.ndarray | None
    sha256: str
    unit: float = 1.0

    @property
    def polygons(self) -> int:
        """Number of faces in the file."""
        return len(self.triangles) if self.polygon_starts is None else len(self.polygon_starts) - 1


@dataclass
class _Content:
    """What was read: arrays as in ``Mesh``, and ``files``: name and hash of every other file that it took."""

    vertices: np.ndarray
    triangles: np.ndarray
    polygon_starts: np.ndarray | None = None
    unit: float = 1.0
    files: tuple[tuple[str, str], ...] = ()


def fan_polygons(corners: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Triangles (m, 3), fanned from each polygon's first corner, and the polygons' starts among them (p + 1,).

    corners (c,) vertex numbers, polygon k being corners[starts[k]:starts[k + 1]], each of three or more. The starts are
    None when all polygons are triangles.
    """
    polygons = len(starts) - 1
    if len(corners) == 3 * polygons:
        return corners.reshape(-1, 3), None
    counts = np.diff(starts) - 2
    polygon_starts = np.concatenate([np.zeros(1, np.int64), np.cumsum(counts)])
    first = np.repeat(starts[:-1], counts)
    place = first + np.arange(len(first)) - np.repeat(polygon_starts[:-1], counts)
    return np.stack([corners[first], corners[place + 1], corners[place + 2]], axis=1), polygon_starts


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


def _format(path: Path) -> str:
    """The format by the file's ending; raises MeshError for one that can't be read."""
    ending = path.suffix.lower().lstrip(".")
    if ending in PACKED:
        raise MeshError("mesh", f"{path.name!r} is packed; unpack it first")
    if ending not in FORMATS and ending not in other_formats():
        raise MeshError(
            "mesh", f"{path.name!r} has none of the endings .{', .'.join(FORMATS)}, nor one that trimesh reads"
        )
    return ending


def _read(data: bytes, path: Path, max_triangles: int) -> _Content:
    """The content of a file's bytes, by its endings."""
    suffix = _format(path)
    if not data.strip():
        raise MeshError(path.name, "the file is empty")
    found = _sniff(data)
    if found and found != suffix and suffix in OWN_FORMATS:
        raise MeshError(path.name, f"the content looks like .{found}, not .{suffix}; rename the file")
    if suffix not in OWN_FORMATS:
        content = _read_scene(data, suffix, path, max_triangles)
    elif suffix == "stl":
        content = _Content(*read_stl(data, path.name, max_triangles))
    else:
        reader = {"obj": read_obj, "off": read_off, "ply": read_ply}[suffix]
        vertices, corners, starts = reader(data, path.name)
        _check_triangles(len(corners) - 2 * (len(starts) - 1), max_triangles, path.name)
        content = _Content(vertices, *fan_polygons(corners, starts))
    _check_triangles(len(content.triangles), max_triangles, path.name)
    return content


def _check_triangles(count: int, max_triangles: int, name: str) -> None:
    if count > max_triangles:
        raise MeshError(name, f"{count} triangles are more than {max_triangles}; --max-triangles raises the limit")


def _read_scene(data: bytes, suffix: str, path: Path, max_triangles: int) -> _Content:
    """What a file of placed parts shows, in metres."""
    max_bytes = BYTES_PER_TRIANGLE * max_triangles
    files: dict[str, str] = {}

    def beside(name: str) -> bytes:
        found = unquote(name)
        try:
            content = read_bounded(path.parent / found, max_bytes, path.name, "a file with the mesh's numbers")
        except InputError as error:
            raise MeshError(error.field, error.received, error.accepted) from None
        files[found] = hashlib.sha256(content).hexdigest()
        return content

    assembly, unit = Assembly(path.name, max_triangles), 1.0
    try:
        if suffix in ("glb", "gltf"):
            add_gltf(data, beside, assembly)
        elif suffix == "3mf":
            unit = add_threemf(data, assembly, max_bytes)
        elif suffix == "dae":
            unit = add_collada(data, assembly)
        else:
            unit = add_by_trimesh(data, suffix, assembly)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file leads to in a reader that takes it as specified
        reason = " ".join(str(error).split())[:120]
        raise MeshError(path.name, f"the .{suffix} file can't be read ({type(error).__name__}: {reason})") from None
    if not 1e-9 <= unit <= 1e9:
        raise MeshError(path.name, f"a unit of {unit:g} m", "a unit of 1e-9 m to 1e9 m")
    vertices, triangles = assembly.surface()
    return _Content(unit * vertices, triangles, None, unit, tuple(sorted(files.items())))


def _from_cache(key: str) -> _Content | None:
    """What is kept under a file's hash."""
    kept = mesh_cache.load_arrays(key)
    if kept is None or not {"vertices", "triangles", "unit"} <= kept.keys():
        return None
    return _Content(kept["vertices"], kept["triangles"], kept.get("polygon_starts"), float(kept["unit"]))


def _to_cache(key: str, content: _Content) -> None:
    """Keep what was read of a file by itself; the others that one took may change."""
    if not content.files:
        polygons = {} if content.polygon_starts is None else {"polygon_starts": content.polygon_starts}
        arrays = {"vertices": content.vertices, "triangles": content.triangles, "unit": np.array(content.unit)}
        mesh_cache.store_arrays(key, **arrays, **polygons)


def load_mesh(name: str, *, max_triangles: int = MAX_TRIANGLES, search: Search = NOWHERE_ELSE) -> Mesh:
    """The mesh that ``name`` stands for, exactly as the file has it but for the unit that it states.

    ``max_triangles`` guards against files that would fill the memory. A large file is parsed once and then read from
    the cache by its content's hash. Raises MeshError naming the file and what is wrong with it.
    """
    path = resolve_mesh(name, search)
    kind = f"a mesh of {max_triangles} triangles (--max-triangles raises the limit)"
    data = read_bounded(path, BYTES_PER_TRIANGLE * max_triangles, "mesh", kind)
    sha256 = hashlib.sha256(data).hexdigest()
    key = f"{sha256}-{path.suffix.lower().lstrip('.')}"
    cached = len(data) >= CACHED_SIZE and not mesh_cache.is_passing(path)
    content = _from_cache(key) if cached else None
    if content is None or len(content.triangles) > max_triangles:
        content = _read(data, path, max_triangles)
        if cached:
            _to_cache(key, content)
    if len(content.triangles) == 0:
        raise MeshError(path.name, "the file has no faces")
    if content.files:
        sha256 = hashlib.sha256(repr((sha256, content.files)).encode()).hexdigest()
    surface = content.vertices, content.triangles, content.polygon_starts
    return Mesh(path.stem, str(path), *surface, sha256, content.unit)
