# SPDX-License-Identifier: MIT
"""What loads and damping do to the velocities while the attitude stands still: the other half of the splittings."""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate
from ..variables import damping_functions
from .equations import undamped_torque


@njit(cache=True, error_model="numpy", allocates=False)
def push(y: np.ndarray, p: np.record) -> tuple[float, ...]:
    """Torque (principal axes) and acceleration (world axes) at the attitude of y: six numbers."""
    tx, ty, tz = undamped_torque(y[0], y[1], y[2], y[3], p)
    if not p.translates:
        return tx, ty, tz, 0.0, 0.0, 0.0
    own, added = p.acceleration_body, p.acceleration_added
    ax, ay, az = rotate(y[0], y[1], y[2], y[3], own[0], own[1], own[2])
    return tx, ty, tz, ax + added[0], ay + added[1], az + added[2]


@njit(cache=True, error_model="numpy", allocates=False)
def kick(y: np.ndarray, p: np.record, h: float, pushed: tuple[float, ...]) -> None:
    """Let ``push`` act for h seconds on ω and the added velocity, in place; damping in closed form."""
    angular, linear = p.damping_angular, p.damping_linear
    for k in range(3):
        rate = pushed[k] / p.moments[k]
        if angular == 0.0:
            y[4 + k] += h * rate
        else:
            # ω' = rate − z ω: ω + h φ₁(zh)(rate − z ω).
            z = angular / p.moments[k]
            y[4 + k] += h * damping_functions(z * h)[0] * (rate - z * y[4 + k])
        if p.translates:
            y[10 + k] += h * damping_functions(linear * h)[0] * (pushed[3 + k] - linear * y[10 + k])


@njit(cache=True, error_model="numpy", allocates=False)
def drift_freely(y: np.ndarray, h: float) -> None:
    """Move the added displacement on with its velocity for h seconds, in place."""
    for k in range(3):
        y[7 + k] += h * y[10 + k]
