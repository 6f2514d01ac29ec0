# SPDX-License-Identifier: MIT
"""Triangles that intersect, and nesting of closed components.

Both use a bounding volume hierarchy, so that a query visits only few triangles: these are sorted along a Morton curve
through their boxes' centres (Morton, IBM 1966; Karras, High Performance Graphics 2012) and grouped into leaves of LEAF;
the boxes above them form a complete binary tree: node i has children 2i + 1 and 2i + 2, leaf l is node leaves − 1 + l.

Two triangles intersect if each lies on both sides of the other's plane and the intervals that they cut from the planes'
common line overlap (Möller, Journal of Graphics Tools 2, 1997). Touching and coplanar triangles don't count.

A point lies inside a closed component if a ray from it leaves and enters the component unequally often. A ray too near
an edge is repeated in another direction; points on the other surface are ignored.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import exported, local_integers, njit
from ..base.vectors import BoolArray, FloatArray, IntArray, Points, Triangles
from .topology import Components, Topology

LEAF = 8
"""Triangles per leaf: fewer need more boxes, more need more tests of triangles."""
WORK_LIMIT = 100_000_000
"""Visited boxes after which a result is reported as undecided: about a second."""
TEST = 10
"""Cost of a test of two triangles, in visited boxes."""
MAX_SELF_CROSSING = 20_000
"""Triangles above which nobody looks whether a component passes through itself: no number depends on it, and it takes
four to eight times as long as reading the file."""
TOUCHING = 1e-9
"""Fraction of the triangles' size up to which a distance or an overlap counts as rounding error."""
SAMPLES = 24
"""Points per component, in evenly spaced triangles, that are tested for lying inside another component."""
NEAR = 1e-9
"""Fraction of a triangle's size, or of the mesh's, within which a hit near an edge, or near the ray's origin, is
uncertain."""
_CELLS = 1 << 20  # cells of the curve along each axis
_SEVERAL, _NONE = -1, -2  # components below a node
_KEY_BITS, _DIGIT_BITS, _DIGITS = 60, 10, 1 << 10  # of a place on the curve, sorted in an even number of digits
_SPREADING = ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F), (4, 0x10C30C30C30C30C3),
              (2, 0x1249249249249249))  # fmt: skip  # put two zeros between the bits of a number

# Directions unlikely to be aligned with a mesh; only the first is used unless a ray meets an edge.
_DIRECTIONS = ((0.8163, 0.3719, 0.4421), (-0.2917, 0.9013, -0.3204), (0.1373, -0.5381, 0.8316))
# Barycentric coordinates of the sample in its triangle: not on any of its symmetry lines.
_SAMPLE = (0.4479, 0.3413, 0.2108)

Hierarchy = tuple[IntArray, FloatArray, FloatArray]
"""Order of the triangles (m,), leaf after leaf; their boxes (m, 6), lower and upper corner, in that order; the nodes'
boxes (2·leaves − 1, 6)."""
_Vector = tuple[float, float, float]
_Triangle = tuple[_Vector, _Vector, _Vector]


@njit(error_model="numpy", allocates=False)
def _corner(vertices: Points, i: int) -> _Vector:
    return vertices[i, 0], vertices[i, 1], vertices[i, 2]


@njit(error_model="numpy", allocates=False)
def corners_of(vertices: Points, corners: Triangles, i: int) -> _Triangle:
    """The three corners of triangle i."""
    return _corner(vertices, corners[i, 0]), _corner(vertices, corners[i, 1]), _corner(vertices, corners[i, 2])


@njit(error_model="numpy", allocates=False)
def minus(a: _Vector, b: _Vector) -> _Vector:
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(error_model="numpy", allocates=False)
def cross(a: _Vector, b: _Vector) -> _Vector:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(error_model="numpy", allocates=False)
def dot(a: _Vector, b: _Vector) -> float:
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(error_model="numpy", allocates=False)
def _largest(a: _Vector) -> float:
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@njit(error_model="numpy", allocates=False)
def _spread_bits(x: int) -> int:
    """x with two zeros between its bits."""
    for shift, mask in _SPREADING:
        x = (x | (x << shift)) & mask
    return x


@njit(error_model="numpy", allocates=False)
def _enclose(boxes: FloatArray, i: int, others: FloatArray, j: int) -> None:
    """Extend box i to hold box j of ``others``."""
    for k in range(3):
        boxes[i, k] = min(boxes[i, k], others[j, k])
        boxes[i, k + 3] = max(boxes[i, k + 3], others[j, k + 3])


@njit(error_model="numpy", allocates=False)
def _sort(keys: IntArray, values: IntArray, keys_room: IntArray, values_room: IntArray) -> None:
    """Sort keys (m,), none negative, and values (m,) with them, digit by digit; equal keys keep their order."""
    starts = local_integers(_DIGITS)
    for digit in range(0, _KEY_BITS, 2 * _DIGIT_BITS):
        for shift in (digit, digit + _DIGIT_BITS):  # there and back
            for d in range(_DIGITS):
                starts[d] = 0
            for i in range(keys.shape[0]):
                starts[(keys[i] >> shift) & (_DIGITS - 1)] += 1
            place = 0
            for d in range(_DIGITS):
                starts[d], place = place, place + starts[d]
            for i in range(keys.shape[0]):
                d = (keys[i] >> shift) & (_DIGITS - 1)
                keys_room[starts[d]], values_room[starts[d]] = keys[i], values[i]
                starts[d] += 1
            keys, keys_room, values, values_room = keys_room, keys, values_room, values


@exported("f8[:,:]", "i8[:,:]", "i8[:]", "f8[:,:]", "i8[:]", "f8[:,:]", "f8[:,:]", nogil=True)
def build_hierarchy(
    vertices: Points,
    corners: Triangles,
    room: IntArray,
    unsorted: FloatArray,
    order: IntArray,
    own: FloatArray,
    boxes: FloatArray,
) -> None:
    """Fill the Hierarchy of triangles (m, 3); boxes (2·leaves − 1, 6) for a power of two of leaves that hold them all.
    room (3·m,) and unsorted (m, 6): workspace.
    """
    m, leaves = corners.shape[0], (boxes.shape[0] + 1) // 2
    keys, keys_room, order_room = room[:m], room[m : 2 * m], room[2 * m : 3 * m]
    for node in range(boxes.shape[0]):
        for k in range(3):
            boxes[node, k], boxes[node, k + 3] = np.inf, -np.inf
    for t in range(m):
        a, b, c = vertices[corners[t, 0]], vertices[corners[t, 1]], vertices[corners[t, 2]]
        for k in range(3):
            unsorted[t, k], unsorted[t, k + 3] = min(a[k], b[k], c[k]), max(a[k], b[k], c[k])
        _enclose(boxes, 0, unsorted, t)
    for t in range(m):
        key = 0
        for k in range(3):
            side = max(boxes[0, k + 3] - boxes[0, k], 1e-290)  # one cell where the quotient would overflow
            middle = 0.5 * unsorted[t, k] + 0.5 * unsorted[t, k + 3]
            key |= _spread_bits(int((middle - boxes[0, k]) * ((_CELLS - 1) / side))) << k
        keys[t], order[t] = key, t
    _sort(keys, order, keys_room, order_room)
    for i in range(m):
        for k in range(6):
            own[i, k] = unsorted[order[i], k]
        _enclose(boxes, leaves - 1 + i // LEAF, own, i)
    for node in range(leaves - 2, -1, -1):
        _enclose(boxes, node, boxes, 2 * node + 1)
        _enclose(boxes, node, boxes, 2 * node + 2)


def hierarchy(vertices: Points, corners: Triangles) -> Hierarchy:
    """The hierarchy of triangles (m, 3); an empty node's lower corner lies above its upper one."""
    m, leaves = len(corners), 1
    while leaves * LEAF < m:
        leaves *= 2
    order, own, boxes = np.empty(m, np.int64), np.empty((m, 6)), np.empty((2 * leaves - 1, 6))
    build_hierarchy(vertices, corners, np.empty(3 * m, np.int64), np.empty((m, 6)), order, own, boxes)
    return order, own, boxes


@njit(error_model="numpy", allocates=False)
def _boxes_meet(boxes: FloatArray, i: int, others: FloatArray, j: int) -> bool:
    """Whether box i and box j of ``others`` have a point in common."""
    x = (boxes[i, 0] <= others[j, 3]) & (others[j, 0] <= boxes[i, 3])
    y = (boxes[i, 1] <= others[j, 4]) & (others[j, 1] <= boxes[i, 4])
    return bool(x & y & (boxes[i, 2] <= others[j, 5]) & (others[j, 2] <= boxes[i, 5]))


@njit(error_model="numpy", allocates=False)
def _heights(triangle: _Triangle, other: _Triangle) -> tuple[_Vector, _Vector]:
    """Normal of a triangle, with a length of twice its area, and its scalar products with the corners of the other one
    relative to its first corner; 0 for corners in its plane to rounding.
    """
    u, w = minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0])
    normal = cross(u, w)
    margin = TOUCHING * math.sqrt(dot(normal, normal)) * 2.0 * (_largest(u) + _largest(w))
    d, e, f = (dot(minus(other[0], triangle[0]), normal), dot(minus(other[1], triangle[0]), normal),
               dot(minus(other[2], triangle[0]), normal))  # fmt: skip
    return normal, (d if abs(d) > margin else 0.0, e if abs(e) > margin else 0.0, f if abs(f) > margin else 0.0)


@njit(error_model="numpy", allocates=False)
def _along(axis: int, a: _Vector) -> float:
    """Component ``axis`` of a."""
    return a[0] if axis == 0 else (a[1] if axis == 1 else a[2])


@njit(error_model="numpy", allocates=False)
def _with_end(low: float, high: float, d: float, e: float, x: float, y: float) -> tuple[float, float]:
    """The interval, made to hold where an edge from x at the height d to y at the height e meets the height 0."""
    if d == 0.0 or d * e < 0.0:
        place = x + (y - x) * (d / (d - e)) if d != 0.0 else x
        return min(low, place), max(high, place)
    return low, high


@njit(error_model="numpy", allocates=False)
def _piece(triangle: _Triangle, heights: _Vector, axis: int, origin: float) -> tuple[float, float]:
    """Interval along ``axis``, from ``origin``, in which a triangle meets the plane above which its corners have
    ``heights``."""
    x, y, z = _along(axis, triangle[0]) - origin, _along(axis, triangle[1]) - origin, _along(axis, triangle[2]) - origin
    low, high = _with_end(math.inf, -math.inf, heights[0], heights[1], x, y)
    low, high = _with_end(low, high, heights[1], heights[2], y, z)
    return _with_end(low, high, heights[2], heights[0], z, x)


@njit(error_model="numpy", allocates=False)
def triangles_cross(vertices: Points, corners: Triangles, i: int, j: int) -> bool:
    """Whether triangles i and j of ``corners`` (m, 3) over vertices (n, 3) properly intersect."""
    one, other = corners_of(vertices, corners, i), corners_of(vertices, corners, j)
    normal, above = _heights(one, other)
    if not (min(above) < 0.0 < max(above)):
        return False
    across, heights = _heights(other, one)
    if not (min(heights) < 0.0 < max(heights)):
        return False
    dx, dy, dz = cross(normal, across)
    axis = 0 if abs(dx) >= max(abs(dy), abs(dz)) else (1 if abs(dy) >= abs(dz) else 2)
    origin = _along(axis, one[0])
    low, high = _piece(one, heights, axis, origin)
    lower, higher = _piece(other, above, axis, origin)
    return min(high, higher) - max(low, lower) > TOUCHING * (max(high, higher) - min(low, lower))


@njit(error_model="numpy", allocates=False)
def _share_a_corner(corners: Triangles, i: int, j: int) -> bool:
    for k in range(3):
        if corners[i, k] == corners[j, 0] or corners[i, k] == corners[j, 1] or corners[i, k] == corners[j, 2]:
            return True
    return False


@njit(error_model="numpy", allocates=False)
def _components_of_nodes(component: IntArray, order: IntArray, of_node: IntArray) -> None:
    """Fill of_node (2·leaves − 1,) with the component of all triangles below a node, -1 where there are several, -2
    where there are none.
    """
    inner = of_node.shape[0] // 2
    for leaf in range(inner + 1):
        of_node[inner + leaf] = _NONE
        for i in range(leaf * LEAF, min((leaf + 1) * LEAF, order.shape[0])):
            c, before = component[order[i]], of_node[inner + leaf]
            of_node[inner + leaf] = c if before in (c, _NONE) else _SEVERAL
    for node in range(inner - 1, -1, -1):
        one, other = of_node[2 * node + 1], of_node[2 * node + 2]
        of_node[node] = one if one == other or other == _NONE else _SEVERAL


@njit(error_model="numpy", allocates=False)
def _leaves_cross(
    vertices: Points,
    corners: Triangles,
    component: IntArray,
    order: IntArray,
    own: FloatArray,
    boxes: FloatArray,
    a: int,
    b: int,
    also_within: bool,
    crossing: BoolArray,
) -> tuple[int, int]:
    """Pairs of one triangle of leaf a with a later one of leaf b that intersect, as ``crossings`` counts them, and how
    many pairs were tested.
    """
    within, tests = 0, 0
    for i in range(a * LEAF, min((a + 1) * LEAF, order.shape[0])):
        if not _boxes_meet(boxes, boxes.shape[0] // 2 + b, own, i):
            continue
        s = order[i]
        for j in range(max(i + 1, b * LEAF), min((b + 1) * LEAF, order.shape[0])):
            t = order[j]
            c, d = component[s], component[t]
            if not _boxes_meet(own, i, own, j) or crossing[c, d]:
                continue
            if c == d and (not also_within or _share_a_corner(corners, s, t)):
                continue
            tests += 1
            if triangles_cross(vertices, corners, s, t):
                within += c == d
                crossing[c, d] = crossing[d, c] = c != d
    return within, tests


@exported(
    *("f8[:,:]", "i8[:,:]", "i8[:]", "i8[:]", "f8[:,:]", "f8[:,:]", "i8[:]", "b1", "i8", "b1[:,:]"),
    returns="i8 b1",
    nogil=True,
)
def crossings(
    vertices: Points,
    corners: Triangles,
    component: IntArray,
    order: IntArray,
    own: FloatArray,
    boxes: FloatArray,
    of_node: IntArray,
    also_within: bool,
    limit: int,
    crossing: BoolArray,
) -> tuple[int, bool]:
    """Number of intersecting pairs of triangles of one component without a common corner, if ``also_within``, and
    whether ``limit`` visits sufficed; fills ``crossing`` (k, k) with which components intersect. corners (m, 3): over
    welded vertices; component (m,); order, own and boxes: the Hierarchy; of_node (2·leaves − 1,): workspace.

    Both nodes of a pair have the same level, so that each pair is visited once.
    """
    inner = boxes.shape[0] // 2
    for c in range(crossing.shape[0]):
        for d in range(crossing.shape[0]):
            crossing[c, d] = False
    _components_of_nodes(component, order, of_node)
    within, visits = 0, 0
    stack = local_integers(512)  # at most three pairs wait a level, beside the four of the last one
    stack[0], stack[1] = 0, 0
    top = 2
    while top > 0:
        top -= 2
        a, b = stack[top], stack[top + 1]
        visits += 1
        if not also_within and of_node[a] == of_node[b] >= 0:
            continue
        if a != b and not _boxes_meet(boxes, a, boxes, b):
            continue
        if a < inner:
            for one in (2 * a + 1, 2 * a + 2):
                for other in (2 * b + 1, 2 * b + 2):
                    if other >= one:
                        stack[top], stack[top + 1] = one, other
                        top += 2
            continue
        found, tests = _leaves_cross(
            vertices, corners, component, order, own, boxes, a - inner, b - inner, also_within, crossing
        )
        within, visits = within + found, visits + TEST * tests
        if visits > limit:
            return within, False
    return within, True


@njit(error_model="numpy", allocates=False)
def _hit(triangle: _Triangle, origin: _Vector, direction: _Vector, reach: float) -> tuple[int, bool]:
    """(sign, sure): +1 where the ray leaves through the triangle, −1 where it enters, 0 for a miss; sure: neither near
    an edge nor within ``reach`` of the origin.

    The ray's sides of the three edges are triple products, which are also the weights of the corners in the hit point.
    """
    a, b, c = minus(triangle[0], origin), minus(triangle[1], origin), minus(triangle[2], origin)
    u, v, w = dot(direction, cross(b, c)), dot(direction, cross(c, a)), dot(direction, cross(a, b))
    size = max(_largest(minus(b, a)), _largest(minus(c, a)), _largest(minus(c, b)))
    far = max(_largest(a), _largest(b), _largest(c))
    margin = NEAR * size * size + 1e-15 * far * far
    if (u < -margin or v < -margin or w < -margin) and (u > margin or v > margin or w > margin):
        return 0, True
    if abs(u) <= margin or abs(v) <= margin or abs(w) <= margin:
        return 0, False
    distance = (u * dot(a, direction) + v * dot(b, direction) + w * dot(c, direction)) / (u + v + w)
    if abs(distance) <= reach:
        return 0, False
    if distance < 0.0:
        return 0, True
    return (1 if u + v + w > 0.0 else -1), True


@njit(error_model="numpy", allocates=False)
def _slab(near: float, far: float, low: float, high: float, origin: float, direction: float) -> tuple[float, float]:
    """The part of a ray, from ``near`` to ``far``, that lies between low and high along one axis."""
    a, b = (low - origin) / direction, (high - origin) / direction
    return max(near, min(a, b)), min(far, max(a, b))


@njit(error_model="numpy", allocates=False)
def _shoot(
    vertices: Points,
    corners: Triangles,
    component: IntArray,
    order: IntArray,
    boxes: FloatArray,
    own: int,
    origin: _Vector,
    direction: _Vector,
    reach: float,
    winding: IntArray,
    sure: BoolArray,
) -> int:
    """Sum the signed hits of all components but ``own`` in winding (k,); sure (k,): whether they are certain. Returns
    the number of boxes visited.
    """
    for c in range(winding.shape[0]):
        winding[c], sure[c] = 0, True
    inner = boxes.shape[0] // 2
    stack = local_integers(64)
    stack[0] = 0
    top, visits = 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        visits += 1
        # Widened, so that no uncertain hit is missed.
        box = boxes[node]
        near, far = _slab(0.0, math.inf, box[0] - reach, box[3] + reach, origin[0], direction[0])
        near, far = _slab(near, far, box[1] - reach, box[4] + reach, origin[1], direction[1])
        near, far = _slab(near, far, box[2] - reach, box[5] + reach, origin[2], direction[2])
        if near > far:
            continue
        if node < inner:
            stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
            top += 2
            continue
        for i in range((node - inner) * LEAF, min((node - inner + 1) * LEAF, order.shape[0])):
            other = component[order[i]]
            if other != own:
                sign, certain = _hit(corners_of(vertices, corners, order[i]), origin, direction, reach)
                winding[other] += sign
                sure[other] &= certain
    return visits


@exported(
    *("f8[:,:]", "i8[:,:]", "i8[:]", "i8[:]", "f8[:,:]", "i8[:]", "b1[:,:]", "f8", "b1[:,:]", "b1[:,:]", "i8[:]"),
    *("b1[:,:]",),
    returns="b1",
    nogil=True,
)
def sides_of_components(
    vertices: Points,
    corners: Triangles,
    component: IntArray,
    order: IntArray,
    boxes: FloatArray,
    samples: IntArray,
    near: BoolArray,
    reach: float,
    outside: BoolArray,
    inside: BoolArray,
    winding: IntArray,
    flags: BoolArray,
) -> bool:
    """Fill which components have samples outside and inside which others, (k, k) each; whether the work limit sufficed.

    samples (s,): triangles in which a ray begins; near (k, k): pairs whose boxes overlap. order and boxes: of the
    Hierarchy. winding (k,) and flags (2, k): workspace.
    """
    count, visits = near.shape[0], 0
    sure, asked = flags[0], flags[1]
    for c in range(count):
        for d in range(count):
            outside[c, d] = inside[c, d] = False
    for s in range(samples.shape[0]):
        own = component[samples[s]]
        a, b, c = corners_of(vertices, corners, samples[s])
        origin = (
            dot(_SAMPLE, (a[0], b[0], c[0])),
            dot(_SAMPLE, (a[1], b[1], c[1])),
            dot(_SAMPLE, (a[2], b[2], c[2])),
        )
        for d in range(count):
            asked[d] = near[own, d]
        for direction in _DIRECTIONS:
            visits += _shoot(vertices, corners, component, order, boxes, own, origin, direction, reach, winding, sure)
            is_unsure = False
            for d in range(count):
                if asked[d] and sure[d]:
                    inside[own, d] |= winding[d] != 0
                    outside[own, d] |= winding[d] == 0
                    asked[d] = False
                is_unsure = is_unsure or asked[d]
            if not is_unsure:
                break
        if visits > WORK_LIMIT:
            return False
    return True


@dataclass(frozen=True)
class Nesting:
    """inside (k, k) bool: component i lies in component j. crossing (k, k) bool: their surfaces intersect. within:
    pairs of triangles of one component that intersect, None of a mesh of more than MAX_SELF_CROSSING. complete: False
    if the work limit was reached before."""

    inside: BoolArray
    crossing: BoolArray
    within: int | None
    complete: bool

    @property
    def depth(self) -> IntArray:
        """Number of other components in which each one lies, (k,)."""
        return np.asarray(np.count_nonzero(self.inside, axis=1))

    @property
    def crosses(self) -> BoolArray:
        """Which components intersect another one, (k,) bool."""
        return np.asarray(self.crossing.any(axis=1))


def component_nesting(vertices: Points, topology: Topology, sums: Components) -> Nesting:
    """Nesting, intersections and self-intersections of closed components."""
    return nesting_of(vertices, topology.corners, topology.component, sums.lower, sums.upper)


def nesting_of(vertices: Points, corners: Triangles, component: IntArray, lower: Points, upper: Points) -> Nesting:
    """The same of any closed surfaces: component (m,): number of the one that a triangle belongs to; lower and upper
    (k, 3): corners of their boxes.
    """
    count = len(lower)
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    order, own, boxes = hierarchy(vertices, corners)
    found = np.empty((count, count), dtype=bool)
    examined = len(component) <= MAX_SELF_CROSSING
    tree = order, own, boxes, np.empty(len(boxes), np.int64)
    within, complete = crossings(vertices, corners, component, *tree, examined, WORK_LIMIT, found)
    near = np.all((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None]), axis=2)
    np.fill_diagonal(near, False)
    inside = np.zeros((count, count), dtype=bool)
    if near.any():
        of_each = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
        samples = np.concatenate(
            [mine[:: -(-len(mine) // SAMPLES)] for mine, asked in zip(of_each, near.any(axis=1), strict=True) if asked]
        )
        reach = NEAR * float(np.linalg.norm(upper.max(axis=0) - lower.min(axis=0)))
        outside, inner = np.empty_like(near), np.empty_like(near)
        room = np.empty(count, np.int64), np.empty((2, count), dtype=bool)
        rays = order, boxes, samples
        decided = sides_of_components(vertices, corners, component, *rays, near, reach, outside, inner, *room)
        on_both_sides = outside & inner
        found = found | on_both_sides | on_both_sides.T
        inside = inner & ~outside & ~found
        complete = complete and decided
    return Nesting(inside, found, int(within) if examined else None, bool(complete))
