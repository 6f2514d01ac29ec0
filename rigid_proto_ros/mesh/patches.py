# SPDX-License-Identifier: MIT
"""Patches of a surface that can't cross themselves, so that no two of their triangles need be compared.

A patch's triangles hang together and all face one way along an axis. Seen along that axis, as many of them lie over a
point as the patch's boundary winds around it (the projected triangles, all of positive area, are a chain whose boundary
that is). Where the boundary splits into closed curves that don't cross themselves, of which one alone runs
counterclockwise, it winds around no point more than once: no triangle lies over another one, and none crosses another.

Signs that rounding might have turned certify nothing.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from .topology import joined_alike

LEAST = 4
"""Triangles below which a patch isn't worth its boundary."""
FEW = 64
"""Patches that a surface of any size may have; large ones have up to 4√m, since a table of their pairs is made."""
STRAIGHT = 1e-6
"""Part of a triangle's longer side, squared, that its normal must have along the axis that it is said to face."""
SURE = 2e-15
"""Part of the products' sizes that a difference of two products must exceed to have a sure sign."""

ROUNDS = 3
"""How often patches that could not be shown to cover once are tried again without the triangles where they fail."""
WORTH = 0.05
"""Part of all triangles that another try must be about."""

_GROUP = 8
"""Sides of a boundary in one box."""
_LONGEST = 4096
"""Sides of a boundary beyond which it isn't examined: the boxes are compared by pairs."""


@njit(cache=True, nogil=True)
def _facing(vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of each triangle (m,) the axis that its normal is closest to, twice its number, one more against it; −1 when it
    is too thin to say."""
    facing = np.empty(len(corners), np.int8)
    for t in range(len(corners)):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        wx, wy, wz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        sx, sy, sz = abs(nx), abs(ny), abs(nz)
        largest = max(sx, sy, sz)
        k = 0 if sx == largest else 2 if sy == largest else 4
        against = (nx if k == 0 else ny if k == 2 else nz) < 0.0
        sure = largest > STRAIGHT * max(ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz)
        facing[t] = k + against if sure else -1
    return facing


@njit(cache=True, nogil=True)
def _number(
    corners: np.ndarray, edges: np.ndarray, facing: np.ndarray, vertex_count: int, most: int
) -> tuple[np.ndarray, int]:
    """Of each triangle (m,) the number of its patch, or −1, and how many there are; ``most`` patches at most."""
    parent = joined_alike(edges, facing)
    size = np.zeros(len(parent), np.int32)
    for t in range(len(parent)):
        size[parent[t]] += facing[t] >= 0
    # Of an edge of many triangles two alone are known: patches that may have one aren't examined.
    many = np.zeros(vertex_count, np.bool_)
    any_many = False
    for e in range(len(edges)):
        if edges[e, 2] + edges[e, 3] > 2:
            many[edges[e, 0]] = many[edges[e, 1]] = any_many = True
    if any_many:
        for t in range(len(parent)):
            if int(many[corners[t, 0]]) + int(many[corners[t, 1]]) + int(many[corners[t, 2]]) > 1:
                size[parent[t]] = 0
    patch, number = np.empty(len(parent), np.int32), np.full(len(parent), -1, np.int32)
    count = 0
    for t in range(len(parent)):
        root = parent[t]
        if root == t and size[t] >= LEAST and count < most:  # it stands before the others of its patch
            number[t] = count
            count += 1
        patch[t] = number[root]
    return patch, count


@njit(cache=True, nogil=True)
def _boundaries(corners: np.ndarray, edges: np.ndarray, patch: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The sides at which patches end, (starts, sides): those of patch p are sides[starts[p]:starts[p + 1]], each (tail,
    head, triangle)."""
    starts = np.zeros(count + 1, np.int64)
    for e in range(len(edges)):
        s, t = edges[e, 4], edges[e, 5]
        p = patch[s]
        q = patch[t] if t >= 0 else -1
        if p != q or edges[e, 2] != edges[e, 3]:
            starts[p + 1] += p >= 0
            starts[q + 1] += q >= 0
    for p in range(count):
        starts[p + 1] += starts[p]
    fill = starts[:-1].copy()
    sides = np.empty((starts[count], 3), np.int32)
    for e in range(len(edges)):
        s, t = edges[e, 4], edges[e, 5]
        p = patch[s]
        q = patch[t] if t >= 0 else -1
        if p != q or edges[e, 2] != edges[e, 3]:
            for side in range(2):
                owner, one = (p, s) if side == 0 else (q, t)
                if owner >= 0:
                    low, high = edges[e, 0], edges[e, 1]
                    a, b, c = corners[one, 0], corners[one, 1], corners[one, 2]
                    upward = (a == low and b == high) or (b == low and c == high) or (c == low and a == high)
                    sides[fill[owner], 0], sides[fill[owner], 1] = (low, high) if upward else (high, low)
                    sides[fill[owner], 2] = one
                    fill[owner] += 1
    return starts, sides


@njit(cache=True, nogil=True)
def _turn(ax: float, ay: float, bx: float, by: float) -> int:
    """Whether b lies counterclockwise of a, 1, or clockwise, −1; 0 when that isn't sure."""
    one, other = ax * by, ay * bx
    margin = SURE * (abs(one) + abs(other))
    return 1 if one - other > margin else -1 if one - other < -margin else 0


@njit(cache=True, nogil=True)
def _apart(x: np.ndarray, y: np.ndarray, i: int, j: int) -> bool:
    """Whether side i of a boundary surely lies on one side of side j's line, or the other way round."""
    for _ in range(2):
        ux, uy = x[i + 1] - x[i], y[i + 1] - y[i]
        first = _turn(ux, uy, x[j] - x[i], y[j] - y[i])
        if first != 0 and first == _turn(ux, uy, x[j + 1] - x[i], y[j + 1] - y[i]):
            return True
        i, j = j, i
    return False


@njit(cache=True, nogil=True)
def _opens(x: np.ndarray, y: np.ndarray, before: int, at: int, after: int) -> bool:
    """Whether two sides that meet ``at`` a corner surely don't lie on each other."""
    ax, ay, bx, by = x[before] - x[at], y[before] - y[at], x[after] - x[at], y[after] - y[at]
    return _turn(ax, ay, bx, by) != 0 or ax * bx + ay * by < -SURE * (abs(ax * bx) + abs(ay * by))


@njit(cache=True, nogil=True)
def _boxes(x: np.ndarray, y: np.ndarray, n: int) -> np.ndarray:
    """Boxes (g, 4) of _GROUP sides each: lower and upper x, lower and upper y."""
    boxes = np.empty(((n + _GROUP - 1) // _GROUP, 4))
    for g in range(len(boxes)):
        low_x = high_x = x[g * _GROUP]
        low_y = high_y = y[g * _GROUP]
        for i in range(g * _GROUP + 1, min((g + 1) * _GROUP, n) + 1):
            low_x, high_x, low_y, high_y = min(low_x, x[i]), max(high_x, x[i]), min(low_y, y[i]), max(high_y, y[i])
        boxes[g, 0], boxes[g, 1], boxes[g, 2], boxes[g, 3] = low_x, high_x, low_y, high_y
    return boxes


@njit(cache=True, nogil=True)
def _mark_touching(x: np.ndarray, y: np.ndarray, n: int, triangles: np.ndarray, given_up: np.ndarray) -> bool:
    """Whether no two sides of the closed curve through n points may touch; of those that may, the triangle of the
    longer one is marked in ``given_up``.

    x, y hold the first point again behind the last; triangles (n,): whose side begins at each point.
    """
    boxes = _boxes(x, y, n)
    simple = True
    for g in range(len(boxes)):
        for h in range(g, len(boxes)):
            meet = (boxes[g, 0] <= boxes[h, 1]) & (boxes[h, 0] <= boxes[g, 1])
            if not meet & (boxes[g, 2] <= boxes[h, 3]) & (boxes[h, 2] <= boxes[g, 3]):
                continue
            for i in range(g * _GROUP, min((g + 1) * _GROUP, n)):
                low_x, high_x = min(x[i], x[i + 1]), max(x[i], x[i + 1])
                low_y, high_y = min(y[i], y[i + 1]), max(y[i], y[i + 1])
                for j in range(max(i + 1, h * _GROUP), min((h + 1) * _GROUP, n)):
                    meet = (max(x[j], x[j + 1]) >= low_x) & (min(x[j], x[j + 1]) <= high_x)
                    if not meet & (max(y[j], y[j + 1]) >= low_y) & (min(y[j], y[j + 1]) <= high_y):
                        continue
                    if j == i + 1:
                        fine = _opens(x, y, i, j, j + 1)
                    elif i == 0 and j == n - 1:
                        fine = _opens(x, y, 1, 0, j)
                    else:
                        fine = _apart(x, y, i, j)
                    if not fine:
                        simple = False
                        long_i = max(high_x - low_x, high_y - low_y)
                        long_j = max(abs(x[j + 1] - x[j]), abs(y[j + 1] - y[j]))
                        given_up[triangles[i if long_i > long_j else j]] = True
    return simple


@njit(cache=True, nogil=True)
def _counterclockwise(x: np.ndarray, y: np.ndarray, n: int) -> bool:
    """Whether the closed curve may run counterclockwise: its area isn't surely negative."""
    area = size = 0.0
    for i in range(1, n - 1):
        one, other = (x[i] - x[0]) * (y[i + 1] - y[0]), (y[i] - y[0]) * (x[i + 1] - x[0])
        area += one - other
        size += abs(one) + abs(other)
    return area > -SURE * n * size


@njit(cache=True, nogil=True)
def _covers_once(
    vertices: np.ndarray,
    sides: np.ndarray,
    facing: int,
    leaving: np.ndarray,
    place: np.ndarray,
    given_up: np.ndarray,
) -> bool:
    """Whether the boundary surely winds around no point more than once, seen against the axis that ``facing`` names;
    if not, triangles without which it might not are marked in ``given_up`` (m,).

    sides (k, 3): tail, head, triangle. leaving, place (n,) int32: −1 for each vertex, before and after.
    """
    count = len(sides)
    u, v = (facing // 2 + 1) % 3, (facing // 2 + 2) % 3
    if facing % 2:
        u, v = v, u
    link, path, owners = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.int32)
    x, y = np.empty(count + 1), np.empty(count + 1)
    for h in range(count):
        link[h] = leaving[sides[h, 0]]
        leaving[sides[h, 0]] = h
    outer = 0
    good = True
    for h in range(count):
        vertex, length = sides[h, 0], 0
        while True:
            begin = place[vertex]
            if begin >= 0:
                n = length - begin
                for i in range(n):
                    side = path[begin + i]
                    x[i], y[i] = vertices[sides[side, 0], u], vertices[sides[side, 0], v]
                    owners[i] = sides[side, 2]
                    place[sides[side, 0]] = -1
                x[n], y[n] = x[0], y[0]
                length = begin
                outer += _counterclockwise(x, y, n)
                good &= n > 2 and _mark_touching(x, y, n, owners, given_up)
            side = leaving[vertex]
            if side < 0:
                break
            leaving[vertex] = link[side]
            place[vertex], path[length] = length, side
            length += 1
            vertex = sides[side, 1]
        for i in range(length):  # sides that close no curve
            place[sides[path[i], 0]], good = -1, False
    return good and outer <= 1


@njit(cache=True, nogil=True)
def _of(edges: np.ndarray, label: np.ndarray) -> np.ndarray:
    """The edges that a triangle with a label ≥ 0 has."""
    count = 0
    kept = np.empty_like(edges)
    for e in range(len(edges)):
        if label[edges[e, 4]] >= 0 or (edges[e, 5] >= 0 and label[edges[e, 5]] >= 0):
            kept[count] = edges[e]
            count += 1
    return kept[:count]


@njit(cache=True, nogil=True)
def surface_patches(vertices: np.ndarray, corners: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Of each triangle of ``corners`` (m, 3) over welded vertices (n, 3) the number of a patch that doesn't cross
    itself, or −1, (m,) int32; edges (e, 6) as in a topology."""
    label = _facing(vertices, corners)
    patch, found = np.full(len(corners), -1, np.int32), 0
    leaving, place = np.full(len(vertices), -1, np.int32), np.full(len(vertices), -1, np.int32)
    given_up = np.zeros(len(corners), np.bool_)
    most = max(FEW, int(4.0 * math.sqrt(len(corners))))
    for _ in range(ROUNDS):
        candidate, count = _number(corners, edges, label, len(vertices), most - found)
        starts, sides = _boundaries(corners, edges, candidate, count)
        facing, number = np.empty(count, np.int8), np.full(count, -1, np.int32)
        for t in range(len(candidate)):
            if candidate[t] >= 0:
                facing[candidate[t]] = label[t]
        for p in range(count):
            own = sides[starts[p] : starts[p + 1]]
            if len(own) <= _LONGEST and _covers_once(vertices, own, facing[p], leaving, place, given_up):
                number[p] = found
                found += 1
        left = 0
        for t in range(len(candidate)):
            p = candidate[t]
            again = p >= 0
            if again and number[p] >= 0:
                patch[t], again = number[p], False
            left += again
            label[t] = label[t] if again and not given_up[t] else -1
        if left < WORTH * len(corners):
            break
        edges = _of(edges, label)
    return patch
