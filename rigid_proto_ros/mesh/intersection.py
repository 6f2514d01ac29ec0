# SPDX-License-Identifier: MIT
"""Which triangles pass through each other, and which closed components lie inside which others.

Both ask a bounding volume hierarchy, so that a query visits the few triangles that may matter: these are sorted along a
Morton curve through their boxes' centres (Morton, IBM 1966; Karras, High Performance Graphics 2012) and taken LEAF at a
time; the boxes above them form a complete binary tree: node i has the children 2i + 1 and 2i + 2, and leaf l is node
leaves − 1 + l.

Two triangles cross where each lies on both sides of the other's plane and the pieces that they cut from the planes'
common line overlap (Möller, Journal of Graphics Tools 2, 1997). Touching and coplanar triangles don't.

A point lies inside a closed component when a ray from it leaves the component more often than it enters it. The ray's
hits are found with the watertight test of Woop, Benthin and Wald (Journal of Computer Graphics Techniques 2, 2013); one
that comes too near an edge to be sure is shot again in another direction, and a point on the other surface decides
nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit

LEAF = 8
"""Triangles in a leaf: fewer cost more boxes, more cost tests in vain."""
MAX_TRIANGLES = 20_000
"""Above this many triangles a surface isn't examined for crossing itself."""
PAIR_LIMIT = 10_000_000
"""Pairs of nodes after which the search between components ends undecided: about a second. A surface of MAX_TRIANGLES
has fewer."""
WORK_LIMIT = 100_000_000
"""Boxes and triangles visited by rays after which nesting is left undecided and said to be so: about a second."""
TOUCHING = 1e-9
"""Part of the triangles' size up to which a distance or an overlap is taken for rounding."""
SAMPLES = 24
"""Points of a component, inside evenly picked triangles, of which it is asked whether they lie inside another one."""
NEAR = 1e-9
"""Part of a triangle's size, or of the mesh's, within which a hit on an edge, or on the surface itself, isn't
trusted."""
_CELLS = 1 << 20  # places along each axis that the curve tells apart

# Directions that no mesh is aligned with; the first alone is used unless a ray meets an edge.
_DIRECTIONS = np.array([(0.8163, 0.3719, 0.4421), (-0.2917, 0.9013, -0.3204), (0.1373, -0.5381, 0.8316)])
# Barycentric coordinates of the sample in its triangle: not on any of its symmetry lines.
_SAMPLE = np.array([0.4479, 0.3413, 0.2108])


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
def _hierarchy(
    vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The hierarchy of the triangles numbered ``chosen`` (k,).

    Returns their order (k,), leaf after leaf; their boxes (k, 6), lower and upper corner, in that order; and the nodes'
    boxes (2·leaves − 1, 6). An empty node's lower corner lies above its upper one.
    """
    own, lower, upper = np.empty((len(chosen), 6)), np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(len(chosen)):
        a, b, c = triangles[chosen[i], 0], triangles[chosen[i], 1], triangles[chosen[i], 2]
        for k in range(3):
            own[i, k] = min(vertices[a, k], vertices[b, k], vertices[c, k])
            own[i, 3 + k] = max(vertices[a, k], vertices[b, k], vertices[c, k])
            lower[k], upper[k] = min(lower[k], own[i, k]), max(upper[k], own[i, 3 + k])
    places = np.zeros(len(chosen), np.int64)
    for k in range(3):
        side = upper[k] - lower[k]
        scale = (_CELLS - 1) / side if side > 1e-290 else 0.0  # one cell where the quotient would overflow
        for i in range(len(chosen)):
            middle = 0.5 * own[i, k] + 0.5 * own[i, 3 + k]
            places[i] |= _spread(np.int64((middle - lower[k]) * scale)) << k
    along = np.argsort(places, kind="mergesort")
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
def _boxes_meet(boxes: np.ndarray, i: int, j: int) -> bool:
    """Whether boxes i and j have a point in common."""
    x = (boxes[i, 0] <= boxes[j, 3]) & (boxes[j, 0] <= boxes[i, 3])
    y = (boxes[i, 1] <= boxes[j, 4]) & (boxes[j, 1] <= boxes[i, 4])
    return bool(x & y & (boxes[i, 2] <= boxes[j, 5]) & (boxes[j, 2] <= boxes[i, 5]))


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
            s, t = order[i], order[j]
            c, d = component[s], component[t]
            if not (c == d if len(asked) == 0 else asked[c, d]) or not _boxes_meet(own, i, j):
                continue
            if (c != d or not _share_a_corner(corners, s, t)) and triangles_cross(vertices, corners, s, t):
                found += 1
                if len(asked) > 0:
                    asked[c, d] = asked[d, c] = False
    return found


@njit(cache=True, nogil=True)
def _crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, asked: np.ndarray) -> tuple[int, bool]:
    """Pairs of triangles of ``corners`` (m, 3) that cross, and whether PAIR_LIMIT comparisons sufficed.

    asked (k, k) bool: pairs of components to look at; the first crossing of two clears their mark. Of shape (0, 0) it
    stands for triangles of one component, of which those that share a corner don't count.
    """
    order, own, boxes = _hierarchy(vertices, corners, np.arange(len(corners)))
    inner = (len(boxes) - 1) // 2
    stack = np.empty((256, 2), np.int64)
    stack[0, 0] = stack[0, 1] = 0
    top, found = 1, 0
    for _ in range(PAIR_LIMIT):
        if top == 0:
            return found, True
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if a != b and not _boxes_meet(boxes, a, b):
            continue
        if a >= inner and b >= inner:
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
    return found, False


def self_crossings(vertices: np.ndarray, corners: np.ndarray, component: np.ndarray) -> int:
    """Pairs of triangles of one component that cross without sharing a corner; corners (m, 3) over welded vertices,
    component (m,). 0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    return int(_crossings(vertices, corners, component, np.zeros((0, 0), dtype=bool))[0])


def crossing_components(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Which of the pairs of components marked in ``asked`` (k, k) have triangles that cross, (k, k), and whether
    PAIR_LIMIT comparisons sufficed.
    """
    wanted = np.nonzero(np.isin(component, np.nonzero(asked)[0]))[0]
    if not len(wanted):
        return np.zeros_like(asked), True
    left = asked.copy()
    complete = _crossings(vertices, triangles[wanted], component[wanted], left)[1]
    return asked & ~left, bool(complete)


@njit(cache=True, nogil=True)
def _hit(
    vertices: np.ndarray,
    triangle: np.ndarray,
    origin: np.ndarray,
    direction: np.ndarray,
    kx: int,
    ky: int,
    kz: int,
    reach: float,
) -> tuple[int, bool]:
    """(sign, sure): +1 where the ray leaves through the triangle, −1 where it enters, 0 for a miss; sure: not near an
    edge or within ``reach`` of the origin.
    """
    sx, sy = direction[kx] / direction[kz], direction[ky] / direction[kz]
    a, b, c = vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]
    az, bz, cz = a[kz] - origin[kz], b[kz] - origin[kz], c[kz] - origin[kz]
    ax, ay = a[kx] - origin[kx] - sx * az, a[ky] - origin[ky] - sy * az
    bx, by = b[kx] - origin[kx] - sx * bz, b[ky] - origin[ky] - sy * bz
    cx, cy = c[kx] - origin[kx] - sx * cz, c[ky] - origin[ky] - sy * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    edges = max(abs(bx - ax), abs(cx - ax), abs(cx - bx)) * max(abs(by - ay), abs(cy - ay), abs(cy - by))
    corners = max(abs(ax), abs(bx), abs(cx)) * max(abs(ay), abs(by), abs(cy))
    margin = NEAR * edges + 1e-15 * corners
    if (u < -margin or v < -margin or w < -margin) and (u > margin or v > margin or w > margin):
        return 0, True
    total = u + v + w
    if abs(u) <= margin or abs(v) <= margin or abs(w) <= margin:
        return 0, False
    distance = (u * az + v * bz + w * cz) / total / direction[kz]
    if abs(distance) <= reach:
        return 0, False
    if distance < 0.0:
        return 0, True
    # The projected triangle runs one way round seen from behind, the other way seen from in front.
    front = total * direction[kz] > 0.0
    return (-1 if front else 1), True


@njit(cache=True, nogil=True)
def _shoot(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    order: np.ndarray,
    boxes: np.ndarray,
    own: int,
    origin: np.ndarray,
    direction: np.ndarray,
    reach: float,
    winding: np.ndarray,
    sure: np.ndarray,
) -> int:
    """Put the signed hits of all components but ``own`` into winding (k,), and into sure (k,) whether they are certain;
    returns the boxes visited.
    """
    kz = int(np.argmax(np.abs(direction)))
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    winding[:] = 0
    sure[:] = True
    inner = (len(boxes) - 1) // 2
    stack = np.zeros(64, np.int64)
    top, visits = 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        visits += 1
        near, far = 0.0, math.inf
        for k in range(3):  # widened, so that no hit is lost that isn't sure
            a = (boxes[node, k] - reach - origin[k]) / direction[k]
            b = (boxes[node, 3 + k] + reach - origin[k]) / direction[k]
            near, far = max(near, min(a, b)), min(far, max(a, b))
        if near > far:
            continue
        if node < inner:
            stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
            top += 2
            continue
        for i in range((node - inner) * LEAF, min((node - inner + 1) * LEAF, len(order))):
            other = component[order[i]]
            if other != own:
                sign, certain = _hit(vertices, triangles[order[i]], origin, direction, kx, ky, kz, reach)
                winding[other] += sign
                sure[other] &= certain
    return visits


@njit(cache=True, nogil=True)
def _sides(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    chosen: np.ndarray,
    samples: np.ndarray,
    near: np.ndarray,
    reach: float,
    limit: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many of each component's samples are outside and inside each other one, (k, k) each, and the components left
    undecided (k,) when ``limit`` visits didn't suffice.

    chosen (c,): triangles of the components in question; samples (s,): those in whose middle a ray begins; near (k, k):
    pairs whose boxes overlap.
    """
    order, _, boxes = _hierarchy(vertices, triangles, chosen)
    count = near.shape[0]
    outside, inside = np.zeros((count, count), np.int32), np.zeros((count, count), np.int32)
    undecided = np.zeros(count, np.bool_)
    winding, sure = np.zeros(count, np.int64), np.ones(count, np.bool_)
    origin = np.empty(3)
    visits = 0
    for sample in samples:
        own = component[sample]
        for k in range(3):
            origin[k] = 0.0
            for corner in range(3):
                origin[k] += _SAMPLE[corner] * vertices[triangles[sample, corner], k]
        asked = near[own].copy()
        for attempt in range(len(_DIRECTIONS)):
            if visits >= limit:
                undecided[own] = True
                break
            direction = _DIRECTIONS[attempt]
            visits += _shoot(vertices, triangles, component, order, boxes, own, origin, direction, reach, winding, sure)
            for other in range(count):
                if asked[other] and sure[other]:
                    asked[other] = False
                    inside[own, other] += winding[other] != 0
                    outside[own, other] += winding[other] == 0
            if not asked.any():
                break
    return outside, inside, undecided


def _samples(component: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Up to SAMPLES triangles (s,), evenly picked, of each of the components marked in ``wanted`` (k,)."""
    of_each = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
    return np.concatenate(
        [
            own[np.arange(min(SAMPLES, len(own))) * len(own) // min(SAMPLES, len(own))]
            for own, asked in zip(of_each, wanted, strict=True)
            if asked
        ]
    )


@dataclass(frozen=True)
class Nesting:
    """inside (k, k) bool: component i lies in component j. crossing: pairs (i, j) whose surfaces cross. decided (k,)
    bool: False for a component of which the work limit left open where it lies. complete: False when anything was left
    open.
    """

    inside: np.ndarray
    crossing: tuple[tuple[int, int], ...]
    decided: np.ndarray
    complete: bool

    @property
    def depth(self) -> np.ndarray:
        """In how many other components each one lies, (k,)."""
        return np.count_nonzero(self.inside, axis=1)


def component_nesting(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Nesting:
    """How closed components lie to each other; component (m,) numbers them, lower and upper (k, 3) are their boxes."""
    count = len(lower)
    near = np.all((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None]), axis=2)
    np.fill_diagonal(near, False)
    if not near.any():
        return Nesting(np.zeros((count, count), dtype=bool), (), np.ones(count, dtype=bool), True)
    wanted = near.any(axis=1)
    chosen, samples = np.nonzero(wanted[component])[0], _samples(component, wanted)
    reach = NEAR * float(np.linalg.norm(upper.max(axis=0) - lower.min(axis=0)))
    outside, within, undecided = _sides(vertices, triangles, component, chosen, samples, near, reach, WORK_LIMIT)
    found = (outside > 0) & (within > 0)
    found |= found.T
    crossing, complete = crossing_components(vertices, triangles, component, near & ~found)
    found |= crossing
    inside = (within > 0) & (outside == 0) & ~found & ~undecided[:, None]
    pairs = tuple((int(i), int(j)) for i, j in np.argwhere(np.triu(found)))
    return Nesting(inside, pairs, ~undecided, bool(complete and not undecided.any()))
