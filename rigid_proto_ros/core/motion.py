# SPDX-License-Identifier: MIT
"""From a state to an integrator's variables and back.

The variables y (13,) of a segment: attitude q xyzw of the principal axes (principal to world), ω in principal axes, then
the displacement and the velocity that body-fixed force and damping have added since the segment's start. What constant
world acceleration does is closed form, x = x₀ + t(v₀ + ½ t g_w), and stays out of y: it has no error to accumulate.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .problem import (
    ACCELERATION_WORLD,
    DAMPING_LINEAR,
    PRINCIPAL_AXES,
    PRINCIPAL_QUATERNION,
    START_POSITION,
    START_VELOCITY,
)
from .rotation import multiply

VARIABLES = 13


@njit(cache=True)
def to_variables(row, p, y):
    """State row (13,) to variables y (13,) at the start of the segment with problem p."""
    P, Q = PRINCIPAL_AXES, PRINCIPAL_QUATERNION
    y[0], y[1], y[2], y[3] = multiply(row[3], row[4], row[5], row[6], p[Q], p[Q + 1], p[Q + 2], p[Q + 3])
    for k in range(3):
        y[4 + k] = p[P + k] * row[10] + p[P + 3 + k] * row[11] + p[P + 6 + k] * row[12]
        y[7 + k] = 0.0
        y[10 + k] = 0.0


@njit(cache=True)
def to_row(y, p, elapsed, row):
    """Variables y (13,), ``elapsed`` seconds after the segment's start, to a state row (13,)."""
    P, Q = PRINCIPAL_AXES, PRINCIPAL_QUATERNION
    closed_form = p[DAMPING_LINEAR] == 0.0
    for k in range(3):
        g = p[ACCELERATION_WORLD + k] if closed_form else 0.0
        v = p[START_VELOCITY + k]
        row[k] = p[START_POSITION + k] + (elapsed * (v + 0.5 * elapsed * g) + y[7 + k])
        row[7 + k] = v + (elapsed * g + y[10 + k])
        row[10 + k] = p[P + 3 * k] * y[4] + p[P + 3 * k + 1] * y[5] + p[P + 3 * k + 2] * y[6]
    row[3], row[4], row[5], row[6] = multiply(y[0], y[1], y[2], y[3], -p[Q], -p[Q + 1], -p[Q + 2], p[Q + 3])


def new_variables(row: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Variables (13,) of a state row at a segment's start."""
    y = np.empty(VARIABLES)
    to_variables(row, p, y)
    return y
