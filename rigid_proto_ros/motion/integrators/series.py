# SPDX-License-Identifier: MIT
"""Taylor series of the motion: recurrences for the coefficients, and summation.

The equations of motion are made of products, quotients and one square root, so every coefficient follows from those
before it by Cauchy products. There are two recurrences. ``spin_series`` is for loads that rotate with the body: Euler's
equations, q' = ½ q ⊗ ω and u' = R g_b + a are polynomial. ``motion_series`` is for all others and for a string: R from
the products of q, the knot's a = d + R r, its distance l from l² = a·a, its direction n from n l = a, the tension T =
k(l − rest) + c l', the force −T n and its torque r × RᵀF. The first takes half of the second's time. The momentum of
a flywheel has two coefficients, h₀ and h', so that of ω × h is ωₖ × h₀ + ωₖ₋₁ × h'.

Numbers are processed four at a time (base/simd.py): a vector's three components and one that only q uses. Source: Jorba
and Zou, Experimental Mathematics 14 (2005) 99, section 2; Moore, Methods and Applications of Interval Analysis (1979),
chapter 3.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import copy_numbers, local_matrix, local_numbers, njit
from ...base.rotation import norm, normalize
from ...base.simd import (
    Packed,
    arranged,
    component,
    filled,
    four,
    half,
    joined,
    load,
    mixed,
    number,
    paired,
    store,
    triple,
)
from ...base.vectors import FloatArray
from ..loads import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, ROTOR
from ..problem import (
    DISPLACEMENT,
    HAND_WORK,
    HEAT,
    SPIN,
    TIME,
    VARIABLES,
    VELOCITY,
    Variables,
    is_good,
    later,
    rotor_momentum,
)
from ..string import NO_DIRECTION
from .integrator import Integrator

MAX_DEGREE = 26
"""Largest degree of a series: what the smallest ``accuracy`` that can be asked for, 1e-16, takes (``degree_for``)."""


@njit(error_model="numpy", allocates=False)
def _spread(v: Packed) -> tuple[Packed, Packed, Packed]:
    """The first three numbers of v, each repeated four times."""
    return arranged(v, (0, 0, 0, 0)), arranged(v, (1, 1, 1, 1)), arranged(v, (2, 2, 2, 2))


@njit(error_model="numpy", allocates=False)
def _axes(q: Packed) -> tuple[Packed, Packed, Packed]:
    """q ⊗ x, q ⊗ y, q ⊗ z, whose sum weighted by the components of v is q ⊗ v."""
    return arranged(q, (3, 2, 5, 4)), arranged(q, (6, 3, 0, 5)), arranged(q, (1, 4, 3, 6))


@njit(error_model="numpy", allocates=False)
def power_sum(c: FloatArray, at: int, columns: int, degree: int, h: float, like: Packed) -> Packed:
    """Σ cₖ hᵏ up to k = degree ≥ 4 of the numbers at ``at`` in rows of ``columns``: four independent Horner schemes,
    each over every fourth power, which the processor overlaps; the largest term is added last.
    """
    square = h * h
    fourth = square * square
    at += (degree // 4) * 4 * columns
    past = degree % 4
    a, b, e, f = load(c, at, like), like, like, like
    if past > 0:
        b = load(c, at + columns, like)
    if past > 1:
        e = load(c, at + 2 * columns, like)
    if past > 2:
        f = load(c, at + 3 * columns, like)
    for _ in range(degree // 4 - 1):
        at -= 4 * columns
        a = a * fourth + load(c, at, like)
        b = b * fourth + load(c, at + columns, like)
        e = e * fourth + load(c, at + 2 * columns, like)
        f = f * fourth + load(c, at + 3 * columns, like)
    at -= 4 * columns
    b = b * fourth + load(c, at + columns, like)
    e = e * fourth + load(c, at + 2 * columns, like)
    f = f * fourth + load(c, at + 3 * columns, like)
    return load(c, at, like) + ((a * fourth + e * square) + (b + f * square) * h)


@njit(error_model="numpy", allocates=False)
def _cross(a: Packed, b: Packed) -> Packed:
    return arranged(a, (1, 2, 0, 3)) * arranged(b, (2, 0, 1, 3)) - arranged(a, (2, 0, 1, 3)) * arranged(b, (1, 2, 0, 3))


@njit(error_model="numpy", allocates=False)
def _rotor_at(y: Variables, p: np.record) -> tuple[Packed, Packed]:
    """The flywheel's momentum at the variables y and its rate, as the gyroscopic term has them."""
    a, b, c = rotor_momentum(y[TIME], p)
    return four(a, b, c, 0.0) * p.gyroscopic, triple(p.rotor_torque, 0, 0.0) * p.gyroscopic


# Loads that rotate with the body

# Layout of a coefficient's row: parts of four numbers each, of which only q uses the fourth. Two parts fill a cache
# line: q times the unit vectors, and ω permuted; the variables; the factors of these, each component of ω four times
# and ω in another permutation; q z and q again; and likewise g_b ⊗ q*, with its real part negated.
_QX, _QZ, _Q, _W, _D, _U = 0, 8, 16, 20, 24, 28
_WX, _WZ, _QZ_Q, _GX, _GZ = 32, 40, 48, 56, 64
SPIN_COLUMNS = 72

VARIABLES_AT = _Q
"""Offset of q, ω, d and u, which are contiguous."""


@njit(error_model="numpy", allocates=False)
def spin_series(y: Variables, p: np.record, degree: int, c: FloatArray) -> None:
    """Coefficients c (degree + 1, SPIN_COLUMNS) of the motion from variables y: q, ω, d, u."""
    translates, has_rotor = p.translates, p.has_rotor
    moments = triple(p.moments, 0, 1.0)
    gyroscopic = (arranged(moments, (1, 2, 0, 3)) - arranged(moments, (2, 0, 1, 3))) / moments
    gyroscopic = gyroscopic * p.gyroscopic
    cw, cv = p.damping_angular / moments, p.damping_linear
    bx, by, bz = _spread(triple(p.acceleration_body, 0, 0.0))
    zeros, eight = filled(0.0, 4), filled(0.0, 8)
    q, w, d, u = load(y, 0, zeros), triple(y, 4, 0.0), triple(y, 7, 0.0), triple(y, 10, 0.0)
    # Constant terms enter only the first order.
    turning, pushing = triple(p.torque_body, 0, 0.0) / moments, triple(p.acceleration_added, 0, 0.0)
    q0, (qx0, qy0, qz0), (wx0, wy0, wz0) = q, _axes(q), _spread(w)
    yzx0, zxy0 = gyroscopic * arranged(w, (1, 2, 0, 3)), gyroscopic * arranged(w, (2, 0, 1, 3))
    rotor = rotor_rate = w_before = zeros
    if has_rotor:
        rotor, rotor_rate = _rotor_at(y, p)
        turning = turning - triple(p.rotor_torque, 0, 0.0) / moments
    row = 0
    for k in range(degree):
        if has_rotor:
            turning = turning - (_cross(w, rotor) + _cross(w_before, rotor_rate)) / moments
            w_before = w
        qx, qy, qz = _axes(q)
        wx, wy, wz = _spread(w)
        yzx, zxy = arranged(w, (1, 2, 0, 3)), arranged(w, (2, 0, 1, 3))
        # Both products of rows i and j = k − i at once, from the middle outwards: the newest row comes last. Products
        # with the first and the latest row, which are still in registers, are added after that.
        turn, rest, push, far = eight, eight, eight, eight
        i, j = (k // 2) * SPIN_COLUMNS, row - (k // 2) * SPIN_COLUMNS
        if k % 2 == 0 and k > 0:
            turn = load(c, i + _QX, eight) * load(c, i + _WX, eight)
            rest = load(c, i + _QZ, eight) * load(c, i + _WZ, eight)
            if translates:
                # Of a symmetric sum half is computed and doubled; the middle term counts once.
                push = load(c, i + _QX, eight) * load(c, i + _GX, eight) * 0.5
                far = load(c, i + _QZ_Q, eight) * load(c, i + _GZ, eight) * 0.5
            i -= SPIN_COLUMNS
            j += SPIN_COLUMNS
        while i > 0:
            x, z = load(c, i + _QX, eight), load(c, i + _QZ, eight)
            turn = turn + (x * load(c, j + _WX, eight) + load(c, j + _QX, eight) * load(c, i + _WX, eight))
            rest = rest + (z * load(c, j + _WZ, eight) + load(c, j + _QZ, eight) * load(c, i + _WZ, eight))
            if translates:
                push = push + x * load(c, j + _GX, eight)
                far = far + load(c, i + _QZ_Q, eight) * load(c, j + _GZ, eight)
            i -= SPIN_COLUMNS
            j += SPIN_COLUMNS
        store(c, row + _QX, paired(qx, qy))
        store(c, row + _QZ, paired(qz, yzx))
        store(c, row + _Q, paired(q, w))
        store(c, row + _D, paired(d, u))
        store(c, row + _WX, paired(wx, wy))
        store(c, row + _WZ, paired(wz, zxy))
        f = 1.0 / (k + 1.0)
        half_f = 0.5 * f
        # The next coefficient depends on products with the latest one: one multiplication and one addition for each.
        before = (gyroscopic * half(rest, 1) - cw * w + turning) * f
        turned = (half(turn, 0) + half(turn, 1) + half(rest, 0)) * half_f
        if k > 0:
            before = before + zxy * (yzx0 * f)
            turned = turned + ((wx * (qx0 * half_f) + wy * (qy0 * half_f)) + wz * (qz0 * half_f))
        next_w = before + yzx * (zxy0 * f)
        next_q = turned + ((qx * (wx0 * half_f) + qy * (wy0 * half_f)) + qz * (wz0 * half_f))
        turning = zeros
        if translates:
            g = bx * qx + by * qy + bz * qz
            gx, gy, gz = _spread(g)
            gw = arranged(g, (3, 3, 3, 3))
            store(c, row + _QZ_Q, paired(qz, q))
            store(c, row + _GX, paired(gx, gy))
            store(c, row + _GZ, paired(gz, arranged(gw, (4, 5, 6, 7))))
            # The vector part of a ⊗ (g ⊗ b*) is that of b ⊗ (g ⊗ a*).
            force = (half(push, 0) + half(push, 1)) + (half(far, 0) + half(far, 1))
            last = (gx * qx0 + gy * qy0) + (gz * qz0 - gw * q0)
            force = force + (last if k > 0 else last * 0.5)
            d = u * f
            u = (force + force + pushing - cv * u) * f
            pushing = zeros
        else:
            d, u = zeros, zeros
        q, w = next_q, next_w
        row += SPIN_COLUMNS
    store(c, row + _Q, paired(q, w))
    store(c, row + _D, paired(d, u))


@njit(error_model="numpy", allocates=False)
def spin_at(c: FloatArray, degree: int, h: float, y: Variables) -> None:
    """Write the variables after h seconds into y (≥ 13,), with a unit quaternion; degree: 4 or more."""
    sums = power_sum(c, _Q, SPIN_COLUMNS, degree, h, filled(0.0, 16))
    q, w, d, u = component(sums, 0), component(sums, 1), component(sums, 2), component(sums, 3)
    q1, q2, q3, q4 = number(q, 0), number(q, 1), number(q, 2), number(q, 3)
    store(y, 0, q * (1.0 / math.sqrt((q1 * q1 + q2 * q2) + (q3 * q3 + q4 * q4))))
    y[4], y[5], y[6] = number(w, 0), number(w, 1), number(w, 2)
    y[7], y[8], y[9] = number(d, 0), number(d, 1), number(d, 2)
    y[10], y[11], y[12] = number(u, 0), number(u, 1), number(u, 2)


TAYLOR_DEGREE = 18
"""Degree of the integrator taylor: fixed steps of a spin's series, for a constant wrench in body axes. Within its disc
of convergence (|ω|h of about 1 to 3) the best method for that; beyond it the series diverges.
"""


_MOST_COEFFICIENTS = MAX_DEGREE + 1


@njit(error_model="numpy", allocates=False)
def taylor_steps_of_degree(y: Variables, p: np.record, h: float, n: int, degree: int) -> int:
    """Up to n steps of h seconds in place by series of this degree, ≤ MAX_DEGREE; returns the number of good ones."""
    c, new = local_matrix(_MOST_COEFFICIENTS, SPIN_COLUMNS), local_numbers(VARIABLES)
    copy_numbers(y, new)
    here, there = y, new
    for done in range(n):
        spin_series(here, p, degree, c)
        spin_at(c, degree, h, there)
        there[TIME] = later(here[TIME], h)
        if not is_good(there):
            n = done
            break
        here, there = there, here
    if n % 2 == 1:
        copy_numbers(new, y)
    return n


@njit(error_model="numpy", allocates=False)
def taylor_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return taylor_steps_of_degree(y, p, h, n, TAYLOR_DEGREE)


TAYLOR = Integrator(
    name="taylor",
    order=TAYLOR_DEGREE,
    evaluations=1,
    source="Jorba and Zou, Experimental Mathematics 14 (2005) 99",
    limits="For a constant wrench in body axes, no world torque, no string; diverges beyond |ω|h of about 2.",
    stability_limit=1.0,
    supports=frozenset({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING, ROTOR}),
    kernel=taylor_steps,
)


# Loads of any kind, and a string

# Columns of the coefficient array c (degree + 2, MOTION_COLUMNS); the first 15 are the variables of motion/problem.py.
# Then factors of products, sixteen numbers at a time, in fours: ω and q as above; q's numbers each four times, and (a,
# l); q three times, and (a, l); R's columns, and n; each component of ω × r, and l, four times; the force F three
# times, and T four times.
_LEFT, _RIGHT, _SPREAD, _REPEATED, _COLUMNS, _SWING, _FORCE = 16, 32, 48, 64, 80, 96, 112
A_KNOT, DISTANCE = _SPREAD + 12, _SPREAD + 15
TENSION = _FORCE + 12
STRETCH, _RATE = 128, 129
"""Columns of l − rest length, only in the first row, and of the derivative of l."""
MOTION_COLUMNS = 136

Knot = tuple[float, float, float, float, float]
"""Vector from the free end to the knot (3,) [m, world], its length l, and l − rest length [m]."""


@njit(error_model="numpy", allocates=False)
def _dot(a: Packed, b: Packed) -> float:
    """Scalar product of the first three components."""
    ab = a * b
    return float(number(ab, 0) + number(ab, 1) + number(ab, 2))


@njit(error_model="numpy", allocates=False)
def _columns(xs: Packed, ys: Packed, zs: Packed, one: float) -> tuple[Packed, Packed, Packed]:
    """Columns of R, or of a coefficient of it, from the products x q, y q and z q; one: 1 for R itself, 0 for higher
    coefficients.
    """
    x = mixed(ys, xs, (1, 5, 6, 3)) * four(-2.0, 2.0, 2.0, 0.0) + mixed(zs, ys, (2, 3, 7, 3)) * four(
        -2.0, 2.0, -2.0, 0.0
    )
    y = mixed(xs, ys, (1, 0, 6, 3)) * four(2.0, -2.0, 2.0, 0.0) + mixed(zs, xs, (3, 2, 7, 3)) * four(
        -2.0, -2.0, 2.0, 0.0
    )
    z = mixed(xs, ys, (2, 6, 0, 3)) * four(2.0, 2.0, -2.0, 0.0) + mixed(ys, xs, (3, 7, 1, 3)) * four(
        2.0, -2.0, -2.0, 0.0
    )
    return x + four(one, 0.0, 0.0, 0.0), y + four(0.0, one, 0.0, 0.0), z + four(0.0, 0.0, one, 0.0)


@njit(error_model="numpy", allocates=False)
def _put_variables(c: FloatArray, k: int, q: Packed, w: Packed, d: Packed, u: Packed) -> None:
    """Store coefficient k of the variables; each vector's fourth number is overwritten by the next one's first."""
    at = k * MOTION_COLUMNS
    store(c, at, q)
    store(c, at + SPIN, w)
    store(c, at + DISPLACEMENT, d)
    store(c, at + VELOCITY, u)
    c[k, HEAT] = 0.0


@njit(error_model="numpy", allocates=False)
def _put_factors(c: FloatArray, k: int, q: Packed, w: Packed, span: Packed) -> None:
    """Store the factors of products from coefficient k of q, ω and (a, l)."""
    at = k * MOTION_COLUMNS
    axes = _axes(q)
    store(c, at + _LEFT, joined(arranged(w, (1, 2, 0, 3)), axes[0], axes[1], axes[2]))
    wx, wy, wz = _spread(w)
    store(c, at + _RIGHT, joined(arranged(w, (2, 0, 1, 3)), wx, wy, wz))
    x, y, z = _spread(q)
    store(c, at + _SPREAD, joined(x, y, z, span))
    store(c, at + _REPEATED, joined(q, q, q, span))


@njit(error_model="numpy", allocates=False)
def distance_series(c: FloatArray, degree: int) -> None:
    """Compute the series of the knot's distance for a string that doesn't pull, whose motion doesn't need it."""
    for k in range(1, degree + 1):
        square = 0.0
        for i in range(1, k):
            square += c[i, A_KNOT] * c[k - i, A_KNOT] + c[i, A_KNOT + 1] * c[k - i, A_KNOT + 1]
            square += c[i, A_KNOT + 2] * c[k - i, A_KNOT + 2] - c[i, DISTANCE] * c[k - i, DISTANCE]
        ends = c[0, A_KNOT] * c[k, A_KNOT] + c[0, A_KNOT + 1] * c[k, A_KNOT + 1] + c[0, A_KNOT + 2] * c[k, A_KNOT + 2]
        c[k, DISTANCE] = (0.5 * square + ends) / c[0, DISTANCE]


@njit(error_model="numpy", allocates=False)
def _heat_at_the_end(c: FloatArray, k: int) -> float:
    """Coefficient k of |a'|², for a string of rest length 0."""
    heat = 0.0
    for i in range(k + 1):
        for j in range(3):
            heat += (i + 1) * c[i + 1, A_KNOT + j] * ((k - i + 1) * c[k - i + 1, A_KNOT + j])
    return heat


@njit(error_model="numpy", allocates=False)
def _turned_by_the_world(p: np.record, x: Packed, y: Packed, z: Packed) -> Packed:
    """Rᵀ τ_w + vee(M R) from R's columns."""
    torque = triple(p.torque_world, 0, 0.0)
    m1, m2, m3 = triple(p.moment, 0, 0.0), triple(p.moment, 3, 0.0), triple(p.moment, 6, 0.0)
    # (M R)ᵢⱼ = Σ Mᵢₙ Rₙⱼ; vee takes (M R)₁₂ − (M R)₂₁ and so on.
    return four(
        _dot(x, torque) + (_dot(m2, z) - _dot(m3, y)),
        _dot(y, torque) + (_dot(m3, x) - _dot(m1, z)),
        _dot(z, torque) + (_dot(m1, y) - _dot(m2, x)),
        0.0,
    )


@njit(error_model="numpy", allocates=False)
def _turned_over(x: Packed, y: Packed, z: Packed) -> tuple[Packed, Packed, Packed]:
    """Rows of the matrix with these columns."""
    return (
        four(number(x, 0), number(y, 0), number(z, 0), 0.0),
        four(number(x, 1), number(y, 1), number(z, 1), 0.0),
        four(number(x, 2), number(y, 2), number(z, 2), 0.0),
    )


@njit(error_model="numpy", allocates=False)
def _weighed(x: Packed, y: Packed, z: Packed, v: Packed) -> Packed:
    """The sum of x, y, z, weighted by the components of v."""
    v1, v2, v3 = _spread(v)
    return x * v1 + y * v2 + z * v3


@njit(error_model="numpy", allocates=False)
def motion_series(  # noqa: C901 - the recurrences of one order, in their order; a call in between costs more than they do
    y: Variables, p: np.record, knot: Knot, degree: int, taut: bool, c: FloatArray
) -> None:
    """Fill c with the coefficients of the motion from variables y up to ``degree``. knot: that of the string, if one is
    tied; taut: whether its law of tension holds.
    """
    tied, turned, has_rotor = p.has_string, p.has_world_torque, p.has_rotor
    moments = four(p.moments[0], p.moments[1], p.moments[2], 1.0)
    inverse_moments = filled(1.0, 4) / moments
    gyroscopic = (arranged(moments, (1, 2, 0, 3)) - arranged(moments, (2, 0, 1, 3))) * p.gyroscopic
    cw, cv, inverse_mass = p.damping_angular, p.damping_linear, 1.0 / p.mass
    body_acceleration = triple(p.acceleration_body, 0, 0.0)
    arm, hand = triple(p.attach, 0, 0.0), triple(p.hand_velocity, 0, 0.0)
    stiffness, damping, to_the_end = p.stiffness, p.string_damping, p.rest_length == 0.0
    zeros, many, last = filled(0.0, 4), filled(0.0, 16), four(0.0, 0.0, 0.0, 1.0)

    q, w, d, u = load(y, 0, zeros), triple(y, 4, 0.0), triple(y, 7, 0.0), triple(y, 10, 0.0)
    a, length, along, pulls, inverse = zeros, 0.0, zeros, False, 0.0
    if tied:
        ax, ay, az, length, c[0, STRETCH] = knot
        a = four(ax, ay, az, 0.0)
        pulls = to_the_end or (taut and length >= NO_DIRECTION * p.rest_length)
        if pulls and not to_the_end:
            inverse = 1.0 / length
            along = a * inverse
    _put_variables(c, 0, q, w, d, u)
    c[0, HAND_WORK], c[0, HEAT] = y[13], y[14]
    _put_factors(c, 0, q, w, a + last * length)
    qx0, qy0, qz0 = _spread(q)
    r1, r2, r3 = _columns(qx0 * q, qy0 * q, qz0 * q, 1.0)
    q0, a0, along0, tension0, rate0 = q, a, along, 0.0, 0.0
    column1, column2, column3 = r1, r2, r3
    row1, row2, row3 = _turned_over(r1, r2, r3)
    swing0 = _cross(w, arm)
    # n·R (ω × r) = ω·lever: the only term through which tension and spin depend on each other.
    lever = _cross(arm, _weighed(row1, row2, row3, along0))
    rotor = rotor_rate = w_before = zeros
    if has_rotor:
        rotor, rotor_rate = _rotor_at(y, p)
    for k in range(degree):
        at, f = k * MOTION_COLUMNS, 1.0 / (k + 1.0)
        # Sums of products of earlier coefficients first: they don't depend on those computed in this iteration.
        products, squares, swings, pulled, heat = many, many, many, many, 0.0
        i, j = MOTION_COLUMNS, at - MOTION_COLUMNS
        for m in range(1, k):
            products = products + load(c, i + _LEFT, many) * load(c, j + _RIGHT, many)
            squares = squares + load(c, i + _SPREAD, many) * load(c, j + MOTION_COLUMNS + _REPEATED, many)
            if tied:
                columns = load(c, i + _COLUMNS, many)
                swings = swings + columns * load(c, j + _SWING, many)
                if pulls:
                    pulled = pulled + columns * load(c, j + _FORCE, many)
                    heat += c[m, _RATE] * c[k - m, _RATE]
            i += MOTION_COLUMNS
            j -= MOTION_COLUMNS
        if k > 0:
            # Row k with row 1: the last products of earlier coefficients in sums that go up to k + 1.
            squares = squares + load(c, at + _SPREAD, many) * load(c, MOTION_COLUMNS + _REPEATED, many)
            products = products + load(c, _LEFT, many) * load(c, at + _RIGHT, many)
        products = products + load(c, at + _LEFT, many) * load(c, _RIGHT, many)
        torque = gyroscopic * component(products, 0) - w * cw
        push = _weighed(r1, r2, r3, body_acceleration) - u * cv
        if k == 0:
            torque, push = torque + triple(p.torque_body, 0, 0.0), push + triple(p.acceleration_added, 0, 0.0)
        if turned:
            torque = torque + _turned_by_the_world(p, r1, r2, r3)
        if has_rotor:
            torque = torque - (_cross(w, rotor) + _cross(w_before, rotor_rate))
            w_before = w
            if k == 0:
                torque = torque - triple(p.rotor_torque, 0, 0.0)
        next_d, next_a, next_length, work = u * f, zeros, 0.0, 0.0
        if tied:
            # The knot's velocity is u + R (ω × r).
            swing, before = _cross(w, arm), next_d
            if k > 0:
                before = before + _weighed(r1, r2, r3, swing0) * f
                before = before + (component(swings, 0) + component(swings, 1) + component(swings, 2)) * f
                along = (a - component(swings, 3) - along0 * length) * inverse
            next_a = before + _weighed(column1, column2, column3, swing) * f
            s1, s2, s3 = _spread(swing)
            store(c, at + _SWING, joined(s1, s2, s3, filled(length, 4)))
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
            store(c, at + _FORCE, joined(force, force, force, filled(tension, 4)))
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
            c[k + 1, HAND_WORK], c[k + 1, HEAT] = work * f, damping * heat * f
        qx, qy, qz = _spread(q)
        xs = component(squares, 0) + (qx * q0 + qx0 * q)
        ys = component(squares, 1) + (qy * q0 + qy0 * q)
        zs = component(squares, 2) + (qz * q0 + qz0 * q)
        r1, r2, r3 = _columns(xs, ys, zs, 0.0)


@njit(error_model="numpy", allocates=False)
def motion_at(c: FloatArray, p: np.record, degree: int, h: float, y: Variables) -> None:
    """Advance the variables y, about which c is the series, by h seconds."""
    columns = 15 if p.has_string else 13 if p.translates else 7
    sums = power_sum(c, MOTION_COLUMNS, MOTION_COLUMNS, degree - 1, h, filled(0.0, 16))
    # The row after the last coefficient is scratch memory.
    changes = c[degree + 1]
    store(c, (degree + 1) * MOTION_COLUMNS, sums)
    for j in range(columns):
        y[j] += h * changes[j]
    y[0], y[1], y[2], y[3] = normalize(y[0], y[1], y[2], y[3])
    y[TIME] += h


@njit(error_model="numpy", allocates=False)
def stretch_at(c: FloatArray, p: np.record, degree: int, h: float) -> tuple[float, float]:
    """x = l − rest length, and its rate, after h seconds."""
    a, b = filled(0.0, 4), filled(0.0, 4)
    at = degree * MOTION_COLUMNS + A_KNOT
    for k in range(degree, 0, -1):
        span = load(c, at, a)
        b = b * h + span * float(k)
        a = a * h + span
        at -= MOTION_COLUMNS
    ax, ay, az, bx, by, bz = number(a, 0), number(a, 1), number(a, 2), number(b, 0), number(b, 1), number(b, 2)
    dx, dy, dz = ax * h, ay * h, az * h
    ax, ay, az = c[0, A_KNOT] + dx, c[0, A_KNOT + 1] + dy, c[0, A_KNOT + 2] + dz
    length = norm(ax, ay, az)
    if length == 0.0:
        return -p.rest_length, 0.0
    # The change of length without cancellation: l⁺² − l² = (a⁺ − a)·(a⁺ + a).
    change = (dx * (ax + c[0, A_KNOT]) + dy * (ay + c[0, A_KNOT + 1]) + dz * (az + c[0, A_KNOT + 2])) / (
        length + c[0, DISTANCE]
    )
    return c[0, STRETCH] + change, (ax * bx + ay * by + az * bz) / length
