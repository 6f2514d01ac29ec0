# SPDX-License-Identifier: MIT
"""Taylor series with steps as long as the accuracy allows, read off the coefficients: no step is ever rejected.

Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99, section 3. With the coefficients' size σᵏ the remainder after
degree N is (σh)^(N+1)/(1 − σh); h is where that is the accuracy times h.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ..compilation import njit
from . import control as ctl
from .error_measure import FLOOR, WEIGHINGS, heavier, scales
from .runge_kutta import is_good
from .taylor import ROWS, series, sum_series

PART = 0.5
"""Of what is allowed, a remainder gets this part: the last coefficients are no bound on those to come. Measured over random
scenes at accuracies 1e-3 to 1e-12 the error stays below 0.6 of what is allowed."""


@functools.cache
def degree_for(accuracy: float) -> int:
    """The degree at which work per time is smallest for this accuracy: measured, a flat minimum (12 at 1e-3, 19 at 1e-9)."""
    return min(max(round(8.5 - 1.15 * math.log10(accuracy)), 6), 26)


@njit(cache=True, error_model="numpy")
def _growth(c, degree, weights):
    """σ from the last three coefficients: the largest k-th root of their measure."""
    attitude, spin, place, speed = weights
    growth = 0.0
    for k in range(degree - 2, degree + 1):
        a = attitude * math.sqrt(c[0, k] ** 2 + c[1, k] ** 2 + c[2, k] ** 2 + c[3, k] ** 2)
        a = max(a, spin * math.sqrt(c[4, k] ** 2 + c[5, k] ** 2 + c[6, k] ** 2))
        if place != 0.0:
            a = max(a, place * math.sqrt(c[7, k] ** 2 + c[8, k] ** 2 + c[9, k] ** 2))
            a = max(a, speed * math.sqrt(c[10, k] ** 2 + c[11, k] ** 2 + c[12, k] ** 2))
        if a > 0.0:
            growth = max(growth, math.exp(math.log(a) / k))
    return growth


@njit(cache=True, error_model="numpy")
def step_length(growth, accuracy, degree, part):
    """h [s] with (σh)^(N+1)/(1 − σh) = max(accuracy h, floor) times ``part``."""
    if growth == 0.0:
        return ctl.LONGEST
    x = 0.5
    for _ in range(3):
        allowed = part * max(accuracy * x / growth, FLOOR) * (1.0 - x)
        x = min(math.exp(math.log(allowed) / (degree + 1)), 0.9)
    return min(x / growth, ctl.LONGEST)


def workspace(degree: int) -> np.ndarray:
    """Room for the coefficients, which stay there until the step is committed: every look before sums them once more."""
    return np.zeros((ROWS, degree + 1))


@njit(cache=True, error_model="numpy")
def steps(y, p, control, following, c, span_ns, look):
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c: workspace.

    look: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it failed.
    """
    degree = int(control[ctl.DEGREE])
    advanced = 0
    while True:
        if control[ctl.SERIES] == 0.0:
            series(y, p, degree, c)
            control[ctl.SERIES] = 1.0
        if look:
            sum_series(c, p, degree, span_ns * 1e-9, y)
            return span_ns if is_good(y) else 0
        if control[ctl.ACCEPTED_NS] == 0.0:
            weights = scales(y, p, control[ctl.ELAPSED_NS] * 1e-9)
            for _ in range(WEIGHINGS):
                growth = _growth(c, degree, weights)
                length_ns = math.floor(step_length(growth, control[ctl.ACCURACY], degree, PART) * 1e9)
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
            control[ctl.ACCEPTED_NS] = length_ns
            control[ctl.PENDING] = 1.0
            if control[ctl.ACCURACY] * length_ns * 1e-9 < FLOOR:
                control[ctl.FLOOR_BINDS] = 1.0
        length = int(control[ctl.ACCEPTED_NS])
        if advanced + length > span_ns:
            return advanced
        y[:] = following
        advanced += length
        ctl.commit(control)
