# SPDX-License-Identifier: MIT
"""Whether a surface passes through itself: what it then encloses twice counts twice."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from .nesting import triangles_cross
from .tree import LEAF, triangle_tree

MAX_TRIANGLES = 20_000
"""Above this many triangles the surface isn't examined: a search takes some microseconds a triangle."""
WORK_LIMIT = 30_000_000
"""Boxes visited after which the search ends, some tenths of a second."""


@njit(cache=True, nogil=True)
def _touch(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two triangles (3,) share a corner."""
    for i in range(3):
        for j in range(3):
            if a[i] == b[j]:
                return True
    return False


@njit(cache=True, nogil=True)
def _crossings(
    vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, order: np.ndarray, boxes: np.ndarray, limit: int
) -> int:
    """Pairs of triangles of one component that cross without sharing a corner, as far as ``limit`` visits tell."""
    leaves = (len(boxes) + 1) // 2
    stack = np.empty(64, np.int64)
    lower, upper = np.empty(3), np.empty(3)
    visits = found = 0
    for i in range(len(order)):
        s = corners[order[i]]
        for k in range(3):
            x, y, z = vertices[s[0], k], vertices[s[1], k], vertices[s[2], k]
            lower[k], upper[k] = min(x, y, z), max(x, y, z)
        stack[0], top = 0, 1
        while top > 0 and visits < limit:
            top -= 1
            node = stack[top]
            visits += 1
            # Triangles before this one in the order have met it already.
            if _apart(boxes[node], lower, upper) or (node >= leaves - 1 and (node - leaves + 2) * LEAF <= i):
                continue
            if node < leaves - 1:
                stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
                continue
            first = (node - leaves + 1) * LEAF
            for j in range(max(first, i + 1), min(first + LEAF, len(order))):
                t = corners[order[j]]
                if component[order[i]] == component[order[j]] and not _touch(s, t) and _near(vertices, t, lower, upper):
                    found += triangles_cross(vertices, s, t)
    return found


@njit(cache=True, nogil=True)
def _near(vertices: np.ndarray, t: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Whether the box of triangle t (3,) meets the one from lower to upper (3,)."""
    near = True
    for k in range(3):
        x, y, z = vertices[t[0], k], vertices[t[1], k], vertices[t[2], k]
        near = near and min(x, y, z) <= upper[k] and max(x, y, z) >= lower[k]
    return near


@njit(cache=True, nogil=True)
def _apart(box: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    apart = False
    for k in range(3):
        apart = apart or box[k] > upper[k] or box[3 + k] < lower[k]
    return apart


def self_crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray) -> int:
    """Pairs of triangles of one component that cross; corners (m, 3) over welded vertices, component (m,).

    0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    order, boxes = triangle_tree(vertices, corners, np.arange(len(corners)))
    return int(_crossings(vertices, corners, component, order, boxes, WORK_LIMIT))
