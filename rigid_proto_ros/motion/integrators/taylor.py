# SPDX-License-Identifier: MIT
"""taylor: power series of the motion under a wrench that turns with the body.

With the wrench fixed in body axes, Euler's equations, q' = ½ q ⊗ ω and u' = R g_b + a are polynomial, so the
coefficients follow from each other by Cauchy products, to any degree. Order 18 by default. Source: Jorba and Zou,
Experimental Mathematics 14 (2005) 99. Within its disc of convergence (|ω|h of about 1 to 3) the best there is for a
held body-axes wrench; beyond it the series diverges.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.simd import (
    Packed,
    arranged,
    component,
    filled,
    joined,
    load,
    root,
    store,
    width,
)
from ..problem import (
    ACCELERATION_ADDED,
    ACCELERATION_BODY,
    DAMPING_ANGULAR,
    DAMPING_LINEAR,
    GYROSCOPIC,
    MOMENTS,
    TORQUE_BODY,
    TRANSLATES,
)
from .integrator import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, Integrator
from .runge_kutta import is_good
from .stepping import fixed_steps

DEGREE = 18

# Where the parts of a coefficient stand in its row, four components each, of which the fourth counts for q alone: ω,
# then q times the unit vectors and q itself, so that one vector holds what a product takes of a row.
_YZX, _QX, _Q = 0, 4, 16
_W, _D, _U = 20, 24, 28
# The other factors: ω in another order and each of its components four times, and those of g_b ⊗ q* with the real part
# negated.
_ZXY, _G = 32, 48
COLUMNS = 64


@njit(cache=True, error_model="numpy")
def _four(x: Packed) -> Packed:
    return joined(x, x, x, x)


@njit(cache=True, error_model="numpy")
def _triple(array: np.ndarray, at: int, last: Packed) -> Packed:
    """Three numbers of an array and ``last``; where flights go side by side each number has one for every flight."""
    n = width(last)
    return joined(load(array, at * n, last), load(array, (at + 1) * n, last), load(array, (at + 2) * n, last), last)


@njit(cache=True, error_model="numpy")
def _spread(v: Packed) -> tuple[Packed, Packed, Packed]:
    return _four(component(v, 0)), _four(component(v, 1)), _four(component(v, 2))


@njit(cache=True, error_model="numpy")
def _axes(q: Packed) -> tuple[Packed, Packed, Packed]:
    """q ⊗ x, q ⊗ y, q ⊗ z, whose sum weighed by the components of v is q ⊗ v."""
    return arranged(q, (3, 2, 5, 4)), arranged(q, (6, 3, 0, 5)), arranged(q, (1, 4, 3, 6))


@njit(cache=True, error_model="numpy")
def series_beside(y: np.ndarray, p: np.ndarray, degree: int, c: np.ndarray, translates: bool, zero: Packed) -> None:
    """Coefficients c (degree + 1, COLUMNS) of the motion from y: q, ω, d, u. zero: one number, or one for every flight
    that goes beside others; then y (≥ 13, n), p (SIZE, n) and c (degree + 1, COLUMNS n) hold the flights' numbers next
    to each other.
    """
    n, zeros = width(zero), _four(zero)
    one, many = zero + 1.0, _four(_four(zero))
    moments = _triple(p, MOMENTS, one)
    gyroscopic = (arranged(moments, (1, 2, 0, 3)) - arranged(moments, (2, 0, 1, 3))) / moments
    gyroscopic = _four(load(p, GYROSCOPIC * n, zero)) * gyroscopic
    cw, cv = _four(load(p, DAMPING_ANGULAR * n, zero)) / moments, _four(load(p, DAMPING_LINEAR * n, zero))
    b = ACCELERATION_BODY * n
    bx, by, bz = _four(load(p, b, zero)), _four(load(p, b + n, zero)), _four(load(p, b + 2 * n, zero))
    q, w = load(y, 0, zeros), _triple(y, 4, zero)
    d, u = _triple(y, 7, zero), _triple(y, 10, zero)
    length = COLUMNS * n
    # Products with the first and the latest coefficient come last in every sum: what is older need not wait for them.
    q0, (qx0, qy0, qz0), (wx0, wy0, wz0) = q, _axes(q), _spread(w)
    yzx0, zxy0 = arranged(w, (1, 2, 0, 3)), arranged(w, (2, 0, 1, 3))
    for k in range(degree + 1):
        row = k * length
        store(c, row + _Q * n, q)
        store(c, row + _W * n, w)
        store(c, row + _D * n, d)
        store(c, row + _U * n, u)
        if k == degree:
            break
        qx, qy, qz = _axes(q)
        wx, wy, wz = _spread(w)
        yzx, zxy = arranged(w, (1, 2, 0, 3)), arranged(w, (2, 0, 1, 3))
        g = bx * qx + by * qy + bz * qz
        gx, gy, gz = _spread(g)
        gw = _four(component(g, 3))
        store(c, row + _YZX * n, joined(yzx, qx, qy, qz))
        store(c, row + _ZXY * n, joined(zxy, wx, wy, wz))
        store(c, row + _G * n, joined(gx, gy, gz, gw))
        turn, push = many, many
        # Rows i and j = k − i, by their first numbers: both of a pair at once, and the middle one where there is one.
        i, j = length, row - length
        for _ in range((k - 1) // 2):
            one_way = load(c, i + _YZX * n, many) * load(c, j + _ZXY * n, many)
            turn = turn + (one_way + load(c, j + _YZX * n, many) * load(c, i + _ZXY * n, many))
            if translates:
                push = push + load(c, i + _QX * n, many) * load(c, j + _G * n, many)
            i += length
            j -= length
        # The vector part of a ⊗ (g ⊗ b*) is that of b ⊗ (g ⊗ a*): half of the sum counts twice, its middle once.
        push = push + push
        if k % 2 == 0 and k > 0:
            turn = turn + load(c, i + _YZX * n, many) * load(c, i + _ZXY * n, many)
            if translates:
                push = push + load(c, i + _QX * n, many) * load(c, i + _G * n, many)
        spin, turned = component(turn, 0), component(turn, 1) + component(turn, 2) + component(turn, 3)
        spin, turned = spin + yzx * zxy0, turned + (wx0 * qx + wy0 * qy + wz0 * qz)
        if k > 0:
            spin, turned = spin + yzx0 * zxy, turned + (wx * qx0 + wy * qy0 + wz * qz0)
        f = 1.0 / (k + 1.0)
        if translates:
            force = (component(push, 0) + component(push, 1)) + (component(push, 2) - component(push, 3))
            ends = (gx * qx0 + gy * qy0) + (gz * qz0 - gw * q0)
            force = force + (ends + ends if k > 0 else ends + _triple(p, ACCELERATION_ADDED, zero))
            d = u * f
            u = (force - cv * u) * f
        rate = gyroscopic * spin - cw * w
        if k == 0:
            rate = rate + _triple(p, TORQUE_BODY, zero) / moments
        w = rate * f
        q = turned * (0.5 * f)


@njit(cache=True, error_model="numpy")
def series(y: np.ndarray, p: np.ndarray, degree: int, c: np.ndarray) -> None:
    """Coefficients c (degree + 1, COLUMNS) of the motion from y: q, ω, d, u."""
    series_beside(y, p, degree, c, p[TRANSLATES] != 0.0, filled(0.0, 1))


@njit(cache=True, error_model="numpy")
def _sum(c: np.ndarray, at: int, degree: int, length: int, h: Packed, zeros: Packed) -> Packed:
    """Of the part that begins at the number ``at`` of each row, h seconds on: even and odd powers by themselves, each
    from the smallest term (Horner), so that neither waits for the other.
    """
    square = h * h
    even, odd = at + (degree - degree % 2) * length, at + (degree - 1 + degree % 2) * length
    evens, odds = load(c, even, zeros), load(c, odd, zeros)
    for _ in range((degree - 1) // 2):
        even -= 2 * length
        odd -= 2 * length
        evens = evens * square + load(c, even, zeros)
        odds = odds * square + load(c, odd, zeros)
    if degree % 2 == 0:
        evens = evens * square + load(c, at, zeros)
    return evens + odds * h


@njit(cache=True, error_model="numpy")
def _put_triple(array: np.ndarray, at: int, vector: Packed, n: int) -> None:
    store(array, at * n, component(vector, 0))
    store(array, (at + 1) * n, component(vector, 1))
    store(array, (at + 2) * n, component(vector, 2))


@njit(cache=True, error_model="numpy")
def sum_beside(c: np.ndarray, translates: bool, degree: int, h: Packed, out: np.ndarray, zero: Packed) -> None:
    """The variables out (≥ 13, n), h seconds on, with unit quaternions; h as ``zero`` one number or one
    for every flight.
    """
    n, zeros, hs = width(zero), _four(zero), _four(h)
    length = COLUMNS * n
    q = _sum(c, _Q * n, degree, length, hs, zeros)
    x, y, z, w = component(q, 0), component(q, 1), component(q, 2), component(q, 3)
    store(out, 0, q * _four((zero + 1.0) / root(x * x + y * y + z * z + w * w)))
    _put_triple(out, 4, _sum(c, _W * n, degree, length, hs, zeros), n)
    if translates:
        _put_triple(out, 7, _sum(c, _D * n, degree, length, hs, zeros), n)
        _put_triple(out, 10, _sum(c, _U * n, degree, length, hs, zeros), n)


@njit(cache=True, error_model="numpy")
def sum_series(c: np.ndarray, p: np.ndarray, degree: int, h: float, out: np.ndarray) -> None:
    """The variables h seconds on, with a unit quaternion."""
    sum_beside(c, p[TRANSLATES] != 0.0, degree, filled(h, 1), out, filled(0.0, 1))


@njit(cache=True, error_model="numpy")
def taylor_steps_of_degree(y: np.ndarray, p: np.ndarray, h: float, n: int, degree: int) -> int:
    """Up to n steps of h seconds in place by series of this degree; returns the number of good ones."""
    c, new = np.zeros((degree + 1, COLUMNS)), y.copy()
    for done in range(n):
        series(y, p, degree, c)
        sum_series(c, p, degree, h, new)
        if not is_good(new):
            return done
        y[:] = new
    return n


@njit(cache=True, error_model="numpy")
def taylor_steps(y: np.ndarray, p: np.ndarray, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return taylor_steps_of_degree(y, p, h, n, DEGREE)


TAYLOR = Integrator(
    name="taylor",
    order=DEGREE,
    evaluations=1,
    source="Jorba and Zou, Experimental Mathematics 14 (2005) 99",
    limits="A held body-axes wrench, no world torque, no string; diverges beyond |ω|h of about 2.",
    stability_limit=1.0,
    supports=frozenset({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING}),
    kernel=taylor_steps,
    make_methods=fixed_steps,
)
