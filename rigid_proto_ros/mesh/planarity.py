# SPDX-License-Identifier: MIT
"""How far polygons are from lying in a plane, and what that leaves open of the volume."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit


@njit(cache=True, nogil=True)
def _ring(vertices: np.ndarray, triangles: np.ndarray, first: int, last: int, reference: np.ndarray) -> np.ndarray:
    """Corners (n, 3), from ``reference``, of the polygon whose fan is triangles first to last."""
    p = np.empty((last - first + 2, 3))
    for k in range(len(p)):
        v = triangles[first, k] if k < 2 else triangles[first + k - 2, 2]
        for a in range(3):
            p[k, a] = vertices[v, a] - reference[a]
    return p


@njit(cache=True, nogil=True)
def _off_plane(p: np.ndarray) -> tuple[float, np.ndarray]:
    """Largest distance of a ring's corners p (n, 3) from its Newell plane, and their mean (3,)."""
    n = len(p)
    center = np.zeros(3)
    normal = np.zeros(3)
    for k in range(n):
        m = (k + 1) % n
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            center[a] += p[k, a] / n
            normal[a] += (p[k, b] - p[0, b]) * (p[m, c] - p[0, c]) - (p[k, c] - p[0, c]) * (p[m, b] - p[0, b])
    size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    deviation = 0.0
    if size > 0.0:
        for k in range(n):
            height = 0.0
            for a in range(3):
                height += (p[k, a] - center[a]) * normal[a] / size
            deviation = max(deviation, abs(height))
    return deviation, center


@njit(cache=True, nogil=True)
def _fan_volume(p: np.ndarray, base: int, center: np.ndarray) -> float:
    """Signed volume between ``center`` and the ring p (n, 3), fanned from its corner ``base``."""
    n = len(p)
    volume = 0.0
    for k in range(1, n - 1):
        i, j = (base + k) % n, (base + k + 1) % n
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            cross = (p[i, b] - p[base, b]) * (p[j, c] - p[base, c]) - (p[i, c] - p[base, c]) * (p[j, b] - p[base, b])
            volume += (p[base, a] - center[a]) * cross / 6.0
    return volume


@njit(cache=True, nogil=True)
def polygon_planarity(
    vertices: np.ndarray, triangles: np.ndarray, starts: np.ndarray, reference: np.ndarray
) -> tuple[float, float]:
    """(non-planar polygons' largest distance from the Newell plane, spread of the volume over their fans).

    The spread sums, over polygons of up to 64 corners, the range of the signed volume between the fans from each of
    its corners; larger polygons are compared from the first and the middle corner.
    """
    deviation = 0.0
    spread = 0.0
    for polygon in range(starts.shape[0] - 1):
        first, last = starts[polygon], starts[polygon + 1]
        n = last - first + 2
        if n < 4:
            continue
        p = _ring(vertices, triangles, first, last, reference)
        off, center = _off_plane(p)
        deviation = max(deviation, off)
        low, high = np.inf, -np.inf
        for base in range(0, n, 1 if n <= 64 else n // 2):
            volume = _fan_volume(p, base, center)
            low, high = min(low, volume), max(high, volume)
        spread += high - low
    return deviation, spread
