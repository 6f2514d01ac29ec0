# SPDX-License-Identifier: MIT
"""The surface as a thin shell of uniform thickness: integrals of 1, x and x xᵀ over its triangles.

For a triangle (a, b, c) of area A: ∫ 1 = A, ∫ x = A/3 s, ∫ x xᵀ = A/12 (s sᵀ + a aᵀ + b bᵀ + c cᵀ), s = a + b + c
(Eberly, "Polyhedral mass properties", 2002, the surface case). A fan triangle of a concave polygon that lies outside
it counts negative: its sign is that of its normal against the polygon's Newell normal.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.exact_arithmetic import pair_add
from .moments import Moments, as_arrays, central_moments, exact_reference


@njit(cache=True, nogil=True)
def _triangle(
    vertices: np.ndarray, corners: np.ndarray, reference: np.ndarray, factor: float, out: np.ndarray
) -> tuple[float, float, float]:
    """The triangle's corners as out (3, 3), from the reference times factor, and its normal of twice its area."""
    for i in range(3):
        for k in range(3):
            out[i, k] = (vertices[corners[i], k] - reference[k]) * factor
    ux, uy, uz = out[1, 0] - out[0, 0], out[1, 1] - out[0, 1], out[1, 2] - out[0, 2]
    wx, wy, wz = out[2, 0] - out[0, 0], out[2, 1] - out[0, 1], out[2, 2] - out[0, 2]
    return uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx


@njit(cache=True, nogil=True)
def _add_triangle(corner: np.ndarray, area: float, total: np.ndarray, low: np.ndarray) -> None:
    """Add the integrals of 1, x and x xᵀ over the triangle ``corner`` (3, 3) of signed ``area`` to pairs (10,)."""
    s = (
        corner[0, 0] + corner[1, 0] + corner[2, 0],
        corner[0, 1] + corner[1, 1] + corner[2, 1],
        corner[0, 2] + corner[1, 2] + corner[2, 2],
    )
    total[0], low[0] = pair_add(total[0], low[0], area, 0.0)
    slot = 4
    for row in range(3):
        total[1 + row], low[1 + row] = pair_add(total[1 + row], low[1 + row], area * s[row], 0.0)
        for column in range(row, 3):
            term = area * (
                s[row] * s[column]
                + corner[0, row] * corner[0, column]
                + corner[1, row] * corner[1, column]
                + corner[2, row] * corner[2, column]
            )
            total[slot], low[slot] = pair_add(total[slot], low[slot], term, 0.0)
            slot += 1


@njit(cache=True, nogil=True)
def _shell_sums(
    vertices: np.ndarray, triangles: np.ndarray, starts: np.ndarray, reference: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray]:
    total = np.zeros(10)
    low = np.zeros(10)
    corner = np.empty((3, 3))
    polygons = triangles.shape[0] if starts.shape[0] == 0 else starts.shape[0] - 1
    for polygon in range(polygons):
        first, last = polygon, polygon + 1
        if starts.shape[0]:
            first, last = starts[polygon], starts[polygon + 1]
        mx = my = mz = 0.0  # twice the Newell normal: the fan triangles' normals add up to it
        if last > first + 1:
            for t in range(first, last):
                nx, ny, nz = _triangle(vertices, triangles[t], reference, factor, corner)
                mx += nx
                my += ny
                mz += nz
        for t in range(first, last):
            nx, ny, nz = _triangle(vertices, triangles[t], reference, factor, corner)
            area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            _add_triangle(corner, -area if mx * nx + my * ny + mz * nz < 0.0 else area, total, low)
    return total, low


def shell_moments(vertices: np.ndarray, triangles: np.ndarray, polygon_starts: np.ndarray | None = None) -> Moments:
    """Moments of the uniform surface; the measure is its area.

    vertices (n, 3), triangles (m, 3); polygon_starts (p + 1,) says which fan triangles make up a polygon, None that
    each triangle is one. Raises MeshError for an empty mesh, non-finite vertices, or zero area.
    """
    vertices, triangles = as_arrays(vertices, triangles)
    reference, factor, _ = exact_reference(vertices)
    starts = np.empty(0, np.int64) if polygon_starts is None else np.ascontiguousarray(polygon_starts, np.int64)
    sums, low = _shell_sums(vertices, triangles, starts, reference, factor)
    moments = central_moments(sums, low, reference, factor, (1.0, 3.0, 12.0), "closed form")
    return Moments(
        moments.measure * factor,
        reference,
        moments.center,
        moments.center_low,
        moments.second * factor,
        "closed form",
    )
