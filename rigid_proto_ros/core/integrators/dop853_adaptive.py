# SPDX-License-Identifier: MIT
"""DOP853 with its error estimate and steps as long as the accuracy allows.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), sections II.4 and II.10: the estimates of
orders 5 and 3 combine to one that falls with h⁸, while the error itself falls with h⁹. A step is tried at full length,
cut only where the string turns slack or taut, and accepted or rejected as a whole.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..problem import DAMPING_ANGULAR, DAMPING_LINEAR, HAS_STRING, MOMENTS
from . import control as ctl
from . import slack
from .dop853_tableau import ERROR_3, ERROR_5, STAGES, WEIGHTS
from .equations import stretch, tension_margin
from .error_measure import FLOOR, jerk_of_rounding, scales, size
from .runge_kutta import advance, integrated, is_good, rates, stages

UNDERESTIMATE = 4.0
"""The error is at most this many times the estimate: measured over random scenes at accuracies 1e-3 to 1e-12."""

_SHRINK, _GROW, _SAFETY = 0.2, 6.0, 0.9


@njit(cache=True, error_model="numpy")
def first_trial(y, p, accuracy, string_frequency):
    """Length of the first trial [s] from the fastest rate in sight."""
    k = np.zeros(15)
    x, rate = stretch(y, p)
    taut = p[HAS_STRING] != 0.0 and tension_margin(x, rate, p) > 0.0
    rates(y, p, taut, k)
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    angular = math.sqrt(k[4] * k[4] + k[5] * k[5] + k[6] * k[6])
    fastest = max(spin, math.sqrt(angular), string_frequency, p[DAMPING_LINEAR], p[DAMPING_ANGULAR] / p[MOMENTS])
    if fastest == 0.0:
        return 1.0
    return min(1.5 * accuracy**0.125 / fastest, 1e3)


@njit(cache=True, error_model="numpy")
def _estimate(k, weights, count):
    """Error of a step per second from its stages."""
    e5, e3 = np.zeros(13), np.zeros(13)
    for i in range(12):
        if ERROR_5[i] != 0.0 or ERROR_3[i] != 0.0:
            for j in range(count):
                e5[j] += ERROR_5[i] * k[i, j]
                e3[j] += ERROR_3[i] * k[i, j]
    attitude, spin, place, speed = weights
    a = size(e5, attitude, spin, place, speed)
    b = size(e3, attitude, spin, place, speed)
    if a == 0.0:
        return 0.0
    return a * a / math.hypot(a, 0.1 * b)


@njit(cache=True, error_model="numpy")
def _try(y, p, h, weights, search, k, z, trial, new):
    """A step of h seconds from y into new; returns its estimated error and the evaluations it took."""
    count = min(integrated(p), 13)
    new[:] = y
    if p[HAS_STRING] == 0.0:
        rates(new, p, False, k[0])
        stages(new, p, h, False, STAGES, 12, k, z)
        advance(y, p, h, WEIGHTS, 12, k, new)
        return h * _estimate(k, weights, count), 12.0
    estimate, evaluations = 0.0, 0.0
    slack.begin(search, new, p, h)
    while search[slack.REMAINING] > 0.0:
        part = search[slack.TRIAL]
        taut = search[slack.TAUT] != 0.0
        rates(new, p, taut, k[0])
        stages(new, p, part, taut, STAGES, 12, k, z)
        advance(new, p, part, WEIGHTS, 12, k, trial)
        evaluations += 12.0
        if slack.judge(search, trial, p):
            estimate += part * _estimate(k, weights, count)
            new[:] = trial
    return estimate, evaluations


@njit(cache=True, error_model="numpy")
def dop853_advance(y, p, control, following, span_ns):
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays."""
    k, z, trial = np.zeros((12, 15)), np.zeros(15), np.zeros(15)
    search = slack.new_search()
    accuracy = control[ctl.ACCURACY]
    advanced = 0
    while True:
        if control[ctl.ACCEPTED_NS] == 0.0:
            weights = scales(y, p, control[ctl.ELAPSED_NS] * 1e-9)
            jerk = jerk_of_rounding(p, weights[1], weights[3])
            while True:
                length_ns = math.floor(control[ctl.NEXT_S] * 1e9)
                if not length_ns >= 1.0:
                    control[ctl.FAILED] = 1.0
                    return advanced
                h = length_ns * 1e-9
                estimate, evaluations = _try(y, p, h, weights, search, k, z, trial, following)
                control[ctl.PENDING] += evaluations
                floor = max(FLOOR, jerk * h)
                allowed = max(accuracy * h, floor)
                ratio = UNDERESTIMATE * estimate / allowed
                # The estimate falls with h⁸, what is allowed with h: their ratio with h⁷.
                factor = _GROW
                if not is_good(following):
                    ratio, factor = math.inf, _SHRINK
                elif ratio > 0.0:
                    factor = min(max(_SAFETY * ratio ** (-1.0 / 7.0), _SHRINK), _GROW)
                if ratio <= 1.0:
                    control[ctl.NEXT_S] = min(h * factor, ctl.LONGEST)
                    control[ctl.ACCEPTED_NS] = length_ns
                    if accuracy * h < floor:
                        control[ctl.FLOOR_BINDS] = 1.0
                    break
                control[ctl.NEXT_S] = h * min(factor, 0.9)
        length = int(control[ctl.ACCEPTED_NS])
        if advanced + length > span_ns:
            return advanced
        y[:] = following
        advanced += length
        ctl.commit(control)
