# SPDX-License-Identifier: MIT
"""Closed components that overlap as one solid, by manifold3d (Lalish, github.com/elalish/manifold), an optional package
that is imported here alone.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import MeshError
from .intersection import component_nesting
from .topology import component_sums, mesh_topology

if TYPE_CHECKING:
    import manifold3d

MAX_UNITED = 300_000
"""Triangles up to which overlaps are measured: about a second of manifold3d's work."""


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
