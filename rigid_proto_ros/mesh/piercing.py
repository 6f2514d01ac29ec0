# SPDX-License-Identifier: MIT
"""Whether two triangles pass properly through each other (Möller, Journal of Graphics Tools 2, 1997). Touching and
coplanar triangles don't.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit


@njit(cache=True, nogil=True)
def _sides(
    vertices: np.ndarray, numbers: np.ndarray, i: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """First corner of triangle i, and the two sides that leave it."""
    a, b, c = numbers[i, 0], numbers[i, 1], numbers[i, 2]
    x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    ux, uy, uz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
    return x, y, z, ux, uy, uz, vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z


@njit(cache=True, nogil=True)
def _heights(vertices: np.ndarray, numbers: np.ndarray, i: int, j: int) -> tuple[float, float, float]:
    """Products of the normal of triangle i, as long as twice its area, with the corners of triangle j, from i's first
    corner."""
    ax, ay, az, ux, uy, uz, wx, wy, wz = _sides(vertices, numbers, i)
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    a, b, c = numbers[j, 0], numbers[j, 1], numbers[j, 2]
    d0 = (vertices[a, 0] - ax) * nx + (vertices[a, 1] - ay) * ny + (vertices[a, 2] - az) * nz
    d1 = (vertices[b, 0] - ax) * nx + (vertices[b, 1] - ay) * ny + (vertices[b, 2] - az) * nz
    d2 = (vertices[c, 0] - ax) * nx + (vertices[c, 1] - ay) * ny + (vertices[c, 2] - az) * nz
    return d0, d1, d2


@njit(cache=True, nogil=True)
def _pierces(vertices: np.ndarray, numbers: np.ndarray, i: int, j: int) -> bool:
    """Whether one of the sides of triangle j passes properly through triangle i."""
    d0, d1, d2 = _heights(vertices, numbers, i, j)
    ax, ay, az, ux, uy, uz, wx, wy, wz = _sides(vertices, numbers, i)
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    margin = 1e-9 * size * (abs(ux) + abs(uy) + abs(uz) + abs(wx) + abs(wy) + abs(wz))
    if not (max(d0, d1, d2) > margin and min(d0, d1, d2) < -margin):
        return False
    n2 = size * size
    for side in range(3):
        end = (side + 1) % 3
        ds = d0 if side == 0 else d1 if side == 1 else d2
        dt = d1 if side == 0 else d2 if side == 1 else d0
        if (ds > margin and dt < -margin) or (ds < -margin and dt > margin):
            share = ds / (ds - dt)
            s, t = numbers[j, side], numbers[j, end]
            x = vertices[s, 0] + share * (vertices[t, 0] - vertices[s, 0]) - ax
            y = vertices[s, 1] + share * (vertices[t, 1] - vertices[s, 1]) - ay
            z = vertices[s, 2] + share * (vertices[t, 2] - vertices[s, 2]) - az
            # Barycentric coordinates from the areas against the normal.
            beta = ((y * wz - z * wy) * nx + (z * wx - x * wz) * ny + (x * wy - y * wx) * nz) / n2
            gamma = ((uy * z - uz * y) * nx + (uz * x - ux * z) * ny + (ux * y - uy * x) * nz) / n2
            if beta > 1e-9 and gamma > 1e-9 and beta + gamma < 1.0 - 1e-9:
                return True
    return False


@njit(cache=True, nogil=True)
def cross(vertices: np.ndarray, numbers: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j of ``numbers`` (m, 3), of which neither lies on one side of the other's plane, pass
    properly through each other."""
    return _pierces(vertices, numbers, i, j) or _pierces(vertices, numbers, j, i)


@njit(cache=True, nogil=True)
def on_both_sides(vertices: np.ndarray, numbers: np.ndarray, pairs: np.ndarray, count: int) -> int:
    """Keep those of the first ``count`` pairs, i·2³² + j, of triangles of ``numbers`` (m, 3) of which neither lies
    wholly on one side of the other's plane, or in it; returns how many.

    Without a branch that depends on the mesh: the processor needn't wait for one pair to begin the next.
    """
    for turn in range(2):
        left = 0
        for pair in range(count):
            key = pairs[pair]
            i, j = key >> 32, key & 0xFFFFFFFF
            if turn == 1:
                i, j = j, i
            d0, d1, d2 = _heights(vertices, numbers, i, j)
            pairs[left] = key
            left += (min(d0, d1, d2) < 0.0) & (max(d0, d1, d2) > 0.0)
        count = left
    return count
