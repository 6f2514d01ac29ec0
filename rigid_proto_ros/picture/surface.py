# SPDX-License-Identifier: MIT
"""Surfaces with normals for shading, smooth except at sharp edges; box and ball."""

from __future__ import annotations

import functools

import numpy as np

from ..base.vectors import IntArray, Points, Triangles, Vector3
from .backend import DrawnMesh

CREASE_ANGLE = np.deg2rad(35.0)
"""Angle between adjacent faces [rad] above which their edge is sharp."""

CREASED_TRIANGLES_MAX = 200_000
"""Largest number of triangles with sharp edges; larger meshes are shaded smoothly, because their facets are finer than
a picture shows, and the pairs of corners too many.
"""


def shaded_surface(vertices: Points, triangles: Triangles) -> DrawnMesh:
    """The surface to draw, in float32 and uint32, from vertices (n, 3) and triangles (m, 3).

    A vertex on a sharp edge is split into one per smooth side, so there are at least as many vertices as referenced
    ones; the order of triangles is kept.
    """
    triangles = np.asarray(triangles, dtype=np.int64)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    corners = (vertices - centre)[triangles]
    face_area_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if len(triangles) > CREASED_TRIANGLES_MAX:
        normals = np.zeros((len(vertices), 3))
        for k in range(3):
            np.add.at(normals, triangles[:, k], face_area_normals)
        return DrawnMesh(vertices.astype(np.float32), triangles.astype(np.uint32), _unit(normals).astype(np.float32))

    corner_vertex = triangles.ravel()
    corner_face = np.repeat(np.arange(len(triangles)), 3)
    corner_normals = _corner_normals(corner_vertex, corner_face, face_area_normals)
    # Corners of one vertex whose normals agree to 1e-4 are merged into one drawn vertex.
    key = np.column_stack([corner_vertex, np.rint(corner_normals * 1e4).astype(np.int64)])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    drawn = vertices[corner_vertex[first]]
    return DrawnMesh(
        drawn.astype(np.float32),
        inverse.reshape(-1, 3).astype(np.uint32),
        corner_normals[first].astype(np.float32),
    )


def _corner_normals(corner_vertex: IntArray, corner_face: IntArray, face_area_normals: Points) -> Points:
    """Normal of each corner: the area-weighted mean of the normals of faces around its vertex that are within
    CREASE_ANGLE of the corner's face.
    """
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


def _unit(vectors: Points) -> Points:
    """Rows (n, 3) normalized; a zero row becomes +z, since a viewer can't shade with a zero normal."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), [0.0, 0.0, 1.0])


BOX_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
BOX_TRIANGLES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)
BOX_EDGES = np.array([(k, k | 1 << axis) for axis in range(3) for k in range(8) if not k >> axis & 1])
"""Pairs (12, 2) of corners."""


@functools.cache
def box_mesh() -> DrawnMesh:
    """The box from -1 to 1 along each axis."""
    return shaded_surface(BOX_CORNERS, BOX_TRIANGLES)


def box_edges(centre: Vector3, half_sizes: Vector3) -> list[Points]:
    """The twelve edges (2, 3) of an axis-aligned box."""
    return list((centre + half_sizes * BOX_CORNERS)[BOX_EDGES])


@functools.cache
def ball_mesh() -> DrawnMesh:
    """The ball of radius 1 about the origin."""
    rings, sides = 24, 48
    polar, around = np.meshgrid(
        np.linspace(0.0, np.pi, rings + 1), np.linspace(0.0, 2.0 * np.pi, sides + 1), indexing="ij"
    )
    points = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    index = np.arange((rings + 1) * (sides + 1)).reshape(rings + 1, sides + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    points = points.reshape(-1, 3).astype(np.float32)
    return DrawnMesh(points, triangles.astype(np.uint32), points)
