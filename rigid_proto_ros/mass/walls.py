# SPDX-License-Identifier: MIT
"""Printed parts: walls of full density along a solid's surface, and infill of a lower one within.

The walls are the surface with a mass per area, thickness times density, and the infill is the solid: both to first
order in the thickness t. With V the volume and A the area, the walls have the volume

    t A − t² Σ L w + O(t³),   w = tan(α/2) along a convex edge of length L, −α/2 along a concave one,

where α is the angle between the normals that meet there: what is left of a convex polyhedron when its faces move
inward, and Steiner's formula at concave edges (Schneider, "Convex bodies: the Brunn-Minkowski theory", 2014, 4.2). Of
their second moments about c the next term is −t² (V 1 + Σ ∫ w r rᵀ dl): the walls lie t/2 within the surface, and
∫ r nᵀ dA = V 1. These terms are the model's error. Where opposite walls meet they count twice, which no term shows:
rays from points of the surface measure how thick the solid is there.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.arithmetic import inverse_tangent_of
from ..base.compilation import exported, local_numbers, matrix_of, new_record, njit, record_type
from ..base.errors import InputError, MeshError
from ..base.vectors import FloatArray, IntArray, Points, Triangles, Vector3
from ..mesh.topology import mesh_topology
from .moments import FOUND, MOMENTS, NO_AREA, Moments, shell_moments

RAYS = 64
"""Points of the surface, evenly spread by area, from which the solid's thickness is measured."""
LIMIT = 0.1
"""Error of mass and tensor, relative to the whole, up to which the first order is taken."""
_NEAR = 1e-9
"""Part of the surface's size within which a hit is where the ray begins."""
_SPREAD = 0.7548776662466927, 0.5698402909980532
"""Steps between points that fill a square evenly (Roberts, "The unreasonable effectiveness of quasirandom sequences",
2018)."""

WALLS = record_type(
    [
        ("surface", MOMENTS),
        ("stretch", np.float64, 3),  # |scale|/|scale_x| for which all of this holds
        ("edges", np.float64),  # Σ L w
        ("edges_second", np.float64),  # Σ ∫ w r² dl about the solid's centre
        ("depth", np.float64, RAYS),  # how thick the solid is below points of the surface
    ]
)
"""What the model needs beside the solid's moments, in units of the mesh as stretched."""


def walls_room(vertices: int, triangles: int) -> int:
    """Doubles of workspace of ``walls_of``."""
    return 3 * (vertices + triangles)


@njit(error_model="numpy", allocates=False)
def _fill_normals(points: Points, triangles: Triangles, starts: IntArray, normals: Points) -> float:
    """Fill the unit normals (m, 3) of triangles as wound, of a polygon's those of the polygon, 0 where it has no area;
    the volume that they enclose.
    """
    is_fan, volume = starts.shape[0] > 0, 0.0
    for polygon in range(starts.shape[0] - 1 if is_fan else triangles.shape[0]):
        begin, end = (starts[polygon], starts[polygon + 1]) if is_fan else (polygon, polygon + 1)
        x = y = z = 0.0
        for t in range(begin, end):
            a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            x, y, z = x + nx, y + ny, z + nz
            volume += a[0] * nx + a[1] * ny + a[2] * nz
        length = math.sqrt(x * x + y * y + z * z)
        unit = 1.0 / length if length > 0.0 else 0.0
        for t in range(begin, end):
            normals[t, 0], normals[t, 1], normals[t, 2] = x * unit, y * unit, z * unit
    return volume / 6.0


@njit(error_model="numpy", allocates=False)
def _add_edges(
    points: Points,
    triangles: Triangles,
    edges: IntArray,
    normals: Points,
    sign: float,
    middle: Vector3,
    found: np.record,
) -> None:
    """Add up the edges (e, 6), see ``Topology``, about ``middle`` (3,); sign: −1 for a surface wound inward."""
    found.edges = found.edges_second = 0.0
    for e in range(edges.shape[0]):
        if edges[e, 2] != 1 or edges[e, 3] != 1:
            continue  # where bodies touch
        one, other, a, b = edges[e, 4], edges[e, 5], edges[e, 0], edges[e, 1]
        for k in range(3):
            if triangles[one, k] == b and triangles[one, (k + 1) % 3] == a:
                a, b = b, a
                break
        n, m = normals[one], normals[other]
        x, y, z = n[1] * m[2] - n[2] * m[1], n[2] * m[0] - n[0] * m[2], n[0] * m[1] - n[1] * m[0]
        cosine = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
        sine = math.sqrt(x * x + y * y + z * z)
        if sine == 0.0:
            continue
        p, q = points[a], points[b]
        sx, sy, sz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        along = sign * (x * sx + y * sy + z * sz)
        length, near, far, both = math.sqrt(sx * sx + sy * sy + sz * sz), 0.0, 0.0, 0.0
        for k in range(3):
            r, w = p[k] - middle[k], q[k] - middle[k]
            near, far, both = near + r * r, far + w * w, both + r * w
        weight = sine / max(1.0 + cosine, 1e-9) if along > 0.0 else -0.5 * inverse_tangent_of(sine, cosine)
        found.edges += length * weight
        found.edges_second += length * weight * (near + far + both) / 3.0


@njit(error_model="numpy", allocates=False)
def _depth(points: Points, triangles: Triangles, origin: Vector3, way: Vector3, near: float) -> float:
    """Distance from ``origin`` (3,) along the unit vector ``way`` (3,) to the nearest triangle, beyond ``near``."""
    nearest = np.inf
    for t in range(triangles.shape[0]):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        px, py, pz = way[1] * wz - way[2] * wy, way[2] * wx - way[0] * wz, way[0] * wy - way[1] * wx
        d = ux * px + uy * py + uz * pz
        if d == 0.0:
            continue
        sx, sy, sz = origin[0] - a[0], origin[1] - a[1], origin[2] - a[2]
        u = (sx * px + sy * py + sz * pz) / d
        if u < 0.0 or u > 1.0:
            continue
        qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
        v = (way[0] * qx + way[1] * qy + way[2] * qz) / d
        if v < 0.0 or u + v > 1.0:
            continue
        distance = (wx * qx + wy * qy + wz * qz) / d
        if near < distance < nearest:
            nearest = distance
    return nearest


@njit(error_model="numpy", allocates=False)
def _area(points: Points, triangles: Triangles, t: int) -> float:
    a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    return 0.5 * math.sqrt(x * x + y * y + z * z)


@njit(error_model="numpy", allocates=False)
def _measure_depth(points: Points, triangles: Triangles, normals: Points, sign: float, found: np.record) -> None:
    """Shoot the rays; sign: −1 for a surface wound inward."""
    whole, size = 0.0, 0.0
    for t in range(triangles.shape[0]):
        whole += _area(points, triangles, t)
    for i in range(points.shape[0]):
        size = max(size, abs(points[i, 0]), abs(points[i, 1]), abs(points[i, 2]))
    origin, way = local_numbers(3), local_numbers(3)
    t, before, u, v = 0, 0.0, 0.5, 0.5
    own = _area(points, triangles, 0)
    for ray in range(RAYS):
        target = whole * (ray + 0.5) / RAYS
        while before + own < target and t + 1 < triangles.shape[0]:
            before, t = before + own, t + 1
            own = _area(points, triangles, t)
        u, v = u + _SPREAD[0], v + _SPREAD[1]
        u, v = u - math.floor(u), v - math.floor(v)
        p, q = (u, v) if u + v <= 1.0 else (1.0 - u, 1.0 - v)
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        for k in range(3):
            origin[k] = a[k] + p * (b[k] - a[k]) + q * (c[k] - a[k])
            way[k] = -sign * normals[t, k]
        found.depth[ray] = _depth(points, triangles, origin, way, _NEAR * size)


@exported("f8[:,:]", "i8[:,:]", "i8[:]", "i8[:,:]", "f8[:]", MOMENTS, "f8[:]", WALLS, returns="i8", nogil=True)
def walls_of(
    vertices: Points,
    triangles: Triangles,
    starts: IntArray,
    edges: IntArray,
    scale: Vector3,
    solid: np.record,
    room: FloatArray,
    found: np.record,
) -> int:
    """Fill ``found`` for a solid's surface, triangles (m, 3) over vertices (n, 3), stretched by |scale|/|scale_x|;
    FOUND, or why there are no walls. starts: of its polygons, empty where they are triangles; edges (e, 6): as in
    Topology, over the same vertices. solid: its moments, unstretched. room: see ``walls_room``.
    """
    points = matrix_of(room, vertices.shape[0], 3)
    normals = matrix_of(room[3 * vertices.shape[0] :], triangles.shape[0], 3)
    code = shell_moments(vertices, triangles, starts, scale, points, found.surface)
    if code != FOUND:
        return code
    middle = local_numbers(3)
    for k in range(3):
        found.stretch[k] = abs(scale[k]) / abs(scale[0])
        middle[k] = found.stretch[k] * (solid.center[k] + solid.center_low[k])
        for i in range(vertices.shape[0]):
            points[i, k] = found.stretch[k] * (vertices[i, k] - solid.reference[k])
    volume = _fill_normals(points, triangles, starts, normals)
    if volume == 0.0:
        return NO_AREA
    sign = 1.0 if volume > 0.0 else -1.0
    _add_edges(points, triangles, edges, normals, sign, middle, found)
    _measure_depth(points, triangles, normals, sign, found)
    return FOUND


def walls_of_surface(
    vertices: Points, triangles: Triangles, starts: IntArray | None, stretch: Vector3, solid: Moments
) -> np.record:
    """WALLS of a solid bounded by triangles (m, 3) over vertices (n, 3), stretched by ``stretch`` (3,); starts: of its
    polygons, None where they are triangles. Raises MeshError for one without an area.
    """
    topology = mesh_topology(vertices, triangles)
    vertices, found = np.ascontiguousarray(vertices, dtype=np.float64), new_record(WALLS)
    own = np.empty(0, np.int64) if starts is None else np.ascontiguousarray(starts, np.int64)
    room = np.empty(walls_room(len(vertices), len(triangles)))
    code = walls_of(vertices, topology.corners, own, topology.edges, stretch, solid.record, room, found)
    if code != FOUND:
        raise MeshError("mesh", "the surface has no area, and so no walls")
    return found


def rounded_down(value: float) -> float:
    """In three digits; rounded up it would be refused itself."""
    from decimal import ROUND_DOWN, Context  # 3 ms, which no start needs

    return float(Context(prec=3, rounding=ROUND_DOWN).create_decimal_from_float(value))


def walls_of_parts() -> InputError:
    """The error that says that parts have walls of their own."""
    return InputError("inertia_model", "walled", "wall_thickness of each part, in the file of parts")


def refused_walls(thickness: float, largest: float, error: float) -> InputError:
    """The error that says that walls are too thick."""
    accepted = f"at most {rounded_down(largest):g} m for this body and infill, where the error of the first order is"
    return InputError("wall_thickness", thickness, f"{accepted} {LIMIT:g} of mass or tensor; here it is {error:.3g}")
