# SPDX-License-Identifier: MIT
"""semi_implicit_euler: velocities first, then positions with the new velocities, as game engines step.

Order 1, one evaluation a step; the attitude moves by the exponential map. Source: Hairer, Lubich and Wanner, Geometric
Numerical Integration (2006), section I.1 (symplectic Euler). Symplectic only where velocities do not act on velocities:
the gyroscopic term is taken explicitly, so a spinning body gains energy.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import exponential, multiply, normalize
from .equations import accelerations
from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .runge_kutta import repeated
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.record, h: float, pulls: bool, _k: np.ndarray, out: np.ndarray) -> None:
    qx, qy, qz, qw, wx, wy, wz = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    ex, ey, ez, ax, ay, az, work, heat = accelerations(
        qx, qy, qz, qw, wx, wy, wz, y[7], y[8], y[9], y[10], y[11], y[12], p, pulls
    )
    wx, wy, wz = wx + h * ex, wy + h * ey, wz + h * ez
    rx, ry, rz, rw = exponential(h * wx, h * wy, h * wz)
    qx, qy, qz, qw = multiply(qx, qy, qz, qw, rx, ry, rz, rw)
    out[0], out[1], out[2], out[3] = normalize(qx, qy, qz, qw)
    out[4], out[5], out[6] = wx, wy, wz
    out[10], out[11], out[12] = y[10] + h * ax, y[11] + h * ay, y[12] + h * az
    out[7], out[8], out[9] = y[7] + h * out[10], y[8] + h * out[11], y[9] + h * out[12]
    out[13], out[14] = y[13] + h * work, y[14] + h * heat


@njit(cache=True, error_model="numpy")
def semi_implicit_euler_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, y, p, h, n, 1)


SEMI_IMPLICIT_EULER = Integrator(
    name="semi_implicit_euler",
    order=1,
    evaluations=1,
    source="Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), section I.1",
    limits="First order; a string stays bounded up to ω_s h of about 2, "
    "a spinning body gains energy beyond |ω|h of 0.1.",
    stability_limit=0.1,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=semi_implicit_euler_steps,
    make_methods=fixed_steps,
)
