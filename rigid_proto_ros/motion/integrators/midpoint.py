# SPDX-License-Identifier: MIT
"""midpoint: the explicit midpoint step on a rotation matrix kept orthonormal by Gram-Schmidt, the paper's second
method.

Order 2, two evaluations a step (the paper's O(n³) is the local error). Source: "Interactively prototyping properties of
rigid bodies for physically-based animation" (2019); Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations
I (1993), section II.1. With ``gyroscopic: false`` it is the paper's eq. 9.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from .equations import accelerations
from .gram_schmidt import columns, orthonormal, quaternion_near, turned
from .integrator import (
    ANGULAR_DAMPING,
    LOADS,
    NO_GYROSCOPIC_TERM,
    STRING,
    Integrator,
)
from .runge_kutta import repeated, repeated_on_string
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.record, h: float, taut: bool, out: np.ndarray) -> None:
    """One step of h seconds from y into out, the string's law given."""
    qx, qy, qz, qw, wx, wy, wz = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    ex, ey, ez, ax, ay, az, work, heat = accelerations(
        qx, qy, qz, qw, wx, wy, wz, y[7], y[8], y[9], y[10], y[11], y[12], p, taut
    )
    half = 0.5 * h
    R = columns(qx, qy, qz, qw)
    middle = orthonormal(turned(R, R, wx, wy, wz, half))
    mx, my, mz, mw = quaternion_near(middle, qx, qy, qz, qw)
    vx, vy, vz = wx + half * ex, wy + half * ey, wz + half * ez
    ux, uy, uz = y[10] + half * ax, y[11] + half * ay, y[12] + half * az
    dx, dy, dz = y[7] + half * y[10], y[8] + half * y[11], y[9] + half * y[12]
    ex, ey, ez, ax, ay, az, work, heat = accelerations(mx, my, mz, mw, vx, vy, vz, dx, dy, dz, ux, uy, uz, p, taut)
    R = orthonormal(turned(R, middle, vx, vy, vz, h))
    out[0], out[1], out[2], out[3] = quaternion_near(R, mx, my, mz, mw)
    out[4], out[5], out[6] = wx + h * ex, wy + h * ey, wz + h * ez
    out[7], out[8], out[9] = y[7] + h * ux, y[8] + h * uy, y[9] + h * uz
    out[10], out[11], out[12] = y[10] + h * ax, y[11] + h * ay, y[12] + h * az
    out[13], out[14] = y[13] + h * work, y[14] + h * heat


@njit(cache=True, error_model="numpy")
def midpoint_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, y, p, h, n)


@njit(cache=True, error_model="numpy")
def midpoint_string_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """The same, each step cut where the string turns slack or taut."""
    return repeated_on_string(_step, y, p, h, n)


MIDPOINT = Integrator(
    name="midpoint",
    order=2,
    evaluations=2,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: energy drifts with h³ per step; diverges beyond |ω|h of about 1.",
    stability_limit=0.3,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=midpoint_steps,
    string_kernel=midpoint_string_steps,
    make_methods=fixed_steps,
)
