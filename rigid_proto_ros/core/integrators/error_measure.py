# SPDX-License-Identifier: MIT
"""How large an error is: attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1 rad/s) and |Δv|/max(|v|, ℓ·1 rad/s), the largest of them.

``accuracy`` is a rate in this measure: a step of h seconds may err by accuracy·h, but rounding allows no less than 32 ε a
step.
"""

from __future__ import annotations

import math

from ..compilation import njit
from ..motion import damping_functions
from ..problem import (
    ATTACH,
    HAS_STRING,
    LENGTH,
    MASS,
    MOMENTS,
    REFERENCE_ACCELERATION,
    REFERENCE_DAMPING,
    REFERENCE_VELOCITY,
    STRING_DAMPING,
    TRANSLATES,
)

WEIGHINGS = 4
"""Of a step whose end weighs errors more than its start did, each shorter than the one before."""

FLOOR = 32.0 * 2.0**-52


@njit(cache=True, error_model="numpy")
def scales(y, p, elapsed):
    """Weights of attitude (as quaternion difference), ω, x and v at variables y, ``elapsed`` seconds into the segment."""
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    if p[TRANSLATES] == 0.0:
        return 2.0, 1.0 / max(spin, 1.0), 0.0, 0.0
    c = p[REFERENCE_DAMPING]
    push = elapsed * damping_functions(c * elapsed)[0]
    speed = 0.0
    for k in range(3):
        v = p[REFERENCE_VELOCITY + k]
        v += push * (p[REFERENCE_ACCELERATION + k] - c * v) + y[10 + k]
        speed += v * v
    length = p[LENGTH]
    return 2.0, 1.0 / max(spin, 1.0), 1.0 / length, 1.0 / max(math.sqrt(speed), length)


@njit(cache=True, error_model="numpy")
def heavier(ending, weights):
    """The larger of the weights at a step's end and start, and whether they are clearly more than those at the start: a quarter."""
    spin, speed = max(ending[1], weights[1]), max(ending[3], weights[3])
    return (weights[0], spin, weights[2], speed), spin > 1.25 * weights[1] or speed > 1.25 * weights[3]


@njit(cache=True, error_model="numpy")
def size(e, attitude, spin, place, speed):
    """The measure of a small difference e (≥ 13,) of variables."""
    a = attitude * math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3])
    a = max(a, spin * math.sqrt(e[4] * e[4] + e[5] * e[5] + e[6] * e[6]))
    if place == 0.0:
        return a
    a = max(a, place * math.sqrt(e[7] * e[7] + e[8] * e[8] + e[9] * e[9]))
    return max(a, speed * math.sqrt(e[10] * e[10] + e[11] * e[11] + e[12] * e[12]))


@njit(cache=True, error_model="numpy")
def jump_of_displacement(p, spin, speed):
    """Error that a displacement by one unit of the measure causes when a damped string jerks taut that much too early or late."""
    if p[HAS_STRING] == 0.0:
        return 0.0
    arm = math.sqrt(p[ATTACH] ** 2 + p[ATTACH + 1] ** 2 + p[ATTACH + 2] ** 2)
    # What a force at the knot does to the measured velocities, per newton and second.
    response = max(speed / p[MASS], spin * arm / p[MOMENTS])
    return p[STRING_DAMPING] * p[LENGTH] * response
