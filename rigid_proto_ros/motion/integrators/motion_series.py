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
from ...base.simd import Packed, arranged, component, filled, joined, load, mixed, number, store
from ..string import NO_DIRECTION
from ..variables import LOW
from .knot import Knot, moved_pair, unit_attitude
from .taylor import power_sum

# Columns of the coefficient array c (degree + 2, COLUMNS); the first 15 are the variables of motion/variables.py.
_Q, _W, _D, _U, _WORK, _HEAT = 0, 4, 7, 10, 13, 14
# What products take, sixteen numbers at once, in fours: ω and q as in taylor.py; q's numbers each four times, and (a,
# l); q three times, and (a, l); R's columns, and n; each component of ω × r, and l, four times; the force F three
# times, and T four times.
_LEFT, _RIGHT, _SPREAD, _REPEATED, _COLUMNS, _SWING, _FORCE = 16, 32, 48, 64, 80, 96, 112
A_KNOT, DISTANCE = _SPREAD + 12, _SPREAD + 15
_ALONG, _LENGTHS, TENSION = _COLUMNS + 12, _SWING + 12, _FORCE + 12
STRETCH, _RATE = 128, 129
"""Of the distance: less the rest length, at the start alone; and its derivative."""
COLUMNS = 136


@njit(cache=True, error_model="numpy", allocates=False)
def _four(x: float) -> Packed:
    """Four times the number x."""
    return filled(x, 4)


@njit(cache=True, error_model="numpy", allocates=False)
def _vector(a: float, b: float, c: float, d: float) -> Packed:
    """Four numbers side by side. What was stored one by one and is loaded together has to wait until it is written."""
    return joined(filled(a, 1), filled(b, 1), filled(c, 1), filled(d, 1))


@njit(cache=True, error_model="numpy", allocates=False)
def _triple(array: np.ndarray, at: int) -> Packed:
    return _vector(array[at], array[at + 1], array[at + 2], 0.0)


@njit(cache=True, error_model="numpy", allocates=False)
def _dot(a: Packed, b: Packed) -> float:
    """Of the first three components."""
    ab = a * b
    return number(ab, 0) + number(ab, 1) + number(ab, 2)


@njit(cache=True, error_model="numpy", allocates=False)
def _cross(a: Packed, b: Packed) -> Packed:
    return arranged(a, (1, 2, 0, 3)) * arranged(b, (2, 0, 1, 3)) - arranged(a, (2, 0, 1, 3)) * arranged(b, (1, 2, 0, 3))


@njit(cache=True, error_model="numpy", allocates=False)
def _each_four_times(v: Packed) -> tuple[Packed, Packed, Packed]:
    """The first three numbers of v, each four times."""
    x, y, z = component(v, 0), component(v, 1), component(v, 2)
    return joined(x, x, x, x), joined(y, y, y, y), joined(z, z, z, z)


@njit(cache=True, error_model="numpy", allocates=False)
def _columns(xs: Packed, ys: Packed, zs: Packed, one: float) -> tuple[Packed, Packed, Packed]:
    """Columns of R, or of a coefficient of it, from the products x q, y q and z q; one: 1 for R itself, 0
    for its derivatives.
    """
    x = mixed(ys, xs, (1, 5, 6, 3)) * _vector(-2.0, 2.0, 2.0, 0.0) + mixed(zs, ys, (2, 3, 7, 3)) * _vector(
        -2.0, 2.0, -2.0, 0.0
    )
    y = mixed(xs, ys, (1, 0, 6, 3)) * _vector(2.0, -2.0, 2.0, 0.0) + mixed(zs, xs, (3, 2, 7, 3)) * _vector(
        -2.0, -2.0, 2.0, 0.0
    )
    z = mixed(xs, ys, (2, 6, 0, 3)) * _vector(2.0, 2.0, -2.0, 0.0) + mixed(ys, xs, (3, 7, 1, 3)) * _vector(
        2.0, -2.0, -2.0, 0.0
    )
    return x + _vector(one, 0.0, 0.0, 0.0), y + _vector(0.0, one, 0.0, 0.0), z + _vector(0.0, 0.0, one, 0.0)


@njit(cache=True, error_model="numpy", allocates=False)
def _put_variables(c: np.ndarray, k: int, q: Packed, w: Packed, d: Packed, u: Packed) -> None:
    """Coefficient k of the variables; each vector's fourth number gives way to the next one's first."""
    at = k * COLUMNS
    store(c, at + _Q, q)
    store(c, at + _W, w)
    store(c, at + _D, d)
    store(c, at + _U, u)
    c[k, _HEAT] = 0.0


@njit(cache=True, error_model="numpy", allocates=False)
def _put_factors(c: np.ndarray, k: int, q: Packed, w: Packed, span: Packed) -> None:
    """What products take of coefficient k of q, ω and (a, l)."""
    at = k * COLUMNS
    axes = arranged(q, (3, 2, 5, 4)), arranged(q, (6, 3, 0, 5)), arranged(q, (1, 4, 3, 6))
    store(c, at + _LEFT, joined(arranged(w, (1, 2, 0, 3)), axes[0], axes[1], axes[2]))
    wx, wy, wz = _each_four_times(w)
    store(c, at + _RIGHT, joined(arranged(w, (2, 0, 1, 3)), wx, wy, wz))
    x, y, z = _each_four_times(q)
    store(c, at + _SPREAD, joined(x, y, z, span))
    store(c, at + _REPEATED, joined(q, q, q, span))


@njit(cache=True, error_model="numpy", allocates=False)
def distance_series(c: np.ndarray, degree: int) -> None:
    """Fill in the knot's distance for a string that doesn't pull, whose motion needs it not."""
    for k in range(1, degree + 1):
        square = 0.0
        for i in range(1, k):
            square += c[i, A_KNOT] * c[k - i, A_KNOT] + c[i, A_KNOT + 1] * c[k - i, A_KNOT + 1]
            square += c[i, A_KNOT + 2] * c[k - i, A_KNOT + 2] - c[i, DISTANCE] * c[k - i, DISTANCE]
        ends = c[0, A_KNOT] * c[k, A_KNOT] + c[0, A_KNOT + 1] * c[k, A_KNOT + 1] + c[0, A_KNOT + 2] * c[k, A_KNOT + 2]
        c[k, DISTANCE] = (0.5 * square + ends) / c[0, DISTANCE]


@njit(cache=True, error_model="numpy", allocates=False)
def _heat_at_the_end(c: np.ndarray, k: int) -> float:
    """Coefficient k of |a'|², for a string without length."""
    heat = 0.0
    for i in range(k + 1):
        for j in range(3):
            heat += (i + 1) * c[i + 1, A_KNOT + j] * ((k - i + 1) * c[k - i + 1, A_KNOT + j])
    return heat


@njit(cache=True, error_model="numpy", allocates=False)
def _turned_by_the_world(p: np.record, x: Packed, y: Packed, z: Packed) -> Packed:
    """Rᵀ τ_w + vee(M R) from R's columns."""
    torque = _triple(p.torque_world, 0)
    m1, m2, m3 = _triple(p.moment, 0), _triple(p.moment, 3), _triple(p.moment, 6)
    # (M R)ᵢⱼ = Σ Mᵢₙ Rₙⱼ; vee takes (M R)₁₂ − (M R)₂₁ and so on.
    return _vector(
        _dot(x, torque) + (_dot(m2, z) - _dot(m3, y)),
        _dot(y, torque) + (_dot(m3, x) - _dot(m1, z)),
        _dot(z, torque) + (_dot(m1, y) - _dot(m2, x)),
        0.0,
    )


@njit(cache=True, error_model="numpy", allocates=False)
def _turned_over(x: Packed, y: Packed, z: Packed) -> tuple[Packed, Packed, Packed]:
    """Rows of the matrix with these columns."""
    return (
        _vector(number(x, 0), number(y, 0), number(z, 0), 0.0),
        _vector(number(x, 1), number(y, 1), number(z, 1), 0.0),
        _vector(number(x, 2), number(y, 2), number(z, 2), 0.0),
    )


@njit(cache=True, error_model="numpy", allocates=False)
def _weighed(x: Packed, y: Packed, z: Packed, v: Packed) -> Packed:
    """The sum of x, y, z, weighed by the components of v."""
    v1, v2, v3 = _each_four_times(v)
    return x * v1 + y * v2 + z * v3


@njit(cache=True, error_model="numpy", allocates=False)
def motion_series(  # noqa: C901 - the recurrences of one order, in their order; a call in between costs more than they do
    y: np.ndarray, p: np.record, knot: Knot, degree: int, taut: bool, c: np.ndarray
) -> None:
    """Fill c with the coefficients of the motion from variables y up to ``degree``; knot: where a string is tied,
    its knot; taut: its law.
    """
    tied, turned = p.has_string, p.has_world_torque
    moments = _vector(p.moments[0], p.moments[1], p.moments[2], 1.0)
    inverse_moments = _four(1.0) / moments
    gyroscopic = (arranged(moments, (1, 2, 0, 3)) - arranged(moments, (2, 0, 1, 3))) * p.gyroscopic
    cw, cv, inverse_mass = p.damping_angular, p.damping_linear, 1.0 / p.mass
    body_acceleration, arm, hand = _triple(p.acceleration_body, 0), _triple(p.attach, 0), _triple(p.hand_velocity, 0)
    stiffness, damping, to_the_end = p.stiffness, p.string_damping, p.rest_length == 0.0
    zeros, many, last = _four(0.0), filled(0.0, 16), _vector(0.0, 0.0, 0.0, 1.0)

    q, w, d, u = load(y, 0, zeros), _triple(y, 4), _triple(y, 7), _triple(y, 10)
    a, length, along, pulls, inverse = zeros, 0.0, zeros, False, 0.0
    if tied:
        ax, ay, az, length, c[0, STRETCH] = knot
        a = _vector(ax, ay, az, 0.0)
        pulls = to_the_end or (taut and length >= NO_DIRECTION * p.rest_length)
        if pulls and not to_the_end:
            inverse = 1.0 / length
            along = a * inverse
    _put_variables(c, 0, q, w, d, u)
    c[0, _WORK], c[0, _HEAT] = y[13], y[14]
    _put_factors(c, 0, q, w, a + last * length)
    qx0, qy0, qz0 = _each_four_times(q)
    r1, r2, r3 = _columns(qx0 * q, qy0 * q, qz0 * q, 1.0)
    q0, a0, along0, tension0, rate0 = q, a, along, 0.0, 0.0
    column1, column2, column3 = r1, r2, r3
    row1, row2, row3 = _turned_over(r1, r2, r3)
    swing0 = _cross(w, arm)
    # n·R (ω × r) = ω·lever: tension and spin wait for each other by way of it alone.
    lever = _cross(arm, _weighed(row1, row2, row3, along0))
    for k in range(degree):
        at, f = k * COLUMNS, 1.0 / (k + 1.0)
        # Sums of products of old coefficients first: none of them waits for those that this round finds.
        products, squares, swings, pulled, heat = many, many, many, many, 0.0
        i, j = COLUMNS, at - COLUMNS
        for m in range(1, k):
            products = products + load(c, i + _LEFT, many) * load(c, j + _RIGHT, many)
            squares = squares + load(c, i + _SPREAD, many) * load(c, j + COLUMNS + _REPEATED, many)
            if tied:
                columns = load(c, i + _COLUMNS, many)
                swings = swings + columns * load(c, j + _SWING, many)
                if pulls:
                    pulled = pulled + columns * load(c, j + _FORCE, many)
                    heat += c[m, _RATE] * c[k - m, _RATE]
            i += COLUMNS
            j -= COLUMNS
        if k > 0:
            # Row k with row 1: the last old products of what goes up to k + 1.
            squares = squares + load(c, at + _SPREAD, many) * load(c, COLUMNS + _REPEATED, many)
            products = products + load(c, _LEFT, many) * load(c, at + _RIGHT, many)
        products = products + load(c, at + _LEFT, many) * load(c, _RIGHT, many)
        torque = gyroscopic * component(products, 0) - w * cw
        push = _weighed(r1, r2, r3, body_acceleration) - u * cv
        if k == 0:
            torque, push = torque + _triple(p.torque_body, 0), push + _triple(p.acceleration_added, 0)
        if turned:
            torque = torque + _turned_by_the_world(p, r1, r2, r3)
        next_d, next_a, next_length, work = u * f, zeros, 0.0, 0.0
        if tied:
            # The knot's velocity is u + R (ω × r).
            swing, before = _cross(w, arm), next_d
            if k > 0:
                before = before + _weighed(r1, r2, r3, swing0) * f
                before = before + (component(swings, 0) + component(swings, 1) + component(swings, 2)) * f
                along = (a - component(swings, 3) - along0 * length) * inverse
            next_a = before + _weighed(column1, column2, column3, swing) * f
            s1, s2, s3 = _each_four_times(swing)
            store(c, at + _SWING, joined(s1, s2, s3, _four(length)))
            store(c, at + _COLUMNS, joined(r1, r2, r3, along))
        if pulls:
            if to_the_end:
                tension, rest = 0.0, a * -stiffness - next_a * (damping * (k + 1.0))
            else:
                square = number(squares, 12) + number(squares, 13) + number(squares, 14) - number(squares, 15)
                rate = (0.5 * square + _dot(a0, before)) * ((k + 1.0) * inverse) + _dot(lever, w)
                next_length = rate * f
                c[k, _RATE] = rate
                tension = stiffness * (length if k > 0 else c[0, STRETCH]) + damping * rate
                if k == 0:
                    tension0, rate0 = tension, rate
                    rest, heat = zeros, rate * rate
                else:
                    rest, heat = (component(pulled, 3) + along * tension0) * -1.0, heat + 2.0 * rate0 * rate
            force = rest - along0 * tension
            store(c, at + _FORCE, joined(force, force, force, _four(tension)))
            back = _weighed(row1, row2, row3, rest)
            if k > 0:
                force0 = load(c, _FORCE, zeros)
                x, y1, z = component(pulled, 0), component(pulled, 1), component(pulled, 2)
                s1, s2, s3 = _turned_over(x + r1 * force0, y1 + r2 * force0, z + r3 * force0)
                back = back + (s1 + s2 + s3)
            torque, push = torque + _cross(arm, back) - lever * tension, push + force * inverse_mass
            work = _dot(force, hand)
        # The next coefficients.
        q = (component(products, 1) + component(products, 2) + component(products, 3)) * (0.5 * f)
        w, d, u, a, length = torque * inverse_moments * f, next_d, push * f, next_a, next_length
        _put_variables(c, k + 1, q, w, d, u)
        _put_factors(c, k + 1, q, w, a + last * length)
        if pulls:
            if to_the_end and damping != 0.0:
                heat = _heat_at_the_end(c, k)
            c[k + 1, _WORK], c[k + 1, _HEAT] = work * f, damping * heat * f
        qx, qy, qz = _each_four_times(q)
        xs = component(squares, 0) + (qx * q0 + qx0 * q)
        ys = component(squares, 1) + (qy * q0 + qy0 * q)
        zs = component(squares, 2) + (qz * q0 + qz0 * q)
        r1, r2, r3 = _columns(xs, ys, zs, 0.0)


@njit(cache=True, error_model="numpy", allocates=False)
def motion_at(c: np.ndarray, p: np.record, degree: int, h: float, y: np.ndarray) -> None:
    """Take the variables y, those that c is the series of, h seconds on."""
    columns = 15 if p.has_string else 13 if p.translates else 7
    sums = power_sum(c, COLUMNS, COLUMNS, degree - 1, h, filled(0.0, 16))
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


@njit(cache=True, error_model="numpy", allocates=False)
def stretch_at(c: np.ndarray, p: np.record, degree: int, h: float) -> tuple[float, float]:
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
    ax, ay, az = c[0, A_KNOT] + dx, c[0, A_KNOT + 1] + dy, c[0, A_KNOT + 2] + dz
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0:
        return -p.rest_length, 0.0
    # The change of length without cancellation: l⁺² − l² = (a⁺ − a)·(a⁺ + a).
    change = (dx * (ax + c[0, A_KNOT]) + dy * (ay + c[0, A_KNOT + 1]) + dz * (az + c[0, A_KNOT + 2])) / (
        length + c[0, DISTANCE]
    )
    return c[0, STRETCH] + change, (ax * bx + ay * by + az * bz) / length
