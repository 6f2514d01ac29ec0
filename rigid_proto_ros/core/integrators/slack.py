# SPDX-License-Identifier: MIT
"""Where a pull-only string turns slack or taut inside a step, located in double precision.

The law of tension has a kink (a jump, with a damper) where min(k x, k x + c x') changes sign, and a step across it loses its
order. So a step is cut there. An integrator asks in turn: ``begin`` says with which law and how long to step, the integrator
takes that trial step, ``judge`` accepts it or asks for another. The root is bracketed and found by regula falsi (Illinois
variant: Dowell and Jarratt, BIT 11, 1971). A slack or taut spell between two ends that look alike is sought at
the extremum of the cubic through both ends' stretch and rate.
"""

from __future__ import annotations

import math

import numpy as np

from ..compilation import njit
from ..motion import HEAT
from ..problem import STIFFNESS
from .equations import stretch, tension_margin

REMAINING = 0  # of the whole step [s]
TRIAL = 1  # length of the trial step to take [s]
TAUT = 2  # the law it is to be taken with
_PHASE = 3
_LOW = 4
_HIGH = 5
_MARGIN_LOW = 6
_MARGIN_HIGH = 7
_X = 8  # stretch and rate where the trial starts
_RATE = 9
_RESOLUTION = 10  # of the root [s]
_TRIALS = 11
_SWITCHES = 12
_EDGE = 13  # 1 while the start itself lies on the kink, so that either law may be the right one
_SIZE = 14

_WHOLE, _PEEK, _BRACKET, _LAST, _SETTLED = 0.0, 1.0, 2.0, 3.0, 4.0

_MAX_SWITCHES = 1000
"""In one step: more is chatter of a step far too long for its string, and the rest of it is taken with one law."""


@njit(cache=True, error_model="numpy")
def new_search():
    """The search's own numbers, to be kept by the integrator."""
    return np.zeros(_SIZE)


@njit(cache=True, error_model="numpy")
def begin(s, y, p, h):
    """Start a step of h seconds from variables y."""
    x, rate = stretch(y, p)
    margin = tension_margin(x, rate, p)
    s[_RESOLUTION] = h * 2.0**-50
    s[_SWITCHES] = 0.0
    s[REMAINING] = h
    s[TAUT] = 1.0 if margin > 0.0 else 0.0
    s[_EDGE] = 1.0 if margin == 0.0 else 0.0
    _begin_part(s, x, rate, margin)


@njit(cache=True, error_model="numpy")
def _begin_part(s, x, rate, margin):
    s[_PHASE] = _WHOLE
    s[TRIAL] = s[REMAINING]
    s[_X], s[_RATE], s[_MARGIN_LOW] = x, rate, margin
    s[_LOW] = 0.0
    s[_TRIALS] = 0.0


@njit(cache=True, error_model="numpy")
def judge(s, trial, p):
    """Whether the trial step is accepted (its heat then completed); s says what is to be done next until nothing remains."""
    x, rate = stretch(trial, p)
    margin = tension_margin(x, rate, p)
    right = (margin > 0.0) == (s[TAUT] != 0.0)
    phase = s[_PHASE]
    if phase == _LAST:
        return _accept(s, trial, p, x, rate, margin, True)
    if phase == _SETTLED or not math.isfinite(margin):
        return _accept(s, trial, p, x, rate, margin, False)
    if phase == _WHOLE and not right and s[_EDGE] != 0.0:
        s[TAUT] = 1.0 - s[TAUT]
        s[_EDGE] = 0.0
        return False
    if phase == _WHOLE and right:
        hidden = extremum(s[_X], s[_RATE], x, rate, s[TRIAL], s[TAUT] != 0.0)
        if hidden <= 0.0:
            return _accept(s, trial, p, x, rate, margin, False)
        s[_PHASE] = _PEEK
        s[TRIAL] = hidden
        return False
    if phase == _PEEK and right:
        s[_PHASE] = _SETTLED
        s[TRIAL] = s[REMAINING]
        return False
    if phase != _BRACKET:
        s[_PHASE] = _BRACKET
        s[_HIGH], s[_MARGIN_HIGH] = s[TRIAL], margin
    elif right:
        s[_LOW], s[_MARGIN_LOW] = s[TRIAL], margin
        s[_MARGIN_HIGH] *= 0.5
    else:
        s[_HIGH], s[_MARGIN_HIGH] = s[TRIAL], margin
        s[_MARGIN_LOW] *= 0.5
    _next_trial(s)
    return False


@njit(cache=True, error_model="numpy")
def _next_trial(s):
    low, high, resolution = s[_LOW], s[_HIGH], s[_RESOLUTION]
    s[_TRIALS] += 1.0
    if high - low <= 2.0 * resolution:
        s[_PHASE] = _LAST
        s[TRIAL] = high
        return
    middle = 0.5 * (low + high)
    difference = s[_MARGIN_HIGH] - s[_MARGIN_LOW]
    # Sixty trials find any simple root; what is left then is halved.
    if s[_TRIALS] <= 60.0 and difference != 0.0:
        root = high - s[_MARGIN_HIGH] * (high - low) / difference
        if low <= root <= high:
            middle = root
    # A root at one end is closed in from the other side by the smallest step.
    s[TRIAL] = min(max(middle, low + resolution), high - resolution)


@njit(cache=True, error_model="numpy")
def _accept(s, trial, p, x, rate, margin, switches):
    if s[TAUT] == 0.0:
        # Stretched but not pulling, because it shortens faster than its damper lets it: the damper takes all of ½ k x².
        before, after = max(s[_X], 0.0), max(x, 0.0)
        trial[HEAT] += 0.5 * p[STIFFNESS] * (before - after) * (before + after)
    s[REMAINING] -= s[TRIAL]
    if s[REMAINING] <= s[_RESOLUTION]:
        s[REMAINING] = 0.0
    s[_EDGE] = 0.0
    if switches:
        s[TAUT] = 1.0 - s[TAUT]
        s[_SWITCHES] += 1.0
    _begin_part(s, x, rate, margin)
    if s[_SWITCHES] > _MAX_SWITCHES:
        s[_PHASE] = _SETTLED
    return True


@njit(cache=True, error_model="numpy")
def extremum(x0, rate0, x1, rate1, h, taut):
    """Time in (0, h) at which the cubic through both ends dips below zero (taut) or rises above it (slack); else 0."""
    sign = -1.0 if taut else 1.0
    if not (sign * rate0 > 0.0 and sign * rate1 < 0.0):
        return 0.0
    # x(s h) = x0 + r0 s + (3Δ − 2 r0 − r1) s² + (r0 + r1 − 2Δ) s³ with r = rate h.
    r0, r1, rise = rate0 * h, rate1 * h, x1 - x0
    a, b = 3.0 * (r0 + r1 - 2.0 * rise), 2.0 * (3.0 * rise - 2.0 * r0 - r1)
    root = math.sqrt(max(b * b - 4.0 * a * r0, 0.0))
    # x' = r0 + b s + a s² falls through zero (in the sense of ``sign``) once in between.
    denominator = -b + sign * root
    if denominator == 0.0:
        return 0.0
    s = 2.0 * r0 / denominator
    if not 0.0 < s < 1.0:
        return 0.0
    top = x0 + s * (r0 + s * (0.5 * b + s * a / 3.0))
    return s * h if sign * top > 0.0 else 0.0
