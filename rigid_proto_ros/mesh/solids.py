# SPDX-License-Identifier: MIT
"""Solids made of others: the union of components that overlap, by manifold3d (Lalish, github.com/elalish/manifold),
and a mesh's convex hull and bounding box.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import MeshError, is_missing
from .intersection import component_nesting
from .topology import component_sums, mesh_topology

if TYPE_CHECKING:
    import manifold3d

MAX_UNITED = 300_000
"""Triangles up to which overlaps are measured: about a second of manifold3d's work."""
FLAT = 1e-12
"""Points that spread by less than this part of their extent along an axis lie in a plane: rounding does as much."""


def can_unite() -> bool:
    """Whether manifold3d is installed."""
    return importlib.util.find_spec("manifold3d") is not None


def united(
    vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, volume: np.ndarray, depth: np.ndarray
) -> tuple[manifold3d.Manifold, np.ndarray] | None:
    """The union of closed components as manifold3d has it, and the point (3,) that is its origin, near their centre;
    None where it can't be had, or would take long.

    component (m,) numbers the triangles (m, 3); volume (k,): signed; depth (k,): in how many others each lies.
    Outermost first, they are united where they are wound outward and cut out where inward.
    """
    if not can_unite() or len(corners) > MAX_UNITED:
        return None
    import manifold3d

    points = vertices[corners.ravel()]
    middle = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    result = manifold3d.Manifold()
    for c in np.argsort(depth, kind="stable").tolist():
        part = corners[component == c]
        if volume[c] < 0.0:
            part = part[:, [0, 2, 1]]
        used, local = np.unique(part, return_inverse=True)
        local = local.reshape(-1, 3).astype(np.uint64)
        solid = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices[used] - middle, tri_verts=local))
        if solid.status() != manifold3d.Error.NoError:
            return None
        result = result - solid if volume[c] < 0.0 else result + solid
    return result, middle


def united_surface(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the union of closed components that overlap."""
    topology = mesh_topology(vertices, triangles)
    sums = component_sums(vertices, topology)
    nesting = component_nesting(vertices, topology, sums)
    found = united(vertices, topology.corners, topology.component, sums.volume, nesting.depth)
    if found is None:  # the verdict has had it
        raise MeshError("mesh", "components that overlap can't be united")
    mesh = found[0].to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3] + found[1], np.asarray(mesh.tri_verts).astype(np.int64)


def convex_hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3), some of points (k, 3), and outward triangles (m, 3) of their convex hull, to rounding of the
    extent, by Qhull (Barber, Dobkin, Huhdanpaa, ACM TOMS 22, 1996).

    Raises MeshError when the points lie in one plane, and without SciPy.
    """
    try:
        from scipy.spatial import ConvexHull, QhullError
    except ImportError:
        raise MeshError("mesh_fallback", f"hull: {is_missing('scipy', 'meshes')}; box needs no package") from None
    flat = MeshError("mesh_fallback", "the points lie in one plane and have no hull with a volume; use box instead")
    # Stretched until all directions spread alike, which leaves the hull's faces as they are: Qhull would take a thin
    # slab at an angle for flat.
    shape = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    shape = shape / (float(np.max(np.abs(shape))) or 1.0)
    axes = np.linalg.svd(shape - shape.mean(axis=0), full_matrices=False)[2].T
    if len(points) < 4:
        raise flat
    shape = shape @ (axes if np.linalg.det(axes) > 0.0 else -axes)  # a mirrored shape's hull would face inward
    half = 0.5 * np.ptp(shape, axis=0)
    if half.min() < FLAT:
        raise flat
    shape = shape / half
    try:
        # Points in one plane but for rounding can leave cracks between triangles; moved by 1e-11 of the extent
        # ("joggled") they can't.
        hull = ConvexHull(shape, qhull_options="QJ")
    except QhullError:
        raise flat from None
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    a, b, c = (shape[used[triangles[:, k]]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    if len(mesh_topology(shape[used], triangles).unbalanced):
        raise flat
    return points[used], triangles


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
