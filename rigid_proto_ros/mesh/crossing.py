# SPDX-License-Identifier: MIT
"""Triangles that pass through each other: of one surface, which then counts twice what it encloses twice, or of two.

Both ends of a pair of nodes descend the hierarchy together (Gottschalk, Lin, Manocha, SIGGRAPH 1996). Two triangles
cross where each lies on both sides of the other's plane and the pieces that they cut from the planes' common line
overlap (Möller, Journal of Graphics Tools 2, 1997). Touching and coplanar triangles don't.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from .bvh import LEAF, boxes_meet, hierarchy

MAX_TRIANGLES = 20_000
"""Above this many triangles a surface isn't examined for crossing itself."""
SELF_LIMIT = 30_000_000
"""Pairs of boxes compared after which the search within surfaces ends, some tenths of a second."""
WORK_LIMIT = 100_000_000
"""Pairs of boxes after which the search between surfaces ends undecided: about a second."""
TOUCHING = 1e-9
"""Part of the triangles' size up to which a distance or an overlap is taken for rounding."""

_Plane = tuple[float, float, float, float]


@njit(cache=True, nogil=True)
def _plane(vertices: np.ndarray, corners: np.ndarray, i: int) -> _Plane:
    """Normal of triangle i, as long as twice its area, and the product with it that counts as zero."""
    a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
    x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    ux, uy, uz = vertices[b, 0] - x, vertices[b, 1] - y, vertices[b, 2] - z
    wx, wy, wz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx, ny, nz, TOUCHING * size * (abs(ux) + abs(uy) + abs(uz) + abs(wx) + abs(wy) + abs(wz))


@njit(cache=True, nogil=True)
def _heights(vertices: np.ndarray, corners: np.ndarray, i: int, plane: _Plane, j: int) -> tuple[float, float, float]:
    """Products of the normal of triangle i with the corners of triangle j from i's first one; 0 for those in its
    plane."""
    nx, ny, nz, margin = plane
    a = corners[i, 0]
    x, y, z = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    p, q, r = corners[j, 0], corners[j, 1], corners[j, 2]
    d = (vertices[p, 0] - x) * nx + (vertices[p, 1] - y) * ny + (vertices[p, 2] - z) * nz
    e = (vertices[q, 0] - x) * nx + (vertices[q, 1] - y) * ny + (vertices[q, 2] - z) * nz
    f = (vertices[r, 0] - x) * nx + (vertices[r, 1] - y) * ny + (vertices[r, 2] - z) * nz
    return d if abs(d) > margin else 0.0, e if abs(e) > margin else 0.0, f if abs(f) > margin else 0.0


@njit(cache=True, nogil=True)
def _piece(
    vertices: np.ndarray, corners: np.ndarray, j: int, heights: tuple[float, float, float], axis: int, origin: float
) -> tuple[float, float]:
    """Where, along ``axis`` from ``origin``, triangle j begins and ends in the plane over which its corners have
    ``heights``."""
    low, high = math.inf, -math.inf
    for k in range(3):
        end = (k + 1) % 3
        d, e = heights[k], heights[end]
        if d == 0.0 or d * e < 0.0:
            x, y = vertices[corners[j, k], axis] - origin, vertices[corners[j, end], axis] - origin
            place = x + (y - x) * (d / (d - e)) if d != 0.0 else x
            low, high = min(low, place), max(high, place)
    return low, high


@njit(cache=True, nogil=True)
def triangles_cross(vertices: np.ndarray, corners: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j of ``corners`` (m, 3) over vertices (n, 3) pass properly through each other."""
    one = _plane(vertices, corners, i)
    above = _heights(vertices, corners, i, one, j)
    if not (min(above) < 0.0 < max(above)):
        return False
    other = _plane(vertices, corners, j)
    heights = _heights(vertices, corners, j, other, i)
    if not (min(heights) < 0.0 < max(heights)):
        return False
    dx, dy = abs(one[1] * other[2] - one[2] * other[1]), abs(one[2] * other[0] - one[0] * other[2])
    dz = abs(one[0] * other[1] - one[1] * other[0])
    axis = 0 if dx >= max(dy, dz) else (1 if dy >= dz else 2)
    origin = vertices[corners[i, 0], axis]
    low, high = _piece(vertices, corners, i, heights, axis, origin)
    lower, higher = _piece(vertices, corners, j, above, axis, origin)
    return min(high, higher) - max(low, lower) > TOUCHING * (max(high, higher) - min(low, lower))


@njit(cache=True, nogil=True)
def _share_a_corner(corners: np.ndarray, i: int, j: int) -> bool:
    for k in range(3):
        if corners[i, k] == corners[j, 0] or corners[i, k] == corners[j, 1] or corners[i, k] == corners[j, 2]:
            return True
    return False


@njit(cache=True, nogil=True)
def _components_of_nodes(component: np.ndarray, order: np.ndarray, nodes: int) -> np.ndarray:
    """The component that all triangles below each node are of, or −1, (nodes,)."""
    leaves = (nodes + 1) // 2
    found = np.full(nodes, -2)  # none
    for i in range(len(order)):
        node, own = leaves - 1 + i // LEAF, component[order[i]]
        found[node] = own if found[node] in (-2, own) else -1
    for node in range(nodes - 1, 0, -1):
        above = (node - 1) // 2
        if found[node] != -2:
            found[above] = found[node] if found[above] in (-2, found[node]) else -1
    return found


@njit(cache=True, nogil=True)
def _in_leaves(
    vertices: np.ndarray,
    corners: np.ndarray,
    component: np.ndarray,
    order: np.ndarray,
    own: np.ndarray,
    first: int,
    second: int,
    asked: np.ndarray,
) -> int:
    """Crossings between the triangles of two leaves, which may be one, as ``_crossings`` has it."""
    found = 0
    for i in range(first * LEAF, min((first + 1) * LEAF, len(order))):
        for j in range(i + 1 if first == second else second * LEAF, min((second + 1) * LEAF, len(order))):
            if not boxes_meet(own, i, j):
                continue
            s, t = order[i], order[j]
            c, d = component[s], component[t]
            within = c == d and not _share_a_corner(corners, s, t)
            if (within if len(asked) == 0 else asked[c, d]) and triangles_cross(vertices, corners, s, t):
                found += 1
                if len(asked) > 0:
                    asked[c, d] = asked[d, c] = False
    return found


@njit(cache=True, nogil=True)
def _crossings(
    vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, asked: np.ndarray, limit: int
) -> tuple[int, bool]:
    """Pairs of triangles of ``corners`` (m, 3) that cross, and whether ``limit`` comparisons of boxes sufficed.

    asked (k, k) bool: pairs of components to look at; the first crossing of two clears their mark. Of shape (0, 0) it
    stands for triangles of one component, of which those that share a corner don't count.
    """
    order, own, boxes = hierarchy(vertices, corners, np.arange(len(corners)))
    part = _components_of_nodes(component, order, len(boxes))
    inner = (len(boxes) - 1) // 2
    within = len(asked) == 0
    stack = np.empty((256, 2), np.int64)
    stack[0, 0] = stack[0, 1] = 0
    top, visits, found = 1, 0, 0
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        visits += 1
        if visits > limit:
            return found, False
        if a != b and not boxes_meet(boxes, a, b):
            continue
        alone = part[a] >= 0 and part[b] >= 0
        if alone and ((part[a] != part[b]) if within else not asked[part[a], part[b]]):
            continue
        if a >= inner and b >= inner:
            visits += LEAF * LEAF
            found += _in_leaves(vertices, corners, component, order, own, a - inner, b - inner, asked)
        elif a == b:
            for one, other in ((2 * a + 1, 2 * a + 1), (2 * a + 2, 2 * a + 2), (2 * a + 1, 2 * a + 2)):
                stack[top, 0], stack[top, 1] = one, other
                top += 1
        else:
            # Both are of one depth, or b one below a.
            for child in (1, 2):
                stack[top, 0], stack[top, 1] = (2 * a + child, b) if a < b and a < inner else (a, 2 * b + child)
                top += 1
    return found, True


def self_crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray) -> int:
    """Pairs of triangles of one component that cross without sharing a corner, as far as SELF_LIMIT comparisons tell;
    corners (m, 3) over welded vertices, component (m,). 0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    return int(_crossings(vertices, corners, component, np.zeros((0, 0), dtype=bool), SELF_LIMIT)[0])


def crossing_components(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Which of the pairs of components marked in ``asked`` (k, k) have triangles that cross, (k, k), and whether
    WORK_LIMIT comparisons sufficed.
    """
    wanted = np.nonzero(np.isin(component, np.nonzero(asked)[0]))[0]
    if not len(wanted):
        return np.zeros_like(asked), True
    left = asked.copy()
    complete = _crossings(vertices, triangles[wanted], component[wanted], left, WORK_LIMIT)[1]
    return asked & ~left, bool(complete)
