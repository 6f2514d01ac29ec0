# SPDX-License-Identifier: MIT
"""A tree of boxes over triangles, so that a query visits the few that may matter.

Triangles are sorted along a Morton curve through their centres (Morton, IBM 1966; Karras, High Performance Graphics
2012) and taken LEAF at a time; the boxes above them form a complete binary tree: node i has the children 2i + 1 and 2i
+ 2.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit

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
def curve_place(x: int, y: int, z: int) -> int:
    """The place along the curve of a cell, CELLS along each axis."""
    return _spread(x) | (_spread(y) << 1) | (_spread(z) << 2)


@njit(cache=True, nogil=True)
def _curve_places(vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Places along the curve (k,) of the centres of the triangles numbered ``chosen`` (k,)."""
    low, size = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(chosen)):
        for corner in range(3):
            for k in range(3):
                x = vertices[triangles[chosen[i], corner], k]
                low[k], size[k] = min(low[k], x), max(size[k], x)
    size -= low
    places = np.empty(len(chosen), np.int64)
    cells = np.empty(3, np.int64)
    for i in range(len(chosen)):
        for k in range(3):
            centre = 0.0
            for corner in range(3):
                centre += (vertices[triangles[chosen[i], corner], k] - low[k]) / 3.0
            cell = centre / size[k] * CELLS if size[k] > 0.0 else 0.0
            cells[k] = min(max(int(cell), 0), CELLS - 1)
        places[i] = curve_place(cells[0], cells[1], cells[2])
    return places


@njit(cache=True, nogil=True)
def along_curve(places: np.ndarray, chosen: np.ndarray) -> np.ndarray:
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


def triangle_tree(vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(order, boxes) of the triangles numbered ``chosen`` (k,): their order (k,) along the curve, leaf after leaf, and
    the nodes' boxes (2·leaves − 1, 6), lower and upper corner; leaf l is node leaves − 1 + l.
    """
    order = along_curve(_curve_places(vertices, triangles, chosen), chosen)
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    return order, _boxes(vertices, triangles, order, leaves)
