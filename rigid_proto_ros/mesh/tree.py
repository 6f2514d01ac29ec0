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


@njit(cache=True, nogil=True)
def _spread(value: np.uint64) -> np.uint64:
    """The 21 low bits of a number with two zeros between each."""
    x = (value | (value << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    x = (x | (x << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    x = (x | (x << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)


@njit(cache=True, nogil=True)
def _codes(
    vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray, low: np.ndarray, size: np.ndarray
) -> np.ndarray:
    codes = np.empty(len(chosen), np.uint64)
    for i in range(len(chosen)):
        code = np.uint64(0)
        for k in range(3):
            centre = 0.0
            for corner in range(3):
                centre += (vertices[triangles[chosen[i], corner], k] - low[k]) / 3.0
            cell = centre / size[k] * 2097151.0 if size[k] > 0.0 else 0.0
            code |= _spread(np.uint64(min(max(cell, 0.0), 2097151.0))) << np.uint64(k)
        codes[i] = code
    return codes


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
    points = vertices[triangles[chosen].ravel()]
    low = points.min(axis=0)
    codes = _codes(vertices, triangles, chosen, low, points.max(axis=0) - low)
    order = chosen[np.argsort(codes, kind="stable")]
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    return order, _boxes(vertices, triangles, order, leaves)
