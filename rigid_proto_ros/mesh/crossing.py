# SPDX-License-Identifier: MIT
"""Triangles that pass through each other: of one surface, which then counts twice what it encloses twice, or of two.

Both ends of a pair of nodes descend a tree of boxes together (Gottschalk, Lin, Manocha, SIGGRAPH 1996), and of two
triangles near each other those that lie wholly on one side of the other's plane are passed over (Möller, Journal of
Graphics Tools 2, 1997).
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from .tree import LEAF, triangle_tree

MAX_TRIANGLES = 20_000
"""Above this many triangles a surface isn't examined for crossing itself: a search takes half a microsecond each."""
SELF_LIMIT = 30_000_000
"""Pairs of boxes compared after which the search within surfaces ends, some tenths of a second."""
WORK_LIMIT = 100_000_000
"""Pairs of boxes after which the search between surfaces ends undecided: about a second."""


@njit(cache=True, nogil=True)
def _gathered(
    vertices: np.ndarray, corners: np.ndarray, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the triangles in ``order``: corner coordinates (n, 3, 3), corner numbers (n, 3), boxes (n, 6)."""
    points = np.empty((len(order), 3, 3))
    numbers = np.empty((len(order), 3), np.int64)
    boxes = np.empty((len(order), 6))
    for i in range(len(order)):
        for corner in range(3):
            numbers[i, corner] = corners[order[i], corner]
        for k in range(3):
            for corner in range(3):
                points[i, corner, k] = vertices[numbers[i, corner], k]
            x, y, z = points[i, 0, k], points[i, 1, k], points[i, 2, k]
            boxes[i, k], boxes[i, 3 + k] = min(x, y, z), max(x, y, z)
    return points, numbers, boxes


@njit(cache=True, nogil=True)
def _apart(a: np.ndarray, i: int, b: np.ndarray, j: int) -> bool:
    """Whether box i of ``a`` and box j of ``b`` have no point in common; without branches, hard to predict here."""
    return bool(
        (a[i, 0] > b[j, 3])
        | (a[i, 3] < b[j, 0])
        | (a[i, 1] > b[j, 4])
        | (a[i, 4] < b[j, 1])
        | (a[i, 2] > b[j, 5])
        | (a[i, 5] < b[j, 2])
    )


@njit(cache=True, nogil=True)
def _on_one_side(p: np.ndarray, i: int, j: int) -> bool:
    """Whether all corners of triangle j lie strictly on one side of the plane of triangle i."""
    ux, uy, uz = p[i, 1, 0] - p[i, 0, 0], p[i, 1, 1] - p[i, 0, 1], p[i, 1, 2] - p[i, 0, 2]
    wx, wy, wz = p[i, 2, 0] - p[i, 0, 0], p[i, 2, 1] - p[i, 0, 1], p[i, 2, 2] - p[i, 0, 2]
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    above = below = 0
    for c in range(3):
        distance = (p[j, c, 0] - p[i, 0, 0]) * nx + (p[j, c, 1] - p[i, 0, 1]) * ny + (p[j, c, 2] - p[i, 0, 2]) * nz
        above += distance > 0.0
        below += distance < 0.0
    return above == 3 or below == 3


@njit(cache=True, nogil=True)
def _side_crosses(p: np.ndarray, i: int, side: int, j: int) -> bool:
    """Whether one side of triangle i passes properly through triangle j; touching and coplanar cases don't count."""
    ax, ay, az = p[j, 0, 0], p[j, 0, 1], p[j, 0, 2]
    ux, uy, uz = p[j, 1, 0] - ax, p[j, 1, 1] - ay, p[j, 1, 2] - az
    wx, wy, wz = p[j, 2, 0] - ax, p[j, 2, 1] - ay, p[j, 2, 2] - az
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    span = abs(ux) + abs(uy) + abs(uz) + abs(wx) + abs(wy) + abs(wz)
    margin = 1e-9 * size * span
    end = (side + 1) % 3
    px, py, pz = p[i, side, 0], p[i, side, 1], p[i, side, 2]
    qx, qy, qz = p[i, end, 0], p[i, end, 1], p[i, end, 2]
    dp = (px - ax) * nx + (py - ay) * ny + (pz - az) * nz
    dq = (qx - ax) * nx + (qy - ay) * ny + (qz - az) * nz
    if not ((dp > margin and dq < -margin) or (dp < -margin and dq > margin)):
        return False
    s = dp / (dp - dq)
    x, y, z = px + s * (qx - px) - ax, py + s * (qy - py) - ay, pz + s * (qz - pz) - az
    # Barycentric coordinates from the areas against the normal.
    n2 = size * size
    beta = ((y * wz - z * wy) * nx + (z * wx - x * wz) * ny + (x * wy - y * wx) * nz) / n2
    gamma = ((uy * z - uz * y) * nx + (uz * x - ux * z) * ny + (ux * y - uy * x) * nz) / n2
    return beta > 1e-9 and gamma > 1e-9 and beta + gamma < 1.0 - 1e-9


@njit(cache=True, nogil=True)
def _cross(p: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j pass properly through each other."""
    if _on_one_side(p, i, j) or _on_one_side(p, j, i):
        return False
    crosses = False
    for side in range(3):
        crosses = crosses or _side_crosses(p, i, side, j) or _side_crosses(p, j, side, i)
    return crosses


@njit(cache=True, nogil=True)
def _touch(numbers: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j share a corner."""
    a, b, c = numbers[i, 0], numbers[i, 1], numbers[i, 2]
    x, y, z = numbers[j, 0], numbers[j, 1], numbers[j, 2]
    first = (a == x) | (a == y) | (a == z)
    return bool(first | (b == x) | (b == y) | (b == z) | (c == x) | (c == y) | (c == z))


@njit(cache=True, nogil=True)
def _push_children(boxes: np.ndarray, a: int, b: int, stack: np.ndarray, top: int) -> int:
    """Put those pairs of children of nodes a and b on the stack whose boxes meet; returns its new height."""
    for left in range(2 * a + 1, 2 * a + 3):
        for right in range(left if a == b else 2 * b + 1, 2 * b + 3):
            stack[top, 0], stack[top, 1] = left, right
            top += not _apart(boxes, left, boxes, right)
    return top


@njit(cache=True, nogil=True)
def _near_in_leaves(boxes: np.ndarray, first: int, second: int, near: np.ndarray) -> int:
    """Put the pairs of triangles, one from the leaf that begins at each number, whose boxes meet into ``near``
    (LEAF², 2); returns how many.
    """
    count = 0
    for i in range(first, min(first + LEAF, len(boxes))):
        for j in range(max(i + 1, second), min(second + LEAF, len(boxes))):
            near[count, 0], near[count, 1] = i, j
            count += not _apart(boxes, i, boxes, j)
    return count


@njit(cache=True, nogil=True)
def _crossings(
    vertices: np.ndarray,
    corners: np.ndarray,
    component: np.ndarray,
    order: np.ndarray,
    boxes: np.ndarray,
    between: np.ndarray,
    limit: int,
) -> tuple[int, bool]:
    """Pairs of triangles that cross, and whether ``limit`` comparisons of boxes sufficed.

    between (k, k) bool: pairs of components to look at; the first crossing of two clears their mark. Of shape (0, 0) it
    stands for triangles of one component, of which those that share a corner don't count.
    """
    points, numbers, own_boxes = _gathered(vertices, corners, order)
    within = len(between) == 0
    leaves = (len(boxes) + 1) // 2
    stack, near = np.zeros((256, 2), np.int64), np.empty((LEAF * LEAF + 1, 2), np.int64)
    top, visits, found = 1, 0, 0
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if a < leaves - 1:
            visits += 4
            top = _push_children(boxes, a, b, stack, top)
            continue
        visits += LEAF * LEAF
        if visits > limit:
            return found, False
        for pair in range(_near_in_leaves(own_boxes, (a - leaves + 1) * LEAF, (b - leaves + 1) * LEAF, near)):
            i, j = near[pair, 0], near[pair, 1]
            one, other = component[order[i]], component[order[j]]
            asked = (one == other and not _touch(numbers, i, j)) if within else between[one, other]
            if asked and _cross(points, i, j):
                found += 1
                if not within:
                    between[one, other] = between[other, one] = False
    return found, True


def self_crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray) -> int:
    """Pairs of triangles of one component that cross without sharing a corner, as far as SELF_LIMIT comparisons tell;
    corners (m, 3) over welded vertices, component (m,).

    0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    order, boxes = triangle_tree(vertices, corners, np.arange(len(corners)))
    within = np.zeros((0, 0), dtype=bool)
    return int(_crossings(vertices, corners, component, order, boxes, within, SELF_LIMIT)[0])


def crossing_components(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    order: np.ndarray,
    boxes: np.ndarray,
    asked: np.ndarray,
) -> tuple[np.ndarray, bool]:
    """Which of the pairs of components marked in ``asked`` (k, k) have triangles that cross, (k, k), and whether
    WORK_LIMIT comparisons sufficed; order and boxes are the triangles' tree.
    """
    left = asked.copy()
    _, complete = _crossings(vertices, triangles, component, order, boxes, left, WORK_LIMIT)
    return asked & ~left, complete
