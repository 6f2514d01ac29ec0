# SPDX-License-Identifier: MIT
"""Closed components as one solid, in which what several of them enclose counts once.

Without crossings it follows from how the components lie in each other. Crossing ones are united by manifold3d (Lalish,
github.com/elalish/manifold), an optional package; it is imported here alone.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import MeshError, is_missing

if TYPE_CHECKING:
    import manifold3d

MAX_UNITED = 300_000
"""Triangles up to which overlaps are measured unasked: about a second of manifold3d's work."""


def can_unite() -> bool:
    """Whether manifold3d is installed."""
    return importlib.util.find_spec("manifold3d") is not None


def counted_once(volume: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """By what factor, −1, 0 or 1, each component's enclosed volume |volume| (k,) belongs to the union of components
    that don't cross; inside (k, k): component i lies in component j.

    A place is solid where more outward components enclose it than inward ones.
    """
    sign = np.sign(volume)
    around = inside @ sign
    return (around + sign > 0.0).astype(float) - (around > 0.0)


def united(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, volume: np.ndarray, depth: np.ndarray
) -> tuple[manifold3d.Manifold, np.ndarray]:
    """The union of closed components as manifold3d has it, and the point (3,) that is its origin, near their centre.

    component (t,) numbers them; volume (k,): signed; depth (k,): in how many others each lies. Outermost first, they
    are united where they are wound outward and cut out where inward. Raises MeshError without manifold3d, and for a
    component that it can't take.
    """
    if not can_unite():
        raise MeshError("mesh_repair", f"union: {is_missing('manifold3d', 'meshes')}")
    import manifold3d

    corners = vertices[triangles.ravel()]
    middle = 0.5 * corners.min(axis=0) + 0.5 * corners.max(axis=0)
    result = manifold3d.Manifold()
    for c in np.argsort(depth, kind="stable").tolist():
        part = triangles[component == c]
        if volume[c] < 0.0:
            part = part[:, [0, 2, 1]]
        used, local = np.unique(part, return_inverse=True)
        local = local.reshape(-1, 3).astype(np.uint64)
        solid = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices[used] - middle, tri_verts=local))
        if solid.status() != manifold3d.Error.NoError:
            raise MeshError("mesh_repair", f"component {c} can't be united: manifold3d says {solid.status().name}")
        result = result - solid if volume[c] < 0.0 else result + solid
    return result, middle


def united_surface(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, volume: np.ndarray, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the union, which takes what ``united`` does."""
    solid, middle = united(vertices, triangles, component, volume, depth)
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3] + middle, np.asarray(mesh.tri_verts).astype(np.int64)


def united_volume(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, volume: np.ndarray, depth: np.ndarray
) -> float | None:
    """The union's volume; None where it can't be had, or would take long."""
    if not can_unite() or len(triangles) > MAX_UNITED:
        return None
    try:
        return float(united(vertices, triangles, component, volume, depth)[0].volume())
    except MeshError:
        return None
