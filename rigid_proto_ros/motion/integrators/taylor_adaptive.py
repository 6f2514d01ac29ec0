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
from ...base.elementary import logarithm
from ...base.simd import aligned
from . import control as ctl
from .error_measure import FLOOR, WEIGHINGS, heavier, scales
from .rough_logarithm import rough_exp2, rough_log2
from .runge_kutta import is_good
from .taylor import _D, _Q, _U, _W, COLUMNS, series, sum_series

PART = 0.5
"""Of what is allowed, a remainder gets this part: the last coefficients are no bound on those to come. Measured over
random scenes at accuracies 1e-3 to 1e-12 the error stays below 0.6 of what is allowed.
"""


# log₂ of 0.4, 0.6 and 0.9.
_LOG2_START, _LOG2_REST, _LOG2_MOST = -1.3219280948873623, -0.7369655941662062, -0.15200309344504997

MAX_DEGREE = 26


@functools.cache
def degree_for(accuracy: float) -> int:
    """The degree at which work per time is smallest for this accuracy: measured, a flat minimum (12 at
    1e-3, 19 at 1e-9).
    """
    return min(max(round(8.5 - 1.15 * logarithm(accuracy) / logarithm(10.0)), 6), MAX_DEGREE)


@njit(cache=True, error_model="numpy")
def log2_growth(
    c: np.ndarray, degree: int, weights: tuple[float, float, float, float], q: int, w: int, d: int, u: int
) -> float:
    """log₂ σ from the last three coefficients: of the largest k-th root of their measure. −∞ where all are zero.
    q, w, d, u: where in a row of c attitude, spin, displacement and velocity begin.
    """
    attitude, spin, place, speed = weights
    growth = -math.inf
    for k in range(degree - 2, degree + 1):
        # Sums of absolute values bound the lengths, and no square of a large coefficient overflows.
        a = attitude * (abs(c[k, q]) + abs(c[k, q + 1]) + abs(c[k, q + 2]) + abs(c[k, q + 3]))
        a = max(a, spin * (abs(c[k, w]) + abs(c[k, w + 1]) + abs(c[k, w + 2])))
        if place != 0.0:
            a = max(a, place * (abs(c[k, d]) + abs(c[k, d + 1]) + abs(c[k, d + 2])))
            a = max(a, speed * (abs(c[k, u]) + abs(c[k, u + 1]) + abs(c[k, u + 2])))
        if a > 0.0:
            growth = max(growth, rough_log2(a) / k)
    return growth


@njit(cache=True, error_model="numpy")
def length_for(log2_growth: float, accuracy: float, degree: int, part: float) -> float:
    """h [s] with (σh)^(N+1)/(1 − σh) = max(accuracy h, floor) times ``part``."""
    inverse = 1.0 / (degree + 1.0)
    share, least = rough_log2(part * accuracy) - log2_growth, rough_log2(part * FLOOR)
    # Two steps of a fixed-point iteration for x = log₂ σh from σh = .4: each divides the error by the degree and more.
    x = (max(share + _LOG2_START, least) + _LOG2_REST) * inverse
    x = (max(share + x, least) + rough_log2(max(1.0 - rough_exp2(x), 0.1))) * inverse
    return min(rough_exp2(min(x, _LOG2_MOST) - log2_growth), ctl.LONGEST)


def workspace(degree: int) -> np.ndarray:
    """Room for the coefficients, which stay there until the step is committed: every sample before sums
    them once more.
    """
    return aligned((degree + 1, COLUMNS))


@njit(cache=True, error_model="numpy")
def steps(
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
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
    degree = int(control[ctl.DEGREE])
    advanced = 0
    ending, follows = (0.0, 0.0, 0.0, 0.0), False
    while True:
        if control[ctl.SERIES] == 0.0:
            # What has just been committed is still in registers, or on its way to where it was copied from.
            series(following if follows else y, p, degree, c)
            control[ctl.SERIES] = 1.0
        if sampling:
            sum_series(c, p, degree, span_ns * 1e-9, y)
            return span_ns if is_good(y) else 0
        if control[ctl.ACCEPTED_NS] == 0.0:
            # A step begins with the scales with which the one before it has ended.
            weights = ending if follows else scales(y, p, control[ctl.ELAPSED_NS] * 1e-9)
            for _ in range(WEIGHINGS):
                growth = log2_growth(c, degree, weights, _Q, _W, _D, _U)
                length_ns = math.floor(length_for(growth, control[ctl.ACCURACY], degree, PART) * 1e9)
                good = length_ns >= 1.0
                if not good:
                    break
                following[:] = y
                sum_series(c, p, degree, length_ns * 1e-9, following)
                good = is_good(following)
                # The error of a spin is measured by the spin at the end: where it falls within the step, that counts.
                ending = scales(following, p, (control[ctl.ELAPSED_NS] + length_ns) * 1e-9)
                weights, more = heavier(ending, weights)
                if not (good and more):
                    break
            if not good:
                control[ctl.FAILED] = 1.0
                return advanced
            ctl.accept(control, length_ns)
            control[ctl.PENDING] = 1.0
        length = ctl.commit(control, y, following, span_ns - advanced)
        if length == 0:
            return advanced
        advanced += length
        follows = ending[0] != 0.0
