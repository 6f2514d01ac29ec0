# SPDX-License-Identifier: MIT
"""Queries of commands on the body's surface: ray intersection, nearest point, and inward normal at a point.

Everything is in mesh coordinates (the file's numbers). Each query visits all triangles: pokes are rare, and a million
triangles take 10 ms for a ray, 20 ms for a nearest point and 40 ms for a normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arithmetic import inverse_tangent_of
from ..base.compilation import exported, local_numbers, njit
from ..base.rotation import norm
from ..base.vectors import Numbers, Points, Triangles, Vector, Vector3
from ..mass.moments import bounding_box
from ..mesh.intersection import corners_of, cross, dot, minus


@dataclass(frozen=True)
class Surface:
    """vertices (n, 3) float64, triangles (m, 3) integer, counter-clockwise seen from outside."""

    vertices: Points
    triangles: Triangles

    @cached_property
    def _arrays(self) -> tuple[Points, Triangles]:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        return vertices, np.ascontiguousarray(self.triangles, dtype=np.int64)

    @cached_property
    def extent(self) -> Vector3:
        """Sides of the bounding box (3,)."""
        lower, upper = np.zeros(3), np.zeros(3)
        bounding_box(*self._arrays, np.empty(len(self.vertices), np.bool_), lower, upper)
        return upper - lower

    def ray_hit(self, origin: Numbers, direction: Numbers) -> Vector3 | None:
        """First point (3,) where the ray meets the surface from either side; None for a miss."""
        point = np.empty(3)
        hits = ray_hit(*self._arrays, _three(origin), _three(direction), point)
        return point if hits else None

    def nearest_point(self, point: Numbers) -> Vector3:
        """The point (3,) of the surface nearest to ``point`` (3,)."""
        nearest = np.empty(3)
        nearest_point(*self._arrays, _three(point), nearest)
        return nearest

    def inward_normal(self, point: Numbers) -> Vector3:
        """Unit inward normal (3,) of the surface where it is nearest to ``point`` (3,).

        On an edge or at a vertex it is the angle-weighted mean of the normals of adjacent faces (Baerentzen & Aanaes
        2005), which doesn't depend on how the faces are triangulated. Zero where they cancel.
        """
        normal = np.empty(3)
        inward_normal(*self._arrays, _three(point), self.extent, normal)
        return normal


def _three(numbers: Numbers) -> Vector3:
    return np.ascontiguousarray(numbers, dtype=np.float64)


@njit(error_model="numpy", allocates=False)
def _first_hit(vertices: Points, triangles: Triangles, origin: Vector3, direction: Vector3) -> float:
    """Distance along ``direction`` of the first hit, infinite for none: Woop, Benthin and Wald (2013), watertight at
    edges.
    """
    kz = 0
    if abs(direction[1]) > abs(direction[kz]):
        kz = 1
    if abs(direction[2]) > abs(direction[kz]):
        kz = 2
    kx = (kz + 1) % 3
    ky = (kx + 1) % 3
    sx = direction[kx] / direction[kz]
    sy = direction[ky] / direction[kz]
    best = math.inf
    for i in range(triangles.shape[0]):
        a, b, c = triangles[i, 0], triangles[i, 1], triangles[i, 2]
        az = vertices[a, kz] - origin[kz]
        bz = vertices[b, kz] - origin[kz]
        cz = vertices[c, kz] - origin[kz]
        ax = vertices[a, kx] - origin[kx] - sx * az
        ay = vertices[a, ky] - origin[ky] - sy * az
        bx = vertices[b, kx] - origin[kx] - sx * bz
        by = vertices[b, ky] - origin[ky] - sy * bz
        cx = vertices[c, kx] - origin[kx] - sx * cz
        cy = vertices[c, ky] - origin[ky] - sy * cz
        u = cx * by - cy * bx
        v = ax * cy - ay * cx
        w = bx * ay - by * ax
        if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
            continue
        determinant = u + v + w
        if determinant == 0.0:
            continue
        distance = (u * az + v * bz + w * cz) / direction[kz] / determinant
        if 0.0 <= distance < best:
            best = distance
    return best


@exported("f8[:,:]", "i8[:,:]", "f8[:]", "f8[:]", "f8[:]", returns="b1", nogil=True)
def ray_hit(vertices: Points, triangles: Triangles, origin: Vector3, direction: Vector3, point: Vector3) -> bool:
    """Whether a ray meets triangles (m, 3) over vertices (n, 3) from either side; fills ``point`` (3,), the first one
    where it does. direction (3,): of any length.
    """
    unit = local_numbers(3)
    largest = max(abs(direction[0]), abs(direction[1]), abs(direction[2]))
    for k in range(3):
        unit[k] = direction[k] / largest
    distance = _first_hit(vertices, triangles, origin, unit)
    if not distance < math.inf:
        return False
    for k in range(3):
        point[k] = origin[k] + distance * unit[k]
    return True


@njit(error_model="numpy", allocates=False)
def _angle(a: Vector, b: Vector) -> float:
    return inverse_tangent_of(norm(*cross(a, b)), dot(a, b))


@njit(error_model="numpy", allocates=False)
def _nearest_on_triangle(p: Vector, a: Vector, b: Vector, c: Vector) -> tuple[Vector, float, float, float]:
    """Nearest point of a triangle to p, squared distance, and its coordinates u, v along the edges ab and ac. After
    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    ab, ac = minus(b, a), minus(c, a)
    ap, bp, cp = minus(p, a), minus(p, b), minus(p, c)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        u, v = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        u, v = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        u, v = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 >= d3 and d1 > d3:  # not where the corners a and b are one point
        u, v = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        u, v = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        u = 1.0 - v
    else:
        total = va + vb + vc
        u, v = vb / total, vc / total
    nearest = (
        a[0] + u * ab[0] + v * ac[0],
        a[1] + u * ab[1] + v * ac[1],
        a[2] + u * ab[2] + v * ac[2],
    )
    gap = minus(p, nearest)
    return nearest, dot(gap, gap), u, v


@njit(error_model="numpy", allocates=False)
def _angle_at(u: float, v: float, a: Vector, b: Vector, c: Vector) -> float:
    """The angle of a triangle at a point of it: the corner's angle, π on an edge, 2π inside."""
    tolerance = 1e-9
    if u <= tolerance and v <= tolerance:
        return _angle(minus(b, a), minus(c, a))
    if u >= 1.0 - tolerance:
        return _angle(minus(a, b), minus(c, b))
    if v >= 1.0 - tolerance:
        return _angle(minus(a, c), minus(b, c))
    if u <= tolerance or v <= tolerance or u + v >= 1.0 - tolerance:
        return math.pi
    return 2.0 * math.pi


@njit(error_model="numpy", allocates=False)
def _nearest(vertices: Points, triangles: Triangles, point: Vector) -> Vector:
    best = math.inf
    found = (0.0, 0.0, 0.0)
    for i in range(triangles.shape[0]):
        a, b, c = corners_of(vertices, triangles, i)
        nearest, squared, _, _ = _nearest_on_triangle(point, a, b, c)
        if squared < best:
            best, found = squared, nearest
    return found


@exported("f8[:,:]", "i8[:,:]", "f8[:]", "f8[:]", nogil=True)
def nearest_point(vertices: Points, triangles: Triangles, point: Vector3, nearest: Vector3) -> None:
    """Fill ``nearest`` (3,): the point of triangles (m, 3) over vertices (n, 3) that is nearest to ``point`` (3,)."""
    nearest[0], nearest[1], nearest[2] = _nearest(vertices, triangles, (point[0], point[1], point[2]))


@exported("f8[:,:]", "i8[:,:]", "f8[:]", "f8[:]", "f8[:]", returns="b1", nogil=True)
def inward_normal(vertices: Points, triangles: Triangles, point: Vector3, extent: Vector3, normal: Vector3) -> bool:
    """Fill the unit ``normal`` (3,), see ``Surface``; False, and zeros, where there is none. extent (3,): of the
    surface.
    """
    tolerance = 1e-9 * norm(extent[0], extent[1], extent[2])
    foot = _nearest(vertices, triangles, (point[0], point[1], point[2]))
    nx, ny, nz = 0.0, 0.0, 0.0
    for i in range(triangles.shape[0]):
        a, b, c = corners_of(vertices, triangles, i)
        _, gap, u, v = _nearest_on_triangle(foot, a, b, c)
        if gap <= tolerance * tolerance:
            angle = _angle_at(u, v, a, b, c)
            x, y, z = cross(minus(b, a), minus(c, a))
            area = norm(x, y, z)
            if area > 0.0:
                nx += angle * x / area
                ny += angle * y / area
                nz += angle * z / area
    size = norm(nx, ny, nz)
    if not size > 1e-12:
        normal[0] = normal[1] = normal[2] = 0.0
        return False
    normal[0], normal[1], normal[2] = -nx / size, -ny / size, -nz / size
    return True
