# SPDX-License-Identifier: MIT
"""The ten moments of a mesh: measure, first and second moments at unit density, for each inertia model.

All models but the box are sums over vertices or triangles about a reference point near the bounding box's centre,
chosen so that subtracting it from a vertex never rounds. Far from the origin a mesh is therefore as accurate as at the
origin. With the reference point as the fourth corner, a triangle (a, b, c) spans a tetrahedron of signed volume d/6,
where d = a · (b − a) × (c − a), and with s = a + b + c (Tonon, J. Math. Stat. 1, 2005; Eberly, "Polyhedral mass
properties", 2002)

    ∫ 1 = d/6,   ∫ x = d/24 s,   ∫ x xᵀ = d/120 (s sᵀ + a aᵀ + b bᵀ + c cᵀ).

Over the triangle itself, of area A, the integrals are A, A/3 s and A/12 times the same bracket. d is computed from the
edges, not from the corners: its rounding error then decreases with the triangle's area and doesn't add up over a fine
mesh.

Sums are in the order 1, x, y, z, xx, xy, xz, yy, yz, zz, each a pair of doubles: its value and the rounding error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arithmetic import (
    exponent_of,
    fast_two_sum,
    pair_add,
    pair_divide,
    pair_multiply,
    scaled,
    two_product,
    two_sum,
)
from ..base.compilation import exported, local_matrix, local_numbers, matrix_of, njit, record_type
from ..base.errors import MeshError
from ..base.simd import Packed, filled, fused_multiply_add, load, number, store
from ..base.vectors import BoolArray, FloatArray, IntArray, Points, Triangles, Vector3
from . import INERTIA_MODELS

SMALL_MESH = 16
"""Up to this many triangles the compensated sums cost less than the call, so they are always used."""
ROUNDING_LIMIT = 5e-14
"""Estimated relative rounding error of the volume above which compensated sums are used. Below it the error of volume,
centroid and tensor was at most 1.1e-14 for 3,000 random convex hulls, many of them thin, and 548 parts of robots.
"""
_BLOCK = 256
"""Triangles whose plain sum is added to the total without error; their corners, 18 KB, stay in the L1 cache."""
ROOM = 9 * _BLOCK
"""Doubles of workspace for a solid's moments."""
_LANES = 8
"""Triangles of which every one is added to another sum; an order chosen by the compiler would depend on the processor.
"""
_HALF = _LANES // 2
_UNIT_ROUNDOFF = 2.0**-53
_UNSCALED = np.ones(3)

_Pair = tuple[Packed, Packed]  # the nearest doubles, and their rounding errors
_Point = tuple[float, float, float]


MOMENTS = record_type(
    [
        ("measure", np.float64),
        ("reference", np.float64, 3),
        ("center", np.float64, 3),
        ("center_low", np.float64, 3),
        ("second", np.float64, 6),
    ]
)
"""``Moments`` as kernels have it."""


@dataclass(frozen=True)
class Moments:
    """Mass distribution at unit density; lengths in mesh units. measure: volume, area or number of points. reference
    (3,): a point near the bounding box's centre. center (3,): centroid minus reference, and center_low (3,) its
    rounding error, to be added to it. second (6,): ∫ x xᵀ about the centroid in the order xx, xy, xz, yy, yz, zz.
    """

    measure: float
    reference: Vector3
    center: Vector3
    center_low: Vector3
    second: FloatArray

    @property
    def centroid(self) -> Vector3:
        """Centroid (3,) in mesh coordinates, without ``center_low``."""
        return self.reference + self.center

    @cached_property
    def record(self) -> np.record:
        """The same as MOMENTS."""
        numbers, record = _new_moments()
        numbers[0] = self.measure
        numbers[1:4], numbers[4:7] = self.reference, self.center
        numbers[7:10], numbers[10:] = self.center_low, self.second
        return record


def _new_moments() -> tuple[FloatArray, np.record]:
    """Memory for moments as numbers (16,), in their order, and as MOMENTS: fields by name take longer than a kernel."""
    numbers = np.zeros(16)
    record: np.record = numbers.view(MOMENTS)[0]
    return numbers, record


MODELS = INERTIA_MODELS[:-2]
"""Those that are moments of a mesh by themselves, by their numbers in kernels."""
SOLID, SHELL, POINTS, BOX = range(len(MODELS))
STRETCHED = ("shell",)
"""Models whose measure stretches depending on direction, so that a non-uniform scale needs a new pass."""

AS_NEEDED, PLAIN, IN_PAIRS = range(3)
"""How the solid's sums are computed."""

FOUND, NO_FACES, NO_VERTEX, NOT_FINITE, ONE_POINT, NO_VOLUME, NO_AREA = range(7)
"""Whether a mesh has the moments, and why not."""
_REASONS = {
    NO_FACES: "there are no faces; a surface has at least one triangle",
    NO_VERTEX: "a face uses a vertex outside 0 to {}",
    NOT_FINITE: "a vertex coordinate is not finite",
    ONE_POINT: "all vertices lie in one point",
    NO_VOLUME: "the surface encloses no volume",
    NO_AREA: "the surface has no area",
}


@njit(error_model="numpy", allocates=False)
def _bounds(points: Points, lower: Vector3, upper: Vector3) -> bool:
    """Fill the lower and upper corner (3,); False for coordinates that aren't finite."""
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    zero = 0.0  # or NaN
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        x0, y0, z0 = x if x < x0 else x0, y if y < y0 else y0, z if z < z0 else z0
        x1, y1, z1 = x if x > x1 else x1, y if y > y1 else y1, z if z > z1 else z1
        zero += (x - x) + (y - y) + (z - z)
    lower[0], lower[1], lower[2] = x0, y0, z0
    upper[0], upper[1], upper[2] = x1, y1, z1
    return zero == 0.0


@njit(error_model="numpy", allocates=False)
def _leads_outside(triangles: Triangles, count: int) -> bool:
    """Whether a triangle uses a vertex number outside 0 to ``count`` − 1."""
    signs, last = 0, count - 1
    for t in range(triangles.shape[0]):
        for k in range(3):
            signs |= triangles[t, k] | (last - triangles[t, k])
    return signs < 0


@exported("i8[:,:]", "b1[:]", returns="i8", nogil=True)
def mark_referenced(triangles: Triangles, used: BoolArray) -> int:
    """Mark in ``used`` (n,) the vertices that at least one of triangles (m, 3) uses; their number, or −1 where a
    triangle uses one outside 0 to n − 1.
    """
    count, vertex_count = 0, used.shape[0]
    for i in range(vertex_count):
        used[i] = False
    for t in range(triangles.shape[0]):
        for k in range(3):
            i = triangles[t, k]
            if i < 0 or i >= vertex_count:
                return -1
            used[i] = True
    for i in range(vertex_count):
        count += used[i]
    return count


@exported("f8[:,:]", "i8[:,:]", "b1[:]", "f8[:]", "f8[:]", returns="i8", nogil=True)
def bounding_box(vertices: Points, triangles: Triangles, used: BoolArray, lower: Vector3, upper: Vector3) -> int:
    """Fill the lower and upper corner (3,) of the vertices (n, 3) that triangles (m, 3) use; FOUND, or why there are
    none. ``used`` (n,) is filled as by ``mark_referenced``.
    """
    if triangles.shape[0] == 0 or vertices.shape[0] == 0:
        return NO_FACES
    if mark_referenced(triangles, used) < 0:
        return NO_VERTEX
    for k in range(3):
        lower[k], upper[k] = np.inf, -np.inf
    zero = 0.0  # or NaN
    for i in range(vertices.shape[0]):
        if used[i]:
            for k in range(3):
                x = vertices[i, k]
                lower[k], upper[k] = x if x < lower[k] else lower[k], x if x > upper[k] else upper[k]
                zero += x - x
    return FOUND if zero == 0.0 else NOT_FINITE


@njit(error_model="numpy", allocates=False)
def _exact_reference(lower: Vector3, upper: Vector3, reference: Vector3) -> tuple[float, float]:
    """Fill ``reference`` (3,): a point near the centre of a box from which the differences of all points in it are
    exact in double precision.

    Per axis: the centre c if the box's half extent is below |c|/2, since v − c is then exact (Sterbenz), otherwise 0.
    Returns the power of two that scales the largest |v − reference| to about 1, and that largest; for a box that is one
    point they are 0.
    """
    size = 0.0
    is_point = True
    for k in range(3):
        low, high = lower[k], upper[k]
        middle = 0.5 * low + 0.5 * high
        reference[k] = middle if 0.5 * high - 0.5 * low <= 0.49 * abs(middle) else 0.0
        size = max(size, abs(low - reference[k]), abs(high - reference[k]))
        is_point = is_point and low == high
    if is_point:
        return 0.0, 0.0
    return scaled(1.0, -exponent_of(size)), size


@njit(error_model="numpy", allocates=False)
def _central(
    sums: FloatArray,
    reference: Vector3,
    factor: float,
    divisors: tuple[float, float, float],
    dimension: int,
    found: np.record,
) -> bool:
    """Fill ``found``, MOMENTS, from the raw sums (10, 2) of (v − reference)·factor; dimension: that of the measure;
    divisors: of the measure, the first and the second moments.

    The subtraction that cancels is done in pairs. False if the measure is zero.
    """
    measure, measure_low = pair_divide(sums[0, 0], sums[0, 1], divisors[0], 0.0)
    if measure == 0.0:
        return False
    first, center = local_matrix(3, 2), local_matrix(3, 2)
    unit = 1.0
    for _ in range(dimension):
        unit /= factor
    found.measure = measure * unit
    for k in range(3):
        first[k, 0], first[k, 1] = pair_divide(sums[1 + k, 0], sums[1 + k, 1], divisors[1], 0.0)
        center[k, 0], center[k, 1] = pair_divide(first[k, 0], first[k, 1], measure, measure_low)
        found.reference[k] = reference[k]
        found.center[k], found.center_low[k] = center[k, 0] / factor, center[k, 1] / factor
    slot = 0
    for i in range(3):
        for j in range(i, 3):
            raw, raw_low = pair_divide(sums[4 + slot, 0], sums[4 + slot, 1], divisors[2], 0.0)
            moved, moved_low = pair_multiply(first[i, 0], first[i, 1], center[j, 0], center[j, 1])
            found.second[slot] = pair_add(raw, raw_low, -moved, -moved_low)[0] / factor / factor * unit
            slot += 1
    return bool(found.measure != 0.0)


@njit(error_model="numpy", allocates=False)
def _gather(vertices: Points, triangles: Triangles, start: int, corners: FloatArray) -> int:
    """Copy the corners a, b, c of the triangles from ``start`` on into the columns of ``corners`` (9, n).

    Returns their number, padded to a multiple of _LANES with triangles of zero size; −1 if one of them uses a vertex
    that isn't there.
    """
    last = vertices.shape[0] - 1
    count: int = min(corners.shape[1], triangles.shape[0] - start)
    for t in range(count):
        a, b, c = triangles[start + t, 0], triangles[start + t, 1], triangles[start + t, 2]
        if (a | b | c | (last - a) | (last - b) | (last - c)) < 0:
            return -1
        for k in range(3):
            corners[k, t], corners[3 + k, t], corners[6 + k, t] = vertices[a, k], vertices[b, k], vertices[c, k]
    whole = -(-count // _LANES) * _LANES
    for row in range(9):
        for t in range(count, whole):
            corners[row, t] = 0.0
    return whole


@njit(error_model="numpy", allocates=False)
def _corner(
    corners: FloatArray, corner: int, t: int, reference: Vector3, factor: float, zero: Packed
) -> tuple[Packed, ...]:
    """x, y and z of one corner of as many triangles as ``zero`` has lanes, relative to the reference in units of
    1/factor.
    """
    first = 3 * corner * corners.shape[1] + t
    x = load(corners, first, zero)
    y = load(corners, first + corners.shape[1], zero)
    z = load(corners, first + 2 * corners.shape[1], zero)
    return (x - reference[0]) * factor, (y - reference[1]) * factor, (z - reference[2]) * factor


@njit(error_model="numpy", allocates=False)
def _across(lanes: Packed) -> float:
    """The sum of four numbers, by halves (pairwise)."""
    return (number(lanes, 0) + number(lanes, 2)) + (number(lanes, 1) + number(lanes, 3))


@njit(error_model="numpy", allocates=False)
def _clear(sums: FloatArray) -> None:
    for k in range(10):
        sums[k, 0] = sums[k, 1] = 0.0


@njit(error_model="numpy", allocates=False)
def _add_across(sums: FloatArray, slot: int, lanes: Packed) -> None:
    """Add the sum of four numbers to one sum of ``sums`` (10, 2), without error."""
    sums[slot, 0], error = two_sum(sums[slot, 0], _across(lanes))
    sums[slot, 1] += error


@njit(error_model="numpy", allocates=False)
def _half_block(corners: FloatArray, first: int, whole: int, reference: Vector3, factor: float) -> tuple[Packed, ...]:
    """The ten sums of a block's triangles, and Σ(|b − a|² + |c − a|²), in _HALF lanes, from lane ``first`` on. The sums
    of all lanes at once wouldn't stay in the registers of most processors.
    """
    zero = filled(0.0, _HALF)
    v0, vx, vy, vz, size = zero, zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for t in range(first, whole, _LANES):
        ax, ay, az = _corner(corners, 0, t, reference, factor, zero)
        bx, by, bz = _corner(corners, 1, t, reference, factor, zero)
        cx, cy, cz = _corner(corners, 2, t, reference, factor, zero)
        ux, uy, uz = bx - ax, by - ay, bz - az
        wx, wy, wz = cx - ax, cy - ay, cz - az
        d = ax * (uy * wz - uz * wy) + ay * (uz * wx - ux * wz) + az * (ux * wy - uy * wx)
        sx, sy, sz = ax + bx + cx, ay + by + cy, az + bz + cz
        v0 = v0 + d
        vx = vx + d * sx
        vy = vy + d * sy
        vz = vz + d * sz
        xx = xx + d * (sx * sx + ax * ax + bx * bx + cx * cx)
        xy = xy + d * (sx * sy + ax * ay + bx * by + cx * cy)
        xz = xz + d * (sx * sz + ax * az + bx * bz + cx * cz)
        yy = yy + d * (sy * sy + ay * ay + by * by + cy * cy)
        yz = yz + d * (sy * sz + ay * az + by * bz + cy * cz)
        zz = zz + d * (sz * sz + az * az + bz * bz + cz * cz)
        size = size + (ux * ux + uy * uy + uz * uz + wx * wx + wy * wy + wz * wz)
    return v0, vx, vy, vz, xx, xy, xz, yy, yz, zz, size


@njit(error_model="numpy", allocates=False)
def _blocked_sums(
    vertices: Points, triangles: Triangles, reference: Vector3, factor: float, corners: FloatArray, sums: FloatArray
) -> float:
    """Add the solid's ten sums to ``sums`` (10, 2), zeros, in plain doubles, block by block; the sums of blocks are
    added without error. corners (9, _BLOCK): workspace.

    Returns Σ(|b − a|² + |c − a|²), which measures the rounding error of d; −1 if a triangle uses a vertex that isn't
    there.
    """
    edges = 0.0
    for start in range(0, triangles.shape[0], _BLOCK):
        whole = _gather(vertices, triangles, start, corners)
        if whole < 0:
            return -1.0
        one = _half_block(corners, 0, whole, reference, factor)
        other = _half_block(corners, _HALF, whole, reference, factor)
        _add_across(sums, 0, one[0] + other[0])
        _add_across(sums, 1, one[1] + other[1])
        _add_across(sums, 2, one[2] + other[2])
        _add_across(sums, 3, one[3] + other[3])
        _add_across(sums, 4, one[4] + other[4])
        _add_across(sums, 5, one[5] + other[5])
        _add_across(sums, 6, one[6] + other[6])
        _add_across(sums, 7, one[7] + other[7])
        _add_across(sums, 8, one[8] + other[8])
        _add_across(sums, 9, one[9] + other[9])
        edges += _across(one[10] + other[10])
    return edges


@njit(error_model="numpy", allocates=False)
def _plus(p: _Pair, q: _Pair) -> _Pair:
    return pair_add(p[0], p[1], q[0], q[1])


@njit(error_model="numpy", allocates=False)
def _times(p: _Pair, q: _Pair) -> _Pair:
    return pair_multiply(p[0], p[1], q[0], q[1])


@njit(error_model="numpy", allocates=False)
def _minor(p: _Pair, q: _Pair, r: _Pair, s: _Pair) -> _Pair:
    """p q − r s."""
    moved, moved_low = _times(r, s)
    return _plus(_times(p, q), (-moved, -moved_low))


@njit(error_model="numpy", allocates=False)
def _sum(a: tuple[Packed, ...], b: tuple[Packed, ...], sign: float) -> tuple[_Pair, ...]:
    """a + sign·b, exactly."""
    return two_sum(a[0], sign * b[0]), two_sum(a[1], sign * b[1]), two_sum(a[2], sign * b[2])


@njit(error_model="numpy", allocates=False)
def _scalar_product(a: tuple[_Pair, ...], b: tuple[_Pair, ...]) -> _Pair:
    return _plus(_plus(_times(a[0], b[0]), _times(a[1], b[1])), _times(a[2], b[2]))


@njit(error_model="numpy", allocates=False)
def _add(sums: FloatArray, slot: int, p: _Pair) -> None:
    """Add p to one sum of ``sums`` (20 · _LANES,): for each slot high parts, then low ones."""
    high = 2 * slot * _LANES
    total = load(sums, high, p[0]), load(sums, high + _LANES, p[0])
    total = _plus(total, p)
    store(sums, high, total[0])
    store(sums, high + _LANES, total[1])


@njit(error_model="numpy", allocates=False)
def _compensated_sums(
    vertices: Points, triangles: Triangles, reference: Vector3, factor: float, corners: FloatArray, sums: FloatArray
) -> bool:
    """Fill the solid's ten ``sums`` (10, 2) in pairs (about 104 bits), for bodies so thin that products of doubles
    round too much; relative to the reference every corner is exact. corners (9, _BLOCK): workspace. False if a triangle
    uses a vertex that isn't there.
    """
    of_lanes = local_numbers(160)
    for k in range(160):
        of_lanes[k] = 0.0
    zero = filled(0.0, _LANES)
    for start in range(0, triangles.shape[0], _BLOCK):
        whole = _gather(vertices, triangles, start, corners)
        if whole < 0:
            return False
        for t in range(0, whole, _LANES):
            a = _corner(corners, 0, t, reference, factor, zero)
            b = _corner(corners, 1, t, reference, factor, zero)
            c = _corner(corners, 2, t, reference, factor, zero)
            u, w = _sum(b, a, -1.0), _sum(c, a, -1.0)
            d = _times(_minor(u[1], w[2], u[2], w[1]), (a[0], zero))
            d = _plus(d, _times(_minor(u[2], w[0], u[0], w[2]), (a[1], zero)))
            d = _plus(d, _times(_minor(u[0], w[1], u[1], w[0]), (a[2], zero)))
            p, q, r = _sum(a, b, 1.0), _sum(b, c, 1.0), _sum(c, a, 1.0)
            _add(of_lanes, 0, d)
            _add(of_lanes, 1, _times(d, _plus(p[0], (c[0], zero))))
            _add(of_lanes, 2, _times(d, _plus(p[1], (c[1], zero))))
            _add(of_lanes, 3, _times(d, _plus(p[2], (c[2], zero))))
            x, y, z = (p[0], q[0], r[0]), (p[1], q[1], r[1]), (p[2], q[2], r[2])
            # s sᵀ + a aᵀ + b bᵀ + c cᵀ as (a + b)(a + b)ᵀ + (b + c)(b + c)ᵀ + (c + a)(c + a)ᵀ.
            _add(of_lanes, 4, _times(d, _scalar_product(x, x)))
            _add(of_lanes, 5, _times(d, _scalar_product(x, y)))
            _add(of_lanes, 6, _times(d, _scalar_product(x, z)))
            _add(of_lanes, 7, _times(d, _scalar_product(y, y)))
            _add(of_lanes, 8, _times(d, _scalar_product(y, z)))
            _add(of_lanes, 9, _times(d, _scalar_product(z, z)))
    for k in range(10):
        sums[k, 0] = sums[k, 1] = 0.0
        for lane in range(_LANES):
            at = 2 * k * _LANES + lane
            sums[k, 0], sums[k, 1] = pair_add(sums[k, 0], sums[k, 1], of_lanes[at], of_lanes[at + _LANES])
    return True


@exported("f8[:,:]", "i8[:,:]", "i8", "f8[:]", MOMENTS, returns="i8", nogil=True)
def signed_solid_moments(vertices: Points, triangles: Triangles, how: int, room: FloatArray, found: np.record) -> int:
    """Fill ``found`` with the moments of the solid as it is wound, see ``solid_moments``; FOUND, or why there are none.

    how: AS_NEEDED, PLAIN or IN_PAIRS. room: memory for ROOM doubles.
    """
    if triangles.shape[0] == 0 or vertices.shape[0] == 0:
        return NO_FACES
    lower, upper, reference, sums = local_numbers(3), local_numbers(3), local_numbers(3), local_matrix(10, 2)
    is_finite = _bounds(vertices, lower, upper)
    factor, size = _exact_reference(lower, upper, reference)
    if not is_finite or size == 0.0:
        if _leads_outside(triangles, vertices.shape[0]):
            return NO_VERTEX
        return NOT_FINITE if not is_finite else ONE_POINT
    corners, in_pairs = matrix_of(room, 9, _BLOCK), how == IN_PAIRS
    if how == AS_NEEDED:
        in_pairs = triangles.shape[0] <= SMALL_MESH
    if not in_pairs:
        _clear(sums)
        edges = _blocked_sums(vertices, triangles, reference, factor, corners, sums)
        if edges < 0.0:
            return NO_VERTEX
        rounding = _UNIT_ROUNDOFF * (size * factor) * 0.5 * edges
        in_pairs = how == AS_NEEDED and not rounding <= ROUNDING_LIMIT * abs(sums[0, 0])
    if in_pairs and not _compensated_sums(vertices, triangles, reference, factor, corners, sums):
        return NO_VERTEX
    return FOUND if _central(sums, reference, factor, (6.0, 24.0, 120.0), 3, found) else NO_VOLUME


@njit(error_model="numpy", allocates=False)
def _point(points: Points, i: int) -> _Point:
    return points[i, 0], points[i, 1], points[i, 2]


@njit(error_model="numpy", allocates=False)
def _normal(points: Points, triangle: IntArray) -> _Point:
    """The triangle's normal; its length is twice the area."""
    a, b, c = _point(points, triangle[0]), _point(points, triangle[1]), _point(points, triangle[2])
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx


@njit(error_model="numpy", allocates=False)
def _add_number(sums: FloatArray, slot: int, x: float) -> None:
    """Add x to one sum of ``sums`` (10, 2)."""
    sums[slot, 0], sums[slot, 1] = pair_add(sums[slot, 0], sums[slot, 1], x, 0.0)


@njit(error_model="numpy", allocates=False)
def _shell_sums(points: Points, triangles: Triangles, starts: IntArray, sums: FloatArray) -> None:
    """Add the ten sums to ``sums`` (10, 2), zeros. Polygon k consists of the triangles starts[k] to starts[k + 1] − 1,
    a fan; without ``starts`` each triangle is one.
    """
    is_fan = starts.shape[0] > 0
    for polygon in range(starts.shape[0] - 1 if is_fan else triangles.shape[0]):
        begin, end = (starts[polygon], starts[polygon + 1]) if is_fan else (polygon, polygon + 1)
        mx = my = mz = 0.0  # twice the Newell normal: the fan triangles' normals add up to it
        for t in range(begin, end):
            nx, ny, nz = _normal(points, triangles[t])
            mx, my, mz = mx + nx, my + ny, mz + nz
        for t in range(begin, end):
            nx, ny, nz = _normal(points, triangles[t])
            area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            if mx * nx + my * ny + mz * nz < 0.0:
                area = -area
            a, b, c = _point(points, triangles[t, 0]), _point(points, triangles[t, 1]), _point(points, triangles[t, 2])
            x, y, z = a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2]
            _add_number(sums, 0, area)
            _add_number(sums, 1, area * x)
            _add_number(sums, 2, area * y)
            _add_number(sums, 3, area * z)
            _add_number(sums, 4, area * (x * x + a[0] * a[0] + b[0] * b[0] + c[0] * c[0]))
            _add_number(sums, 5, area * (x * y + a[0] * a[1] + b[0] * b[1] + c[0] * c[1]))
            _add_number(sums, 6, area * (x * z + a[0] * a[2] + b[0] * b[2] + c[0] * c[2]))
            _add_number(sums, 7, area * (y * y + a[1] * a[1] + b[1] * b[1] + c[1] * c[1]))
            _add_number(sums, 8, area * (y * z + a[1] * a[2] + b[1] * b[2] + c[1] * c[2]))
            _add_number(sums, 9, area * (z * z + a[2] * a[2] + b[2] * b[2] + c[2] * c[2]))


@njit(error_model="numpy", allocates=False)
def _put_back(found: np.record, stretch: Vector3, base: Vector3) -> None:
    """Add the stretched ``base`` (3,), about which ``found`` is, to its reference: the nearest doubles, and what they
    lack to ``center_low``.

    The rest of a fused multiply-add is a sum of two doubles (Boldo and Muller, "Exact and approximated error of the
    FMA", IEEE Trans. Comput. 60, 2011), while a product is exact in two.
    """
    for k in range(3):
        r = found.reference[k]
        near = fused_multiply_add(base[k], stretch[k], r)
        product, product_low = two_product(base[k], stretch[k])
        s, s_low = two_sum(r, product_low)
        t, t_low = two_sum(product, s)
        rest, _ = fast_two_sum((t - near) + t_low, s_low)
        found.reference[k] = near
        found.center_low[k] += rest


@njit(error_model="numpy", allocates=False)
def shell_moments(
    vertices: Points, triangles: Triangles, starts: IntArray, scale: Vector3, points: Points, found: np.record
) -> int:
    """The shell's part of ``moments_of``, which ``walls`` needs, too; points (n, 3): workspace."""
    stretch, base, reference = local_numbers(3), local_numbers(3), local_numbers(3)
    lower, upper, sums = local_numbers(3), local_numbers(3), local_matrix(10, 2)
    is_stretched = False
    for k in range(3):
        stretch[k] = abs(scale[k]) / abs(scale[0])
        is_stretched = is_stretched or stretch[k] != 1.0
    if _leads_outside(triangles, vertices.shape[0]):
        return NO_VERTEX
    for k in range(3):
        base[k] = vertices[triangles[0, 0], k]
    for i in range(vertices.shape[0]):
        for k in range(3):
            # About a vertex: far from the origin the products would round.
            points[i, k] = (vertices[i, k] - base[k]) * stretch[k] if is_stretched else vertices[i, k]
    if not _bounds(points, lower, upper):
        return NOT_FINITE
    factor, size = _exact_reference(lower, upper, reference)
    if size == 0.0:
        return ONE_POINT
    for i in range(vertices.shape[0]):
        for k in range(3):
            points[i, k] = (points[i, k] - reference[k]) * factor
    _clear(sums)
    _shell_sums(points, triangles, starts, sums)
    if not _central(sums, reference, factor, (1.0, 3.0, 12.0), 2, found):
        return NO_AREA
    if is_stretched:
        _put_back(found, stretch, base)
    return FOUND


@njit(error_model="numpy", allocates=False)
def _points(vertices: Points, used: BoolArray, lower: Vector3, upper: Vector3, found: np.record) -> int:
    """The points' part of ``moments_of``, for vertices within a box."""
    reference, sums = local_numbers(3), local_matrix(10, 2)
    factor, size = _exact_reference(lower, upper, reference)
    if size == 0.0:
        return ONE_POINT
    count = 0
    _clear(sums)
    for i in range(vertices.shape[0]):
        if used[i]:
            x = (vertices[i, 0] - reference[0]) * factor
            y = (vertices[i, 1] - reference[1]) * factor
            z = (vertices[i, 2] - reference[2]) * factor
            count += 1
            _add_number(sums, 1, x)
            _add_number(sums, 2, y)
            _add_number(sums, 3, z)
            _add_number(sums, 4, x * x)
            _add_number(sums, 5, x * y)
            _add_number(sums, 6, x * z)
            _add_number(sums, 7, y * y)
            _add_number(sums, 8, y * z)
            _add_number(sums, 9, z * z)
    sums[0, 0] = count
    _central(sums, reference, factor, (1.0, 1.0, 1.0), 0, found)
    return FOUND


@njit(error_model="numpy", allocates=False)
def _box(lower: Vector3, upper: Vector3, found: np.record) -> None:
    """The moments of a box as a solid cuboid."""
    x, y, z = upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]
    volume = x * y * z
    # A flat box has no volume, but a mass distribution: its measure is then 1.
    measure = volume if volume > 0.0 else 1.0
    found.measure = measure
    for k in range(3):
        found.reference[k], found.center[k], found.center_low[k] = 0.5 * lower[k] + 0.5 * upper[k], 0.0, 0.0
    for k in range(6):
        found.second[k] = 0.0
    found.second[0] = measure * (x * x) / 12.0
    found.second[3] = measure * (y * y) / 12.0
    found.second[5] = measure * (z * z) / 12.0


@exported("i8", "f8[:,:]", "i8[:,:]", "i8[:]", "f8[:]", "b1[:]", "f8[:]", MOMENTS, returns="i8", nogil=True)
def moments_of(
    model: int,
    vertices: Points,
    triangles: Triangles,
    starts: IntArray,
    scale: Vector3,
    used: BoolArray,
    room: FloatArray,
    found: np.record,
) -> int:
    """Fill ``found`` with the moments of a model, see ``mesh_moments``; FOUND, or why there are none.

    starts: empty where each triangle is a polygon. used (n,): workspace of POINTS and BOX; room: memory for ROOM
    doubles of SOLID, for 3 n of SHELL.
    """
    if model == SOLID:
        code = signed_solid_moments(vertices, triangles, AS_NEEDED, room, found)
        if code == FOUND and not found.measure >= 0.0:
            found.measure = -found.measure
            for k in range(6):
                found.second[k] = -found.second[k]
        return code
    if triangles.shape[0] == 0 or vertices.shape[0] == 0:
        return NO_FACES
    if model == SHELL:
        return shell_moments(vertices, triangles, starts, scale, matrix_of(room, vertices.shape[0], 3), found)
    lower, upper = local_numbers(3), local_numbers(3)
    code = bounding_box(vertices, triangles, used, lower, upper)
    if code != FOUND:
        return code
    if model == POINTS:
        return _points(vertices, used, lower, upper, found)
    _box(lower, upper, found)
    return FOUND


@njit(error_model="numpy", allocates=False)
def largest_effect(solid: np.record, added: float, first: float, second: float) -> float:
    """The largest change of volume, relative to itself, or of the tensor, relative to its largest entry, if a solid's
    volume, first and second moments change by at most ``added``, ``first`` and ``second``; -1 where nothing can be
    said.
    """
    volume: float = abs(solid.measure)
    if not added < volume:
        return -1.0
    xx, yy, zz = abs(solid.second[0]), abs(solid.second[3]), abs(solid.second[5])
    shifted = first * first / (volume - added)
    of_tensor: float = (second + shifted) / max(yy + zz, xx + zz, xx + yy)
    return max(added / volume, of_tensor)


@exported("f8[:,:]", "i8[:,:]", "f8", MOMENTS, returns="f8", nogil=True)
def effect_of_strips(vertices: Points, edges: IntArray, width: float, solid: np.record) -> float:
    """The largest effect, see ``largest_effect``, that any way to close a solid by strips along the open ones of its
    edges (e, 6) can have, if opposite corners lie at most ``width`` apart: -1 where nothing can be said.

    A strip's area is at most (length + width) · width. Relative to the centroid, an element dA at the distance r adds
    at most r dA/3 to the volume, r² dA/4 to the first and r³ dA/5 to the second moments.
    """
    far, whole = 0.0, 0.0
    for e in range(edges.shape[0]):
        if (edges[e, 2] + edges[e, 3]) & 1:
            length, near, distant = 0.0, 0.0, 0.0  # squares
            for k in range(3):
                a, b = vertices[edges[e, 0], k], vertices[edges[e, 1], k]
                middle = solid.reference[k] + solid.center[k]
                length += (b - a) * (b - a)
                near += (a - middle) * (a - middle)
                distant += (b - middle) * (b - middle)
            whole += (math.sqrt(length) + width) * width
            far = max(far, near, distant)
    reach = math.sqrt(far) + width
    return largest_effect(solid, whole * reach / 3.0, whole * reach * reach / 4.0, whole * reach * reach * reach / 5.0)


def _moments(code: int, numbers: FloatArray, vertices: Points) -> Moments:
    """What a kernel has found, numbers (16,); raises MeshError where there is nothing."""
    if code != FOUND:
        raise MeshError("mesh", _REASONS[code].format(len(vertices) - 1))
    return Moments(float(numbers[0]), numbers[1:4], numbers[4:7], numbers[7:10], numbers[10:])


def solid_moments(vertices: Points, triangles: Triangles, *, compensated: bool | None = None) -> Moments:
    """Moments of the solid bounded by ``triangles`` (m, 3) over ``vertices`` (n, 3), accurate to about 1e-14.

    Signed: a surface wound inward gives a negative volume and negative second moments. One pass in plain doubles; where
    the estimated rounding ε·size·Σ|edge|²/V is too large (thin bodies, few triangles) a pass in pairs of doubles is
    used; always or never if ``compensated`` says so. Raises MeshError for an empty or non-finite mesh, a vertex number
    out of range, or zero volume.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    numbers, found = _new_moments()
    how = AS_NEEDED if compensated is None else IN_PAIRS if compensated else PLAIN
    return _moments(signed_solid_moments(vertices, triangles, how, np.empty(ROOM), found), numbers, vertices)


def mesh_moments(
    model: str,
    vertices: Points,
    triangles: Triangles,
    polygon_starts: IntArray | None = None,
    scale: FloatArray = _UNSCALED,
) -> Moments:
    """Moments of one of MODELS for ``triangles`` (m, 3) over ``vertices`` (n, 3).

    solid: as ``solid_moments``, of the same solid wound outward.

    shell: the surface, of uniform thickness; its measure is its area. polygon_starts (p + 1,) says which fan triangles
    form a polygon; None if each triangle is one. A fan triangle of a concave polygon that lies outside it counts
    negative: its sign is that of its normal relative to the polygon's Newell normal. scale (3,): the moments are those
    of the surface stretched by |scale|/|scale_x|.

    points: equal point masses at the vertices that triangles use, the measure being their number (the 2019 paper's
    eq. 7). bounding_box: that of these vertices as a solid cuboid (its eq. 8, centred on the box).

    Raises MeshError for an empty mesh, a vertex number out of range, coordinates that aren't finite, and where there is
    no volume or area.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    starts = np.empty(0, np.int64) if polygon_starts is None else np.ascontiguousarray(polygon_starts, np.int64)
    number = MODELS.index(model)
    numbers, found = _new_moments()
    used, room = np.empty(len(vertices), np.bool_), np.empty(max(ROOM, 3 * len(vertices)))
    return _moments(moments_of(number, vertices, triangles, starts, scale, used, room, found), numbers, vertices)


def extent(vertices: Points, triangles: Triangles) -> tuple[Vector3, Vector3, int]:
    """Lower and upper corner (3,) of the box around the vertices (n, 3) that triangles (m, 3) use, and how many these
    are; raises MeshError where there are none, for coordinates of theirs that aren't finite, and for a vertex number
    out of range.
    """
    used, lower, upper = np.empty(len(vertices), np.bool_), np.empty(3), np.empty(3)
    vertices, triangles = np.ascontiguousarray(vertices), np.ascontiguousarray(triangles, dtype=np.int64)
    code = bounding_box(vertices, triangles, used, lower, upper)
    if code != FOUND:
        raise MeshError("mesh", _REASONS[code].format(len(vertices) - 1))
    return lower, upper, int(np.count_nonzero(used))


def referenced_vertices(vertices: Points, triangles: Triangles) -> Points:
    """The vertices (k, 3) that at least one triangle uses, in the file's order; raises MeshError for a vertex number
    out of range.
    """
    used = np.empty(len(vertices), np.bool_)
    count = mark_referenced(np.ascontiguousarray(triangles, dtype=np.int64), used)
    if count < 0:
        raise MeshError("mesh", _REASONS[NO_VERTEX].format(len(vertices) - 1))
    return vertices if count == len(vertices) else vertices[used]
