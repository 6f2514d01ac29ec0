# SPDX-License-Identifier: MIT
"""The equations of motion in principal axes, as integrators evaluate them.

q xyzw takes principal to world axes, ω is in principal axes, d and u are the added displacement and velocity in world
axes (motion/variables.py), p is the segment's problem (motion/problem.py). ``taut`` says whether the string's law of
tension holds; where it changes is found by integrators/slack.py.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate, rotate_inverse
from .. import problem as of
from ..string import NO_DIRECTION


@njit(cache=True, error_model="numpy", allocates=False)
def undamped_torque(qx: float, qy: float, qz: float, qw: float, p: np.ndarray) -> tuple[float, float, float]:
    """Torque of the loads about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R)."""
    tx, ty, tz = p[of.TORQUE_BODY], p[of.TORQUE_BODY + 1], p[of.TORQUE_BODY + 2]
    if p[of.HAS_WORLD_TORQUE] != 0.0:
        W, M = of.TORQUE_WORLD, of.MOMENT
        x, y, z = rotate_inverse(qx, qy, qz, qw, p[W], p[W + 1], p[W + 2])
        # Row i of M R is Rᵀ times row i of M; vee takes (M R)₁₂ − (M R)₂₁ and so on, counted from 0.
        _, m01, m02 = rotate_inverse(qx, qy, qz, qw, p[M], p[M + 1], p[M + 2])
        m10, _, m12 = rotate_inverse(qx, qy, qz, qw, p[M + 3], p[M + 4], p[M + 5])
        m20, m21, _ = rotate_inverse(qx, qy, qz, qw, p[M + 6], p[M + 7], p[M + 8])
        tx += x + (m12 - m21)
        ty += y + (m20 - m02)
        tz += z + (m01 - m10)
    return tx, ty, tz


@njit(cache=True, error_model="numpy", allocates=False)
def torque(
    qx: float, qy: float, qz: float, qw: float, wx: float, wy: float, wz: float, p: np.ndarray
) -> tuple[float, float, float]:
    """Torque of loads and damping about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R) − c_ω ω."""
    tx, ty, tz = undamped_torque(qx, qy, qz, qw, p)
    c = p[of.DAMPING_ANGULAR]
    return tx - c * wx, ty - c * wy, tz - c * wz


@njit(cache=True, error_model="numpy", allocates=False)
def angular_acceleration(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, p: np.ndarray
) -> tuple[float, float, float]:
    """Euler's equations in principal axes: ω' = I⁻¹(τ − ω × Iω); without the gyroscopic term I⁻¹τ."""
    a, b, c = p[of.MOMENTS], p[of.MOMENTS + 1], p[of.MOMENTS + 2]
    g = p[of.GYROSCOPIC]
    return (tx - g * (c - b) * wy * wz) / a, (ty - g * (a - c) * wz * wx) / b, (tz - g * (b - a) * wx * wy) / c


@njit(cache=True, error_model="numpy", allocates=False)
def added_acceleration(
    qx: float, qy: float, qz: float, qw: float, ux: float, uy: float, uz: float, p: np.ndarray
) -> tuple[float, float, float]:
    """Acceleration of the added motion without the string: its constant part, R g_b and −c_v u."""
    B, G = of.ACCELERATION_BODY, of.ACCELERATION_ADDED
    ax, ay, az = rotate(qx, qy, qz, qw, p[B], p[B + 1], p[B + 2])
    c = p[of.DAMPING_LINEAR]
    return ax + (p[G] - c * ux), ay + (p[G + 1] - c * uy), az + (p[G + 2] - c * uz)


@njit(cache=True, error_model="numpy", allocates=False)
def knot(
    qx: float,
    qy: float,
    qz: float,
    qw: float,
    wx: float,
    wy: float,
    wz: float,
    dx: float,
    dy: float,
    dz: float,
    ux: float,
    uy: float,
    uz: float,
    p: np.ndarray,
) -> tuple[float, ...]:
    """From the free end to the knot, a (3,), and its rate a' (3,), world axes."""
    A, S = of.ATTACH, of.STRING_START
    rx, ry, rz = p[A], p[A + 1], p[A + 2]
    bx, by, bz = rotate(qx, qy, qz, qw, rx, ry, rz)
    vx, vy, vz = rotate(qx, qy, qz, qw, wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx)
    return p[S] + dx + bx, p[S + 1] + dy + by, p[S + 2] + dz + bz, ux + vx, uy + vy, uz + vz


@njit(cache=True, error_model="numpy", allocates=False)
def string_pull(
    qx: float,
    qy: float,
    qz: float,
    qw: float,
    wx: float,
    wy: float,
    wz: float,
    dx: float,
    dy: float,
    dz: float,
    ux: float,
    uy: float,
    uz: float,
    p: np.ndarray,
    taut: bool,
) -> tuple[float, ...]:
    """Force on the knot (world axes), torque about the COM (principal axes), power of the hand, power
    lost in the damper.
    """
    ax, ay, az, vx, vy, vz = knot(qx, qy, qz, qw, wx, wy, wz, dx, dy, dz, ux, uy, uz, p)
    k, c, rest = p[of.STIFFNESS], p[of.STRING_DAMPING], p[of.REST_LENGTH]
    if rest == 0.0:
        fx, fy, fz = -k * ax - c * vx, -k * ay - c * vy, -k * az - c * vz
        heat = c * (vx * vx + vy * vy + vz * vz)
    else:
        length = math.sqrt(ax * ax + ay * ay + az * az)
        if not taut or length < NO_DIRECTION * rest:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        nx, ny, nz = ax / length, ay / length, az / length
        rate = nx * vx + ny * vy + nz * vz
        tension = k * (length - rest) + c * rate
        fx, fy, fz = -tension * nx, -tension * ny, -tension * nz
        heat = c * rate * rate
    A, H = of.ATTACH, of.HAND_VELOCITY
    bx, by, bz = rotate_inverse(qx, qy, qz, qw, fx, fy, fz)
    rx, ry, rz = p[A], p[A + 1], p[A + 2]
    work = fx * p[H] + fy * p[H + 1] + fz * p[H + 2]
    return fx, fy, fz, ry * bz - rz * by, rz * bx - rx * bz, rx * by - ry * bx, work, heat


@njit(cache=True, error_model="numpy", allocates=False)
def accelerations(
    qx: float,
    qy: float,
    qz: float,
    qw: float,
    wx: float,
    wy: float,
    wz: float,
    dx: float,
    dy: float,
    dz: float,
    ux: float,
    uy: float,
    uz: float,
    p: np.ndarray,
    taut: bool,
) -> tuple[float, ...]:
    """ω' (principal axes), u' (world axes), power of the hand, power lost in the string's damper, for a unit q."""
    tx, ty, tz = torque(qx, qy, qz, qw, wx, wy, wz, p)
    if p[of.TRANSLATES] == 0.0:
        ex, ey, ez = angular_acceleration(wx, wy, wz, tx, ty, tz, p)
        return ex, ey, ez, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay, az = added_acceleration(qx, qy, qz, qw, ux, uy, uz, p)
    work, heat = 0.0, 0.0
    if p[of.HAS_STRING] != 0.0:
        fx, fy, fz, sx, sy, sz, work, heat = string_pull(qx, qy, qz, qw, wx, wy, wz, dx, dy, dz, ux, uy, uz, p, taut)
        m = p[of.MASS]
        ax, ay, az = ax + fx / m, ay + fy / m, az + fz / m
        tx, ty, tz = tx + sx, ty + sy, tz + sz
    ex, ey, ez = angular_acceleration(wx, wy, wz, tx, ty, tz, p)
    return ex, ey, ez, ax, ay, az, work, heat


@njit(cache=True, error_model="numpy", allocates=False)
def stretch(y: np.ndarray, p: np.ndarray) -> tuple[float, float]:
    """x = l − rest length, and its rate, of variables y; (1, 0) for a string whose law never changes."""
    if p[of.BILATERAL] != 0.0 or p[of.HAS_STRING] == 0.0:
        return 1.0, 0.0
    ax, ay, az, vx, vy, vz = knot(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12], p)
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0:
        return -p[of.REST_LENGTH], 0.0
    return length - p[of.REST_LENGTH], (ax * vx + ay * vy + az * vz) / length


@njit(cache=True, error_model="numpy", allocates=False)
def tension_margin(x: float, rate: float, p: np.ndarray) -> float:
    """Positive exactly while the string pulls: min(k x, k x + c x')."""
    spring = p[of.STIFFNESS] * x
    return min(spring, spring + p[of.STRING_DAMPING] * rate)
