# SPDX-License-Identifier: MIT
"""euler: the explicit Euler step on a rotation matrix kept orthonormal by Gram-Schmidt, the paper's first method.

Order 1, one evaluation a step (the paper's O(n²) is the local error). Source: "Interactively prototyping properties of
rigid bodies for physically-based animation" (2019); Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations
I (1993), section II.1. Energy grows steadily; with ``gyroscopic: false`` it is the paper's eq. 9.
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
    R = columns(qx, qy, qz, qw)
    R = orthonormal(turned(R, R, wx, wy, wz, h))
    out[0], out[1], out[2], out[3] = quaternion_near(R, qx, qy, qz, qw)
    out[4], out[5], out[6] = wx + h * ex, wy + h * ey, wz + h * ez
    out[7], out[8], out[9] = y[7] + h * y[10], y[8] + h * y[11], y[9] + h * y[12]
    out[10], out[11], out[12] = y[10] + h * ax, y[11] + h * ay, y[12] + h * az
    out[13], out[14] = y[13] + h * work, y[14] + h * heat


@njit(cache=True, error_model="numpy")
def euler_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, y, p, h, n)


@njit(cache=True, error_model="numpy")
def euler_string_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """The same, each step cut where the string turns slack or taut."""
    return repeated_on_string(_step, y, p, h, n)


EULER = Integrator(
    name="euler",
    order=1,
    evaluations=1,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: gains energy at every step, useless beyond |ω|h of about 0.1.",
    stability_limit=0.1,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=euler_steps,
    string_kernel=euler_string_steps,
    make_methods=fixed_steps,
)
