# SPDX-License-Identifier: MIT
"""taylor: power series of the motion under a wrench that turns with the body.

With the wrench fixed in body axes, Euler's equations, q' = ½ q ⊗ ω and u' = R g_b + a are polynomial, so the coefficients
follow from each other by Cauchy products, to any degree. Order 18 by default. Source: Jorba and Zou, Experimental Mathematics 14
(2005) 99. Within its disc of convergence (|ω|h of about 1 to 3) the best there is for a held body-axes wrench; beyond it
the series diverges.
"""

from __future__ import annotations

import numpy as np

from ..compilation import njit
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
from ..rotation import normalize
from .integrator import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, Integrator
from .runge_kutta import is_good
from .stepping import FixedSteps

DEGREE = 18

# Rows of the coefficient array; column k holds the k-th coefficients.
_Q, _W, _D, _U, _G = 0, 4, 7, 10, 13
ROWS = 17


@njit(cache=True, error_model="numpy")
def series(y, p, degree, c):
    """Coefficients c (17, degree + 1) of the motion from y: q, ω, d, u, and g_b ⊗ q* as a means."""
    A, B, C = p[MOMENTS], p[MOMENTS + 1], p[MOMENTS + 2]
    tx, ty, tz = p[TORQUE_BODY], p[TORQUE_BODY + 1], p[TORQUE_BODY + 2]
    g, cw, cv = p[GYROSCOPIC], p[DAMPING_ANGULAR], p[DAMPING_LINEAR]
    bx, by, bz = p[ACCELERATION_BODY], p[ACCELERATION_BODY + 1], p[ACCELERATION_BODY + 2]
    translates = p[TRANSLATES] != 0.0
    for j in range(13):
        c[j, 0] = y[j]
    for k in range(degree):
        s1, s2, s3 = 0.0, 0.0, 0.0
        x, yy, z, w = 0.0, 0.0, 0.0, 0.0
        for i in range(k + 1):
            wx, wy, wz = c[_W, k - i], c[_W + 1, k - i], c[_W + 2, k - i]
            s1 += c[_W + 1, i] * wz
            s2 += c[_W + 2, i] * wx
            s3 += c[_W, i] * wy
            qx, qy, qz, qw = c[_Q, i], c[_Q + 1, i], c[_Q + 2, i], c[_Q + 3, i]
            x += qw * wx + qy * wz - qz * wy
            yy += qw * wy - qx * wz + qz * wx
            z += qw * wz + qx * wy - qy * wx
            w -= qx * wx + qy * wy + qz * wz
        f = 1.0 / (k + 1.0)
        e1, e2, e3 = (
            g * (B - C) * s1 - cw * c[_W, k],
            g * (C - A) * s2 - cw * c[_W + 1, k],
            g * (A - B) * s3 - cw * c[_W + 2, k],
        )
        if k == 0:
            e1, e2, e3 = e1 + tx, e2 + ty, e3 + tz
        c[_W, k + 1], c[_W + 1, k + 1], c[_W + 2, k + 1] = f * e1 / A, f * e2 / B, f * e3 / C
        h = 0.5 * f
        c[_Q, k + 1], c[_Q + 1, k + 1], c[_Q + 2, k + 1], c[_Q + 3, k + 1] = h * x, h * yy, h * z, h * w
        if translates:
            # R g_b = q ⊗ (g_b ⊗ q*).
            qx, qy, qz, qw = -c[_Q, k], -c[_Q + 1, k], -c[_Q + 2, k], c[_Q + 3, k]
            c[_G, k] = bx * qw + by * qz - bz * qy
            c[_G + 1, k] = by * qw + bz * qx - bx * qz
            c[_G + 2, k] = bz * qw + bx * qy - by * qx
            c[_G + 3, k] = -(bx * qx + by * qy + bz * qz)
            a1, a2, a3 = 0.0, 0.0, 0.0
            # The vector part of a ⊗ (g ⊗ b*) is that of b ⊗ (g ⊗ a*): half of the sum, taken twice, and its middle.
            for i in range(k // 2 + 1):
                weight = 1.0 if 2 * i == k else 2.0
                qx, qy, qz, qw = c[_Q, i], c[_Q + 1, i], c[_Q + 2, i], c[_Q + 3, i]
                x, yy, z, w = c[_G, k - i], c[_G + 1, k - i], c[_G + 2, k - i], c[_G + 3, k - i]
                a1 += weight * (qw * x + qx * w + qy * z - qz * yy)
                a2 += weight * (qw * yy - qx * z + qy * w + qz * x)
                a3 += weight * (qw * z + qx * yy - qy * x + qz * w)
            if k == 0:
                a1, a2, a3 = a1 + p[ACCELERATION_ADDED], a2 + p[ACCELERATION_ADDED + 1], a3 + p[ACCELERATION_ADDED + 2]
            c[_U, k + 1] = f * (a1 - cv * c[_U, k])
            c[_U + 1, k + 1] = f * (a2 - cv * c[_U + 1, k])
            c[_U + 2, k + 1] = f * (a3 - cv * c[_U + 2, k])
            c[_D, k + 1], c[_D + 1, k + 1], c[_D + 2, k + 1] = f * c[_U, k], f * c[_U + 1, k], f * c[_U + 2, k]


@njit(cache=True, error_model="numpy")
def sum_series(c, p, degree, h, out):
    """The variables h seconds on, summed from the smallest term (Horner), with a unit quaternion."""
    rows = 13 if p[TRANSLATES] != 0.0 else 7
    for j in range(rows):
        total = c[j, degree]
        for k in range(degree - 1, 0, -1):
            total = total * h + c[j, k]
        out[j] = c[j, 0] + h * total
    out[0], out[1], out[2], out[3] = normalize(out[0], out[1], out[2], out[3])


@njit(cache=True, error_model="numpy")
def taylor_steps_of_degree(y, p, h, n, degree):
    """Up to n steps of h seconds in place by series of this degree; returns the number of good ones."""
    c, new = np.zeros((ROWS, degree + 1)), y.copy()
    for done in range(n):
        series(y, p, degree, c)
        sum_series(c, p, degree, h, new)
        if not is_good(new):
            return done
        y[:] = new
    return n


@njit(cache=True, error_model="numpy")
def taylor_steps(y, p, h, n):
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return taylor_steps_of_degree(y, p, h, n, DEGREE)


TAYLOR = Integrator(
    name="taylor",
    order=DEGREE,
    evaluations=1,
    source="Jorba and Zou, Experimental Mathematics 14 (2005) 99",
    limits="A held body-axes wrench, no world torque, no string; diverges beyond |ω|h of about 2.",
    stability_limit=1.0,
    carries=frozenset({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING}),
    kernel=taylor_steps,
    stepper=FixedSteps,
)
