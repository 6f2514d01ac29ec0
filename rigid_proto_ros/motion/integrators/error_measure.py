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
from .. import problem as of
from ..variables import damping_functions

WEIGHINGS = 4
"""Of a step whose end weighs errors more than its start did, each shorter than the one before."""

FLOOR = 32.0 * 2.0**-52


_Three = tuple[float, float, float]


@njit(cache=True, error_model="numpy", allocates=False)
def scales(y: np.ndarray, p: np.ndarray, elapsed: float) -> tuple[float, float, float, float]:
    """Weights of attitude (as quaternion difference), ω, x and v at variables y, ``elapsed`` seconds into
    the segment.
    """
    return scales_of((y[4], y[5], y[6]), (y[10], y[11], y[12]), p, elapsed)


@njit(cache=True, error_model="numpy", allocates=False)
def scales_of(w: _Three, u: _Three, p: np.ndarray, elapsed: float) -> tuple[float, float, float, float]:
    """The same at ω = w and the added velocity u."""
    spin = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if p[of.TRANSLATES] == 0.0:
        return 2.0, 1.0 / max(spin, 1.0), 0.0, 0.0
    c = p[of.REFERENCE_DAMPING]
    push = elapsed * damping_functions(c * elapsed)[0]
    speed = 0.0
    for k in range(3):
        v = p[of.REFERENCE_VELOCITY + k]
        v += push * (p[of.REFERENCE_ACCELERATION + k] - c * v) + u[k]
        speed += v * v
    length = p[of.LENGTH]
    return 2.0, 1.0 / max(spin, 1.0), 1.0 / length, 1.0 / max(math.sqrt(speed), length)


@njit(cache=True, error_model="numpy", allocates=False)
def heavier(
    ending: tuple[float, float, float, float], weights: tuple[float, float, float, float]
) -> tuple[tuple[float, float, float, float], bool]:
    """The larger of the weights at a step's end and start, and whether they are clearly more than those
    at the start: a quarter.
    """
    spin, speed = max(ending[1], weights[1]), max(ending[3], weights[3])
    return (weights[0], spin, weights[2], speed), spin > 1.25 * weights[1] or speed > 1.25 * weights[3]


_SQUARED = 1e140
"""Up to this number, and down to one over it, squares and their sums stay well within a double."""


@njit(cache=True, error_model="numpy", allocates=False)
def length_of(x: float, y: float, z: float, w: float) -> float:
    """√(x² + y² + z² + w²), scaled by a power of two where squares would over- or underflow."""
    square = x * x + y * y + z * z + w * w
    if 1.0 / _SQUARED < square < _SQUARED:
        return math.sqrt(square)
    largest = max(abs(x), abs(y), abs(z), abs(w))
    if largest == 0.0 or not math.isfinite(largest):
        return largest
    scale = math.ldexp(1.0, math.frexp(largest)[1] - 1)
    x, y, z, w = x / scale, y / scale, z / scale, w / scale
    return scale * math.sqrt(x * x + y * y + z * z + w * w)


@njit(cache=True, error_model="numpy", allocates=False)
def size(e: np.ndarray, attitude: float, spin: float, place: float, speed: float) -> float:
    """The measure of a small difference e (≥ 13,) of variables."""
    a = attitude * length_of(e[0], e[1], e[2], e[3])
    a = max(a, spin * length_of(e[4], e[5], e[6], 0.0))
    if place == 0.0:
        return a
    a = max(a, place * length_of(e[7], e[8], e[9], 0.0))
    return max(a, speed * length_of(e[10], e[11], e[12], 0.0))


@njit(cache=True, error_model="numpy", allocates=False)
def jump_of_displacement(p: np.ndarray, spin: float, speed: float) -> float:
    """Error that a displacement by one unit of the measure causes when a damped string jerks taut that
    much too early or late.
    """
    if p[of.HAS_STRING] == 0.0:
        return 0.0
    arm = math.sqrt(p[of.ATTACH] ** 2 + p[of.ATTACH + 1] ** 2 + p[of.ATTACH + 2] ** 2)
    # What a force at the knot does to the measured velocities, per newton and second.
    response = max(speed / p[of.MASS], spin * arm / p[of.MOMENTS])
    return p[of.STRING_DAMPING] * p[of.LENGTH] * response
