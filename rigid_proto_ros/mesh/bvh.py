# SPDX-License-Identifier: MIT
"""A bounding volume hierarchy over triangles, so that a query visits the few that may matter.

Triangles are sorted along a Morton curve through their boxes' centres (Morton, IBM 1966; Karras, High Performance
Graphics 2012) and taken LEAF at a time; the boxes above them form a complete binary tree: node i has the children
2i + 1 and 2i + 2, and leaf l is node leaves − 1 + l.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit

LEAF = 8
"""Triangles in a leaf: fewer cost more boxes, more cost tests in vain."""
_CELLS = 1 << 20
"""Places along each axis that the curve tells apart."""


@njit(cache=True, nogil=True)
def _spread(cell: int | np.int64) -> int | np.int64:
    """The 20 low bits of a number with two zeros between each."""
    x = cell & 0xFFFFF
    x = (x | (x << 32)) & 0x1F00000000FFFF
    x = (x | (x << 16)) & 0x1F0000FF0000FF
    x = (x | (x << 8)) & 0x100F00F00F00F00F
    x = (x | (x << 4)) & 0x10C30C30C30C30C3
    return (x | (x << 2)) & 0x1249249249249249


@njit(cache=True, nogil=True)
def _triangle_boxes(vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Lower and upper corner (k, 6) of the triangles numbered ``chosen`` (k,)."""
    boxes = np.empty((len(chosen), 6))
    for i in range(len(chosen)):
        a, b, c = triangles[chosen[i], 0], triangles[chosen[i], 1], triangles[chosen[i], 2]
        for k in range(3):
            boxes[i, k] = min(vertices[a, k], vertices[b, k], vertices[c, k])
            boxes[i, 3 + k] = max(vertices[a, k], vertices[b, k], vertices[c, k])
    return boxes


@njit(cache=True, nogil=True)
def _along_curve(boxes: np.ndarray) -> np.ndarray:
    """The order (k,) of the centres of ``boxes`` (k, 6) along the curve."""
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(boxes)):
        for k in range(3):
            lower[k], upper[k] = min(lower[k], boxes[i, k]), max(upper[k], boxes[i, 3 + k])
    places = np.zeros(len(boxes), np.int64)
    for k in range(3):
        side = upper[k] - lower[k]
        # All is in one cell where the quotient would overflow.
        scale = (_CELLS - 1) / side if side > 1e-290 else 0.0
        for i in range(len(boxes)):
            middle = 0.5 * boxes[i, k] + 0.5 * boxes[i, 3 + k]
            places[i] |= _spread(np.int64((middle - lower[k]) * scale)) << k
    return np.argsort(places, kind="mergesort")


@njit(cache=True, nogil=True)
def hierarchy(
    vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The hierarchy of the triangles numbered ``chosen`` (k,).

    Returns their order (k,), leaf after leaf; their boxes (k, 6), lower and upper corner, in that order; and the nodes'
    boxes (2·leaves − 1, 6). An empty node's lower corner lies above its upper one.
    """
    own = _triangle_boxes(vertices, triangles, chosen)
    along = _along_curve(own)
    own, order = own[along], chosen[along]
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    boxes = np.empty((2 * leaves - 1, 6))
    boxes[:, :3] = np.inf
    boxes[:, 3:] = -np.inf
    for i in range(len(order)):
        _extend(boxes, leaves - 1 + i // LEAF, own, i)
    for node in range(2 * leaves - 2, 0, -1):
        _extend(boxes, (node - 1) // 2, boxes, node)
    return order, own, boxes


@njit(cache=True, nogil=True)
def _extend(boxes: np.ndarray, i: int, others: np.ndarray, j: int) -> None:
    """Make box i contain box j of ``others``."""
    for k in range(3):
        boxes[i, k], boxes[i, 3 + k] = min(boxes[i, k], others[j, k]), max(boxes[i, 3 + k], others[j, 3 + k])


@njit(cache=True, nogil=True)
def boxes_meet(boxes: np.ndarray, i: int, j: int) -> bool:
    """Whether boxes i and j have a point in common."""
    x = (boxes[i, 0] <= boxes[j, 3]) & (boxes[j, 0] <= boxes[i, 3])
    y = (boxes[i, 1] <= boxes[j, 4]) & (boxes[j, 1] <= boxes[i, 4])
    return bool(x & y & (boxes[i, 2] <= boxes[j, 5]) & (boxes[j, 2] <= boxes[i, 5]))
