# SPDX-License-Identifier: MIT
"""Exact derivatives of the equations of motion (integrators/equations.py), for the iteration of an implicit step."""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate, rotate_inverse
from .. import problem as of
from ..string import NO_DIRECTION
from .equations import knot


@njit(cache=True, error_model="numpy")
def _cross_into(M: np.ndarray, scale: float, x: float, y: float, z: float, row: int, column: int) -> None:
    """Add scale [v]× to the 3 × 3 block of M at row, column."""
    M[row, column + 1] -= scale * z
    M[row, column + 2] += scale * y
    M[row + 1, column] += scale * z
    M[row + 1, column + 2] -= scale * x
    M[row + 2, column] -= scale * y
    M[row + 2, column + 1] += scale * x


@njit(cache=True, error_model="numpy")
def derivatives(
    q: np.ndarray,
    w: np.ndarray,
    d: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    taut: bool,
    R: np.ndarray,
    Jv: np.ndarray,
    Jx: np.ndarray,
    K: np.ndarray,
) -> None:
    """Derivatives (6, 6) of (ω' in principal axes, u') by velocities (W, u) and by turn and displacement (ξ, d), all in
    world axes.

    R (3, 3) is filled with the attitude's matrix; K (2, 3, 3) is scratch.
    """
    Jv[:, :] = 0.0
    Jx[:, :] = 0.0
    for k in range(3):
        e0, e1, e2 = rotate(q[0], q[1], q[2], q[3], 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        R[0, k], R[1, k], R[2, k] = e0, e1, e2
    i1, i2, i3 = p[of.MOMENTS], p[of.MOMENTS + 1], p[of.MOMENTS + 2]
    g, cw = p[of.GYROSCOPIC], p[of.DAMPING_ANGULAR]
    # Torque in principal axes by ω there, then by W: G Rᵀ.
    g01, g02 = g * (i2 - i3) * w[2], g * (i2 - i3) * w[1]
    g10, g12 = g * (i3 - i1) * w[2], g * (i3 - i1) * w[0]
    g20, g21 = g * (i1 - i2) * w[1], g * (i1 - i2) * w[0]
    for k in range(3):
        Jv[0, k] = -cw * R[k, 0] + g01 * R[k, 1] + g02 * R[k, 2]
        Jv[1, k] = g10 * R[k, 0] - cw * R[k, 1] + g12 * R[k, 2]
        Jv[2, k] = g20 * R[k, 0] + g21 * R[k, 1] - cw * R[k, 2]
    # A torque in world axes: its change, less ξ × τ, is turned into principal axes below.
    S = K[0]
    S[:, :] = 0.0
    if p[of.HAS_WORLD_TORQUE] != 0.0:
        T, M = of.TORQUE_WORLD, of.MOMENT
        for k in range(3):
            x, y, z = rotate_inverse(q[0], q[1], q[2], q[3], 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
            # Rᵀ(τ × e_k), and vee of M [e_k]× R: the arms of world forces turn.
            tx, ty, tz = rotate_inverse(q[0], q[1], q[2], q[3], p[T], p[T + 1], p[T + 2])
            Jx[0, k] += ty * z - tz * y
            Jx[1, k] += tz * x - tx * z
            Jx[2, k] += tx * y - ty * x
            for i in range(3):
                # Row i of M [e_k]×, then times R: (m × e_k) turned into principal axes.
                mx, my, mz = rotate_inverse(q[0], q[1], q[2], q[3], p[M + 3 * i], p[M + 3 * i + 1], p[M + 3 * i + 2])
                S[i, 0], S[i, 1], S[i, 2] = my * z - mz * y, mz * x - mx * z, mx * y - my * x
            Jx[0, k] += S[1, 2] - S[2, 1]
            Jx[1, k] += S[2, 0] - S[0, 2]
            Jx[2, k] += S[0, 1] - S[1, 0]
    if p[of.TRANSLATES] != 0.0:
        B, cv = of.ACCELERATION_BODY, p[of.DAMPING_LINEAR]
        bx, by, bz = rotate(q[0], q[1], q[2], q[3], p[B], p[B + 1], p[B + 2])
        _cross_into(Jx, -1.0, bx, by, bz, 3, 0)
        for k in range(3):
            Jv[3 + k, 3 + k] -= cv
        if p[of.HAS_STRING] != 0.0:
            _string_derivatives(q, w, d, u, p, taut, R, Jv, Jx, K)
    for k in range(6):
        Jv[0, k] /= i1
        Jv[1, k] /= i2
        Jv[2, k] /= i3
        Jx[0, k] /= i1
        Jx[1, k] /= i2
        Jx[2, k] /= i3


@njit(cache=True, error_model="numpy")
def _string_derivatives(
    q: np.ndarray,
    w: np.ndarray,
    d: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    taut: bool,
    R: np.ndarray,
    Jv: np.ndarray,
    Jx: np.ndarray,
    K: np.ndarray,
) -> None:
    """Add the string's part, its torque not yet divided by the moments: δF = K₀ δa' + K₁ δa with δa = δd + ξ × ρ and
    δa' = δu + δW × ρ + ξ × (W × ρ), torque Rᵀ(ρ × (δF − ξ × F))."""
    k, c, rest = p[of.STIFFNESS], p[of.STRING_DAMPING], p[of.REST_LENGTH]
    ax, ay, az, vx, vy, vz = knot(q[0], q[1], q[2], q[3], w[0], w[1], w[2], d[0], d[1], d[2], u[0], u[1], u[2], p)
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if rest != 0.0 and (not taut or length < NO_DIRECTION * rest):
        return
    r0, r1, r2 = rotate(q[0], q[1], q[2], q[3], p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2])
    # W × ρ
    e0, e1, e2 = vx - u[0], vy - u[1], vz - u[2]
    Kv, Kx = K[0], K[1]
    if rest == 0.0:
        Kv[:, :] = 0.0
        Kx[:, :] = 0.0
        for j in range(3):
            Kv[j, j] = -c
            Kx[j, j] = -k
        f0, f1, f2 = -k * ax - c * vx, -k * ay - c * vy, -k * az - c * vz
    else:
        n = (ax / length, ay / length, az / length)
        v = (vx, vy, vz)
        rate = n[0] * vx + n[1] * vy + n[2] * vz
        tension = k * (length - rest) + c * rate
        f0, f1, f2 = -tension * n[0], -tension * n[1], -tension * n[2]
        for i in range(3):
            for j in range(3):
                nn = n[i] * n[j]
                across = (1.0 if i == j else 0.0) - nn
                Kv[i, j] = -c * nn
                Kx[i, j] = -k * nn - tension / length * across - c * n[i] * (v[j] - rate * n[j]) / length
    m = p[of.MASS]
    for j in range(12):
        # Column j: unit change of W, u, ξ or d.
        x, y, z = 1.0 * (j % 3 == 0), 1.0 * (j % 3 == 1), 1.0 * (j % 3 == 2)
        s0, s1, s2, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        g0, g1, g2 = 0.0, 0.0, 0.0
        if j < 3:
            t0, t1, t2 = y * r2 - z * r1, z * r0 - x * r2, x * r1 - y * r0
        elif j < 6:
            t0, t1, t2 = x, y, z
        elif j < 9:
            s0, s1, s2 = y * r2 - z * r1, z * r0 - x * r2, x * r1 - y * r0
            t0, t1, t2 = y * e2 - z * e1, z * e0 - x * e2, x * e1 - y * e0
            g0, g1, g2 = y * f2 - z * f1, z * f0 - x * f2, x * f1 - y * f0
        else:
            s0, s1, s2 = x, y, z
        d0 = Kv[0, 0] * t0 + Kv[0, 1] * t1 + Kv[0, 2] * t2 + Kx[0, 0] * s0 + Kx[0, 1] * s1 + Kx[0, 2] * s2
        d1 = Kv[1, 0] * t0 + Kv[1, 1] * t1 + Kv[1, 2] * t2 + Kx[1, 0] * s0 + Kx[1, 1] * s1 + Kx[1, 2] * s2
        d2 = Kv[2, 0] * t0 + Kv[2, 1] * t1 + Kv[2, 2] * t2 + Kx[2, 0] * s0 + Kx[2, 1] * s1 + Kx[2, 2] * s2
        h0, h1, h2 = d0 - g0, d1 - g1, d2 - g2
        h0, h1, h2 = r1 * h2 - r2 * h1, r2 * h0 - r0 * h2, r0 * h1 - r1 * h0
        J = Jv if j < 6 else Jx
        column = j % 6
        J[3, column] += d0 / m
        J[4, column] += d1 / m
        J[5, column] += d2 / m
        for i in range(3):
            J[i, column] += R[0, i] * h0 + R[1, i] * h1 + R[2, i] * h2
