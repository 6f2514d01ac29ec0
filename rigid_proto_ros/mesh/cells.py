# SPDX-License-Identifier: MIT
"""Boxes whose corners are counted in cells, 2²⁰ along each axis, three counts to a 64-bit word with a spare bit above
each, so that three comparisons are one subtraction (Lamport, CACM 18, 1975).

Rounding to cells keeps the order of coordinates: boxes that meet still do, and some do by that alone.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit

BITS = 20
FIELD = BITS + 1
"""Bits from one count to the next."""
_LAST = (1 << BITS) - 1
_SPARE = (1 << BITS) | (1 << (BITS + FIELD)) | (1 << (BITS + 2 * FIELD))
"""The bit above each count."""
NO_BOX = (_LAST | (_LAST << FIELD) | (_LAST << (2 * FIELD)), 0)
"""Lower and upper corner of a box that meets none: no vertex is in the last cells."""


@njit(cache=True, nogil=True)
def extents(vertices: np.ndarray, corners: np.ndarray, patch: np.ndarray, count: int) -> np.ndarray:
    """Lower and upper corner (count, 6) of the triangles of each patch (m,), or of none where that is −1; those of the
    one at hand are kept out of memory.
    """
    boxes = np.empty((count, 6))
    boxes[:, :3], boxes[:, 3:] = math.inf, -math.inf
    t = 0
    while t < len(patch):
        p = patch[t]
        if p < 0:
            t += 1
            continue
        low_x, low_y, low_z = boxes[p, 0], boxes[p, 1], boxes[p, 2]
        high_x, high_y, high_z = boxes[p, 3], boxes[p, 4], boxes[p, 5]
        while t < len(patch) and patch[t] == p:
            for corner in range(3):
                vertex = corners[t, corner]
                x, y, z = vertices[vertex, 0], vertices[vertex, 1], vertices[vertex, 2]
                low_x, low_y, low_z = min(low_x, x), min(low_y, y), min(low_z, z)
                high_x, high_y, high_z = max(high_x, x), max(high_y, y), max(high_z, z)
            t += 1
        boxes[p, 0], boxes[p, 1], boxes[p, 2] = low_x, low_y, low_z
        boxes[p, 3], boxes[p, 4], boxes[p, 5] = high_x, high_y, high_z
    return boxes


@njit(cache=True, nogil=True)
def _vertex_cells(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of each vertex (n,) the cell that it lies in; any number for one that no triangle of ``corners`` (m, 3) has."""
    box = extents(vertices, corners, np.zeros(len(corners), np.int32), 1)[0]
    cells = np.zeros(len(vertices), np.int64)
    for k in range(3):
        low, high = box[k], box[3 + k]
        # All is in one cell where the quotient would overflow.
        scale = (_LAST - 1) / (high - low) if high - low > 1e-290 else 0.0
        for i in range(len(vertices)):
            cells[i] |= np.int64((min(max(vertices[i, k], low), high) - low) * scale) << (FIELD * k)
    return cells


@njit(cache=True, nogil=True)
def least(a: int, b: int) -> int:
    """The lesser of each of the three counts."""
    larger = ((a | _SPARE) - b) & _SPARE
    return a ^ ((a ^ b) & (larger - (larger >> BITS)))


@njit(cache=True, nogil=True)
def most(a: int, b: int) -> int:
    """The larger of each of the three counts."""
    larger = ((a | _SPARE) - b) & _SPARE
    return b ^ ((a ^ b) & (larger - (larger >> BITS)))


@njit(cache=True, nogil=True)
def meet(a_low: int, a_high: int, b_low: int, b_high: int) -> bool:
    """Whether two boxes have a cell in common."""
    return ((a_high | _SPARE) - b_low) & ((b_high | _SPARE) - a_low) & _SPARE == _SPARE


@njit(cache=True, nogil=True)
def triangle_boxes(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Lower and upper corner (m, 2), in cells, of each triangle of ``corners`` (m, 3) over vertices (n, 3)."""
    cells = _vertex_cells(vertices, corners)
    boxes = np.empty((len(corners), 2), np.int64)
    for t in range(len(corners)):
        a, b, c = cells[corners[t, 0]], cells[corners[t, 1]], cells[corners[t, 2]]
        boxes[t, 0], boxes[t, 1] = least(least(a, b), c), most(most(a, b), c)
    return boxes
