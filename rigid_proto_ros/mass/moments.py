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
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arithmetic import pair_add, pair_divide, pair_multiply, two_sum
from ..base.compilation import new_record, njit, record_type
from ..base.errors import MeshError
from ..base.simd import Packed, filled, load, number, store
from ..base.vectors import FloatArray, IntArray, Points, Triangles, Vector3

SMALL_MESH = 16
"""Up to this many triangles the compensated sums cost less than the call, so they are always used."""
ROUNDING_LIMIT = 5e-14
"""Estimated relative rounding error of the volume above which compensated sums are used. Below it the error of volume,
centroid and tensor was at most 1.1e-14 for 3,000 random convex hulls, many of them thin, and 548 parts of robots.
"""
_BLOCK = 256
"""Triangles whose plain sum is added to the total without error; their corners, 18 KB, stay in the L1 cache."""
_LANES = 8
"""Triangles processed together in vector registers; an order chosen by the compiler would depend on the processor."""
_UNIT_ROUNDOFF = 2.0**-53

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

    @property
    def record(self) -> np.record:
        """The same as MOMENTS."""
        found = new_record(MOMENTS)
        for name in MOMENTS.names or ():
            found[name] = getattr(self, name)
        return found

    def outward(self) -> Moments:
        """The moments of the same solid wound outward."""
        return self if self.measure >= 0.0 else replace(self, measure=-self.measure, second=-self.second)


@njit(nogil=True)
def _bounds(points: Points) -> tuple[_Point, _Point]:
    """Lower and upper corner; raises MeshError for coordinates that aren't finite."""
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    zero = 0.0  # or NaN
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        x0, y0, z0 = x if x < x0 else x0, y if y < y0 else y0, z if z < z0 else z0
        x1, y1, z1 = x if x > x1 else x1, y if y > y1 else y1, z if z > z1 else z1
        zero += (x - x) + (y - y) + (z - z)
    if zero != 0.0:
        raise MeshError("mesh", "a vertex coordinate is not finite")
    return (x0, y0, z0), (x1, y1, z1)


@njit(nogil=True)
def _leads_outside(triangles: Triangles, count: int) -> bool:
    """Whether a triangle uses a vertex number outside 0 to ``count`` − 1."""
    vertex: Any
    signs, last = 0, count - 1
    for vertex in triangles.ravel():  # contiguous, so that this makes no copy
        signs |= vertex | (last - vertex)
    return signs < 0


def _checked(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64, contiguous; raises MeshError for an empty mesh and for a
    vertex number out of range.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    if triangles.shape[0] == 0 or vertices.shape[0] == 0:
        raise MeshError("mesh", "there are no faces; a surface has at least one triangle")
    if _leads_outside(triangles, vertices.shape[0]):
        raise MeshError("mesh", f"a face uses a vertex outside 0 to {vertices.shape[0] - 1}")
    return vertices, triangles


@njit(nogil=True)
def _exact_reference(vertices: Points) -> tuple[Vector3, float, float]:
    """A point near the bounding box's centre from which the differences of all vertices are exact in double precision.

    Per axis: the centre c if the box's half extent is below |c|/2, since v − c is then exact (Sterbenz), otherwise 0.
    Returns the reference (3,), the power of two that scales the largest |v − reference| to about 1, and that largest.
    Raises MeshError for coordinates that aren't finite, and for vertices all in one point.
    """
    lower, upper = _bounds(vertices)
    reference, size = np.zeros(3), 0.0
    for k in range(3):
        low, high = lower[k], upper[k]
        middle = 0.5 * low + 0.5 * high
        if 0.5 * high - 0.5 * low <= 0.49 * abs(middle):
            reference[k] = middle
        size = max(size, abs(low - reference[k]), abs(high - reference[k]))
    if lower == upper:
        raise MeshError("mesh", "all vertices lie in one point")
    return reference, math.ldexp(1.0, -math.frexp(size)[1]), size


@njit(nogil=True)
def _central(
    sums: FloatArray,
    reference: Vector3,
    factor: float,
    divisors: tuple[float, float, float],
    dimension: int,
    numbers: FloatArray,
) -> None:
    """Compute the numbers (16,) of Moments, in its order, from the raw sums (10, 2) of (v − reference)·factor;
    dimension: that of the measure; divisors: of the measure, the first and the second moments.

    The subtraction that cancels is done in pairs. If the measure is zero, the numbers stay unchanged.
    """
    first, center = np.zeros((3, 2)), np.zeros((3, 2))
    measure, measure_low = pair_divide(sums[0, 0], sums[0, 1], divisors[0], 0.0)
    if measure == 0.0:
        return
    unit = 1.0
    for _ in range(dimension):
        unit /= factor
    numbers[0] = measure * unit
    for k in range(3):
        first[k] = pair_divide(sums[1 + k, 0], sums[1 + k, 1], divisors[1], 0.0)
        center[k] = pair_divide(first[k, 0], first[k, 1], measure, measure_low)
        numbers[1 + k], numbers[4 + k], numbers[7 + k] = reference[k], center[k, 0] / factor, center[k, 1] / factor
    slot = 0
    for i in range(3):
        for j in range(i, 3):
            raw, raw_low = pair_divide(sums[4 + slot, 0], sums[4 + slot, 1], divisors[2], 0.0)
            moved, moved_low = pair_multiply(first[i, 0], first[i, 1], center[j, 0], center[j, 1])
            numbers[10 + slot] = pair_add(raw, raw_low, -moved, -moved_low)[0] / factor / factor * unit
            slot += 1


def _moments(numbers: FloatArray, no_measure: str) -> Moments:
    """Of the numbers by ``_central``; raises MeshError, which says ``no_measure``, if the measure is 0."""
    if numbers[0] == 0.0:
        raise MeshError("mesh", no_measure)
    return Moments(float(numbers[0]), numbers[1:4], numbers[4:7], numbers[7:10], numbers[10:])


@njit(nogil=True)
def _gather(vertices: Points, triangles: Triangles, start: int, corners: FloatArray) -> int:
    """Copy the corners a, b, c of the triangles from ``start`` on into the columns of ``corners`` (9, n).

    Returns their number, padded to a multiple of _LANES with triangles of zero size.
    """
    count: int = min(corners.shape[1], triangles.shape[0] - start)
    for t in range(count):
        for corner in range(3):
            i = triangles[start + t, corner]
            for k in range(3):
                corners[3 * corner + k, t] = vertices[i, k]
    whole = -(-count // _LANES) * _LANES
    corners[:, count:whole] = 0.0
    return whole


@njit(nogil=True)
def _corner(corners: FloatArray, corner: int, t: int, reference: Vector3, factor: float) -> tuple[Packed, ...]:
    """x, y and z of one corner of _LANES triangles, relative to the reference in units of 1/factor."""
    zero, first = filled(0.0, _LANES), 3 * corner * corners.shape[1] + t
    x = load(corners, first, zero)
    y = load(corners, first + corners.shape[1], zero)
    z = load(corners, first + 2 * corners.shape[1], zero)
    return (x - reference[0]) * factor, (y - reference[1]) * factor, (z - reference[2]) * factor


@njit(nogil=True)
def _across(lanes: Packed) -> float:
    """The sum of eight numbers, by halves (pairwise)."""
    even = (number(lanes, 0) + number(lanes, 4)) + (number(lanes, 2) + number(lanes, 6))
    return even + ((number(lanes, 1) + number(lanes, 5)) + (number(lanes, 3) + number(lanes, 7)))


@njit(nogil=True)
def _blocked_sums(
    vertices: Points, triangles: Triangles, reference: Vector3, factor: float
) -> tuple[FloatArray, float]:
    """The solid's ten sums (10, 2) in plain doubles, block by block; the sums of blocks are added without error.

    Also Σ(|b − a|² + |c − a|²), which measures the rounding error of d.
    """
    sums = np.zeros((10, 2))
    edges = 0.0
    corners = np.empty((9, _BLOCK))
    zero = filled(0.0, _LANES)
    for start in range(0, triangles.shape[0], _BLOCK):
        v0, vx, vy, vz, size = zero, zero, zero, zero, zero
        xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
        for t in range(0, _gather(vertices, triangles, start, corners), _LANES):
            ax, ay, az = _corner(corners, 0, t, reference, factor)
            bx, by, bz = _corner(corners, 1, t, reference, factor)
            cx, cy, cz = _corner(corners, 2, t, reference, factor)
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
        block = (v0, vx, vy, vz, xx, xy, xz, yy, yz, zz)
        for k in range(10):
            sums[k, 0], error = two_sum(sums[k, 0], _across(block[k]))
            sums[k, 1] += error
        edges += _across(size)
    return sums, edges


@njit(nogil=True)
def _plus(p: _Pair, q: _Pair) -> _Pair:
    return pair_add(p[0], p[1], q[0], q[1])


@njit(nogil=True)
def _times(p: _Pair, q: _Pair) -> _Pair:
    return pair_multiply(p[0], p[1], q[0], q[1])


@njit(nogil=True)
def _minor(p: _Pair, q: _Pair, r: _Pair, s: _Pair) -> _Pair:
    """p q − r s."""
    moved, moved_low = _times(r, s)
    return _plus(_times(p, q), (-moved, -moved_low))


@njit(nogil=True)
def _sum(a: tuple[Packed, ...], b: tuple[Packed, ...], sign: float) -> tuple[_Pair, ...]:
    """a + sign·b, exactly."""
    return two_sum(a[0], sign * b[0]), two_sum(a[1], sign * b[1]), two_sum(a[2], sign * b[2])


@njit(nogil=True)
def _scalar_product(a: tuple[_Pair, ...], b: tuple[_Pair, ...]) -> _Pair:
    return _plus(_plus(_times(a[0], b[0]), _times(a[1], b[1])), _times(a[2], b[2]))


@njit(nogil=True)
def _add(sums: FloatArray, slot: int, p: _Pair) -> None:
    """Add p to one sum of ``sums`` (10, 2, _LANES)."""
    high = 2 * slot * _LANES
    total = load(sums, high, p[0]), load(sums, high + _LANES, p[0])
    total = _plus(total, p)
    store(sums, high, total[0])
    store(sums, high + _LANES, total[1])


@njit(nogil=True)
def _compensated_sums(vertices: Points, triangles: Triangles, reference: Vector3, factor: float) -> FloatArray:
    """The solid's ten sums (10, 2) in pairs (about 104 bits), for bodies so thin that products of doubles round too
    much; relative to the reference every corner is exact."""
    of_lanes = np.zeros((10, 2, _LANES))
    corners = np.empty((9, _BLOCK))
    zero = filled(0.0, _LANES)
    for start in range(0, triangles.shape[0], _BLOCK):
        for t in range(0, _gather(vertices, triangles, start, corners), _LANES):
            a = _corner(corners, 0, t, reference, factor)
            b = _corner(corners, 1, t, reference, factor)
            c = _corner(corners, 2, t, reference, factor)
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
    sums = np.zeros((10, 2))
    for k in range(10):
        for lane in range(_LANES):
            sums[k] = pair_add(sums[k, 0], sums[k, 1], of_lanes[k, 0, lane], of_lanes[k, 1, lane])
    return sums


@njit(nogil=True)
def _solid(vertices: Points, triangles: Triangles, chooses: bool, in_pairs: bool, numbers: FloatArray) -> None:
    """Compute the solid's ``numbers`` as in ``_central``, its sums in pairs of doubles or not, or as needed."""
    reference, factor, size = _exact_reference(vertices)
    sums = np.zeros((10, 2))
    if chooses:
        in_pairs = triangles.shape[0] <= SMALL_MESH
    if not in_pairs:
        sums, edges = _blocked_sums(vertices, triangles, reference, factor)
        rounding = _UNIT_ROUNDOFF * (size * factor) * 0.5 * edges
        in_pairs = chooses and not rounding <= ROUNDING_LIMIT * abs(sums[0, 0])
    if in_pairs:
        sums = _compensated_sums(vertices, triangles, reference, factor)
    _central(sums, reference, factor, (6.0, 24.0, 120.0), 3, numbers)


def solid_moments(vertices: Points, triangles: Triangles, *, compensated: bool | None = None) -> Moments:
    """Moments of the solid bounded by ``triangles`` (m, 3) over ``vertices`` (n, 3), accurate to about 1e-14.

    Signed: a surface wound inward gives a negative volume and negative second moments. One pass in plain doubles; where
    the estimated rounding ε·size·Σ|edge|²/V is too large (thin bodies, few triangles) a pass in pairs of doubles is
    used; always or never if ``compensated`` says so. Raises MeshError for an empty or non-finite mesh, a vertex number
    out of range, or zero volume.
    """
    vertices, triangles = _checked(vertices, triangles)
    numbers = np.zeros(16)
    _solid(vertices, triangles, compensated is None, bool(compensated), numbers)
    return _moments(numbers, "the surface encloses no volume")


@njit(nogil=True)
def _point(points: Points, i: int) -> _Point:
    return points[i, 0], points[i, 1], points[i, 2]


@njit(nogil=True)
def _normal(points: Points, triangle: IntArray) -> _Point:
    """The triangle's normal; its length is twice the area."""
    a, b, c = _point(points, triangle[0]), _point(points, triangle[1]), _point(points, triangle[2])
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx


@njit(nogil=True)
def _shell_sums(points: Points, triangles: Triangles, starts: IntArray) -> FloatArray:
    """The ten sums (10, 2) over polygons; polygon k consists of the triangles starts[k] to starts[k + 1] − 1, a fan."""
    sums = np.zeros((10, 2))
    for polygon in range(starts.shape[0] - 1):
        mx = my = mz = 0.0  # twice the Newell normal: the fan triangles' normals add up to it
        for t in range(starts[polygon], starts[polygon + 1]):
            nx, ny, nz = _normal(points, triangles[t])
            mx, my, mz = mx + nx, my + ny, mz + nz
        for t in range(starts[polygon], starts[polygon + 1]):
            nx, ny, nz = _normal(points, triangles[t])
            area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            if mx * nx + my * ny + mz * nz < 0.0:
                area = -area
            a, b, c = _point(points, triangles[t, 0]), _point(points, triangles[t, 1]), _point(points, triangles[t, 2])
            s = (a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2])
            sums[0] = pair_add(sums[0, 0], sums[0, 1], area, 0.0)
            slot = 4
            for i in range(3):
                sums[1 + i] = pair_add(sums[1 + i, 0], sums[1 + i, 1], area * s[i], 0.0)
                for j in range(i, 3):
                    bracket = s[i] * s[j] + a[i] * a[j] + b[i] * b[j] + c[i] * c[j]
                    sums[slot] = pair_add(sums[slot, 0], sums[slot, 1], area * bracket, 0.0)
                    slot += 1
    return sums


def shell_moments(vertices: Points, triangles: Triangles, polygon_starts: IntArray | None = None) -> Moments:
    """Moments of the surface as a thin shell of uniform thickness; the measure is its area.

    vertices (n, 3), triangles (m, 3); polygon_starts (p + 1,) says which fan triangles form a polygon; None if each
    triangle is one. A fan triangle of a concave polygon that lies outside it counts negative: its sign is that of its
    normal relative to the polygon's Newell normal. Raises MeshError for an empty mesh, non-finite vertices, or zero
    area.
    """
    vertices, triangles = _checked(vertices, triangles)
    reference, factor, _ = _exact_reference(vertices)
    starts = np.arange(len(triangles) + 1) if polygon_starts is None else np.asarray(polygon_starts, np.int64)
    sums, numbers = _shell_sums((vertices - reference) * factor, triangles, starts), np.zeros(16)
    _central(sums, reference, factor, (1.0, 3.0, 12.0), 2, numbers)
    return _moments(numbers, "the surface has no area")


def referenced_vertices(vertices: Points, triangles: Triangles) -> Points:
    """The vertices (k, 3) that at least one triangle uses, in the file's order."""
    used = np.zeros(vertices.shape[0], dtype=bool)
    used[triangles.ravel()] = True
    return vertices if used.all() else vertices[used]


@njit(nogil=True)
def _point_sums(points: Points) -> FloatArray:
    sums = np.zeros((10, 2))
    sums[0, 0] = points.shape[0]
    for t in range(points.shape[0]):
        x = _point(points, t)
        slot = 4
        for i in range(3):
            sums[1 + i] = pair_add(sums[1 + i, 0], sums[1 + i, 1], x[i], 0.0)
            for j in range(i, 3):
                sums[slot] = pair_add(sums[slot, 0], sums[slot, 1], x[i] * x[j], 0.0)
                slot += 1
    return sums


def point_moments(vertices: Points, triangles: Triangles) -> Moments:
    """Equal point masses at the referenced vertices, the measure being their number (the 2019 paper's eq. 7)."""
    vertices, triangles = _checked(vertices, triangles)
    points = referenced_vertices(vertices, triangles)
    reference, factor, _ = _exact_reference(points)
    sums, numbers = _point_sums((points - reference) * factor), np.zeros(16)
    _central(sums, reference, factor, (1.0, 1.0, 1.0), 0, numbers)
    return _moments(numbers, "there are no points")


def box_moments(vertices: Points, triangles: Triangles) -> Moments:
    """The bounding box of the referenced vertices as a solid cuboid (the 2019 paper's eq. 8, centred on the box)."""
    vertices, triangles = _checked(vertices, triangles)
    lower, upper = _bounds(referenced_vertices(vertices, triangles))
    low, high = np.array(lower), np.array(upper)
    side = high - low
    volume = float(side[0] * side[1] * side[2])
    second = np.zeros(6)
    # A flat box has no volume, but a mass distribution: its measure is then 1.
    measure = volume if volume > 0.0 else 1.0
    second[[0, 3, 5]] = measure * (side * side) / 12.0
    return Moments(measure, 0.5 * low + 0.5 * high, np.zeros(3), np.zeros(3), second)


MODELS: dict[str, Callable[[Points, Triangles, IntArray | None], Moments]] = {
    "solid": lambda vertices, triangles, _: solid_moments(vertices, triangles).outward(),
    "shell": shell_moments,
    "points": lambda vertices, triangles, _: point_moments(vertices, triangles),
    "bounding_box": lambda vertices, triangles, _: box_moments(vertices, triangles),
}
"""The moments of each of INERTIA_MODELS that a mesh has, as functions of vertices, triangles and polygon_starts."""
STRETCHED = ("shell",)
"""Models whose measure stretches depending on direction, so that a non-uniform scale needs a new pass."""
