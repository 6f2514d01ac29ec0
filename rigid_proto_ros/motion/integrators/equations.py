# SPDX-License-Identifier: MIT
"""The equations of motion in principal axes, as integrators evaluate them.

q xyzw takes principal to world axes, ω is in principal axes, d and u are the added displacement and velocity in world
axes (motion/variables.py), p is the segment's problem (motion/problem.py). ``taut`` says whether the string's law of
tension holds; where it changes is found by integrators/string_law.py.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate, rotate_inverse
from ..string import NO_DIRECTION


@njit(cache=True, error_model="numpy", allocates=False)
def undamped_torque(qx: float, qy: float, qz: float, qw: float, p: np.record) -> tuple[float, float, float]:
    """Torque of the loads about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R)."""
    tx, ty, tz = p.torque_body[0], p.torque_body[1], p.torque_body[2]
    if p.has_world_torque:
        W, M = p.torque_world, p.moment
        x, y, z = rotate_inverse(qx, qy, qz, qw, W[0], W[1], W[2])
        # Row i of M R is Rᵀ times row i of M; vee takes (M R)₁₂ − (M R)₂₁ and so on, counted from 0.
        _, m01, m02 = rotate_inverse(qx, qy, qz, qw, M[0], M[1], M[2])
        m10, _, m12 = rotate_inverse(qx, qy, qz, qw, M[3], M[4], M[5])
        m20, m21, _ = rotate_inverse(qx, qy, qz, qw, M[6], M[7], M[8])
        tx += x + (m12 - m21)
        ty += y + (m20 - m02)
        tz += z + (m01 - m10)
    return tx, ty, tz


@njit(cache=True, error_model="numpy", allocates=False)
def torque(
    qx: float, qy: float, qz: float, qw: float, wx: float, wy: float, wz: float, p: np.record
) -> tuple[float, float, float]:
    """Torque of loads and damping about the COM in principal axes: τ_b + Rᵀτ_w + vee(M R) − c_ω ω."""
    tx, ty, tz = undamped_torque(qx, qy, qz, qw, p)
    c = p.damping_angular
    return tx - c * wx, ty - c * wy, tz - c * wz


@njit(cache=True, error_model="numpy", allocates=False)
def angular_acceleration(
    wx: float, wy: float, wz: float, tx: float, ty: float, tz: float, p: np.record
) -> tuple[float, float, float]:
    """Euler's equations in principal axes: ω' = I⁻¹(τ − ω × Iω); without the gyroscopic term I⁻¹τ."""
    a, b, c = p.moments[0], p.moments[1], p.moments[2]
    g = p.gyroscopic
    return (tx - g * (c - b) * wy * wz) / a, (ty - g * (a - c) * wz * wx) / b, (tz - g * (b - a) * wx * wy) / c


@njit(cache=True, error_model="numpy", allocates=False)
def added_acceleration(
    qx: float, qy: float, qz: float, qw: float, ux: float, uy: float, uz: float, p: np.record
) -> tuple[float, float, float]:
    """Acceleration of the added motion without the string: its constant part, R g_b and −c_v u."""
    own, added = p.acceleration_body, p.acceleration_added
    ax, ay, az = rotate(qx, qy, qz, qw, own[0], own[1], own[2])
    c = p.damping_linear
    return ax + (added[0] - c * ux), ay + (added[1] - c * uy), az + (added[2] - c * uz)


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
    p: np.record,
) -> tuple[float, ...]:
    """From the free end to the knot, a (3,), and its rate a' (3,), world axes."""
    arm, start = p.attach, p.string_start
    rx, ry, rz = arm[0], arm[1], arm[2]
    bx, by, bz = rotate(qx, qy, qz, qw, rx, ry, rz)
    vx, vy, vz = rotate(qx, qy, qz, qw, wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx)
    return start[0] + dx + bx, start[1] + dy + by, start[2] + dz + bz, ux + vx, uy + vy, uz + vz


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
    p: np.record,
    taut: bool,
) -> tuple[float, ...]:
    """Force on the knot (world axes), torque about the COM (principal axes), power of the hand, power
    lost in the damper.
    """
    ax, ay, az, vx, vy, vz = knot(qx, qy, qz, qw, wx, wy, wz, dx, dy, dz, ux, uy, uz, p)
    k, c, rest = p.stiffness, p.string_damping, p.rest_length
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
    arm, hand = p.attach, p.hand_velocity
    bx, by, bz = rotate_inverse(qx, qy, qz, qw, fx, fy, fz)
    rx, ry, rz = arm[0], arm[1], arm[2]
    work = fx * hand[0] + fy * hand[1] + fz * hand[2]
    return fx, fy, fz, ry * bz - rz * by, rz * bx - rx * bz, rx * by - ry * bx, work, heat


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
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
    p: np.record,
    taut: bool,
) -> tuple[float, ...]:
    """ω' (principal axes), u' (world axes), power of the hand, power lost in the string's damper, for a unit q."""
    tx, ty, tz = torque(qx, qy, qz, qw, wx, wy, wz, p)
    if not p.translates:
        ex, ey, ez = angular_acceleration(wx, wy, wz, tx, ty, tz, p)
        return ex, ey, ez, 0.0, 0.0, 0.0, 0.0, 0.0
    ax, ay, az = added_acceleration(qx, qy, qz, qw, ux, uy, uz, p)
    work, heat = 0.0, 0.0
    if p.has_string:
        fx, fy, fz, sx, sy, sz, work, heat = string_pull(qx, qy, qz, qw, wx, wy, wz, dx, dy, dz, ux, uy, uz, p, taut)
        m = p.mass
        ax, ay, az = ax + fx / m, ay + fy / m, az + fz / m
        tx, ty, tz = tx + sx, ty + sy, tz + sz
    ex, ey, ez = angular_acceleration(wx, wy, wz, tx, ty, tz, p)
    return ex, ey, ez, ax, ay, az, work, heat


@njit(cache=True, error_model="numpy", allocates=False)
def knot_of(y: np.ndarray, p: np.record) -> tuple[float, ...]:
    """``knot`` at variables y: six numbers."""
    return knot(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12], p)


@njit(cache=True, error_model="numpy", allocates=False)
def stretch(y: np.ndarray, p: np.record) -> tuple[float, float]:
    """x = l − rest length, and its rate, of variables y; (1, 0) for a string whose law never changes."""
    if p.bilateral or not p.has_string:
        return 1.0, 0.0
    ax, ay, az, vx, vy, vz = knot_of(y, p)
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0:
        return -p.rest_length, 0.0
    return length - p.rest_length, (ax * vx + ay * vy + az * vz) / length


@njit(cache=True, error_model="numpy", allocates=False)
def tension_margin(y: np.ndarray, p: np.record) -> float:
    """min(k x, k x + c x'): positive exactly while the string pulls."""
    x, rate = stretch(y, p)
    spring = p.stiffness * x
    return min(spring, spring + p.string_damping * rate)
