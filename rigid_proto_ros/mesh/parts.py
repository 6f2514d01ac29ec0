# SPDX-License-Identifier: MIT
"""One body of several parts, each with its own material: a YAML file that names them, or a list of them.

    scale: 0.001                 # of the parts that give none
    parts:
      body: {mesh: body.stl, density: 2700}
      cover: {mesh: cover.stl, mass: 0.12, position: [0, 0, 0.03], orientation_xyzw: [0, 0, 0, 1]}
      grip: {mesh: grip.stl, density: 1240, wall_thickness: 0.0012, infill: 0.2}

Coordinates of the body are metres: a part's mesh is scaled, then turned, then moved.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError, MeshError, one_of
from ..base.vectors import FloatArray, IntArray
from . import INFILL
from .assembly import Assembly, node_matrix

if TYPE_CHECKING:
    from .reading import Mesh

YAML = ("yaml", "yml")
DENSITY = 1000.0
"""kg/m³ of a part that gives neither density nor mass, as of a mesh alone."""
SCALES = (1e-9, 1e9)
MAX_PARTS = 1000
"""More are no body that somebody wrote by hand; each pair of them is looked at."""

FIELDS = ("mesh", "density", "mass", "scale", "position", "orientation_xyzw", "wall_thickness", "infill")

_TELLS = re.compile(r"^\{?\s*[\"']?parts[\"']?\s*:", re.MULTILINE)


@dataclass(frozen=True)
class Part:
    """matrix (4, 4): from coordinates of its mesh to the body's. density [kg/m³] where ``mass`` [kg] is 0.
    wall_thickness [m]: of full density, ``infill`` of it within; 0: it is solid.
    """

    name: str
    mesh: Mesh
    matrix: FloatArray
    density: float = DENSITY
    mass: float = 0.0
    wall_thickness: float = 0.0
    infill: float = INFILL


def tells_parts(text: str) -> bool:
    """Whether the text of a YAML file is one of parts, and not a scene."""
    return _TELLS.search(text) is not None and "ros__parameters" not in text


def read_parts(data: bytes, file: str, load: Callable[[str], Mesh]) -> tuple[Part, ...]:
    """The parts that a file's bytes tell; load: the mesh that has a name there. Raises MeshError, which says of which
    part what is wrong.
    """
    from ..base.yaml_text import load_yaml  # which a mesh alone doesn't need

    try:
        content = load_yaml(data.decode("utf-8"), file)
    except UnicodeDecodeError:
        raise MeshError(file, "the file isn't UTF-8 text") from None
    except InputError as error:
        raise MeshError(error.field, error.received, error.accepted) from None
    said = content.get("parts") if isinstance(content, Mapping) else None
    if not isinstance(said, Mapping) or not 0 < len(said) <= MAX_PARTS:
        raise MeshError(file, "no parts", f"parts: with 1 to {MAX_PARTS} parts by name, each {{mesh: FILE, ...}}")
    for name in content:
        if name not in ("parts", "scale"):
            raise MeshError(file, str(name), one_of(str(name), ("parts", "scale")))
    scale = content.get("scale", 1.0)
    return tuple(_part(f"{file}, part {name}", str(name), one, scale, load) for name, one in said.items())


def _part(where: str, name: str, said: Any, scale: Any, load: Callable[[str], Mesh]) -> Part:
    if not isinstance(said, Mapping):
        raise MeshError(where, said, "a mapping such as {mesh: body.stl, density: 2700}")
    for field in said:
        if field not in FIELDS:
            raise MeshError(f"{where}, {field}", said[field], one_of(str(field), FIELDS))
    if "density" in said and "mass" in said:
        raise MeshError(f"{where}, mass", said["mass"], "density or mass, not both")
    if "infill" in said and "wall_thickness" not in said:
        raise MeshError(f"{where}, infill", said["infill"], "wall_thickness beside it, within which it is")
    if not isinstance(said.get("mesh"), str):
        raise MeshError(f"{where}, mesh", said.get("mesh"), "the name of a mesh's file")

    def number(field: str, default: float, most: float = math.inf) -> float:
        value = said.get(field, default)
        if field not in said:
            return default
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        low = 0.0 if field == "infill" else 5e-324
        if not is_number or not low <= value <= most or math.isinf(value):
            accepted = "a number from 0 to 1" if field == "infill" else "a finite number > 0"
            raise MeshError(f"{where}, {field}", value, accepted)
        return float(value)

    density, mass = number("density", DENSITY), number("mass", 0.0)
    walls, infill = number("wall_thickness", 0.0), number("infill", INFILL, 1.0)
    matrix = placing(
        where,
        said.get("scale", scale),
        said.get("position", [0.0] * 3),
        said.get("orientation_xyzw", [0.0] * 3 + [1.0]),
    )
    try:
        mesh = load(said["mesh"])
    except InputError as error:
        field = f"{where}, mesh" if error.field == "mesh" else f"{where}, {error.field}"
        raise MeshError(field, error.received, error.accepted) from None
    return Part(name, mesh, matrix, density, mass, walls, infill)


def placing(where: str, scale: Any, position: Any, orientation_xyzw: Any) -> FloatArray:
    """The matrix (4, 4) that scales, turns and moves; raises MeshError, which names ``where``."""

    def numbers(field: str, value: Any, counts: Sequence[int], accepted: str) -> list[float]:
        values = [value] if isinstance(value, (int, float)) else value
        right = isinstance(values, list) and len(values) in counts
        if not right or not all(type(x) in (int, float) and math.isfinite(x) for x in values):
            raise MeshError(f"{where}, {field}", value, accepted)
        return [float(x) for x in values]

    within = "one or three numbers, each with {:g} <= |s| <= {:g}".format(*SCALES)
    s = numbers("scale", scale, (1, 3), within)
    if not all(SCALES[0] <= abs(x) <= SCALES[1] for x in s):
        raise MeshError(f"{where}, scale", scale, within)
    q = numbers("orientation_xyzw", orientation_xyzw, (4,), "four finite numbers x, y, z, w, not all zero")
    if not any(q):
        raise MeshError(f"{where}, orientation_xyzw", orientation_xyzw, "four finite numbers x, y, z, w, not all zero")
    p = numbers("position", position, (3,), "three finite numbers x, y, z")
    matrix = np.empty((4, 4))
    node_matrix(np.array([*p, *q, *(s if len(s) == 3 else s * 3)]), matrix)
    return matrix


def joined_surface(name: str, parts: Sequence[Part]) -> tuple[FloatArray, IntArray, IntArray | None]:
    """Vertices (n, 3) and triangles (m, 3) of all parts, in their order, and where their polygons begin; None where all
    faces are triangles.
    """
    assembly, starts = Assembly(name), []
    count = 0
    for part in parts:
        mesh = part.mesh
        assembly.add(mesh.vertices, mesh.triangles, part.matrix, f"part {part.name}")
        own = np.arange(len(mesh.triangles) + 1) if mesh.polygon_starts is None else mesh.polygon_starts
        starts.append(own[:-1] + count)
        count += len(mesh.triangles)
    vertices, triangles = assembly.surface()
    has_polygons = any(part.mesh.polygon_starts is not None for part in parts)
    return vertices, triangles, np.concatenate([*starts, [count]]) if has_polygons else None


def hash_of_parts(said: str, parts: Sequence[Part]) -> str:
    """A hash of how the parts are told and of all their files' content."""
    return hashlib.sha256(repr((said, [(part.name, part.mesh.sha256) for part in parts])).encode()).hexdigest()
