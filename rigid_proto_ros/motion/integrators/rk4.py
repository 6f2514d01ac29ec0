# SPDX-License-Identifier: MIT
"""Classical Runge-Kutta of order 4 on the quaternion, normalized after each step.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1; Euler's equations
with the gyroscopic term, Goldstein, Classical Mechanics (2002), section 5.5. Order 4, 4 evaluations a step. Explicit:
it loses accuracy as |ω|h nears 1 and diverges beyond about 2.8. Not conservative: energy drifts with h⁵ per step.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import normalize
from .equations import added_acceleration, angular_acceleration, torque
from .integrator import (
    ANGULAR_DAMPING,
    LOADS,
    MAX_SPEED,
    NO_GYROSCOPIC_TERM,
    STRING,
    Integrator,
)
from .runge_kutta import tableau_steps_on_string
from .stepping import fixed_steps

TABLEAU = np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
WEIGHTS = np.array([1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0])


_Seven = tuple[float, float, float, float, float, float, float]
_Ten = tuple[float, float, float, float, float, float, float, float, float, float]


@njit(cache=True, error_model="numpy")
def _rates(
    qx: float,
    qy: float,
    qz: float,
    qw: float,
    wx: float,
    wy: float,
    wz: float,
    ux: float,
    uy: float,
    uz: float,
    p: np.record,
    translate: bool,
) -> _Ten:
    """Time derivatives of q, ω and the added velocity u."""
    nx, ny, nz, nw = qx, qy, qz, qw
    if translate or p.has_world_torque:
        # Stages leave the unit sphere by O(h²); directions of loads must not grow with them.
        nx, ny, nz, nw = normalize(qx, qy, qz, qw)
    tx, ty, tz = torque(nx, ny, nz, nw, wx, wy, wz, p)
    ax, ay, az = angular_acceleration(wx, wy, wz, tx, ty, tz, p)
    dqx = 0.5 * (qw * wx + qy * wz - qz * wy)
    dqy = 0.5 * (qw * wy - qx * wz + qz * wx)
    dqz = 0.5 * (qw * wz + qx * wy - qy * wx)
    dqw = -0.5 * (qx * wx + qy * wy + qz * wz)
    if translate:
        bx, by, bz = added_acceleration(nx, ny, nz, nw, ux, uy, uz, p)
        return dqx, dqy, dqz, dqw, ax, ay, az, bx, by, bz
    return dqx, dqy, dqz, dqw, ax, ay, az, 0.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def _sum(y: _Ten, k: _Ten, c: float) -> _Ten:
    """y + c k over q, ω and u."""
    return (
        y[0] + c * k[0],
        y[1] + c * k[1],
        y[2] + c * k[2],
        y[3] + c * k[3],
        y[4] + c * k[4],
        y[5] + c * k[5],
        y[6] + c * k[6],
        y[7] + c * k[7],
        y[8] + c * k[8],
        y[9] + c * k[9],
    )


@njit(cache=True, error_model="numpy")
def rk4_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    if not p.translates and not p.has_world_torque:
        return _turning_steps(y, p, h, n)
    translate = p.translates
    half, third, sixth = 0.5 * h, h / 3.0, h / 6.0
    # Variables stay out of the array, so that what p holds is read once and not in every step.
    u0: _Ten = (y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[10], y[11], y[12])
    dx, dy, dz = y[7], y[8], y[9]
    good = n
    for done in range(n):
        k1 = _rates(*u0, p, translate)
        u2 = _sum(u0, k1, half)
        k2 = _rates(*u2, p, translate)
        u3 = _sum(u0, k2, half)
        k3 = _rates(*u3, p, translate)
        u4 = _sum(u0, k3, h)
        k4 = _rates(*u4, p, translate)
        increment = _sum(_sum(_sum((0.0,) * 10, k1, sixth), k2, third), _sum(k3, k4, 0.5), third)
        new = _sum(u0, increment, 1.0)
        size = abs(new[4]) + abs(new[5]) + abs(new[6]) + abs(new[7]) + abs(new[8]) + abs(new[9])
        qx, qy, qz, qw = normalize(new[0], new[1], new[2], new[3])
        # Negated, so that NaN counts as a runaway.
        if not (size <= MAX_SPEED and math.isfinite(qx + qy + qz + qw)):
            good = done
            break
        if translate:
            # x' = u: the same weights on the stage velocities, so that x is of order 4 too.
            dx += h * u0[7] + h * h / 6.0 * (k1[7] + k2[7] + k3[7])
            dy += h * u0[8] + h * h / 6.0 * (k1[8] + k2[8] + k3[8])
            dz += h * u0[9] + h * h / 6.0 * (k1[9] + k2[9] + k3[9])
        u0 = (qx, qy, qz, qw, new[4], new[5], new[6], new[7], new[8], new[9])
    y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[10], y[11], y[12] = u0
    y[7], y[8], y[9] = dx, dy, dz
    return good


@njit(cache=True, error_model="numpy")
def _turn(qx: float, qy: float, qz: float, qw: float, wx: float, wy: float, wz: float, k: tuple[float, ...]) -> _Seven:
    """Rates of q and ω where the load turns along; k: τ/I (3,), c_ω/I (3,) and the gyroscopic factors (3,)."""
    tx, ty, tz, cx, cy, cz, gx, gy, gz = k
    return (
        0.5 * (qw * wx + qy * wz - qz * wy),
        0.5 * (qw * wy - qx * wz + qz * wx),
        0.5 * (qw * wz + qx * wy - qy * wx),
        -0.5 * (qx * wx + qy * wy + qz * wz),
        tx - cx * wx + gx * (wy * wz),
        ty - cy * wy + gy * (wz * wx),
        tz - cz * wz + gz * (wx * wy),
    )


@njit(cache=True, error_model="numpy")
def _moved(u: _Seven, k: _Seven, c: float) -> _Seven:
    """u + c k over q and ω."""
    return (
        u[0] + c * k[0],
        u[1] + c * k[1],
        u[2] + c * k[2],
        u[3] + c * k[3],
        u[4] + c * k[4],
        u[5] + c * k[5],
        u[6] + c * k[6],
    )


@njit(cache=True, error_model="numpy")
def _turning_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """The same where translation is closed form and no load hangs on the attitude: a fifth of the time."""
    a, b, c = p.moments[0], p.moments[1], p.moments[2]
    torque_body, g, d = p.torque_body, p.gyroscopic, p.damping_angular
    k = (
        *(torque_body[0] / a, torque_body[1] / b, torque_body[2] / c),
        *(d / a, d / b, d / c),
        *(g * (b - c) / a, g * (c - a) / b, g * (a - b) / c),
    )
    half, third, sixth = 0.5 * h, h / 3.0, h / 6.0
    u0: _Seven = (y[0], y[1], y[2], y[3], y[4], y[5], y[6])
    good = n
    for done in range(n):
        k1 = _turn(*u0, k)
        k2 = _turn(*_moved(u0, k1, half), k)
        k3 = _turn(*_moved(u0, k2, half), k)
        k4 = _turn(*_moved(u0, k3, h), k)
        increment = _moved(_moved(_moved((0.0,) * 7, k1, sixth), k2, third), _moved(k3, k4, 0.5), third)
        new = _moved(u0, increment, 1.0)
        qx, qy, qz, qw = normalize(new[0], new[1], new[2], new[3])
        if not (abs(new[4]) + abs(new[5]) + abs(new[6]) <= MAX_SPEED and math.isfinite(qx + qy + qz + qw)):
            good = done
            break
        u0 = (qx, qy, qz, qw, new[4], new[5], new[6])
    y[0], y[1], y[2], y[3], y[4], y[5], y[6] = u0
    return good


@njit(cache=True, error_model="numpy")
def rk4_string_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """The same by the tableau, each step cut where the string turns slack or taut."""
    return tableau_steps_on_string(y, p, h, n, TABLEAU, WEIGHTS)


RK4 = Integrator(
    name="rk4",
    order=4,
    evaluations=4,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1",
    limits="Explicit: diverges beyond |ω|h of about 2.8; energy drifts with h⁵ per step.",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=rk4_steps,
    string_kernel=rk4_string_steps,
    make_methods=fixed_steps,
)
