# SPDX-License-Identifier: MIT
"""Triangles that pass through each other: of one surface, which then counts twice what it encloses twice, or of two.

Both ends of a pair of nodes descend a tree of boxes together (Gottschalk, Lin, Manocha, SIGGRAPH 1996), and of two
triangles near each other those that lie wholly on one side of the other's plane are passed over (Möller, Journal of
Graphics Tools 2, 1997).

Places of boxes are counted in cells, 2²⁰ along each axis, three counts to a 64-bit word with a spare bit above each, so
that three comparisons are one subtraction (Lamport, CACM 18, 1975). Rounding to cells keeps the order of coordinates:
boxes that meet still do, and what meets by that alone is told apart by the triangles themselves.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from .tree import CELLS, CELLS_BITS, along_curve, curve_place

LEAF = 4
"""Triangles in a leaf."""
MAX_TRIANGLES = 20_000
"""Above this many triangles a surface isn't examined for crossing itself."""
SELF_LIMIT = 30_000_000
"""Pairs of boxes compared after which the search within surfaces ends, some tenths of a second."""
WORK_LIMIT = 100_000_000
"""Pairs of boxes after which the search between surfaces ends undecided: about a second."""

_BITS = 20
_FIELD = _BITS + 1
_LAST = (1 << _BITS) - 1
_SPARE = (1 << _BITS) | (1 << (_BITS + _FIELD)) | (1 << (_BITS + 2 * _FIELD))
"""The bit above each count."""
_NO_BOX = (_LAST | (_LAST << _FIELD) | (_LAST << (2 * _FIELD)), 0)
"""Lower and upper corner of a box that meets none: no vertex is in the last cells."""
_PORTION = 1024
"""Pairs of leaves looked at together: loops without a branch that depends on the mesh are several times faster."""


@njit(cache=True, nogil=True)
def _packed(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of each vertex (n,) the cell that it lies in; any number for one that no triangle has."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(corners)):
        for corner in range(3):
            for k in range(3):
                x = vertices[corners[i, corner], k]
                low[k], high[k] = min(low[k], x), max(high[k], x)
    cells = np.zeros(len(vertices), np.int64)
    scale = np.zeros(3)
    for k in range(3):
        # All is in one cell where the quotient would overflow.
        if high[k] - low[k] > 1e-290:
            scale[k] = (_LAST - 1) / (high[k] - low[k])
    for i in range(len(vertices)):
        for k in range(3):
            x = (min(max(vertices[i, k], low[k]), high[k]) - low[k]) * scale[k]
            cells[i] |= np.int64(x) << (_FIELD * k)
    return cells


@njit(cache=True, nogil=True)
def _least(a: int, b: int) -> int:
    """The lesser of each of the three counts."""
    larger = ((a | _SPARE) - b) & _SPARE
    return a ^ ((a ^ b) & (larger - (larger >> _BITS)))


@njit(cache=True, nogil=True)
def _most(a: int, b: int) -> int:
    """The larger of each of the three counts."""
    larger = ((a | _SPARE) - b) & _SPARE
    return b ^ ((a ^ b) & (larger - (larger >> _BITS)))


@njit(cache=True, nogil=True)
def _meet(a_low: int, a_high: int, b_low: int, b_high: int) -> bool:
    """Whether two boxes have a cell in common."""
    return ((a_high | _SPARE) - b_low) & ((b_high | _SPARE) - a_low) & _SPARE == _SPARE


@njit(cache=True, nogil=True)
def _order(cells: np.ndarray, corners: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The triangles numbered ``chosen`` (k,) by the places of their boxes' centres along the curve."""
    places = np.empty(len(chosen), np.int64)
    shift = _FIELD - CELLS_BITS
    for i in range(len(chosen)):
        t = chosen[i]
        a, b, c = cells[corners[t, 0]], cells[corners[t, 1]], cells[corners[t, 2]]
        # The sum of two counts has room for one bit more.
        middle = _least(_least(a, b), c) + _most(_most(a, b), c)
        places[i] = curve_place(
            (middle >> shift) & (CELLS - 1),
            (middle >> (_FIELD + shift)) & (CELLS - 1),
            (middle >> (2 * _FIELD + shift)) & (CELLS - 1),
        )
    return along_curve(places, chosen)


@njit(cache=True, nogil=True)
def _tree(
    cells: np.ndarray, corners: np.ndarray, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of the triangles in ``order``: corner numbers (n, 3), boxes (leaves·LEAF, 2), the boxes (2·leaves − 1, 2) of the
    nodes above them, of which i has the children 2i + 1 and 2i + 2, and the corner that all triangles of a node
    have, or −1.
    """
    count = len(order)
    leaves = 1
    while leaves * LEAF < count:
        leaves *= 2
    numbers, own = np.empty((count, 3), np.int32), np.empty((leaves * LEAF, 2), np.int64)
    own[count:, 0], own[count:, 1] = _NO_BOX
    boxes, common = np.empty((2 * leaves - 1, 2), np.int64), np.full(2 * leaves - 1, -1)
    for leaf in range(leaves):
        node, first = leaves - 1 + leaf, leaf * LEAF
        boxes[node, 0], boxes[node, 1] = _NO_BOX
        for i in range(first, min(first + LEAF, count)):
            for corner in range(3):
                numbers[i, corner] = corners[order[i], corner]
            a, b, c = cells[numbers[i, 0]], cells[numbers[i, 1]], cells[numbers[i, 2]]
            own[i, 0], own[i, 1] = _least(_least(a, b), c), _most(_most(a, b), c)
            boxes[node, 0], boxes[node, 1] = _least(boxes[node, 0], own[i, 0]), _most(boxes[node, 1], own[i, 1])
        for corner in range(3):
            if first < count:
                shared = numbers[first, corner]
                all_have = True
                for i in range(first + 1, min(first + LEAF, count)):
                    all_have &= (numbers[i, 0] == shared) | (numbers[i, 1] == shared) | (numbers[i, 2] == shared)
                if all_have:
                    common[node] = shared
    for node in range(leaves - 2, -1, -1):
        one, other = 2 * node + 1, 2 * node + 2
        boxes[node, 0], boxes[node, 1] = _least(boxes[one, 0], boxes[other, 0]), _most(boxes[one, 1], boxes[other, 1])
        if common[one] == common[other]:
            common[node] = common[one]
    return numbers, own, boxes, common


@njit(cache=True, nogil=True)
def _points(vertices: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The corners (n, 3, 3) of triangles (n, 3)."""
    points = np.empty((len(numbers), 3, 3))
    for i in range(len(numbers)):
        for corner in range(3):
            for k in range(3):
                points[i, corner, k] = vertices[numbers[i, corner], k]
    return points


@njit(cache=True, nogil=True)
def _pierces(points: np.ndarray, i: int, j: int) -> tuple[bool, bool]:
    """(apart, pierced): whether the corners of triangle j all lie on one side of the plane of triangle i, or in it;
    whether one of its sides passes properly through that. Touching and coplanar cases don't count.
    """
    ax, ay, az = points[i, 0, 0], points[i, 0, 1], points[i, 0, 2]
    ux, uy, uz = points[i, 1, 0] - ax, points[i, 1, 1] - ay, points[i, 1, 2] - az
    wx, wy, wz = points[i, 2, 0] - ax, points[i, 2, 1] - ay, points[i, 2, 2] - az
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    d0 = (points[j, 0, 0] - ax) * nx + (points[j, 0, 1] - ay) * ny + (points[j, 0, 2] - az) * nz
    d1 = (points[j, 1, 0] - ax) * nx + (points[j, 1, 1] - ay) * ny + (points[j, 1, 2] - az) * nz
    d2 = (points[j, 2, 0] - ax) * nx + (points[j, 2, 1] - ay) * ny + (points[j, 2, 2] - az) * nz
    low, high = min(d0, d1, d2), max(d0, d1, d2)
    if low >= 0.0 or high <= 0.0:
        return True, False
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    margin = 1e-9 * size * (abs(ux) + abs(uy) + abs(uz) + abs(wx) + abs(wy) + abs(wz))
    if not (high > margin and low < -margin):
        return False, False
    n2 = size * size
    for side in range(3):
        end = (side + 1) % 3
        ds = d0 if side == 0 else d1 if side == 1 else d2
        dt = d1 if side == 0 else d2 if side == 1 else d0
        if (ds > margin and dt < -margin) or (ds < -margin and dt > margin):
            share = ds / (ds - dt)
            x = points[j, side, 0] + share * (points[j, end, 0] - points[j, side, 0]) - ax
            y = points[j, side, 1] + share * (points[j, end, 1] - points[j, side, 1]) - ay
            z = points[j, side, 2] + share * (points[j, end, 2] - points[j, side, 2]) - az
            # Barycentric coordinates from the areas against the normal.
            beta = ((y * wz - z * wy) * nx + (z * wx - x * wz) * ny + (x * wy - y * wx) * nz) / n2
            gamma = ((uy * z - uz * y) * nx + (uz * x - ux * z) * ny + (ux * y - uy * x) * nz) / n2
            if beta > 1e-9 and gamma > 1e-9 and beta + gamma < 1.0 - 1e-9:
                return False, True
    return False, False


@njit(cache=True, nogil=True)
def _cross(points: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j pass properly through each other."""
    apart, first = _pierces(points, i, j)
    if apart:
        return False
    apart, second = _pierces(points, j, i)
    return not apart and (first or second)


@njit(cache=True, nogil=True)
def _touch(numbers: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j share a corner."""
    a, b, c = numbers[i, 0], numbers[i, 1], numbers[i, 2]
    x, y, z = numbers[j, 0], numbers[j, 1], numbers[j, 2]
    first = (a == x) | (a == y) | (a == z)
    return bool(first | (b == x) | (b == y) | (b == z) | (c == x) | (c == y) | (c == z))


@njit(cache=True, nogil=True)
def _near(own: np.ndarray, leaf_pairs: np.ndarray, count: int, near: np.ndarray) -> int:
    """Put the pairs of triangles, one of each leaf of the first ``count`` pairs, whose boxes meet into ``near``, and
    return how many.
    """
    found = 0
    for pair in range(count):
        first, second = leaf_pairs[pair, 0] * LEAF, leaf_pairs[pair, 1] * LEAF
        for i in range(first, first + LEAF):
            for j in range(second, second + LEAF):
                near[found, 0], near[found, 1] = i, j
                found += _meet(own[i, 0], own[i, 1], own[j, 0], own[j, 1])
    return found


@njit(cache=True, nogil=True)
def _near_within(own: np.ndarray, first: int, last: int, near: np.ndarray) -> int:
    """The same for the pairs within each leaf from ``first`` to last − 1."""
    found = 0
    for leaf in range(first, last):
        for i in range(leaf * LEAF, (leaf + 1) * LEAF):
            for j in range(i + 1, (leaf + 1) * LEAF):
                near[found, 0], near[found, 1] = i, j
                found += _meet(own[i, 0], own[i, 1], own[j, 0], own[j, 1])
    return found


@njit(cache=True, nogil=True)
def _count_crossings(
    points: np.ndarray, numbers: np.ndarray, component: np.ndarray, near: np.ndarray, count: int, between: np.ndarray
) -> int:
    """Of the first ``count`` pairs in ``near`` those that cross, as ``_crossings`` has it; uses up ``near``."""
    left = 0
    if len(between) == 0:
        for pair in range(count):
            i, j = near[pair, 0], near[pair, 1]
            near[left, 0], near[left, 1] = i, j
            left += (not _touch(numbers, i, j)) & (component[i] == component[j])
    else:
        for pair in range(count):
            i, j = near[pair, 0], near[pair, 1]
            near[left, 0], near[left, 1] = i, j
            left += between[component[i], component[j]]
    found = 0
    for pair in range(left):
        i, j = near[pair, 0], near[pair, 1]
        if len(between) == 0:
            found += _cross(points, i, j)
        elif between[component[i], component[j]] and _cross(points, i, j):
            found += 1
            between[component[i], component[j]] = between[component[j], component[i]] = False
    return found


@njit(cache=True, nogil=True)
def _push(
    a: int, b: int, leaves: int, apart: bool, stack: np.ndarray, top: int, leaf_pairs: np.ndarray, count: int
) -> tuple[int, int]:
    """Put the pair of nodes, if not ``apart``, on the stack or among the leaf pairs; returns how many these hold."""
    inner = a < leaves - 1
    stack[top, 0], stack[top, 1] = a, b
    leaf_pairs[count, 0], leaf_pairs[count, 1] = a - leaves + 1, b - leaves + 1
    return top + (inner & (not apart)), count + ((not inner) & (not apart))


@njit(cache=True, nogil=True)
def _crossings(
    vertices: np.ndarray,
    corners: np.ndarray,
    component: np.ndarray,
    chosen: np.ndarray,
    between: np.ndarray,
    limit: int,
) -> tuple[int, bool]:
    """Pairs of the triangles numbered ``chosen`` (k,) that cross, and whether ``limit`` comparisons of boxes sufficed.

    between (k, k) bool: pairs of components to look at; the first crossing of two clears their mark. Of shape (0, 0) it
    stands for triangles of one component, of which those that share a corner don't count.
    """
    cells = _packed(vertices, corners)
    order = _order(cells, corners, chosen)
    numbers, own, boxes, common = _tree(cells, corners, order)
    points, component = _points(vertices, numbers), component[order]
    if len(between) > 0:
        common[:] = -1
    leaves = (len(boxes) + 1) // 2
    near = np.empty(((_PORTION + 4) * LEAF * LEAF + 1, 2), np.int32)
    found = visits = 0
    for first in range(0, leaves, _PORTION):
        last = min(first + _PORTION, leaves)
        visits += (last - first) * LEAF * LEAF
        found += _count_crossings(points, numbers, component, near, _near_within(own, first, last, near), between)
    leaf_pairs, stack = np.empty((_PORTION + 5, 2), np.int32), np.empty((256, 2), np.int32)
    count = 0
    # Pairs of different nodes: each node's children, and what lies below them.
    for node in range(leaves - 1):
        a, b = 2 * node + 1, 2 * node + 2
        apart = not _meet(boxes[a, 0], boxes[a, 1], boxes[b, 0], boxes[b, 1])
        top, count = _push(a, b, leaves, apart, stack, 0, leaf_pairs, count)
        while True:
            if count >= _PORTION:
                visits += count * LEAF * LEAF
                if visits > limit:
                    return found, False
                hits = _near(own, leaf_pairs, count, near)
                found += _count_crossings(points, numbers, component, near, hits, between)
                count = 0
            if top == 0:
                break
            top -= 1
            a, b = stack[top, 0], stack[top, 1]
            visits += 4
            for left in range(2 * a + 1, 2 * a + 3):
                for right in range(2 * b + 1, 2 * b + 3):
                    apart = not _meet(boxes[left, 0], boxes[left, 1], boxes[right, 0], boxes[right, 1])
                    # Triangles around one corner all share it.
                    apart |= (common[left] >= 0) & (common[left] == common[right])
                    top, count = _push(left, right, leaves, apart, stack, top, leaf_pairs, count)
    hits = _near(own, leaf_pairs, count, near)
    return found + _count_crossings(points, numbers, component, near, hits, between), True


def self_crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray) -> int:
    """Pairs of triangles of one component that cross without sharing a corner, as far as SELF_LIMIT comparisons tell;
    corners (m, 3) over welded vertices, component (m,).

    0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    within = np.zeros((0, 0), dtype=bool)
    return int(_crossings(vertices, corners, component, np.arange(len(corners)), within, SELF_LIMIT)[0])


def crossing_components(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, chosen: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Which of the pairs of components marked in ``asked`` (k, k) have triangles that cross, (k, k), and whether
    WORK_LIMIT comparisons sufficed; of the triangles numbered ``chosen``.
    """
    left = asked.copy()
    _, complete = _crossings(vertices, triangles, component, chosen, left, WORK_LIMIT)
    return asked & ~left, complete
