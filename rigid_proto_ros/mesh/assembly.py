# SPDX-License-Identifier: MIT
"""Scenes of placed parts as one surface, and formats read by a library: COLLADA by pycollada, without materials, lights
and animation, and by trimesh formats that have no reader here.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.compilation import exported, local_matrix, njit
from ..base.errors import MeshError, is_missing
from ..base.rotation import matrix_elements, normalize
from ..base.vectors import FloatArray, Points, Triangles
from .topology import turned_triangles

_LIBRARIES = ("images", "effects", "materials", "cameras", "lights", "animations", "animation_clips", "controllers")
_UNUSED = (*(f"library_{kind}" for kind in _LIBRARIES), "bind_material", "instance_camera", "instance_light", "extra")
"""Elements without effect on triangles. pycollada drops a geometry whose material it can't read."""
_ARCHIVES = ("zip", "bz2", "tar.bz2", "tar.gz", "zae")
MAX_TRIANGLES = 20_000_000
"""A mesh with more triangles is refused: to read and judge this many takes about 10 GB (480 bytes for each)."""


@exported("f8[:]", "f8[:,:]")
def node_matrix(numbers: FloatArray, matrix: FloatArray) -> None:
    """Fill the matrix (4, 4) of a scene's node: of 16 numbers, its columns one after the other, or of 10: translation,
    rotation as a quaternion xyzw of any length, and scale, which acts first.
    """
    if numbers.shape[0] == 16:
        for k in range(16):
            matrix[k % 4, k // 4] = numbers[k]
        return
    x, y, z, w = normalize(numbers[3], numbers[4], numbers[5], numbers[6])
    xx, xy, xz, yx, yy, yz, zx, zy, zz = matrix_elements(x, y, z, w)
    a, b, c = numbers[7], numbers[8], numbers[9]
    matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3] = xx * a, xy * b, xz * c, numbers[0]
    matrix[1, 0], matrix[1, 1], matrix[1, 2], matrix[1, 3] = yx * a, yy * b, yz * c, numbers[1]
    matrix[2, 0], matrix[2, 1], matrix[2, 2], matrix[2, 3] = zx * a, zy * b, zz * c, numbers[2]
    matrix[3, 0] = matrix[3, 1] = matrix[3, 2] = 0.0
    matrix[3, 3] = 1.0


@exported("f8[:,:]", "f8[:,:]", "f8[:,:]")
def multiply_matrices(a: FloatArray, b: FloatArray, product: FloatArray) -> None:
    """Fill ``product`` (4, 4), another matrix, with a b, summed in the columns' order."""
    for i in range(4):
        for j in range(4):
            product[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j] + a[i, 3] * b[3, j]


@njit(error_model="numpy", allocates=False)
def _mirrors(matrix: FloatArray) -> bool:
    """Whether the determinant of the upper left (3, 3) is negative: by elimination, rows with the largest pivots first,
    so that nothing overflows.
    """
    rows, negative = local_matrix(3, 3), False
    for i in range(3):
        for j in range(3):
            rows[i, j] = matrix[i, j]
    for k in range(3):
        best = k
        for i in range(k + 1, 3):
            if abs(rows[i, k]) > abs(rows[best, k]):
                best = i
        if rows[best, k] == 0.0:
            return False
        if best != k:
            negative = not negative
            for j in range(3):
                rows[k, j], rows[best, j] = rows[best, j], rows[k, j]
        if rows[k, k] < 0.0:
            negative = not negative
        for i in range(k + 1, 3):
            factor = rows[i, k] / rows[k, k]
            for j in range(k + 1, 3):
                rows[i, j] -= factor * rows[k, j]
    return negative


@exported("f8[:,:]", "f8[:,:]", "f8[:,:]", returns="b1", nogil=True)
def place_vertices(vertices: Points, matrix: FloatArray, placed: Points) -> bool:
    """Fill ``placed`` (n, 3) with vertices (n, 3) transformed by matrix (4, 4), summed in a fixed order; whether that
    mirrors them.
    """
    for i in range(vertices.shape[0]):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(3):
            placed[i, k] = x * matrix[k, 0] + y * matrix[k, 1] + z * matrix[k, 2] + matrix[k, 3]
    return _mirrors(matrix)


class Assembly:
    """Collects the placed parts of the file ``name``."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._vertices: list[Points] = [np.empty((0, 3))]
        self._triangles: list[Triangles] = [np.empty((0, 3), np.int64)]
        self._count = self._held = 0

    def add(self, vertices: NDArray[Any], triangles: NDArray[Any], matrix: NDArray[Any], part: str) -> None:
        """Append ``part``: vertices (n, 3) transformed by matrix (4, 4), triangles (m, 3) reversed if it mirrors.

        Raises MeshError for a vertex number out of range, and beyond MAX_TRIANGLES.
        """
        triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
        wrong = triangles[(triangles < 0) | (triangles >= len(vertices))]
        if len(wrong):
            raise MeshError(self.name, f"{part} uses vertex {wrong[0]}, but it has only {len(vertices)}")
        self._held += len(triangles)
        if max(self._held, (self._count + len(vertices)) // 3) > MAX_TRIANGLES:
            raise MeshError(self.name, f"it has more than {MAX_TRIANGLES} triangles", "a smaller mesh")
        with np.errstate(all="ignore"):  # the verdict refuses numbers that aren't finite
            points, matrix = (np.ascontiguousarray(of, dtype=np.float64) for of in (vertices, matrix))
        placed = np.empty((len(points), 3))
        if place_vertices(points, matrix, placed):
            triangles = turned_triangles(triangles)
        self._vertices.append(placed)
        self._triangles.append(triangles + self._count)
        self._count += len(vertices)

    def surface(self) -> tuple[Points, Triangles]:
        """Vertices (n, 3) and triangles (m, 3) of all parts, in the order in which they were added."""
        return np.concatenate(self._vertices), np.concatenate(self._triangles)


def tag_of(element: ElementTree.Element) -> str:
    """An element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _geometry_alone(data: bytes, name: str) -> tuple[bytes, float]:
    """The document reduced to its geometry, and its unit in metres."""
    root = ElementTree.fromstring(data)
    unit = root.find("{*}asset/{*}unit")  # pycollada takes 1 for one that is no number
    for parent in list(root.iter()):
        for child in list(parent):
            if tag_of(child) in _UNUSED:
                parent.remove(child)
            elif tag_of(child) == "instance_controller":
                raise MeshError(name, f"{child.get('url')} deforms its mesh; apply skin or morph before the export")
            elif tag_of(child) in ("convex_mesh", "spline", "brep", "ph", "skew"):
                raise MeshError(name, f"it has <{tag_of(child)}>", "triangles and polygons without holes, not skewed")
    return ElementTree.tostring(root), 1.0 if unit is None else float(unit.get("meter", "1"))


def add_collada(data: bytes, assembly: Assembly) -> float:
    """Add the geometry of the scene in a file's bytes, in the file's unit; returns this unit in metres.

    Raises MeshError, or pycollada's errors.
    """
    try:
        import collada
    except ImportError:
        raise MeshError(assembly.name, is_missing("pycollada", "meshes")) from None
    geometry, unit = _geometry_alone(data, assembly.name)
    document = collada.Collada(io.BytesIO(geometry))
    if document.scene is None:
        raise MeshError(assembly.name, "the file has no scene, which would define the geometry to be used")
    for bound in document.scene.objects("geometry"):
        for primitive in bound.original.primitives:
            if isinstance(primitive, collada.polylist.Polylist):
                primitive = primitive.triangleset()
            if isinstance(primitive, collada.triangleset.TriangleSet) and primitive.vertex is not None:
                assembly.add(primitive.vertex, primitive.vertex_index, bound.matrix, f"geometry {bound.original.id}")
    return unit


def other_formats() -> tuple[str, ...]:
    """File extensions that the installed trimesh reads, without archives."""
    import trimesh

    return tuple(sorted(set(trimesh.available_formats()) - set(_ARCHIVES)))


def add_by_trimesh(data: bytes, suffix: str, assembly: Assembly) -> float:
    """Add what trimesh reads from a file's bytes; returns the file's unit in metres, 1 if it states none.

    Vertices stay as in the file, neither merged nor sorted. Raises MeshError for a file with anything but triangles,
    which would otherwise be left out silently, and trimesh's errors.
    """
    import trimesh

    load: Any = trimesh.load_scene
    scene = load(io.BytesIO(data), file_type=suffix, process=False, maintain_order=True, skip_materials=True)
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            raise MeshError(assembly.name, f"{name} is a {type(part).__name__}", "triangles alone")
        assembly.add(np.asarray(part.vertices), np.asarray(part.faces), np.asarray(matrix), name)
    return 1.0 if scene.units is None else float(trimesh.units.unit_conversion(scene.units, "meters"))
