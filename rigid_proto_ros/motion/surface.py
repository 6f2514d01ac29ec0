# SPDX-License-Identifier: MIT
"""Queries of commands on the body's surface: ray intersection, nearest point, and inward normal at a point.

Everything is in mesh coordinates (the file's numbers). Each query visits all triangles: pokes are rare, and a million
triangles take some milliseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arithmetic import inverse_tangent_of
from ..base.compilation import njit
from ..base.rotation import length, norm
from ..base.vectors import Numbers
from ..mass.moments import referenced_vertices


@dataclass(frozen=True)
class Surface:
    """vertices (n, 3) float64, triangles (m, 3) integer, counter-clockwise seen from outside."""

    vertices: np.ndarray
    triangles: np.ndarray

    @cached_property
    def extent(self) -> np.ndarray:
        """Sides of the bounding box (3,)."""
        sides: np.ndarray = np.ptp(referenced_vertices(self.vertices, self.triangles), axis=0)
        return sides

    def ray_hit(self, origin: Numbers, direction: Numbers) -> tuple[np.ndarray, int] | None:
        """First point (3,) where the ray meets the surface from either side, and its triangle; None for a miss."""
        direction = np.asarray(direction, dtype=float)
        direction = direction / np.abs(direction).max()
        distance, triangle = _first_hit(self.vertices, self.triangles, np.asarray(origin, dtype=float), direction)
        if triangle < 0:
            return None
        return np.asarray(origin, dtype=float) + distance * direction, int(triangle)

    def nearest_point(self, point: Numbers) -> np.ndarray:
        """The point (3,) of the surface nearest to ``point`` (3,)."""
        nearest, _, _ = _nearest(self.vertices, self.triangles, np.asarray(point, dtype=float))
        return np.array(nearest)

    def inward_normal(self, point: Numbers) -> np.ndarray:
        """Unit inward normal (3,) of the surface where it is nearest to ``point`` (3,).

        On an edge or at a vertex it is the angle-weighted mean of the normals of adjacent faces (Baerentzen & Aanaes
        2005), which doesn't depend on how the faces are triangulated. Zero where they cancel.
        """
        point = np.asarray(point, dtype=float)
        outward = np.array(_pseudo_normal(self.vertices, self.triangles, point, 1e-9 * length(self.extent)))
        size = length(outward)
        return -outward / size if size > 1e-12 else np.zeros(3)


@njit()
def _first_hit(
    vertices: np.ndarray, triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> tuple[float, int]:
    """Distance along ``direction`` and triangle of the first hit: Woop, Benthin and Wald (2013),
    watertight at edges.
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
    best_triangle = -1
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
            best_triangle = i
    return best, best_triangle


@njit()
def _nearest_on_triangle(p: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Nearest point of a triangle, squared distance, and the angle of the triangle at that point: the corner's angle, π
    on an edge, 2π inside. After Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    ab = b - a
    ac = c - a
    ap = p - a
    d1 = (ab * ap).sum()
    d2 = (ac * ap).sum()
    bp = p - b
    d3 = (ab * bp).sum()
    d4 = (ac * bp).sum()
    cp = p - c
    d5 = (ab * cp).sum()
    d6 = (ac * cp).sum()
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
    tolerance = 1e-9
    if u <= tolerance and v <= tolerance:
        angle = _angle(ab, ac)
    elif u >= 1.0 - tolerance:
        angle = _angle(a - b, c - b)
    elif v >= 1.0 - tolerance:
        angle = _angle(a - c, b - c)
    elif u <= tolerance or v <= tolerance or u + v >= 1.0 - tolerance:
        angle = math.pi
    else:
        angle = 2.0 * math.pi
    nearest = a + u * ab + v * ac
    gap = p - nearest
    return nearest, (gap * gap).sum(), angle


@njit()
def _cross(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit()
def _angle(a: np.ndarray, b: np.ndarray) -> float:
    x, y, z = _cross(a, b)
    return inverse_tangent_of(norm(x, y, z), (a * b).sum())


@njit()
def _nearest(vertices: np.ndarray, triangles: np.ndarray, point: np.ndarray) -> tuple[tuple[float, ...], float, int]:
    best = math.inf
    best_point = (0.0, 0.0, 0.0)
    best_triangle = -1
    for i in range(triangles.shape[0]):
        nearest, squared, _ = _nearest_on_triangle(
            point, vertices[triangles[i, 0]], vertices[triangles[i, 1]], vertices[triangles[i, 2]]
        )
        if squared < best:
            best = squared
            best_point = (nearest[0], nearest[1], nearest[2])
            best_triangle = i
    return best_point, best, best_triangle


@njit()
def _pseudo_normal(
    vertices: np.ndarray, triangles: np.ndarray, point: np.ndarray, tolerance: float
) -> tuple[float, float, float]:
    nearest, squared, _ = _nearest(vertices, triangles, point)
    foot = np.array(nearest)
    nx, ny, nz = 0.0, 0.0, 0.0
    for i in range(triangles.shape[0]):
        a = vertices[triangles[i, 0]]
        b = vertices[triangles[i, 1]]
        c = vertices[triangles[i, 2]]
        _, gap, angle = _nearest_on_triangle(foot, a, b, c)
        if gap <= tolerance * tolerance:
            x, y, z = _cross(b - a, c - a)
            area = norm(x, y, z)
            if area > 0.0:
                nx += angle * x / area
                ny += angle * y / area
                nz += angle * z / area
    return nx, ny, nz
