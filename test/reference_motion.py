# SPDX-License-Identifier: MIT
"""High-precision motion of a rigid body to judge integrators by. It never competes and shares no code with them.

Two independent ways, both with mpmath: Jacobi's closed form of torque-free rotation, and Taylor series of the equations of
motion under any load the simulation knows (test/reference_taylor.py). Doubles are taken as the exact numbers they are.
"""

from __future__ import annotations

from functools import lru_cache

import mpmath
import numpy as np
from mpmath import mp, mpf

DIGITS = 50


def angle_between(q, matrix) -> float:
    """Angle [rad] of the rotation from a reference attitude, matrix (3, 3) mpf, to a quaternion q (4,) xyzw of doubles."""
    with mp.workdps(DIGITS):
        squares = ((rotation_of([float(c) for c in q]) - matrix) ** 2).sum()
        # |A - B|² = 8 sin²(angle/2) for two rotations: exact, and without cancellation for small angles.
        return float(2 * mpmath.asin(min(mpf(1), mpmath.sqrt(squares / 8))))


def rotation_of(q):
    """Rotation matrix (3, 3) mpf, body to world, of a quaternion xyzw, normalized in high precision."""
    x, y, z, w = (mpf(c) for c in q)
    s = 2 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


def free_motion(inertia, angular_velocity_body, time, orientation_xyzw=(0, 0, 0, 1), digits=DIGITS):
    """Torque-free rotation in closed form: R (3, 3) and ω body (3,) at ``time``, all mpf.

    inertia 3 × 3 [kg m², body axes], three different moments; ω body [rad/s] not on a principal axis; time [s].
    Source: Landau and Lifshitz, Mechanics (1976), section 37; the precession angle by the incomplete elliptic integral Π.
    """
    key = tuple(tuple(float(x) for x in row) for row in inertia)
    return _free_motion(
        key, tuple(map(float, angular_velocity_body)), mpf(time), tuple(map(float, orientation_xyzw)), digits
    )


@lru_cache(maxsize=512)
def _free_motion(inertia, w0, time, q0, digits):
    # Near a separatrix or on thin rods the closed form cancels; 30 guard digits pay for that.
    with mp.workdps(digits + 30):
        moments, axes = mpmath.eigsy(mpmath.matrix([list(row) for row in inertia]))
        axes = np.array(axes.tolist())
        axes[:, 2] *= mpmath.sign(axes[:, 0] @ np.cross(axes[:, 1], axes[:, 2]))
        w = axes.T @ w0
        first, second, third = moments
        # dn belongs to the axis about which the body circulates: the largest moment's, or else the smallest's.
        if third * (third - second) * w[2] ** 2 < first * (second - first) * w[0] ** 2:
            swap = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])
            axes, w = axes @ swap, swap.T @ w
            first, third = third, first
        R, w = _circulating(first, second, third, w, time)
        return rotation_of(q0) @ axes @ R @ axes.T, axes @ w


def _circulating(A, B, C, w, time):
    """R(t) with R(0) = 1 and ω(t), in principal axes A, B, C of which the third is the circulation axis."""
    a = mpmath.sqrt(w[0] ** 2 + w[1] ** 2 * B * (C - B) / (A * (C - A)))
    c = mpmath.sign(w[2]) * mpmath.sqrt(w[2] ** 2 + w[1] ** 2 * B * (B - A) / (C * (C - A)))
    rate = mpmath.sqrt((C - B) * (C - A) / (A * B)) * abs(c)
    b = (C - A) * a * c / (rate * B)
    k2 = (B - A) * A * a**2 / ((C - B) * C * c**2)
    quarter = mpmath.ellipk(k2)
    phase0 = mpmath.atan2(w[1] / b, w[0] / a)
    u0 = mpmath.ellipf(phase0, k2)
    u = u0 + rate * time
    sn, cn, dn = (mpmath.ellipfun(name, u, m=k2) for name in ("sn", "cn", "dn"))
    turned = np.array([a * cn, b * sn, c * dn])
    # The amplitude am u, continuous over all turns.
    phase = mpmath.atan2(sn, cn)
    phase += 2 * mp.pi * mpmath.nint((u / quarter * mp.pi / 2 - phase) / (2 * mp.pi))
    m0, m1 = np.array([A, B, C]) * w, np.array([A, B, C]) * turned
    L2 = m0 @ m0
    L, twice_energy = mpmath.sqrt(L2), A * w[0] ** 2 + B * w[1] ** 2 + C * w[2] ** 2
    # φ' = L (2E − m₃²/C)/(L² − m₃²), m₃ = C c dn u: its integral is linear in t plus Π.
    rest = (A * a) ** 2
    n = -((C * c) ** 2) * k2 / rest
    precession = L / C * time + L * (twice_energy - L2 / C) / (rest * rate) * (
        mpmath.ellippi(n, phase, k2) - mpmath.ellippi(n, phase0, k2)
    )
    cosine, sine = mpmath.cos(precession), mpmath.sin(precession)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return _node_frame(m0).T @ turn @ _node_frame(m1), turned


def _node_frame(m):
    """Rows: the line of nodes m × e₃, m × node, m, all unit: body to the frame whose third axis is L."""
    node = np.array([m[1], -m[0], mpf(0)]) / mpmath.hypot(m[0], m[1])
    unit = m / mpmath.sqrt(m @ m)
    return np.array([node, np.cross(unit, node), unit])
