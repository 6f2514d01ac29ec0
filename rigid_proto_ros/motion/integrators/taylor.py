# SPDX-License-Identifier: MIT
"""taylor: power series of the motion under a wrench that turns with the body.

With the wrench fixed in body axes, Euler's equations, q' = ½ q ⊗ ω and u' = R g_b + a are polynomial, so the
coefficients follow from each other by Cauchy products, to any degree. Order 18 by default. Source: Jorba and Zou,
Experimental Mathematics 14 (2005) 99. Within its disc of convergence (|ω|h of about 1 to 3) the best there is for a
held body-axes wrench; beyond it the series diverges.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.simd import Packed, arranged, component, filled, half, joined, largest, load, number, paired, store
from .error_measure import scales_of
from .integrator import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, MAX_SPEED, Integrator
from .stepping import fixed_steps

DEGREE = 18

# Where the parts of a coefficient stand in its row, four numbers each, of which the fourth counts for q alone. Two of
# them fill a line of the processor's cache: q times the unit vectors, and ω in another order; the variables; what those
# are multiplied by, each component of ω four times and ω in a third order; q z and q once more; and likewise g_b ⊗ q*,
# its real part negated.
_QX, _QZ, _Q, _W, _D, _U = 0, 8, 16, 20, 24, 28
_WX, _WZ, _QZ_Q, _GX, _GZ = 32, 40, 48, 56, 64
COLUMNS = 72

VARIABLES_AT = _Q
"""Where q, ω, d and u begin, one behind the other."""


@njit(cache=True, error_model="numpy", allocates=False)
def _four(x: float) -> Packed:
    """Four times the number x."""
    return filled(x, 4)


@njit(cache=True, error_model="numpy", allocates=False)
def _triple(array: np.ndarray, at: int, last: float) -> Packed:
    """Three numbers of an array and ``last``."""
    return joined(filled(array[at], 1), filled(array[at + 1], 1), filled(array[at + 2], 1), filled(last, 1))


@njit(cache=True, error_model="numpy", allocates=False)
def _spread(v: Packed) -> tuple[Packed, Packed, Packed]:
    return arranged(v, (0, 0, 0, 0)), arranged(v, (1, 1, 1, 1)), arranged(v, (2, 2, 2, 2))


@njit(cache=True, error_model="numpy", allocates=False)
def _axes(q: Packed) -> tuple[Packed, Packed, Packed]:
    """q ⊗ x, q ⊗ y, q ⊗ z, whose sum weighed by the components of v is q ⊗ v."""
    return arranged(q, (3, 2, 5, 4)), arranged(q, (6, 3, 0, 5)), arranged(q, (1, 4, 3, 6))


@njit(cache=True, error_model="numpy", allocates=False)
def variables_of(y: np.ndarray) -> Packed:
    """q, ω, d and u, four numbers each. Kept so from step to step, nothing waits until it is written."""
    return joined(load(y, 0, _four(0.0)), _triple(y, 4, 0.0), _triple(y, 7, 0.0), _triple(y, 10, 0.0))


@njit(cache=True, error_model="numpy", allocates=False)
def _put_triple(array: np.ndarray, at: int, vector: Packed) -> None:
    array[at], array[at + 1], array[at + 2] = number(vector, 0), number(vector, 1), number(vector, 2)


@njit(cache=True, error_model="numpy", allocates=False)
def put_variables(variables: Packed, y: np.ndarray) -> None:
    """Put them into y (≥ 13,)."""
    store(y, 0, component(variables, 0))
    _put_triple(y, 4, component(variables, 1))
    _put_triple(y, 7, component(variables, 2))
    _put_triple(y, 10, component(variables, 3))


@njit(cache=True, error_model="numpy", allocates=False)
def scales_at(variables: Packed, p: np.record, elapsed: float) -> tuple[float, float, float, float]:
    """Weights of errors at the variables, ``elapsed`` seconds into the segment (integrators/error_measure.py)."""
    w = number(variables, 4), number(variables, 5), number(variables, 6)
    return scales_of(w, (number(variables, 12), number(variables, 13), number(variables, 14)), p, elapsed)


@njit(cache=True, error_model="numpy", allocates=False)
def series(variables: Packed, p: np.record, degree: int, c: np.ndarray) -> None:
    """Coefficients c (degree + 1, COLUMNS) of the motion from these variables: q, ω, d, u."""
    translates = p.translates
    moments = _triple(p.moments, 0, 1.0)
    gyroscopic = (arranged(moments, (1, 2, 0, 3)) - arranged(moments, (2, 0, 1, 3))) / moments
    gyroscopic = gyroscopic * p.gyroscopic
    cw, cv = p.damping_angular / moments, p.damping_linear
    bx, by, bz = _spread(_triple(p.acceleration_body, 0, 0.0))
    zeros, eight = _four(0.0), filled(0.0, 8)
    q, w, d, u = (component(variables, 0), component(variables, 1), component(variables, 2), component(variables, 3))
    # What is constant counts in the first order alone.
    turning, pushing = _triple(p.torque_body, 0, 0.0) / moments, _triple(p.acceleration_added, 0, 0.0)
    q0, (qx0, qy0, qz0), (wx0, wy0, wz0) = q, _axes(q), _spread(w)
    yzx0, zxy0 = gyroscopic * arranged(w, (1, 2, 0, 3)), gyroscopic * arranged(w, (2, 0, 1, 3))
    row = 0
    for k in range(degree):
        qx, qy, qz = _axes(q)
        wx, wy, wz = _spread(w)
        yzx, zxy = arranged(w, (1, 2, 0, 3)), arranged(w, (2, 0, 1, 3))
        # Of rows i and j = k − i both products at once, from the middle outwards: the newest row comes last, and those
        # with the first and the latest, which are still in registers, after that.
        turn, rest, push, far = eight, eight, eight, eight
        i, j = (k // 2) * COLUMNS, row - (k // 2) * COLUMNS
        if k % 2 == 0 and k > 0:
            turn = load(c, i + _QX, eight) * load(c, i + _WX, eight)
            rest = load(c, i + _QZ, eight) * load(c, i + _WZ, eight)
            if translates:
                # Half of a sum that is symmetric counts twice, its middle once.
                push = load(c, i + _QX, eight) * load(c, i + _GX, eight) * 0.5
                far = load(c, i + _QZ_Q, eight) * load(c, i + _GZ, eight) * 0.5
            i -= COLUMNS
            j += COLUMNS
        while i > 0:
            x, z = load(c, i + _QX, eight), load(c, i + _QZ, eight)
            turn = turn + (x * load(c, j + _WX, eight) + load(c, j + _QX, eight) * load(c, i + _WX, eight))
            rest = rest + (z * load(c, j + _WZ, eight) + load(c, j + _QZ, eight) * load(c, i + _WZ, eight))
            if translates:
                push = push + x * load(c, j + _GX, eight)
                far = far + load(c, i + _QZ_Q, eight) * load(c, j + _GZ, eight)
            i -= COLUMNS
            j += COLUMNS
        store(c, row + _QX, paired(qx, qy))
        store(c, row + _QZ, paired(qz, yzx))
        store(c, row + _Q, paired(q, w))
        store(c, row + _D, paired(d, u))
        store(c, row + _WX, paired(wx, wy))
        store(c, row + _WZ, paired(wz, zxy))
        f = 1.0 / (k + 1.0)
        half_f = 0.5 * f
        # What the next coefficient waits for, the products with the latest one, is multiplied and added once each.
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
        row += COLUMNS
    store(c, row + _Q, paired(q, w))
    store(c, row + _D, paired(d, u))


@njit(cache=True, error_model="numpy", allocates=False)
def power_sum(c: np.ndarray, at: int, columns: int, degree: int, h: float, like: Packed) -> Packed:
    """Σ cₖ hᵏ to k = degree, 4 or more, of the numbers from ``at`` on in rows of ``columns``: every fourth power by
    itself, each from the smallest term (Horner), so that none waits for another; the largest term comes last.
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


@njit(cache=True, error_model="numpy", allocates=False)
def sum_series(c: np.ndarray, degree: int, h: float) -> Packed:
    """The variables h seconds on, with a unit quaternion; degree: 4 or more."""
    sums = power_sum(c, _Q, COLUMNS, degree, h, filled(0.0, 16))
    q = component(sums, 0)
    x, y, z, w = number(q, 0), number(q, 1), number(q, 2), number(q, 3)
    q = q * (1.0 / math.sqrt((x * x + y * y) + (z * z + w * w)))
    return joined(q, component(sums, 1), component(sums, 2), component(sums, 3))


@njit(cache=True, error_model="numpy", allocates=False)
def are_good(variables: Packed) -> bool:
    """Finite and no runaway."""
    return largest(variables) <= MAX_SPEED


@njit(cache=True, error_model="numpy")
def taylor_steps_of_degree(y: np.ndarray, p: np.record, h: float, n: int, degree: int) -> int:
    """Up to n steps of h seconds in place by series of this degree; returns the number of good ones."""
    c, here = np.zeros((degree + 1, COLUMNS)), variables_of(y)
    for done in range(n):
        series(here, p, degree, c)
        there = sum_series(c, degree, h)
        if not are_good(there):
            n = done
            break
        here = there
    put_variables(here, y)
    return n


@njit(cache=True, error_model="numpy")
def taylor_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
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
