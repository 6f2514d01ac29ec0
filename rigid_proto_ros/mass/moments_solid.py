# SPDX-License-Identifier: MIT
"""The polyhedron's integrals of 1, x and x xᵀ as sums over signed tetrahedra, in two precisions.

With the reference point as the fourth corner, a triangle (a, b, c) spans a tetrahedron of signed volume d/6, where
d = a · (b − a) × (c − a), and (Tonon, J. Math. Stat. 1, 2005; Eberly, "Polyhedral mass properties", 2002)

    ∫ 1 = d/6,   ∫ x = d/24 s,   ∫ x xᵀ = d/120 (s sᵀ + a aᵀ + b bᵀ + c cᵀ),   s = a + b + c.

d is taken from the edges, not from the corners: its rounding error then falls with the triangle's area and doesn't
add up over a fine mesh. Both kernels return the raw sums of d, d s and d (s sᵀ + …) in the order
``1, x, y, z, xx, xy, xz, yy, yz, zz``.
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from ..base.exact_arithmetic import pair_add, pair_multiply, two_product, two_sum
from ..base.simd import Packed, filled, load, number

BLOCK = 256
"""Triangles a block: its corners (18 KB) stay in the first-level cache, and its plain sum rounds at most 256 times."""
LANES = 8
"""Triangles side by side: a whole register where there are wide ones."""

_Pair = tuple[float, float]  # the nearest double, and what it lacks


@njit(cache=True, nogil=True)
def _accumulate(total: np.ndarray, carry: np.ndarray, k: int, value: float) -> None:
    total[k], error = two_sum(total[k], value)
    carry[k] += error


@njit(cache=True, nogil=True)
def _centre(w: np.ndarray, count: int, rx: float, ry: float, rz: float, factor: float) -> None:
    for corner in range(3):
        for t in range(count):
            w[3 * corner, t] = (w[3 * corner, t] - rx) * factor
            w[3 * corner + 1, t] = (w[3 * corner + 1, t] - ry) * factor
            w[3 * corner + 2, t] = (w[3 * corner + 2, t] - rz) * factor


@njit(cache=True, nogil=True)
def _across(lanes: Packed) -> float:
    """The sum of eight numbers, by halves."""
    even = (number(lanes, 0) + number(lanes, 4)) + (number(lanes, 2) + number(lanes, 6))
    return even + ((number(lanes, 1) + number(lanes, 5)) + (number(lanes, 3) + number(lanes, 7)))


@njit(cache=True, nogil=True)
def _block_sums(w: np.ndarray, count: int, total: np.ndarray, carry: np.ndarray) -> None:
    """Add the sums over a block, LANES triangles side by side; ``count`` is a multiple of that. A compiler left to
    choose the order would choose it by processor.
    """
    zero = filled(0.0, LANES)
    v0, vx, vy, vz, size = zero, zero, zero, zero, zero
    xx, xy, xz, yy, yz, zz = zero, zero, zero, zero, zero, zero
    for t in range(0, count, LANES):
        ax, ay, az = load(w, t, zero), load(w, BLOCK + t, zero), load(w, 2 * BLOCK + t, zero)
        bx, by, bz = load(w, 3 * BLOCK + t, zero), load(w, 4 * BLOCK + t, zero), load(w, 5 * BLOCK + t, zero)
        cx, cy, cz = load(w, 6 * BLOCK + t, zero), load(w, 7 * BLOCK + t, zero), load(w, 8 * BLOCK + t, zero)
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
    _accumulate(total, carry, 0, _across(v0))
    _accumulate(total, carry, 1, _across(vx))
    _accumulate(total, carry, 2, _across(vy))
    _accumulate(total, carry, 3, _across(vz))
    _accumulate(total, carry, 4, _across(xx))
    _accumulate(total, carry, 5, _across(xy))
    _accumulate(total, carry, 6, _across(xz))
    _accumulate(total, carry, 7, _across(yy))
    _accumulate(total, carry, 8, _across(yz))
    _accumulate(total, carry, 9, _across(zz))
    _accumulate(total, carry, 10, _across(size))


@njit(cache=True, nogil=True)
def blocked_sums(
    vertices: np.ndarray, triangles: np.ndarray, reference: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray]:
    """The ten sums in plain doubles, block by block; blocks are combined without error.

    vertices (n, 3), triangles (m, 3), reference (3,), factor a power of two: corners enter as (v − reference)·factor.
    Returns (sums (11,), their low parts (11,)), the eleventh being Σ(|b − a|² + |c − a|²), which measures how much d
    can round; it is −1 when a triangle names a vertex that isn't there.
    """
    known = np.uint64(vertices.shape[0])
    rx, ry, rz = reference[0], reference[1], reference[2]
    total = np.zeros(11)
    carry = np.zeros(11)
    w = np.empty((9, BLOCK))
    for start in range(0, len(triangles), BLOCK):
        size = min(BLOCK, len(triangles) - start)
        for t in range(size):
            for corner in range(3):
                i = triangles[start + t, corner]
                if np.uint64(i) >= known:  # negative numbers wrap to large ones
                    total[10] = -1.0
                    return total, carry
                w[3 * corner, t] = vertices[i, 0]
                w[3 * corner + 1, t] = vertices[i, 1]
                w[3 * corner + 2, t] = vertices[i, 2]
        _centre(w, size, rx, ry, rz, factor)
        whole = -(-size // LANES) * LANES
        w[:, size:whole] = 0.0  # triangles without an extent
        _block_sums(w, whole, total, carry)
    return total, carry


@njit(cache=True, nogil=True)
def _pair_difference_product(p: _Pair, q: _Pair, r: _Pair, s: _Pair) -> _Pair:
    """p q − r s of pairs given as (high, low) tuples."""
    a, a_low = pair_multiply(p[0], p[1], q[0], q[1])
    b, b_low = pair_multiply(r[0], r[1], s[0], s[1])
    return pair_add(a, a_low, -b, -b_low)


@njit(cache=True, nogil=True)
def _pair_second(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    c: tuple[float, float, float],
    s: tuple[_Pair, _Pair, _Pair],
    i: int,
    j: int,
) -> _Pair:
    """s_i s_j + a_i a_j + b_i b_j + c_i c_j as a pair; a, b, c doubles, s pairs."""
    h, low = pair_multiply(s[i][0], s[i][1], s[j][0], s[j][1])
    p, e = two_product(a[i], a[j])
    h, low = pair_add(h, low, p, e)
    p, e = two_product(b[i], b[j])
    h, low = pair_add(h, low, p, e)
    p, e = two_product(c[i], c[j])
    return pair_add(h, low, p, e)


@njit(cache=True, nogil=True)
def _pair_sum3(a: float, b: float, c: float) -> _Pair:
    h, low = two_sum(a, b)
    return pair_add(h, low, c, 0.0)


@njit(cache=True, nogil=True)
def compensated_sums(
    vertices: np.ndarray, triangles: np.ndarray, reference: np.ndarray, factor: float
) -> tuple[np.ndarray, np.ndarray, bool]:
    """The ten sums in pair arithmetic (about 104 bits), for bodies so thin that a double's products round too much.

    Arguments as for ``blocked_sums``; (v − reference) must be exact. Returns (sums (10,), low parts (10,),
    whether every vertex named is there).
    """
    known = np.uint64(vertices.shape[0])
    total = np.zeros(10)
    low = np.zeros(10)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if max(np.uint64(i), np.uint64(j), np.uint64(k)) >= known:
            return total, low, False
        a = (
            (vertices[i, 0] - reference[0]) * factor,
            (vertices[i, 1] - reference[1]) * factor,
            (vertices[i, 2] - reference[2]) * factor,
        )
        b = (
            (vertices[j, 0] - reference[0]) * factor,
            (vertices[j, 1] - reference[1]) * factor,
            (vertices[j, 2] - reference[2]) * factor,
        )
        c = (
            (vertices[k, 0] - reference[0]) * factor,
            (vertices[k, 1] - reference[1]) * factor,
            (vertices[k, 2] - reference[2]) * factor,
        )
        u = (two_sum(b[0], -a[0]), two_sum(b[1], -a[1]), two_sum(b[2], -a[2]))
        w = (two_sum(c[0], -a[0]), two_sum(c[1], -a[1]), two_sum(c[2], -a[2]))
        nx = _pair_difference_product(u[1], w[2], u[2], w[1])
        ny = _pair_difference_product(u[2], w[0], u[0], w[2])
        nz = _pair_difference_product(u[0], w[1], u[1], w[0])
        d, d_low = pair_multiply(nx[0], nx[1], a[0], 0.0)
        p, e = pair_multiply(ny[0], ny[1], a[1], 0.0)
        d, d_low = pair_add(d, d_low, p, e)
        p, e = pair_multiply(nz[0], nz[1], a[2], 0.0)
        d, d_low = pair_add(d, d_low, p, e)
        s = (_pair_sum3(a[0], b[0], c[0]), _pair_sum3(a[1], b[1], c[1]), _pair_sum3(a[2], b[2], c[2]))
        total[0], low[0] = pair_add(total[0], low[0], d, d_low)
        for axis in range(3):
            p, e = pair_multiply(d, d_low, s[axis][0], s[axis][1])
            total[1 + axis], low[1 + axis] = pair_add(total[1 + axis], low[1 + axis], p, e)
        slot = 4
        for row in range(3):
            for column in range(row, 3):
                p, e = _pair_second(a, b, c, s, row, column)
                p, e = pair_multiply(d, d_low, p, e)
                total[slot], low[slot] = pair_add(total[slot], low[slot], p, e)
                slot += 1
    return total, low, True
