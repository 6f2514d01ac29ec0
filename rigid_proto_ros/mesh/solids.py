# SPDX-License-Identifier: MIT
"""Solids derived from others: the union of components that overlap, by manifold3d (Lalish,
github.com/elalish/manifold), and a mesh's convex hull and bounding box.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import MeshError, is_missing
from ..base.vectors import IntArray, Points, Triangles, Vector3
from .intersection import Nesting, component_nesting
from .topology import component_sums, fan, mesh_topology

if TYPE_CHECKING:
    import manifold3d

MAX_UNITED = 300_000
"""Triangles up to which unions are computed: about two seconds of manifold3d's work."""
SAME = 1e-9
"""Relative difference of a union's volume in another order of its parts and about another origin, up to which the union
is taken: where faces lie on each other to rounding, manifold3d 3.5 makes some that are wrong by percents.
"""
NOT_UNITED = "components that overlap can't be united"
FLAT = 1e-12
"""Relative extent along an axis below which points count as lying in a plane: rounding has the same effect."""


def can_unite() -> bool:
    """Whether manifold3d is installed."""
    return importlib.util.find_spec("manifold3d") is not None


def united_surface(
    vertices: Points, triangles: Triangles, nesting: Nesting | None = None
) -> tuple[Points, Triangles, float]:
    """Vertices (n, 3) and triangles (m, 3) of the union of closed components that overlap, and the sum of the volumes
    of its parts; nesting: theirs, if it is known.

    Each component wound outward is a part. One wound inward is a cavity of the smallest part around it, and of no other
    one: what enters a cavity stays. Raises MeshError if that isn't possible, or would take too long.
    """
    refusal = MeshError("mesh", NOT_UNITED)
    if not can_unite() or len(triangles) > MAX_UNITED:
        raise refusal
    import manifold3d

    topology = mesh_topology(vertices, triangles)
    sums = component_sums(vertices, topology)
    nesting = nesting or component_nesting(vertices, topology, sums)
    points = vertices[topology.corners.ravel()]
    cavity = sums.volume < 0.0
    around = np.where(nesting.inside & (sums.volume > 0.0), sums.volume, np.inf)  # volumes of the parts around each
    if cavity.any() and not (nesting.complete and np.isfinite(around[cavity].min(axis=1)).all()):
        raise refusal
    faces = []
    for c in range(topology.components):
        own = topology.corners[topology.component == c]
        own = own[(own != np.roll(own, 1, axis=1)).all(axis=1)]
        steps = own * len(vertices) + np.roll(own, -1, axis=1)
        if len(np.unique(steps)) < steps.size:  # faces that lie on each other, of which manifold3d makes a wrong union
            raise refusal
        faces.append(own[:, [0, 2, 1]] if cavity[c] else own)
    owner = np.where(cavity, np.argmin(around, axis=1), np.arange(topology.components))
    low, high = points.min(axis=0), points.max(axis=0)
    again = _united(vertices, faces, owner, np.argsort(~cavity, kind="stable")[::-1], 0.863 * low + 0.137 * high)
    middle = 0.5 * low + 0.5 * high
    parts = _united(vertices, faces, owner, np.argsort(cavity, kind="stable"), middle)
    union = sum(parts, manifold3d.Manifold())
    if not abs(sum(again, manifold3d.Manifold()).volume() - union.volume()) <= SAME * abs(union.volume()):
        raise refusal
    mesh, volume = union.to_mesh64(), float(sum(part.volume() for part in parts))
    return np.asarray(mesh.vert_properties)[:, :3] + middle, np.asarray(mesh.tri_verts).astype(np.int64), volume


def _united(
    vertices: Points, faces: list[Triangles], owner: IntArray, order: IntArray, origin: Vector3
) -> list[manifold3d.Manifold]:
    """The parts, less their cavities, about an origin (3,), from the faces of each component; owner (c,): the part of
    which each is a cavity, or itself; order: parts before cavities. Raises MeshError where one bounds no solid.
    """
    import manifold3d

    parts: dict[int, manifold3d.Manifold] = {}
    for c in order.tolist():
        used, local = np.unique(faces[c], return_inverse=True)
        local = local.reshape(-1, 3).astype(np.uint64)
        solid = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices[used] - origin, tri_verts=local))
        if solid.status() != manifold3d.Error.NoError:
            raise MeshError("mesh", NOT_UNITED)
        if owner[c] == c:
            parts[c] = solid
        else:
            parts[int(owner[c])] -= solid
    return list(parts.values())


def shared_volume(one: tuple[Points, Triangles], other: tuple[Points, Triangles]) -> float:
    """Volume that two solids, each given by vertices (n, 3) and outward triangles (m, 3), have in common; raises
    MeshError where manifold3d takes one for no solid.
    """
    import manifold3d

    origin = 0.5 * (one[0].min(axis=0) + one[0].max(axis=0))
    solids = []
    for vertices, triangles in (one, other):
        topology = mesh_topology(vertices, triangles)
        used, local = np.unique(topology.corners, return_inverse=True)
        faces = local.reshape(-1, 3).astype(np.uint64)
        solid = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices[used] - origin, tri_verts=faces))
        if solid.status() != manifold3d.Error.NoError:
            raise MeshError("mesh", NOT_UNITED)
        solids.append(solid)
    return float((solids[0] ^ solids[1]).volume())


def hull_is_missing() -> str:
    """What to install for ``convex_hull``; empty where it is there."""
    try:
        import scipy.spatial  # noqa: F401 (looked for)
    except ImportError:
        return is_missing("scipy", "meshes")
    return ""


def convex_hull(points: Points) -> tuple[Points, Triangles]:
    """Vertices (n, 3), a subset of points (k, 3), and outward triangles (m, 3) of their convex hull, accurate to
    rounding of the extent, by Qhull (Barber, Dobkin, Huhdanpaa, ACM TOMS 22, 1996).

    Raises MeshError when the points lie in one plane, and without SciPy.
    """
    if missing := hull_is_missing():
        raise MeshError("mesh_fallback", f"hull: {missing}; box needs no package")
    from scipy.spatial import ConvexHull, QhullError

    remedy = "; use box instead" if np.ptp(points, axis=0).min() > 0.0 else ""
    flat = MeshError("mesh_fallback", f"the points lie in one plane and have no hull with a volume{remedy}")
    # Scaled to the same extent in all directions, which leaves the hull's faces as they are: Qhull would treat a thin
    # slab at an angle as flat.
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
        hull = ConvexHull(shape, qhull_options="Qt")
    except QhullError:
        raise flat from None
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    _wind_alike(triangles, hull.neighbors)
    a, b, c = (shape[used[triangles[:, k]]] for k in range(3))
    if np.sum(a * np.cross(b, c)) < 0.0:
        triangles = triangles[:, ::-1]
    if len(mesh_topology(shape[used], triangles).unbalanced):
        raise MeshError("mesh_fallback", f"the hull of the points isn't closed{remedy}")
    return points[used], triangles


def _wind_alike(triangles: Triangles, neighbors: IntArray) -> None:
    """Wind the triangles (m, 3) of a closed surface alike, from each to its neighbors (m, 3): the normal of a sliver
    between points of one edge is due to rounding.
    """
    wound, waiting = {0}, [0]
    while waiting:
        one = waiting.pop()
        a, b, c = triangles[one].tolist()
        for other in set(neighbors[one].tolist()) - wound:
            x, y, z = triangles[other].tolist()
            # Triangles wound alike pass their common edge in opposite directions.
            if {(a, b), (b, c), (c, a)} & {(x, y), (y, z), (z, x)}:
                triangles[other] = z, y, x
            wound.add(other)
            waiting.append(other)


def box_surface(points: Points) -> tuple[Points, Triangles]:
    """Vertices (8, 3) and outward triangles (12, 3) of the bounding box of points (k, 3); vertex bits are x, y, z."""
    ends = points.min(axis=0), points.max(axis=0)
    vertices = np.array([[ends[(i >> k) & 1][k] for k in range(3)] for i in range(8)])
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return vertices, np.concatenate([fan(list(side)) for side in sides])
