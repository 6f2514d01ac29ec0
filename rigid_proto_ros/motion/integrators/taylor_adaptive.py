# SPDX-License-Identifier: MIT
"""Taylor series with steps as long as the accuracy allows, read off the coefficients: no step is ever rejected.

Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99, section 3. With the coefficients' size σᵏ the remainder
after degree N is (σh)^(N+1)/(1 − σh); h is where that is the accuracy times h.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import BIAS, MANTISSA, MANTISSA_BITS, bits_of, double_of, logarithm
from ...base.simd import Packed, aligned, filled, joined, largest, load
from . import control as ctl
from .error_measure import FLOOR, WEIGHINGS, heavier
from .taylor import COLUMNS, VARIABLES_AT, are_good, put_variables, scales_at, series, sum_series, variables_of

PART = 0.5
"""Of what is allowed, a remainder gets this part: the last coefficients are no bound on those to come. Measured over
random scenes at accuracies 1e-3 to 1e-12 the error stays below 0.6 of what is allowed.
"""


# log₂(1 − 2ˣ) is concave: chords from σh = 0.18 to 0.6, and from there to 0.9, as constant − slope x.
_REST, _SLOPE = -1.7613260844219780, 0.5962259201961054
_REST_NEAR, _SLOPE_NEAR = -3.8416301040166890, 3.4190225827029095
_LOG2_MOST = -0.15200309344504997
"""log₂ of 0.9"""

MAX_DEGREE = 26


# log₂ and 2ˣ to two digits from a double's own exponent: a tenth of the time of libm's, and everywhere the same bits.


@njit(cache=True, error_model="numpy")
def rough_log2(x: float) -> float:
    """log₂ x for x > 0 with an error below 0.006; −1023 for subnormal x."""
    bits = bits_of(x)
    # m − 1 with x = 2ⁿ m: exact where x is normal. log₂ m − (m − 1) vanishes at m = 1 and 2; the line has its slopes
    # there.
    f = double_of((bits & MANTISSA) | (BIAS << MANTISSA_BITS)) - 1.0
    return float((bits >> MANTISSA_BITS) - BIAS) + f + f * (1.0 - f) * (0.4427 - 0.164 * f)


@njit(cache=True, error_model="numpy")
def rough_exp2(x: float) -> float:
    """2ˣ with a relative error below 0.001, for x cut to ±1000."""
    whole = math.floor(min(max(x, -1000.0), 1000.0))
    f = min(max(x, -1000.0), 1000.0) - whole
    power = double_of((int(whole) + BIAS) << MANTISSA_BITS)
    return power * (1.0 + f - f * (1.0 - f) * (0.3069 + 0.0794 * f))


@functools.cache
def degree_for(accuracy: float) -> int:
    """The degree at which work per time is smallest for this accuracy: measured, a flat minimum (12 at
    1e-3, 19 at 1e-9).
    """
    return min(max(round(8.5 - 1.15 * logarithm(accuracy) / logarithm(10.0)), 6), MAX_DEGREE)


@njit(cache=True, error_model="numpy", allocates=False)
def log2_growth(c: np.ndarray, at: int, columns: int, degree: int, weights: Packed) -> float:
    """log₂ σ from the last three coefficients: of the largest k-th root of a bound on their measure. at: where a row's
    variables begin, of ``columns`` numbers; weights: of each of them.
    """
    last = degree * columns + at
    # No length is more than twice the largest number in it, and no square of a large coefficient overflows.
    growth = rough_log2(2.0 * largest(load(c, last - 2 * columns, weights) * weights)) * (1.0 / (degree - 2.0))
    growth = max(growth, rough_log2(2.0 * largest(load(c, last - columns, weights) * weights)) * (1.0 / (degree - 1.0)))
    return max(growth, rough_log2(2.0 * largest(load(c, last, weights) * weights)) * (1.0 / degree))


@njit(cache=True, error_model="numpy", allocates=False)
def length_for(log2_growth: float, accuracy: float, degree: int, part: float) -> float:
    """h [s] with (σh)^(N+1)/(1 − σh) = max(accuracy h, floor) times ``part``, or a little less."""
    share, least = rough_log2(part * accuracy) - log2_growth, rough_log2(part * FLOOR)
    # (N + 1) x = max(share + x, least) + log₂(1 − 2ˣ) for x = log₂ σh, the last term replaced by two chords below it.
    x = max(
        min((share + _REST) / (degree + _SLOPE), (share + _REST_NEAR) / (degree + _SLOPE_NEAR)),
        min((least + _REST) / (degree + 1.0 + _SLOPE), (least + _REST_NEAR) / (degree + 1.0 + _SLOPE_NEAR)),
    )
    return min(rough_exp2(min(x, _LOG2_MOST) - log2_growth), ctl.LONGEST)


def workspace(degree: int) -> np.ndarray:
    """Room for the coefficients, which stay there until the step is committed: every sample before sums
    them once more.
    """
    return aligned((degree + 1, COLUMNS))


@njit(cache=True, error_model="numpy", allocates=False)
def _weights_of_row(weights: tuple[float, float, float, float]) -> Packed:
    attitude, spin, place, speed = weights
    return joined(filled(attitude, 4), filled(spin, 4), filled(place, 4), filled(speed, 4))


@njit(cache=True, error_model="numpy", allocates=False)
def steps(
    y: np.ndarray,
    p: np.record,
    control: np.record,
    following: np.ndarray,
    c: np.ndarray,
    span_ns: int,
    sampling: bool,
) -> int:
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c:
    workspace.

    sampling: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it
    failed.
    """
    degree, accuracy = control.degree, control.accuracy
    here = variables_of(y)
    if sampling:
        if not control.series:
            series(here, p, degree, c)
            control.series = True
        there = sum_series(c, degree, span_ns * 1e-9)
        put_variables(there, y)
        return span_ns if are_good(there) else 0
    advanced, elapsed = 0, control.elapsed_ns
    length, there = control.accepted_ns, variables_of(following)
    # A step begins with the scales with which the one before it has ended.
    weights = scales_at(here, p, elapsed * 1e-9)
    ending = weights
    while True:
        if length == 0:
            if not control.series:
                series(here, p, degree, c)
                control.series = True
            for _ in range(WEIGHINGS):
                growth = log2_growth(c, VARIABLES_AT, COLUMNS, degree, _weights_of_row(weights))
                length = int(length_for(growth, accuracy, degree, PART) * 1e9)
                there = sum_series(c, degree, length * 1e-9)
                if length < 1 or not are_good(there):
                    control.failed = True
                    put_variables(here, y)
                    return advanced
                # The error of a spin is measured by the spin at the end: where it falls within the step, that counts.
                ending = scales_at(there, p, (elapsed + length) * 1e-9)
                weights, more = heavier(ending, weights)
                if not more:
                    break
            ctl.accept(control, length)
            control.pending = 1
        else:
            ending = scales_at(there, p, (elapsed + length) * 1e-9)
        if length > span_ns - advanced:
            put_variables(here, y)
            put_variables(there, following)
            return advanced
        ctl.count(control)
        advanced += length
        elapsed += length
        here, weights, length = there, ending, 0
