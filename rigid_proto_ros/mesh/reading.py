# SPDX-License-Identifier: MIT
"""Meshes from files: selection of the reader, and the file's unit."""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.files import read_bounded
from ..base.vectors import IntArray, Points, Triangles
from .assembly import MAX_TRIANGLES, Assembly, add_by_trimesh, add_collada, other_formats
from .gltf import add_gltf
from .locate import NOWHERE_ELSE, Search, resolve_mesh
from .obj import read_obj
from .parts import YAML, Part, hash_of_parts, joined_surface, read_parts
from .ply import read_ply
from .stl import read_stl
from .threemf import add_threemf

OWN_FORMATS = {"obj": read_obj, "ply": read_ply, "stl": read_stl}
"""Formats of one surface, and what gives vertices, polygons' corners and starts of a file's bytes and name. trimesh 5.2
silently misreads some files of each (benchmarks/mesh_readers.py)."""
FORMATS = (*OWN_FORMATS, "glb", "gltf", "3mf", "dae")
"""Formats read according to their specifications; those beyond OWN_FORMATS are scenes of placed parts. Other formats
are read by trimesh."""
MAX_BYTES = 400 * MAX_TRIANGLES
"""A larger file is refused without reading it; .obj text with normals takes about 150 bytes per triangle."""
_UP_AXIS = re.compile(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>")


@dataclass(frozen=True)
class Mesh:
    """A surface in mesh coordinates, as in its file.

    vertices (n, 3) float64 in the file's order, including unreferenced ones. triangles (m, 3) int64; a polygon's fan
    triangles are contiguous: polygon k is triangles[polygon_starts[k]:polygon_starts[k + 1]]; polygon_starts is None
    when every face is a triangle. sha256 is the hex digest of the file's bytes, and of those of every other file that
    was read with it; path its absolute path. unit: the unit that the file states [m], by which the vertices have been
    multiplied; 1 if it states none. up_axis: which axis it says is up, "" if it says nothing; coordinates stay as they
    are. parts: those of a body of several, of whose surfaces this one consists, in their order.
    """

    name: str
    path: str
    vertices: Points
    triangles: Triangles
    polygon_starts: IntArray | None
    sha256: str
    unit: float = 1.0
    up_axis: str = ""
    parts: tuple[Part, ...] = ()


def fan_polygons(corners: IntArray, starts: IntArray) -> tuple[Triangles, IntArray | None]:
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


def _read_scene(data: bytes, suffix: str, path: Path) -> tuple[Points, Triangles, float, dict[str, str]]:
    """Read a file of placed parts: vertices (n, 3) in metres, triangles (m, 3), the file's unit [m], and names and
    hashes of the other files that were read.
    """
    files: dict[str, str] = {}

    def beside(name: str) -> bytes:
        found = unquote(name)
        kind = "a file with the mesh's numbers"
        content = read_bounded(path.parent / found, MAX_BYTES, path.name, kind, ordinary=True)
        files[found] = hashlib.sha256(content).hexdigest()
        return content

    assembly, unit = Assembly(path.name), 1.0
    try:
        if suffix in ("glb", "gltf"):
            add_gltf(data, beside, assembly)
        elif suffix == "3mf":
            unit = add_threemf(data, assembly, MAX_BYTES)
        elif suffix == "dae":
            unit = add_collada(data, assembly)
        else:
            unit = add_by_trimesh(data, suffix, assembly)
    except InputError as error:
        raise MeshError(error.field, error.received, error.accepted) from None
    except Exception as error:  # a damaged file may cause any error in a reader
        reason = " ".join(str(error).split())[:120]
        raise MeshError(path.name, f"the .{suffix} file can't be read ({type(error).__name__}: {reason})") from None
    if not 1e-9 <= unit <= 1e9:
        raise MeshError(path.name, f"a unit of {unit:g} m", "a unit of 1e-9 m to 1e9 m")
    vertices, triangles = assembly.surface()
    return unit * vertices, triangles, unit, files


def read_mesh(data: bytes, path: Path) -> Mesh:
    """The mesh in a file's bytes, read according to the file's extension; raises MeshError naming what is wrong."""
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in (*FORMATS, *YAML) and suffix not in other_formats():
        formats = f"a file named .{', .'.join(FORMATS)}, a .yaml file of parts"
        raise MeshError("mesh", path.name, f"{formats}, or another format that trimesh reads")
    if not data.strip():
        raise MeshError(path.name, "the file is empty")
    if suffix in YAML:
        parts = read_parts(data, path.name, functools.cache(lambda name: load_part(name, path.parent)))
        return mesh_of_parts(path.stem, str(path), parts, hashlib.sha256(data).hexdigest())
    up = _UP_AXIS.search(data) if suffix == "dae" else None
    sha256, starts, unit = hashlib.sha256(data).hexdigest(), None, 1.0
    if suffix in OWN_FORMATS:
        vertices, corners, sides = OWN_FORMATS[suffix](data, path.name)
        triangles, starts = fan_polygons(corners, sides)
    else:
        vertices, triangles, unit, files = _read_scene(data, suffix, path)
        if files:
            sha256 = hashlib.sha256(repr((sha256, sorted(files.items()))).encode()).hexdigest()
    if not 0 < len(triangles) <= MAX_TRIANGLES:
        many = f"{len(triangles)} triangles; at most {MAX_TRIANGLES} are read"
        raise MeshError(path.name, many if len(triangles) else "the file has no faces")
    up_axis = "" if up is None else up[1].decode()
    return Mesh(path.stem, str(path), vertices, triangles, starts, sha256, unit, up_axis)


def mesh_of_parts(name: str, path: str, parts: Sequence[Part], said: str) -> Mesh:
    """The surface of a body of parts; said: how they are told, for its hash. Raises MeshError where it is too large."""
    vertices, triangles, starts = joined_surface(name, parts)
    return Mesh(name, path, vertices, triangles, starts, hash_of_parts(said, parts), parts=tuple(parts))


def load_part(name: str, folder: Path) -> Mesh:
    """The mesh of a part, by a name as ``load_mesh`` has it, or beside the file that names it; raises MeshError."""
    path = resolve_mesh(name, Search(folder))
    if path.suffix.lower().lstrip(".") in YAML:
        raise MeshError("mesh", name, "a mesh; a file of parts has no others within")
    return load_mesh(str(path))


def load_mesh(name: str, *, search: Search = NOWHERE_ELSE) -> Mesh:
    """The mesh with this name, exactly as in the file except for its stated unit, which is converted to metres.

    Raises MeshError naming the file and what is wrong with it.
    """
    path = resolve_mesh(name, search)
    return read_mesh(read_bounded(path, MAX_BYTES, "mesh", "a mesh file"), path)
