# SPDX-License-Identifier: MIT
"""Where a pull-only string turns slack or taut inside a step, located in double precision.

The law of tension has a kink (a jump, with a damper) where min(k x, k x + c x') changes sign, and a step across it
loses its order. So a step is cut there. An integrator asks in turn: ``begin`` says with which law and how long to step,
the integrator takes that trial step, ``check_trial`` accepts it or asks for another. The root is bracketed and found by
regula falsi (Illinois variant: Dowell and Jarratt, BIT 11, 1971). Which interval is the first is known beforehand, by
the first time (integrators/first_root.py) at which |a|² − rest² changes sign on the cubic through the knot's place and
velocity at both ends; a trial step to the middle of it confirms it.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ..variables import HEAT
from .equations import knot, stretch, tension_margin
from .first_root import NONE, first_rise

REMAINING = 0  # of the whole step [s]
TRIAL = 1  # length of the trial step to take [s]
TAUT = 2  # the law it is to be taken with
_PHASE = 3
_LOW = 4
_HIGH = 5
_MARGIN_LOW = 6
_MARGIN_HIGH = 7
_X = 8  # stretch where the trial starts
_RESOLUTION = 9  # of the root [s]
_TRIALS = 10
_SWITCHES = 11
_EDGE = 12  # 1 while the start itself lies on the kink, so that either law may be the right one
_KNOT = 13  # (6,) its place and velocity where the trial starts
_SIZE = 19

_WHOLE, _PEEK, _BRACKET, _LAST, _CONFIRMED = 0.0, 1.0, 2.0, 3.0, 4.0

_MAX_SWITCHES = 1000
"""In one step: more is chatter of a step far too long for its string, and the rest of it is taken with one law."""


@njit(cache=True, error_model="numpy")
def new_search() -> np.ndarray:
    """The search's own numbers, to be kept by the integrator."""
    return np.zeros(_SIZE)


@njit(cache=True, error_model="numpy")
def begin(s: np.ndarray, y: np.ndarray, p: np.record, h: float) -> None:
    """Start a step of h seconds from variables y."""
    x, rate = stretch(y, p)
    margin = tension_margin(x, rate, p)
    s[_RESOLUTION] = h * 2.0**-50
    s[_SWITCHES] = 0.0
    s[REMAINING] = h
    s[TAUT] = 1.0 if margin > 0.0 else 0.0
    s[_EDGE] = 1.0 if margin == 0.0 else 0.0
    _begin_part(s, x, margin, y, p)


@njit(cache=True, error_model="numpy")
def _begin_part(s: np.ndarray, x: float, margin: float, y: np.ndarray, p: np.record) -> None:
    s[_PHASE] = _WHOLE
    s[TRIAL] = s[REMAINING]
    s[_X], s[_MARGIN_LOW] = x, margin
    s[_LOW], s[_HIGH] = 0.0, 0.0
    place = knot_of(y, p)
    for k in range(6):
        s[_KNOT + k] = place[k]
    s[_TRIALS] = 0.0


@njit(cache=True, error_model="numpy")
def check_trial(s: np.ndarray, trial: np.ndarray, p: np.record) -> bool:
    """Whether the trial step is accepted (its heat then completed); s says what is to be done next until
    nothing remains.
    """
    x, rate = stretch(trial, p)
    margin = tension_margin(x, rate, p)
    right = (margin > 0.0) == (s[TAUT] != 0.0)
    phase = s[_PHASE]
    if phase == _LAST:
        return _accept(s, trial, p, x, margin, True)
    if phase == _CONFIRMED or not math.isfinite(margin):
        return _accept(s, trial, p, x, margin, False)
    if phase == _WHOLE and not right and s[_EDGE] != 0.0:
        s[TAUT] = 1.0 - s[TAUT]
        s[_EDGE] = 0.0
        return False
    if phase == _WHOLE:
        middle, passes = first_interval(s[_KNOT : _KNOT + 6], knot_of(trial, p), s[TRIAL], s[_X], p, s[TAUT] != 0.0)
        if right and middle <= 0.0:
            return _accept(s, trial, p, x, margin, False)
        if not right:
            s[_HIGH], s[_MARGIN_HIGH] = s[TRIAL], margin
        if right or passes:
            s[_PHASE] = _PEEK
            s[TRIAL] = middle
            return False
    if phase == _PEEK and right:
        if s[_HIGH] == 0.0:
            s[_PHASE] = _CONFIRMED
            s[TRIAL] = s[REMAINING]
        else:
            # No such interval, but the end is one.
            s[_PHASE] = _BRACKET
            s[_LOW], s[_MARGIN_LOW] = s[TRIAL], margin
            _next_trial(s)
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
def _next_trial(s: np.ndarray) -> None:
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
def _accept(s: np.ndarray, trial: np.ndarray, p: np.record, x: float, margin: float, switches: bool) -> bool:
    if s[TAUT] == 0.0:
        # Stretched but not pulling, because it shortens faster than its damper lets it: the damper takes all of ½ k x².
        before, after = max(s[_X], 0.0), max(x, 0.0)
        trial[HEAT] += 0.5 * p.stiffness * (before - after) * (before + after)
    s[REMAINING] -= s[TRIAL]
    if s[REMAINING] <= s[_RESOLUTION]:
        s[REMAINING] = 0.0
    s[_EDGE] = 0.0
    if switches:
        s[TAUT] = 1.0 - s[TAUT]
        s[_SWITCHES] += 1.0
    _begin_part(s, x, margin, trial, p)
    if s[_SWITCHES] > _MAX_SWITCHES:
        s[_PHASE] = _CONFIRMED
    return True


@njit(cache=True, error_model="numpy")
def knot_of(y: np.ndarray, p: np.record) -> tuple[float, ...]:
    """From the free end to the knot, and its rate, at variables y: six numbers."""
    return knot(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12], p)


@njit(cache=True, error_model="numpy")
def first_interval(
    start: np.ndarray | tuple[float, ...], end: tuple[float, ...], h: float, x0: float, p: np.record, taut: bool
) -> tuple[float, bool]:
    """Middle of the first interval within h seconds, 0 for none, that the string is stretched (slack for a taut one) on
    the cubic through the knot's place and velocity at both ends (6,), and whether it ends before h. x0: stretch at the
    start.
    """
    rest = p.rest_length
    if p.bilateral or rest == 0.0 or (x0 > 0.0) != taut:
        return 0.0, False
    sign = -1.0 if taut else 1.0
    g = np.zeros(7)
    for k in range(3):
        # a(s h) = a₀ + r₀ s + (3Δ − 2 r₀ − r₁) s² + (r₀ + r₁ − 2Δ) s³ with r = a' h.
        c0, r0, r1, change = start[k], start[3 + k] * h, end[3 + k] * h, end[k] - start[k]
        c2, c3 = 3.0 * change - 2.0 * r0 - r1, r0 + r1 - 2.0 * change
        g[1] += 2.0 * c0 * r0
        g[2] += 2.0 * c0 * c2 + r0 * r0
        g[3] += 2.0 * (c0 * c3 + r0 * c2)
        g[4] += 2.0 * r0 * c3 + c2 * c2
        g[5] += 2.0 * c2 * c3
        g[6] += c3 * c3
    # |a|² − rest², its start from the stretch.
    g[0] = x0 * (2.0 * rest + x0)
    g *= sign
    begin = first_rise(g, 6)
    if begin == NONE or begin >= 1.0:
        return 0.0, False
    # The same from there on, turned over: where it rises again the interval ends.
    left = 1.0 - begin
    for k in range(6):
        for j in range(5, k - 1, -1):
            g[j] += begin * g[j + 1]
    power = -1.0
    for k in range(7):
        g[k] *= power
        power *= left
    g[0] = 0.0
    over = first_rise(g, 6)
    if over == NONE:
        return 0.5 * (begin + 1.0) * h, False
    return (begin + 0.5 * over * left) * h, True
