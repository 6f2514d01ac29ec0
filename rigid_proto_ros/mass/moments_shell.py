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
def _shell_sums(vertices, triangles, starts, reference, factor):
    total = np.zeros(10)
    low = np.zeros(10)
    term = np.empty(10)
    corner = np.empty((3, 3))
    s = np.empty(3)
    polygons = triangles.shape[0] if starts.shape[0] == 0 else starts.shape[0] - 1
    for polygon in range(polygons):
        first, last = polygon, polygon + 1
        if starts.shape[0]:
            first, last = starts[polygon], starts[polygon + 1]
        mx = my = mz = 0.0  # twice the Newell normal: the fan triangles' normals add up to it
        for again in range(2 if last > first + 1 else 1):
            for t in range(first, last):
                for i in range(3):
                    v = triangles[t, i]
                    for k in range(3):
                        corner[i, k] = (vertices[v, k] - reference[k]) * factor
                ux, uy, uz = corner[1, 0] - corner[0, 0], corner[1, 1] - corner[0, 1], corner[1, 2] - corner[0, 2]
                wx, wy, wz = corner[2, 0] - corner[0, 0], corner[2, 1] - corner[0, 1], corner[2, 2] - corner[0, 2]
                nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
                if last > first + 1 and again == 0:
                    mx += nx
                    my += ny
                    mz += nz
                    continue
                area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
                if mx * nx + my * ny + mz * nz < 0.0:
                    area = -area
                for k in range(3):
                    s[k] = corner[0, k] + corner[1, k] + corner[2, k]
                term[0] = area
                slot = 4
                for row in range(3):
                    term[1 + row] = area * s[row]
                    for column in range(row, 3):
                        term[slot] = area * (
                            s[row] * s[column]
                            + corner[0, row] * corner[0, column]
                            + corner[1, row] * corner[1, column]
                            + corner[2, row] * corner[2, column]
                        )
                        slot += 1
                for k in range(10):
                    total[k], low[k] = pair_add(total[k], low[k], term[k], 0.0)
    return total, low


def shell_moments(vertices, triangles, polygon_starts=None) -> Moments:
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
