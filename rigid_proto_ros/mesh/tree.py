# SPDX-License-Identifier: MIT
"""A tree of boxes over triangles, so that a query visits the few that may matter.

Triangles are sorted along a Morton curve through their centres (Morton, IBM 1966; Karras, High Performance Graphics
2012) and taken LEAF at a time; the boxes above them form a complete binary tree: node i has the children 2i + 1 and 2i
+ 2.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from .cells import FIELD

LEAF = 4
"""Triangles in a leaf: fewer cost more boxes, more cost tests in vain."""

CELLS_BITS = 11
"""Bits of a centre's place along each axis."""
CELLS = 1 << CELLS_BITS
FEW = 50_000
"""Triangles up to which a third of the places' bits isn't needed."""


@njit(cache=True, nogil=True)
def _spread(cell: int) -> int:
    """The 11 low bits of a number with two zeros between each."""
    x = (cell | (cell << 16)) & 0x70000FF
    x = (x | (x << 8)) & 0x700F00F
    x = (x | (x << 4)) & 0x430C30C3
    return (x | (x << 2)) & 0x49249249


@njit(cache=True, nogil=True)
def _along_curve(places: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The numbers ``chosen`` (k,) by their places (k,) along the curve, sorted digit by digit; uses up ``places``.

    Of few triangles the last digit is left out: they are further apart than it tells.
    """
    least = 1 if len(places) <= FEW else 0
    counts = np.zeros((3, CELLS), np.int32)
    for i in range(len(places)):
        for digit in range(least, 3):
            counts[digit, (places[i] >> (CELLS_BITS * digit)) & (CELLS - 1)] += 1
    order, sorted_places = chosen.astype(np.int64), np.empty_like(places)
    other = np.empty_like(order)
    for digit in range(least, 3):
        start = 0
        for cell in range(CELLS):
            start, counts[digit, cell] = start + counts[digit, cell], start
        for i in range(len(order)):
            place = (places[i] >> (CELLS_BITS * digit)) & (CELLS - 1)
            to = counts[digit, place]
            counts[digit, place] += 1
            other[to], sorted_places[to] = order[i], places[i]
        order, other = other, order
        places, sorted_places = sorted_places, places
    return order


@njit(cache=True, nogil=True)
def along_curve(boxes: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The triangles numbered ``chosen`` (k,) by the places along the curve of the centres of their ``boxes`` (m, 2), in
    cells."""
    places = np.empty(len(chosen), np.int64)
    shift = FIELD - CELLS_BITS
    for i in range(len(chosen)):
        # The sum of two counts has room for one bit more.
        middle = boxes[chosen[i], 0] + boxes[chosen[i], 1]
        x, y, z = middle >> shift, middle >> (FIELD + shift), middle >> (2 * FIELD + shift)
        places[i] = _spread(x & (CELLS - 1)) | (_spread(y & (CELLS - 1)) << 1) | (_spread(z & (CELLS - 1)) << 2)
    return _along_curve(places, chosen)


@njit(cache=True, nogil=True)
def _boxes(vertices: np.ndarray, triangles: np.ndarray, order: np.ndarray, leaves: int) -> np.ndarray:
    """Lower and upper corners of all nodes (2·leaves − 1, 6); an empty node's lower corner lies above its upper one."""
    boxes = np.empty((2 * leaves - 1, 6))
    boxes[:, :3] = np.inf
    boxes[:, 3:] = -np.inf
    for i in range(len(order)):
        node = leaves - 1 + i // LEAF
        for corner in range(3):
            for k in range(3):
                x = vertices[triangles[order[i], corner], k]
                boxes[node, k] = min(boxes[node, k], x)
                boxes[node, 3 + k] = max(boxes[node, 3 + k], x)
    for node in range(leaves - 2, -1, -1):
        for k in range(3):
            boxes[node, k] = min(boxes[2 * node + 1, k], boxes[2 * node + 2, k])
            boxes[node, 3 + k] = max(boxes[2 * node + 1, 3 + k], boxes[2 * node + 2, 3 + k])
    return boxes


@njit(cache=True, nogil=True)
def triangle_tree(
    vertices: np.ndarray, triangles: np.ndarray, cell_boxes: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(order, boxes) of the triangles numbered ``chosen`` (k,), whose boxes in cells are ``cell_boxes`` (m, 2): their
    order (k,) along the curve, leaf after leaf, and the nodes' boxes (2·leaves − 1, 6), lower and upper corner; leaf l
    is node leaves − 1 + l.
    """
    order = along_curve(cell_boxes, chosen)
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    return order, _boxes(vertices, triangles, order, leaves)
