# SPDX-License-Identifier: MIT
"""Power series of the motion under any loads the simulation knows, a string included.

All of the equations of motion are made of products, quotients and one square root, so every coefficient follows from those
before it by Cauchy products: q' = ½ q ⊗ ω, R from the products of q, the knot's a = d + R r, its distance l from l² = a·a, its
direction n from n l = a, the tension T = k(l − rest) + c l', the force −T n and its torque r × RᵀF. Source: Jorba and Zou,
Experimental Mathematics 14 (2005) 99, section 2; Moore, Methods and Applications of Interval Analysis (1979), chapter 3.
"""

from __future__ import annotations

import math

from ..compilation import njit
from ..motion import LOW
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
from .knot import knot_and_stretch, moved_pair, unit_attitude

# Columns of the coefficient array c (degree + 2, COLUMNS); the first 15 are the variables of core/motion.py.
_Q, _W, _D, _U, _WORK, _HEAT, _R, A_KNOT, _N, _L, _T, _F, _STRETCH = 0, 4, 7, 10, 13, 14, 15, 24, 27, 30, 31, 32, 35
DISTANCE, TENSION, STRETCH = _L, _T, _STRETCH
COLUMNS = 36


@njit(cache=True, error_model="numpy")
def _rotation(c, k):
    """Coefficient k of R from those of q up to k."""
    xx, yy, zz, xy, xz, yz, xw, yw, zw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(k + 1):
        x, y, z = c[i, 0], c[i, 1], c[i, 2]
        j = k - i
        xx += x * c[j, 0]
        yy += y * c[j, 1]
        zz += z * c[j, 2]
        xy += x * c[j, 1]
        xz += x * c[j, 2]
        yz += y * c[j, 2]
        xw += x * c[j, 3]
        yw += y * c[j, 3]
        zw += z * c[j, 3]
    one = 1.0 if k == 0 else 0.0
    c[k, 15], c[k, 16], c[k, 17] = one - 2.0 * (yy + zz), 2.0 * (xy - zw), 2.0 * (xz + yw)
    c[k, 18], c[k, 19], c[k, 20] = 2.0 * (xy + zw), one - 2.0 * (xx + zz), 2.0 * (yz - xw)
    c[k, 21], c[k, 22], c[k, 23] = 2.0 * (xz - yw), 2.0 * (yz + xw), one - 2.0 * (xx + yy)


@njit(cache=True, error_model="numpy")
def _knot(c, p, k):
    """Coefficient k > 0 of the vector from free end to knot."""
    r = ATTACH
    for j in range(3):
        a = c[k, _R + 3 * j] * p[r] + c[k, _R + 3 * j + 1] * p[r + 1] + c[k, _R + 3 * j + 2] * p[r + 2]
        c[k, A_KNOT + j] = c[k, _D + j] + a


@njit(cache=True, error_model="numpy")
def _length(c, k):
    """Coefficient k > 0 of the knot's distance from the free end."""
    square, rest = 0.0, 0.0
    for i in range(k + 1):
        j = k - i
        square += c[i, 24] * c[j, 24] + c[i, 25] * c[j, 25] + c[i, 26] * c[j, 26]
        if 0 < i < k:
            rest += c[i, _L] * c[j, _L]
    c[k, _L] = (square - rest) / (2.0 * c[0, _L])


@njit(cache=True, error_model="numpy")
def distance_series(c, degree):
    """Fill in the knot's distance for a string that doesn't pull, whose motion needs it not."""
    for k in range(1, degree + 1):
        _length(c, k)


@njit(cache=True, error_model="numpy")
def _pull(c, p, k):
    """Coefficient k of the string's force on the knot, from a and l up to k + 1; and of the heat's rate."""
    stiffness, damping, rest = p[STIFFNESS], p[STRING_DAMPING], p[REST_LENGTH]
    if rest == 0.0:
        heat = 0.0
        for j in range(3):
            c[k, _F + j] = -stiffness * c[k, A_KNOT + j] - damping * (k + 1) * c[k + 1, A_KNOT + j]
            if damping != 0.0:
                for i in range(k + 1):
                    heat += (i + 1) * c[i + 1, A_KNOT + j] * ((k - i + 1) * c[k - i + 1, A_KNOT + j])
        return damping * heat
    x, y, z = c[k, 24], c[k, 25], c[k, 26]
    for i in range(1, k + 1):
        length = c[i, _L]
        x -= length * c[k - i, 27]
        y -= length * c[k - i, 28]
        z -= length * c[k - i, 29]
    inverse = 1.0 / c[0, _L]
    c[k, 27], c[k, 28], c[k, 29] = x * inverse, y * inverse, z * inverse
    c[k, _T] = stiffness * (c[k, _L] if k > 0 else c[0, _STRETCH]) + damping * (k + 1) * c[k + 1, _L]
    x, y, z, heat = 0.0, 0.0, 0.0, 0.0
    for i in range(k + 1):
        tension = c[i, _T]
        x -= tension * c[k - i, 27]
        y -= tension * c[k - i, 28]
        z -= tension * c[k - i, 29]
        heat += (i + 1) * c[i + 1, _L] * ((k - i + 1) * c[k - i + 1, _L])
    c[k, _F], c[k, _F + 1], c[k, _F + 2] = x, y, z
    return damping * heat


@njit(cache=True, error_model="numpy")
def motion_series(y, p, degree, taut, c):
    """Fill c with the coefficients of the motion from variables y up to ``degree``; taut: the string's law."""
    i1, i2, i3 = p[MOMENTS], p[MOMENTS + 1], p[MOMENTS + 2]
    gyro, cw, cv, mass = p[GYROSCOPIC], p[DAMPING_ANGULAR], p[DAMPING_LINEAR], p[MASS]
    r1, r2, r3 = p[ATTACH], p[ATTACH + 1], p[ATTACH + 2]
    tied = p[HAS_STRING] != 0.0
    turned = p[HAS_WORLD_TORQUE] != 0.0
    translates = p[TRANSLATES] != 0.0
    for j in range(15):
        c[0, j] = y[j]
    _rotation(c, 0)
    pulls = False
    if tied:
        c[0, 24], c[0, 25], c[0, 26], c[0, _L], c[0, _STRETCH] = knot_and_stretch(y, p)
        pulls = p[REST_LENGTH] == 0.0 or (taut and c[0, _L] >= NO_DIRECTION * p[REST_LENGTH])
    for k in range(degree):
        f = 1.0 / (k + 1.0)
        s1, s2, s3, qx, qy, qz, qw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(k + 1):
            j = k - i
            wx, wy, wz = c[j, 4], c[j, 5], c[j, 6]
            s1 += c[i, 5] * wz
            s2 += c[i, 6] * wx
            s3 += c[i, 4] * wy
            x, yy, z, w = c[i, 0], c[i, 1], c[i, 2], c[i, 3]
            qx += w * wx + yy * wz - z * wy
            qy += w * wy - x * wz + z * wx
            qz += w * wz + x * wy - yy * wx
            qw -= x * wx + yy * wy + z * wz
        c[k + 1, 0], c[k + 1, 1], c[k + 1, 2], c[k + 1, 3] = 0.5 * f * qx, 0.5 * f * qy, 0.5 * f * qz, 0.5 * f * qw
        _rotation(c, k + 1)
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
            _length(c, k + 1)
            heat = _pull(c, p, k)
            b1, b2, b3 = 0.0, 0.0, 0.0
            for i in range(k + 1):
                j = k - i
                x, yy, z = c[j, 32], c[j, 33], c[j, 34]
                b1 += c[i, 15] * x + c[i, 18] * yy + c[i, 21] * z
                b2 += c[i, 16] * x + c[i, 19] * yy + c[i, 22] * z
                b3 += c[i, 17] * x + c[i, 20] * yy + c[i, 23] * z
            t1, t2, t3 = t1 + (r2 * b3 - r3 * b2), t2 + (r3 * b1 - r1 * b3), t3 + (r1 * b2 - r2 * b1)
            H = HAND_VELOCITY
            for j in range(3):
                c[k + 1, _U + j] += f * c[k, _F + j] / mass
            c[k + 1, _WORK] = f * (c[k, 32] * p[H] + c[k, 33] * p[H + 1] + c[k, 34] * p[H + 2])
            c[k + 1, _HEAT] = f * heat
        c[k + 1, 4], c[k + 1, 5], c[k + 1, 6] = f * t1 / i1, f * t2 / i2, f * t3 / i3


@njit(cache=True, error_model="numpy")
def motion_at(c, p, degree, h, y):
    """Take the variables y, those that c is the series of, h seconds on; summed from the smallest term (Horner)."""
    columns = 15 if p[HAS_STRING] != 0.0 else 13 if p[TRANSLATES] != 0.0 else 7
    for j in range(columns):
        change = c[degree, j]
        for k in range(degree - 1, 0, -1):
            change = change * h + c[k, j]
        if j < _W:
            moved_pair(y, y, j, LOW + j, h * change)
        elif _D <= j < _U:
            moved_pair(y, y, j, LOW + 4 + j - _D, h * change)
        else:
            y[j] += h * change
    unit_attitude(y)


@njit(cache=True, error_model="numpy")
def stretch_at(c, p, degree, h):
    """x = l − rest length, and its rate, h seconds on."""
    ax, ay, az, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(degree, 0, -1):
        bx, by, bz = bx * h + k * c[k, 24], by * h + k * c[k, 25], bz * h + k * c[k, 26]
        ax, ay, az = ax * h + c[k, 24], ay * h + c[k, 25], az * h + c[k, 26]
    dx, dy, dz = ax * h, ay * h, az * h
    ax, ay, az = c[0, 24] + dx, c[0, 25] + dy, c[0, 26] + dz
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0:
        return -p[REST_LENGTH], 0.0
    # The change of length without cancellation: l⁺² − l² = (a⁺ − a)·(a⁺ + a).
    change = (dx * (ax + c[0, 24]) + dy * (ay + c[0, 25]) + dz * (az + c[0, 26])) / (length + c[0, _L])
    return c[0, _STRETCH] + change, (ax * bx + ay * by + az * bz) / length
