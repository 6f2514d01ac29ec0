# SPDX-License-Identifier: MIT
"""Power series of the motion under any loads the simulation knows, a string included.

All of the equations of motion are made of products, quotients and one square root, so every coefficient follows from
those before it by Cauchy products: q' = ½ q ⊗ ω, R from the products of q, the knot's a = d + R r, its distance l from
l² = a·a, its direction n from n l = a, the tension T = k(l − rest) + c l', the force −T n and its torque r × RᵀF.
Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99, section 2; Moore, Methods and Applications of Interval
Analysis (1979), chapter 3.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.simd import Packed, arranged, component, filled, joined, load, number, store
from ..problem import (
    ACCELERATION_ADDED,
    ACCELERATION_BODY,
    ATTACH,
    DAMPING_ANGULAR,
    DAMPING_LINEAR,
    GYROSCOPIC,
    HAND_VELOCITY,
    HAS_STRING,
    HAS_WORLD_TORQUE,
    MASS,
    MOMENT,
    MOMENTS,
    REST_LENGTH,
    STIFFNESS,
    STRING_DAMPING,
    TORQUE_BODY,
    TORQUE_WORLD,
    TRANSLATES,
)
from ..string import NO_DIRECTION
from ..variables import LOW
from .knot import knot_and_stretch, moved_pair, unit_attitude

# Columns of the coefficient array c (degree + 2, COLUMNS); the first 15 are the variables of motion/variables.py.
_Q, _W, _D, _U, _WORK, _HEAT, _R, A_KNOT, _N, _L, _T, _F, _STRETCH = 0, 4, 7, 10, 13, 14, 15, 24, 27, 30, 31, 32, 35
DISTANCE, TENSION, STRETCH = _L, _T, _STRETCH
# What products take, four numbers and more at once: as in taylor.py, then R's rows, (a, l) and n, each with a fourth
# number.
_LEFT, _RIGHT, _ROWS, _SPAN, _ALONG = 40, 56, 72, 84, 88
COLUMNS = 96


@njit(cache=True, error_model="numpy")
def _four(c: np.ndarray, at: int) -> Packed:
    """Four times the number ``at`` of c."""
    x = load(c, at, filled(0.0, 1))
    return joined(x, x, x, x)


@njit(cache=True, error_model="numpy")
def _spread(v: Packed) -> tuple[Packed, Packed, Packed]:
    x, y, z = component(v, 0), component(v, 1), component(v, 2)
    return joined(x, x, x, x), joined(y, y, y, y), joined(z, z, z, z)


@njit(cache=True, error_model="numpy")
def _rotation(c: np.ndarray, k: int, xs: Packed, ys: Packed, zs: Packed) -> Packed:
    """Coefficient k of R from the products x q, y q and z q."""
    xx, xy, xz, xw = number(xs, 0), number(xs, 1), number(xs, 2), number(xs, 3)
    yy, yz, yw = number(ys, 1), number(ys, 2), number(ys, 3)
    zz, zw = number(zs, 2), number(zs, 3)
    one = 1.0 if k == 0 else 0.0
    a1, a2, a3 = one - 2.0 * (yy + zz), 2.0 * (xy - zw), 2.0 * (xz + yw)
    b1, b2, b3 = 2.0 * (xy + zw), one - 2.0 * (xx + zz), 2.0 * (yz - xw)
    d1, d2, d3 = 2.0 * (xz - yw), 2.0 * (yz + xw), one - 2.0 * (xx + yy)
    c[k, 15], c[k, 16], c[k, 17] = a1, a2, a3
    c[k, 18], c[k, 19], c[k, 20] = b1, b2, b3
    c[k, 21], c[k, 22], c[k, 23] = d1, d2, d3
    at = k * COLUMNS + _ROWS
    store(c, at, _vector(a1, a2, a3, 0.0))
    store(c, at + 4, _vector(b1, b2, b3, 0.0))
    store(c, at + 8, _vector(d1, d2, d3, 0.0))


@njit(cache=True, error_model="numpy")
def _vector(a: float, b: float, c: float, d: float) -> Packed:
    """Four numbers side by side. What was stored one by one and is loaded together has to wait until it is written."""
    return joined(filled(a, 1), filled(b, 1), filled(c, 1), filled(d, 1))


@njit(cache=True, error_model="numpy")
def _keep(c: np.ndarray, k: int, q: Packed, w: Packed) -> None:
    """Coefficient k of q and ω, and what the products of q' and ω' take of it."""
    at = k * COLUMNS
    store(c, at + _Q, q)
    c[k, _W], c[k, _W + 1], c[k, _W + 2] = number(w, 0), number(w, 1), number(w, 2)
    axes = arranged(q, (3, 2, 5, 4)), arranged(q, (6, 3, 0, 5)), arranged(q, (1, 4, 3, 6))
    store(c, at + _LEFT, joined(arranged(w, (1, 2, 0, 3)), axes[0], axes[1], axes[2]))
    spread = _spread(w)
    store(c, at + _RIGHT, joined(arranged(w, (2, 0, 1, 3)), spread[0], spread[1], spread[2]))


@njit(cache=True, error_model="numpy")
def _knot(c: np.ndarray, p: np.ndarray, k: int) -> None:
    """Coefficient k > 0 of the vector from free end to knot."""
    r = ATTACH
    for j in range(3):
        a = c[k, _R + 3 * j] * p[r] + c[k, _R + 3 * j + 1] * p[r + 1] + c[k, _R + 3 * j + 2] * p[r + 2]
        c[k, A_KNOT + j] = c[k, _D + j] + a


@njit(cache=True, error_model="numpy")
def _span(c: np.ndarray, k: int) -> None:
    store(c, k * COLUMNS + _SPAN, _vector(c[k, 24], c[k, 25], c[k, 26], c[k, _L]))


@njit(cache=True, error_model="numpy")
def _length(c: np.ndarray, k: int, squares: Packed, inverse: float) -> Packed:
    """Coefficient k > 0 of the knot's distance from the free end; squares: products of (a, l) without the first
    and the last; inverse: 1/l now."""
    ends = c[0, 24] * c[k, 24] + c[0, 25] * c[k, 25] + c[0, 26] * c[k, 26]
    square = number(squares, 0) + number(squares, 1) + number(squares, 2) - number(squares, 3)
    c[k, _L] = (0.5 * square + ends) * inverse
    _span(c, k)


@njit(cache=True, error_model="numpy")
def distance_series(c: np.ndarray, degree: int) -> None:
    """Fill in the knot's distance for a string that doesn't pull, whose motion needs it not."""
    for k in range(1, degree + 1):
        squares = filled(0.0, 4)
        i, j = COLUMNS + _SPAN, (k - 1) * COLUMNS + _SPAN
        for _ in range(k - 1):
            squares = squares + load(c, i, squares) * load(c, j, squares)
            i += COLUMNS
            j -= COLUMNS
        _length(c, k, squares, 1.0 / c[0, _L])


@njit(cache=True, error_model="numpy")
def _pull_to_the_end(c: np.ndarray, p: np.ndarray, k: int) -> float:
    """Coefficient k of the force on the knot by a string without length, from a up to k + 1; and of the heat's rate."""
    stiffness, damping = p[STIFFNESS], p[STRING_DAMPING]
    heat = 0.0
    for j in range(3):
        c[k, _F + j] = -stiffness * c[k, A_KNOT + j] - damping * (k + 1) * c[k + 1, A_KNOT + j]
        if damping != 0.0:
            for i in range(k + 1):
                heat += (i + 1) * c[i + 1, A_KNOT + j] * ((k - i + 1) * c[k - i + 1, A_KNOT + j])
    return damping * heat


@njit(cache=True, error_model="numpy")
def _pull(c: np.ndarray, p: np.ndarray, k: int, along: Packed, pull: Packed, heat: float, inverse: float) -> float:
    """The same for a string with a length, from a and l up to k + 1 and from sums of older products: l n,
    T n and l'².
    """
    damping = p[STRING_DAMPING]
    at = k * COLUMNS
    if k > 0:
        along = along + _four(c, at + _L) * load(c, _ALONG, along)
    along = (load(c, at + _SPAN, along) - along) * inverse
    store(c, at + _ALONG, along)
    c[k, 27], c[k, 28], c[k, 29] = number(along, 0), number(along, 1), number(along, 2)
    c[k, _T] = p[STIFFNESS] * (c[k, _L] if k > 0 else c[0, _STRETCH]) + damping * (k + 1) * c[k + 1, _L]
    pull = pull + _four(c, _T) * along
    if k > 0:
        pull = pull + _four(c, at + _T) * load(c, _ALONG, along)
    c[k, _F], c[k, _F + 1], c[k, _F + 2] = -number(pull, 0), -number(pull, 1), -number(pull, 2)
    last = (k + 1) * c[k + 1, _L]
    return damping * (heat + (2.0 if k > 0 else 1.0) * c[1, _L] * last)


@njit(cache=True, error_model="numpy")
def _back(c: np.ndarray, i: int, j: int) -> Packed:
    """A product's share in Rᵀ F: R from the row that begins at i, F from that at j."""
    at = i + _ROWS
    x, y, z = load(c, at, filled(0.0, 4)), load(c, at + 4, filled(0.0, 4)), load(c, at + 8, filled(0.0, 4))
    return _four(c, j + _F) * x + _four(c, j + _F + 1) * y + _four(c, j + _F + 2) * z


@njit(cache=True, error_model="numpy")
def motion_series(y: np.ndarray, p: np.ndarray, degree: int, taut: bool, c: np.ndarray) -> None:
    """Fill c with the coefficients of the motion from variables y up to ``degree``; taut: the string's law."""
    i1, i2, i3 = p[MOMENTS], p[MOMENTS + 1], p[MOMENTS + 2]
    gyro, cw, cv, mass = p[GYROSCOPIC], p[DAMPING_ANGULAR], p[DAMPING_LINEAR], p[MASS]
    r1, r2, r3 = p[ATTACH], p[ATTACH + 1], p[ATTACH + 2]
    tied = p[HAS_STRING] != 0.0
    turned = p[HAS_WORLD_TORQUE] != 0.0
    translates = p[TRANSLATES] != 0.0
    for j in range(15):
        c[0, j] = y[j]
    q, w = load(c, 0, filled(0.0, 4)), _vector(y[4], y[5], y[6], 0.0)
    _keep(c, 0, q, w)
    q0, (x0, y0, z0) = q, _spread(q)
    _rotation(c, 0, x0 * q, y0 * q, z0 * q)
    pulls, inverse = False, 0.0
    if tied:
        c[0, 24], c[0, 25], c[0, 26], c[0, _L], c[0, _STRETCH] = knot_and_stretch(y, p)
        _span(c, 0)
        pulls = p[REST_LENGTH] == 0.0 or (taut and c[0, _L] >= NO_DIRECTION * p[REST_LENGTH])
        inverse = 1.0 / c[0, _L]
    inverse1, inverse2, inverse3, inverse_mass = 1.0 / i1, 1.0 / i2, 1.0 / i3, 1.0 / mass
    for k in range(degree):
        f = 1.0 / (k + 1.0)
        # Sums of products of old coefficients first: none of them waits for those that this round finds.
        products = filled(0.0, 16)
        xs, ys, zs, squares = filled(0.0, 4), filled(0.0, 4), filled(0.0, 4), filled(0.0, 4)
        along, pull, back, heat = filled(0.0, 4), filled(0.0, 4), filled(0.0, 4), 0.0
        i, j = COLUMNS, (k - 1) * COLUMNS
        for m in range(1, k):
            products = products + load(c, i + _LEFT, products) * load(c, j + _RIGHT, products)
            other = load(c, j + COLUMNS, xs)
            xs, ys, zs = xs + _four(c, i) * other, ys + _four(c, i + 1) * other, zs + _four(c, i + 2) * other
            if pulls:
                squares = squares + load(c, i + _SPAN, xs) * load(c, j + COLUMNS + _SPAN, xs)
                n = load(c, j + _ALONG, xs)
                along, pull = along + _four(c, i + _L) * n, pull + _four(c, i + _T) * n
                back = back + _back(c, i, j)
                heat += ((m + 1) * c[m + 1, _L]) * ((k - m + 1) * c[k - m + 1, _L])
            i += COLUMNS
            j -= COLUMNS
        if k > 0:
            # Row k with row 1: the last old products of what goes up to k + 1.
            other = load(c, COLUMNS, xs)
            xs, ys, zs = xs + _four(c, i) * other, ys + _four(c, i + 1) * other, zs + _four(c, i + 2) * other
            squares = squares + load(c, i + _SPAN, xs) * load(c, COLUMNS + _SPAN, xs)
            products = products + load(c, _LEFT, products) * load(c, i + _RIGHT, products)
        products = products + load(c, k * COLUMNS + _LEFT, products) * load(c, _RIGHT, products)
        q = (component(products, 1) + component(products, 2) + component(products, 3)) * (0.5 * f)
        s1, s2, s3 = number(products, 0), number(products, 1), number(products, 2)
        store(c, (k + 1) * COLUMNS + _Q, q)
        x, y1, z = _spread(q)
        xs, ys, zs = xs + (x * q0 + x0 * q), ys + (y1 * q0 + y0 * q), zs + (z * q0 + z0 * q)
        _rotation(c, k + 1, xs, ys, zs)
        t1, t2, t3 = (
            gyro * (i2 - i3) * s1 - cw * c[k, 4],
            gyro * (i3 - i1) * s2 - cw * c[k, 5],
            gyro * (i1 - i2) * s3 - cw * c[k, 6],
        )
        if k == 0:
            t1, t2, t3 = t1 + p[TORQUE_BODY], t2 + p[TORQUE_BODY + 1], t3 + p[TORQUE_BODY + 2]
        if turned:
            T, M = TORQUE_WORLD, MOMENT
            t1 += c[k, 15] * p[T] + c[k, 18] * p[T + 1] + c[k, 21] * p[T + 2]
            t2 += c[k, 16] * p[T] + c[k, 19] * p[T + 1] + c[k, 22] * p[T + 2]
            t3 += c[k, 17] * p[T] + c[k, 20] * p[T + 1] + c[k, 23] * p[T + 2]
            # (M R)ᵢⱼ = Σ Mᵢₙ Rₙⱼ; vee takes (M R)₁₂ − (M R)₂₁ and so on.
            t1 += p[M + 3] * c[k, 17] + p[M + 4] * c[k, 20] + p[M + 5] * c[k, 23]
            t1 -= p[M + 6] * c[k, 16] + p[M + 7] * c[k, 19] + p[M + 8] * c[k, 22]
            t2 += p[M + 6] * c[k, 15] + p[M + 7] * c[k, 18] + p[M + 8] * c[k, 21]
            t2 -= p[M] * c[k, 17] + p[M + 1] * c[k, 20] + p[M + 2] * c[k, 23]
            t3 += p[M] * c[k, 16] + p[M + 1] * c[k, 19] + p[M + 2] * c[k, 22]
            t3 -= p[M + 3] * c[k, 15] + p[M + 4] * c[k, 18] + p[M + 5] * c[k, 21]
        if translates:
            for j in range(3):
                c[k + 1, _D + j] = f * c[k, _U + j]
                a = c[k, 15 + 3 * j] * p[ACCELERATION_BODY] + c[k, 16 + 3 * j] * p[ACCELERATION_BODY + 1]
                a += c[k, 17 + 3 * j] * p[ACCELERATION_BODY + 2] - cv * c[k, _U + j]
                c[k + 1, _U + j] = f * (a + p[ACCELERATION_ADDED + j] if k == 0 else a)
        if tied:
            _knot(c, p, k + 1)
            c[k + 1, _WORK], c[k + 1, _HEAT] = 0.0, 0.0
        if pulls:
            _length(c, k + 1, squares, inverse)
            heat = _pull_to_the_end(c, p, k) if p[REST_LENGTH] == 0.0 else _pull(c, p, k, along, pull, heat, inverse)
            at = k * COLUMNS
            back = back + (_back(c, at, 0) if k == 0 else _back(c, at, 0) + _back(c, 0, at))
            b1, b2, b3 = number(back, 0), number(back, 1), number(back, 2)
            t1, t2, t3 = t1 + (r2 * b3 - r3 * b2), t2 + (r3 * b1 - r1 * b3), t3 + (r1 * b2 - r2 * b1)
            H = HAND_VELOCITY
            for j in range(3):
                c[k + 1, _U + j] += f * c[k, _F + j] * inverse_mass
            c[k + 1, _WORK] = f * (c[k, 32] * p[H] + c[k, 33] * p[H + 1] + c[k, 34] * p[H + 2])
            c[k + 1, _HEAT] = f * heat
        _keep(c, k + 1, q, _vector(f * t1 * inverse1, f * t2 * inverse2, f * t3 * inverse3, 0.0))


@njit(cache=True, error_model="numpy")
def motion_at(c: np.ndarray, p: np.ndarray, degree: int, h: float, y: np.ndarray) -> None:
    """Take the variables y, those that c is the series of, h seconds on; summed from the smallest term (Horner)."""
    columns = 15 if p[HAS_STRING] != 0.0 else 13 if p[TRANSLATES] != 0.0 else 7
    at = degree * COLUMNS
    sums = load(c, at, filled(0.0, 16))
    for _ in range(degree - 1):
        at -= COLUMNS
        sums = sums * h + load(c, at, sums)
    # The row past the last coefficient's is spare.
    changes = c[degree + 1]
    store(c, (degree + 1) * COLUMNS, sums)
    for j in range(columns):
        change = changes[j]
        if j < _W:
            moved_pair(y, y, j, LOW + j, h * change)
        elif _D <= j < _U:
            moved_pair(y, y, j, LOW + 4 + j - _D, h * change)
        else:
            y[j] += h * change
    unit_attitude(y)


@njit(cache=True, error_model="numpy")
def stretch_at(c: np.ndarray, p: np.ndarray, degree: int, h: float) -> tuple[float, float]:
    """x = l − rest length, and its rate, h seconds on."""
    a, b = filled(0.0, 4), filled(0.0, 4)
    at = degree * COLUMNS + A_KNOT
    for k in range(degree, 0, -1):
        span = load(c, at, a)
        b = b * h + span * float(k)
        a = a * h + span
        at -= COLUMNS
    ax, ay, az, bx, by, bz = number(a, 0), number(a, 1), number(a, 2), number(b, 0), number(b, 1), number(b, 2)
    dx, dy, dz = ax * h, ay * h, az * h
    ax, ay, az = c[0, 24] + dx, c[0, 25] + dy, c[0, 26] + dz
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0:
        return -p[REST_LENGTH], 0.0
    # The change of length without cancellation: l⁺² − l² = (a⁺ − a)·(a⁺ + a).
    change = (dx * (ax + c[0, 24]) + dy * (ay + c[0, 25]) + dz * (az + c[0, 26])) / (length + c[0, _L])
    return c[0, _STRETCH] + change, (ax * bx + ay * by + az * bz) / length
