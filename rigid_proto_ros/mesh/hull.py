# SPDX-License-Identifier: MIT
"""Convex hull of a point set, by Qhull (Barber, Dobkin, Huhdanpaa, ACM TOMS 22, 1996) through SciPy, and the bounding
box, as meshes.
"""

from __future__ import annotations

import numpy as np

from ..base.errors import MeshError, is_missing
from .topology import mesh_topology

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


def _round_shape(points: np.ndarray) -> np.ndarray:
    """The points (n, 3) stretched until all directions spread alike, which leaves the hull's faces as they are: Qhull
    would take a thin slab at an angle for flat.
    """
    points = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    extent = float(np.max(np.abs(points)))
    if not extent > 0.0:
        raise MeshError("mesh_fallback", "the points coincide and have no hull")
    points = points / extent
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    points = points @ (axes if np.linalg.det(axes) > 0.0 else -axes)  # a mirrored shape's hull would face inward
    half = 0.5 * np.ptp(points, axis=0)
    if half.min() < FLAT:
        raise MeshError("mesh_fallback", "the points lie in one plane and have no hull with a volume; use box instead")
    return points / half


def convex_hull(points: np.ndarray) -> np.ndarray:
    """Outward triangles (k, 3), numbers into ``points`` (n, 3), of their convex hull, to rounding of the extent.

    Raises MeshError when the points lie in one plane, and without SciPy.
    """
    try:
        from scipy.spatial import ConvexHull, QhullError
    except ImportError:
        raise MeshError("mesh_fallback", f"hull: {is_missing('scipy', 'meshes')}; box needs no package") from None
    if len(points) < 4:
        raise MeshError("mesh_fallback", f"{len(points)} points have no hull with a volume; use box instead")
    shape = _round_shape(points)
    try:
        # Points that lie in one plane but for rounding can leave cracks between Qhull's triangles; moved by 1e-11 of
        # the extent ("joggled") they can't.
        for options in ("Qt", "QJ"):
            hull = ConvexHull(shape, qhull_options=options)
            triangles = hull.simplices.astype(np.int64)
            a, b, c = (shape[triangles[:, k]] for k in range(3))
            inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
            triangles[inward] = triangles[inward][:, [0, 2, 1]]
            topology = mesh_topology(shape, triangles)
            if not len(topology.unbalanced) and not topology.nonmanifold:
                return triangles
    except QhullError:
        pass
    raise MeshError("mesh_fallback", "the points lie in one plane and have no hull with a volume; use box instead")
