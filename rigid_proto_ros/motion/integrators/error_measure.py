# SPDX-License-Identifier: MIT
"""How large an error is: attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1 rad/s) and |Δv|/max(|v|, ℓ·1 rad/s), the largest of
them.

``accuracy`` is a rate in this measure: a step of h seconds may err by accuracy·h, but rounding allows no less than 32 ε
a step.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import norm
from ...base.vectors import Vector
from ..variables import damping_functions

WEIGHINGS = 4
"""Of a step whose end weighs errors more than its start did, each shorter than the one before."""

FLOOR = 32.0 * 2.0**-52

Weights = tuple[float, float, float, float]
"""Of attitude (as quaternion difference), ω, x and v in the measure."""


@njit(cache=True, error_model="numpy", allocates=False)
def scales(y: np.ndarray, p: np.record, elapsed: float) -> Weights:
    """The weights at variables y, ``elapsed`` seconds into the segment."""
    return scales_of((y[4], y[5], y[6]), (y[10], y[11], y[12]), p, elapsed)


@njit(cache=True, error_model="numpy", allocates=False)
def scales_of(w: Vector, u: Vector, p: np.record, elapsed: float) -> Weights:
    """The same at ω = w and the added velocity u."""
    spin = norm(*w)
    if not p.translates:
        return 2.0, 1.0 / max(spin, 1.0), 0.0, 0.0
    c = p.reference_damping
    push = elapsed * damping_functions(c * elapsed)[0]
    speed = 0.0
    for k in range(3):
        v = p.reference_velocity[k]
        v += push * (p.reference_acceleration[k] - c * v) + u[k]
        speed += v * v
    length = p.length
    return 2.0, 1.0 / max(spin, 1.0), 1.0 / length, 1.0 / max(math.sqrt(speed), length)


@njit(cache=True, error_model="numpy", allocates=False)
def heavier(ending: Weights, weights: Weights) -> tuple[Weights, bool]:
    """The larger of the weights at a step's end and start, and whether they are clearly more than those
    at the start: a quarter.
    """
    spin, speed = max(ending[1], weights[1]), max(ending[3], weights[3])
    return (weights[0], spin, weights[2], speed), spin > 1.25 * weights[1] or speed > 1.25 * weights[3]


@njit(cache=True, error_model="numpy", allocates=False)
def jump_of_displacement(p: np.record, spin: float, speed: float) -> float:
    """Error that a displacement by one unit of the measure causes when a damped string jerks taut that
    much too early or late.
    """
    if not p.has_string:
        return 0.0
    arm = norm(p.attach[0], p.attach[1], p.attach[2])
    # What a force at the knot does to the measured velocities, per newton and second.
    response = max(speed / p.mass, spin * arm / p.moments[0])
    return float(p.string_damping * p.length * response)
