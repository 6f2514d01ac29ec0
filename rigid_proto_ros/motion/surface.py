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
from ..base.compilation import njit
from ..base.rotation import length, norm
from ..base.vectors import Numbers, Points, Triangles, Vector, Vector3, vector
from ..mass.moments import referenced_vertices
from ..mesh.intersection import corners_of, cross, dot, minus


@dataclass(frozen=True)
class Surface:
    """vertices (n, 3) float64, triangles (m, 3) integer, counter-clockwise seen from outside."""

    vertices: Points
    triangles: Triangles

    @cached_property
    def extent(self) -> Vector3:
        """Sides of the bounding box (3,)."""
        sides: Vector3 = np.ptp(referenced_vertices(self.vertices, self.triangles), axis=0)
        return sides

    def ray_hit(self, origin: Numbers, direction: Numbers) -> Vector3 | None:
        """First point (3,) where the ray meets the surface from either side; None for a miss."""
        origin, direction = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
        direction = direction / np.abs(direction).max()
        distance = _first_hit(self.vertices, self.triangles, origin, direction)
        return origin + distance * direction if distance < math.inf else None

    def nearest_point(self, point: Numbers) -> Vector3:
        """The point (3,) of the surface nearest to ``point`` (3,)."""
        return np.array(_nearest(self.vertices, self.triangles, vector(point)))

    def inward_normal(self, point: Numbers) -> Vector3:
        """Unit inward normal (3,) of the surface where it is nearest to ``point`` (3,).

        On an edge or at a vertex it is the angle-weighted mean of the normals of adjacent faces (Baerentzen & Aanaes
        2005), which doesn't depend on how the faces are triangulated. Zero where they cancel.
        """
        tolerance = 1e-9 * length(self.extent)
        outward = np.array(_pseudo_normal(self.vertices, self.triangles, vector(point), tolerance))
        size = length(outward)
        return -outward / size if size > 1e-12 else np.zeros(3)


@njit()
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


@njit()
def _angle(a: Vector, b: Vector) -> float:
    return inverse_tangent_of(norm(*cross(a, b)), dot(a, b))


@njit()
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


@njit()
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


@njit()
def _nearest(vertices: Points, triangles: Triangles, point: Vector) -> Vector:
    best = math.inf
    found = (0.0, 0.0, 0.0)
    for i in range(triangles.shape[0]):
        a, b, c = corners_of(vertices, triangles, i)
        nearest, squared, _, _ = _nearest_on_triangle(point, a, b, c)
        if squared < best:
            best, found = squared, nearest
    return found


@njit()
def _pseudo_normal(vertices: Points, triangles: Triangles, point: Vector, tolerance: float) -> Vector:
    foot = _nearest(vertices, triangles, point)
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
    return nx, ny, nz


@njit(error_model="numpy", allocates=False)
def nearest_point(vertices: Points, triangles: Triangles, x: float, y: float, z: float) -> Vector:
    return _nearest(vertices, triangles, (x, y, z))


@njit(error_model="numpy", allocates=False)
def ray_hit(
    vertices: Points, triangles: Triangles, ox: float, oy: float, oz: float, x: float, y: float, z: float
) -> tuple[bool, float, float, float]:
    longest = max(abs(x), abs(y), abs(z))
    x, y, z = x / longest, y / longest, z / longest
    t = _first_hit(vertices, triangles, (ox, oy, oz), (x, y, z))
    return t < math.inf, ox + t * x, oy + t * y, oz + t * z


@njit(error_model="numpy", allocates=False)
def inward_normal(
    vertices: Points, triangles: Triangles, x: float, y: float, z: float
) -> tuple[bool, float, float, float]:
    low = [0.0] if False else (math.inf, math.inf, math.inf)
    lx, ly, lz = low
    hx, hy, hz = -math.inf, -math.inf, -math.inf
    for i in range(triangles.shape[0]):
        for k in range(3):
            v = triangles[i, k]
            lx, ly, lz = min(lx, vertices[v, 0]), min(ly, vertices[v, 1]), min(lz, vertices[v, 2])
            hx, hy, hz = max(hx, vertices[v, 0]), max(hy, vertices[v, 1]), max(hz, vertices[v, 2])
    tolerance = 1e-9 * norm(hx - lx, hy - ly, hz - lz)
    nx, ny, nz = _pseudo_normal(vertices, triangles, (x, y, z), tolerance)
    size = norm(nx, ny, nz)
    if size > 1e-12:
        return True, -nx / size, -ny / size, -nz / size
    return False, 0.0, 0.0, 0.0
