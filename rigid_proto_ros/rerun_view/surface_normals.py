# SPDX-License-Identifier: MIT
"""Shading normals of a triangle mesh: smooth over curved parts, flat at sharp edges."""

from __future__ import annotations

import numpy as np

CREASE_ANGLE = np.deg2rad(35.0)
"""[rad] Faces that meet at more than this are drawn with an edge between them."""

CREASED_TRIANGLES_MAX = 200_000
"""Above this every vertex is shaded smoothly: the facets are finer than a picture shows, and the pairs too many."""


def shaded_surface(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (p, 3), triangles (m, 3) and unit normals (p, 3), all float32/uint32, of the surface to draw.

    vertices (n, 3), triangles (m, 3) as loaded. A vertex on a sharp edge is split into one per smooth side, so p ≥ the
    number of referenced vertices; the order of triangles is kept.
    """
    triangles = np.asarray(triangles, dtype=np.int64)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    corners = (vertices - centre)[triangles]
    face_area_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if len(triangles) > CREASED_TRIANGLES_MAX:
        normals = np.zeros((len(vertices), 3))
        for k in range(3):
            np.add.at(normals, triangles[:, k], face_area_normals)
        return vertices.astype(np.float32), triangles.astype(np.uint32), _unit(normals).astype(np.float32)

    corner_vertex = triangles.ravel()
    corner_face = np.repeat(np.arange(len(triangles)), 3)
    corner_normals = _corner_normals(corner_vertex, corner_face, face_area_normals)
    # Corners of one vertex whose normals agree to 1e-4 are one drawn vertex again.
    key = np.column_stack([corner_vertex, np.rint(corner_normals * 1e4).astype(np.int64)])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    drawn = vertices[corner_vertex[first]]
    return (
        drawn.astype(np.float32),
        inverse.reshape(-1, 3).astype(np.uint32),
        corner_normals[first].astype(np.float32),
    )


def _corner_normals(corner_vertex: np.ndarray, corner_face: np.ndarray, face_area_normals: np.ndarray) -> np.ndarray:
    """Per corner the area-weighted mean of the normals around its vertex that lie within the crease angle of it."""
    unit = _unit(face_area_normals)
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex)
    counts = counts[counts > 0]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # All ordered pairs of corners that share a vertex.
    valence = np.repeat(counts, counts)
    first = np.repeat(np.arange(len(order)), valence)
    offset = np.arange(len(first)) - np.repeat(np.cumsum(valence) - valence, valence)
    second = np.repeat(np.repeat(starts, counts), valence) + offset
    own, other = corner_face[order[first]], corner_face[order[second]]
    smooth = np.einsum("ij,ij->i", unit[own], unit[other]) >= np.cos(CREASE_ANGLE)
    normals = np.empty((len(order), 3))
    for axis in range(3):
        weights = np.where(smooth, face_area_normals[other, axis], 0.0)
        normals[order, axis] = np.bincount(first, weights=weights, minlength=len(order))
    lost = np.linalg.norm(normals, axis=1) == 0.0
    normals[lost] = unit[corner_face[lost]]
    return _unit(normals)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Rows (n, 3) at unit length; a zero row becomes +z, since a viewer can't shade with a zero normal."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), [0.0, 0.0, 1.0])
