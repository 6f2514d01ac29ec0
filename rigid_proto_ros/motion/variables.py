# SPDX-License-Identifier: MIT
"""From a state to an integrator's variables and back.

The variables y of a segment: attitude q xyzw of the principal axes (principal to world), ω in principal axes, the added
displacement and velocity, and what the hand has worked and the string's damper has heated since the segment's start
[J].

Position is reference plus added displacement. The reference is closed form and has no error to accumulate: under a
constant acceleration g and damping c, x = x₀ + t (v₀ φ₁(ct) + t g φ₂(ct)) with φ₁(z) = (1 − e⁻ᶻ)/z and φ₂(z) = (z − 1 +
e⁻ᶻ)/z². Damping is linear, so what a body-fixed force adds obeys u' = R g_b − c u whatever the reference does.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.elementary import expm1
from ..base.rotation import multiply

ATTITUDE = 0  # (4,)
SPIN = 4  # (3,)
DISPLACEMENT = 7  # (3,)
VELOCITY = 10  # (3,)
HAND_WORK = 13
HEAT = 14
VARIABLES = 15

MAX_SPEED = 1e100
"""|x|, |v| or |ω| beyond this is a runaway: squares of it still fit a double, and nothing physical is near."""


@njit(cache=True, error_model="numpy")
def is_good(y: np.ndarray) -> bool:
    """Whether variables y are finite and no runaway."""
    size = 0.0
    for j in range(4, 13):
        size += abs(y[j])
    # Negated sense, so that NaN counts as a runaway.
    return size <= MAX_SPEED and math.isfinite(y[0] + y[1] + y[2] + y[3])


@njit(cache=True, error_model="numpy", allocates=False)
def damping_functions(z: float) -> tuple[float, float]:
    """φ₁(z) = (1 − e⁻ᶻ)/z and φ₂(z) = (z − 1 + e⁻ᶻ)/z², z ≥ 0, to rounding."""
    if z == 0.0:
        return 1.0, 0.5
    if z < 0.5:
        # φ₂ = Σ (−z)ᵏ/(k + 2)!; 14 terms leave 0.5¹⁴/16! = 3e-18.
        phi2 = 0.0
        for k in range(13, -1, -1):
            phi2 = (1.0 - z * phi2) / (k + 2.0)
        return 1.0 - z * phi2, phi2
    phi1 = -expm1(-z) / z
    return phi1, (1.0 - phi1) / z


@njit(cache=True, error_model="numpy", allocates=False)
def to_variables(row: np.ndarray, p: np.record, y: np.ndarray) -> None:
    """State row (13,) to variables y (≥ 15,) at the start of the segment with problem p."""
    P, Q = p.principal_axes, p.principal_quaternion
    y[0], y[1], y[2], y[3] = multiply(row[3], row[4], row[5], row[6], Q[0], Q[1], Q[2], Q[3])
    for k in range(3):
        y[SPIN + k] = P[k] * row[10] + P[3 + k] * row[11] + P[6 + k] * row[12]
        y[DISPLACEMENT + k] = 0.0
        y[VELOCITY + k] = p.start_velocity_added[k]
    y[HAND_WORK] = 0.0
    y[HEAT] = 0.0


@njit(cache=True, error_model="numpy", allocates=False)
def to_row(y: np.ndarray, p: np.record, elapsed: float, row: np.ndarray) -> None:
    """Variables y (≥ 15,), ``elapsed`` seconds after the segment's start, to a state row (13,)."""
    P, Q = p.principal_axes, p.principal_quaternion
    c = p.reference_damping
    phi1, phi2 = damping_functions(c * elapsed)
    for k in range(3):
        g = p.reference_acceleration[k]
        v = p.reference_velocity[k]
        row[k] = p.start_position[k] + (elapsed * (v * phi1 + elapsed * g * phi2) + y[DISPLACEMENT + k])
        row[7 + k] = v + (elapsed * phi1 * (g - c * v) + y[VELOCITY + k])
        row[10 + k] = P[3 * k] * y[4] + P[3 * k + 1] * y[5] + P[3 * k + 2] * y[6]
    row[3], row[4], row[5], row[6] = multiply(y[0], y[1], y[2], y[3], -Q[0], -Q[1], -Q[2], Q[3])


@njit(cache=True, error_model="numpy", allocates=False)
def to_good_row(y: np.ndarray, p: np.record, elapsed: float, row: np.ndarray, limit: float) -> bool:
    """``to_row``; returns whether no number of the row is beyond ``limit`` or no number at all."""
    to_row(y, p, elapsed, row)
    good = True
    for k in range(13):
        good = good and abs(row[k]) <= limit
    return good
