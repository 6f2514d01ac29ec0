# SPDX-License-Identifier: MIT
"""Convex hull of a point set (quickhull: Barber, Dobkin, Huhdanpaa, ACM TOMS 22, 1996) and the bounding box as meshes."""

from __future__ import annotations

import numpy as np

from .errors import MeshError

FLAT = 1e-12
"""Distances below this part of the points' extent count as zero: such a point adds less volume than rounding does."""

_BOX_TRIANGLES = np.array(
    [
        *([0, 3, 1], [0, 2, 3], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]),
        *([2, 7, 3], [2, 6, 7], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]),
    ]
)


def box_surface(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (8, 3) and outward triangles (12, 3) of the box between two corners; vertex bits are x, y, z."""
    vertices = np.array([[(lower, upper)[(i >> k) & 1][k] for k in range(3)] for i in range(8)])
    return vertices, _BOX_TRIANGLES.copy()


def _round_shape(points: np.ndarray) -> tuple[np.ndarray, float]:
    """The points (n, 3) stretched until all directions spread alike, which leaves the hull's faces as they are, and
    the distance below which rounding makes a point lie on a plane. Thin slabs at an angle need this."""
    points = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    extent = float(np.max(np.abs(points)))
    if not extent > 0.0:
        raise MeshError("mesh_fallback", "hull of one point", "points that span a volume")
    points = points / extent
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    points = points @ (axes if np.linalg.det(axes) > 0.0 else -axes)  # a mirrored shape's hull would face inward
    half = 0.5 * np.ptp(points, axis=0)
    if half.min() < FLAT:
        raise MeshError("mesh_fallback", "hull of points in one plane", "points that span a volume; box may do")
    return points / half, max(FLAT, 1e-15 / float(half.min()))


def _plane(points, a, b, c):
    normal = np.cross(points[b] - points[a], points[c] - points[a])
    length = np.linalg.norm(normal)
    normal = normal / length if length > 0.0 else normal
    return normal, float(normal @ points[a])


def _first_tetrahedron(points: np.ndarray, tolerance: float) -> list[int]:
    a = int(np.argmin(points[:, int(np.argmax(np.ptp(points, axis=0)))]))
    b = int(np.argmax(np.linalg.norm(points - points[a], axis=1)))
    along = (points[b] - points[a]) / np.linalg.norm(points[b] - points[a])
    offset = points - points[a]
    c = int(np.argmax(np.linalg.norm(offset - np.outer(offset @ along, along), axis=1)))
    normal, level = _plane(points, a, b, c)
    height = points @ normal - level
    d = int(np.argmax(np.abs(height)))
    if not abs(height[d]) > 100.0 * tolerance:
        raise MeshError("mesh_fallback", "hull of points in one plane", "points that span a volume; box may do")
    return [a, b, c, d] if height[d] < 0.0 else [a, c, b, d]


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Outward triangles (k, 3), numbers into ``points`` (n, 3), of their convex hull, to rounding of the extent.

    Raises MeshError when the points lie in one plane.
    """
    points, tolerance = _round_shape(points)
    a, b, c, d = _first_tetrahedron(points, tolerance)
    faces: dict[int, tuple[int, int, int]] = {}
    planes: dict[int, tuple[np.ndarray, float]] = {}
    outside: dict[int, np.ndarray] = {}
    edge_face: dict[tuple[int, int], int] = {}
    number = 0

    def add(face, candidates):
        nonlocal number
        normal, level = _plane(points, *face)
        above = points[candidates] @ normal - level > tolerance
        faces[number], planes[number], outside[number] = face, (normal, level), candidates[above]
        for k in range(3):
            edge_face[face[k], face[(k + 1) % 3]] = number
        number += 1
        return candidates[~above]

    left = np.setdiff1d(np.arange(len(points)), [a, b, c, d])
    for face in ((a, b, c), (a, d, b), (b, d, c), (c, d, a)):
        left = add(face, left)
    pending = list(faces)
    while pending:
        current = pending.pop()
        if current not in faces or not len(outside[current]):
            continue
        normal = planes[current][0]
        candidates = outside[current]
        apex = int(candidates[np.argmax(points[candidates] @ normal)])
        # Faces that see the apex form a connected cap around the current one; its rim is the horizon.
        visible, stack, horizon = {current}, [current], []
        while stack:
            face = stack.pop()
            corners = faces[face]
            for k in range(3):
                u, v = corners[k], corners[(k + 1) % 3]
                beyond = edge_face[v, u]
                if beyond in visible:
                    continue
                n, e = planes[beyond]
                if float(points[apex] @ n) - e > -tolerance:  # coplanar ones go too: slivers would follow
                    visible.add(beyond)
                    stack.append(beyond)
        for face in visible:
            corners = faces[face]
            for k in range(3):
                if edge_face[corners[(k + 1) % 3], corners[k]] not in visible:
                    horizon.append((corners[k], corners[(k + 1) % 3]))
        orphans = np.concatenate([outside[face] for face in visible])
        orphans = orphans[orphans != apex]
        for face in visible:
            del faces[face], planes[face], outside[face]
        for u, v in horizon:
            pending.append(number)
            orphans = add((u, v, apex), orphans)
    height = max(float(np.max(points @ normal)) - level for normal, level in planes.values())
    if height > 1e3 * tolerance:
        raise MeshError("mesh_fallback", "hull", f"points whose hull can be told to {1e3 * tolerance:.0e}; box may do")
    return np.array(list(faces.values()), np.int64)
