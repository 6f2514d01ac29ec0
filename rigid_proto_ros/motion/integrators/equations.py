# SPDX-License-Identifier: MIT
"""The equations of motion in principal axes, as integrators evaluate them, and the string's force. The other forces are
in motion/problem.py.

q xyzw takes principal to world axes, w = ω is in principal axes, d and u are the added displacement and velocity in
world axes (motion/problem.py), p is the segment's problem (motion/problem.py). ``taut`` says whether the string's law
of tension holds; where it changes is found by integrators/string_law.py.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import norm, rotate, rotate_inverse
from ...base.vectors import Quaternion, Vector
from ..problem import acceleration, torque
from ..string import NO_DIRECTION


@njit(cache=True, error_model="numpy", allocates=False)
def parts_of(y: np.ndarray) -> tuple[Quaternion, Vector, Vector, Vector]:
    """q, ω, d and u of the variables y."""
    return (y[0], y[1], y[2], y[3]), (y[4], y[5], y[6]), (y[7], y[8], y[9]), (y[10], y[11], y[12])


@njit(cache=True, error_model="numpy", allocates=False)
def angular_acceleration(w: Vector, t: Vector, p: np.record) -> Vector:
    """Euler's equations in principal axes: ω' = I⁻¹(τ − ω × Iω); without the gyroscopic term I⁻¹τ."""
    A, B, C, g = p.moments[0], p.moments[1], p.moments[2], p.gyroscopic
    return (
        (t[0] - g * (C - B) * w[1] * w[2]) / A,
        (t[1] - g * (A - C) * w[2] * w[0]) / B,
        (t[2] - g * (B - A) * w[0] * w[1]) / C,
    )


@njit(cache=True, error_model="numpy", allocates=False)
def knot(q: Quaternion, w: Vector, d: Vector, u: Vector, p: np.record) -> tuple[Vector, Vector]:
    """From the free end to the knot, a, and its rate a', world axes."""
    r, start = p.attach, p.string_start
    bx, by, bz = rotate(*q, r[0], r[1], r[2])
    vx, vy, vz = rotate(*q, w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0])
    a = start[0] + d[0] + bx, start[1] + d[1] + by, start[2] + d[2] + bz
    return a, (u[0] + vx, u[1] + vy, u[2] + vz)


@njit(cache=True, error_model="numpy", allocates=False)
def string_pull(
    q: Quaternion, w: Vector, d: Vector, u: Vector, p: np.record, taut: bool
) -> tuple[Vector, Vector, float, float]:
    """Force on the knot (world axes), torque about the COM (principal axes), power of the hand, power lost in the
    damper.
    """
    a, v = knot(q, w, d, u, p)
    k, c, rest = p.stiffness, p.string_damping, p.rest_length
    if rest == 0.0:
        fx, fy, fz = -k * a[0] - c * v[0], -k * a[1] - c * v[1], -k * a[2] - c * v[2]
        heat = c * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    else:
        length = norm(*a)
        if not taut or length < NO_DIRECTION * rest:
            return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0
        nx, ny, nz = a[0] / length, a[1] / length, a[2] / length
        rate = nx * v[0] + ny * v[1] + nz * v[2]
        tension = k * (length - rest) + c * rate
        fx, fy, fz = -tension * nx, -tension * ny, -tension * nz
        heat = c * rate * rate
    r, hand = p.attach, p.hand_velocity
    bx, by, bz = rotate_inverse(*q, fx, fy, fz)
    about_com = r[1] * bz - r[2] * by, r[2] * bx - r[0] * bz, r[0] * by - r[1] * bx
    return (fx, fy, fz), about_com, fx * hand[0] + fy * hand[1] + fz * hand[2], heat


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def accelerations(
    q: Quaternion, w: Vector, d: Vector, u: Vector, p: np.record, taut: bool
) -> tuple[Vector, Vector, float, float]:
    """ω' (principal axes), u' (world axes), power of the hand, power lost in the string's damper, for a unit q.

    I ω' = τ − ω × Iω, without the gyroscopic term τ; u' is what ``acceleration`` gives and the string's F/m.
    """
    if not p.translates:
        return angular_acceleration(w, torque(q, w, p), p), (0.0, 0.0, 0.0), 0.0, 0.0
    tx, ty, tz = torque(q, w, p)
    ax, ay, az = acceleration(q, u, p)
    work, heat = 0.0, 0.0
    if p.has_string:
        force, about_com, work, heat = string_pull(q, w, d, u, p, taut)
        ax, ay, az = ax + force[0] / p.mass, ay + force[1] / p.mass, az + force[2] / p.mass
        tx, ty, tz = tx + about_com[0], ty + about_com[1], tz + about_com[2]
    return angular_acceleration(w, (tx, ty, tz), p), (ax, ay, az), work, heat


@njit(cache=True, error_model="numpy", allocates=False)
def knot_of(y: np.ndarray, p: np.record) -> tuple[Vector, Vector]:
    """``knot`` at variables y."""
    q, w, d, u = parts_of(y)
    return knot(q, w, d, u, p)


@njit(cache=True, error_model="numpy", allocates=False)
def stretch(y: np.ndarray, p: np.record) -> tuple[float, float]:
    """x = l − rest length, and its rate, of variables y; (1, 0) for a string whose law never changes."""
    if p.bilateral or not p.has_string:
        return 1.0, 0.0
    a, v = knot_of(y, p)
    length = norm(*a)
    if length == 0.0:
        return -p.rest_length, 0.0
    return length - p.rest_length, (a[0] * v[0] + a[1] * v[1] + a[2] * v[2]) / length


@njit(cache=True, error_model="numpy", allocates=False)
def tension_margin(y: np.ndarray, p: np.record) -> float:
    """min(k x, k x + c x'): positive exactly while the string pulls."""
    x, rate = stretch(y, p)
    spring = p.stiffness * x
    return float(min(spring, spring + p.string_damping * rate))
