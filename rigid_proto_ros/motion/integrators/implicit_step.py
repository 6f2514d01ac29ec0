# SPDX-License-Identifier: MIT
"""One implicit step (integrators/radau.py) with its error: taken whole and in two halves, of which the halves are kept.
And the time within it at which a pull-only string's law ends.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import exponential_of, logarithm
from ..problem import STIFFNESS, STRING_DAMPING
from ..variables import STORED
from . import control as ctl
from .equations import stretch, tension_margin
from .error_measure import FLOOR, scales, size
from .first_root import NONE
from .radau import radau_step, stage_rates, within
from .radau_tableau import HALVES, STAGES
from .runge_kutta import is_good
from .slack import first_interval, knot_of
from .string_law import is_one_sided

SAFETY = 0.8
"""Part of the step length that the error estimate would allow."""

_EXPONENT = 1.0 / 7.0
"""Of the step length by the error: between 1/9 of smooth motion and 1/5 of stiff components."""

_MOST_GROWTH, _LEAST = 6.0, 0.05
"""Of one step's length to the next, and to the next trial after a rejection."""

_NOISE = 2.0**-40
"""An estimate below this that doesn't fall with the step is rounding, and is reported as a floor."""

_SAMPLES = 8
"""At the string's law within half a step."""

_SHORTEST = 1e-24
"""Of any part [s]: a fastest rate of 1e24 /s."""


@njit(cache=True, error_model="numpy")
def _guess(y: np.ndarray, V: np.ndarray) -> None:
    for i in range(STAGES):
        for k in range(3):
            V[i, k], V[i, 3 + k] = y[4 + k], y[10 + k]


@njit(cache=True, error_model="numpy")
def two_halves(
    y: np.ndarray,
    p: np.ndarray,
    h: float,
    taut: bool,
    guessed: bool,
    first: np.ndarray,
    second: np.ndarray,
    middle: np.ndarray,
    out: np.ndarray,
) -> int:
    """Two steps of h/2 from y into out, by guesses in first and second (5, 6), which are made here unless ``guessed``;
    evaluations, 0 when there is no solution.
    """
    if not guessed:
        _guess(y, first)
    spent = radau_step(y, p, 0.5 * h, taut, first, middle)
    if spent == 0:
        return 0
    if not guessed:
        _guess(middle, second)
    more = radau_step(middle, p, 0.5 * h, taut, second, out)
    return spent + more if more > 0 and is_good(out) else 0


@njit(cache=True, error_model="numpy")
def _compared(
    y: np.ndarray,
    p: np.ndarray,
    h: float,
    taut: bool,
    elapsed: float,
    whole: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    middle: np.ndarray,
    out: np.ndarray,
) -> tuple[int, float]:
    """Two halves into out; evaluations and the error estimated, infinite when there is no solution."""
    _guess(y, whole)
    spent = radau_step(y, p, h, taut, whole, out)
    if spent == 0:
        return STAGES, math.inf
    coarse = out.copy()
    # The whole step's polynomial is a good guess for the halves.
    for i in range(STAGES):
        for k in range(6):
            a, b = 0.0, 0.0
            for j in range(STAGES):
                a += HALVES[0, i, j] * whole[j, k]
                b += HALVES[1, i, j] * whole[j, k]
            first[i, k], second[i, k] = a, b
    more = two_halves(y, p, h, taut, True, first, second, middle, out)
    if more == 0:
        return spent + STAGES, math.inf
    coarse -= out
    start, end = scales(y, p, elapsed), scales(out, p, elapsed + h)
    error = size(coarse, start[0], max(start[1], end[1]), start[2], max(start[3], end[3]))
    return spent + more, error if math.isfinite(error) else math.inf


@njit(cache=True, error_model="numpy")
def _margin(y: np.ndarray, p: np.ndarray, taut: bool) -> tuple[float, float]:
    """What changes its sign where the string's law ends: positive while it pulls; and the stretch."""
    x, rate = stretch(y, p)
    # A string that has just come taut has no stretch but for rounding: only its tension says whether it still pulls.
    return (p[STIFFNESS] * x + p[STRING_DAMPING] * rate if taut else tension_margin(x, rate, p)), x


@njit(cache=True, error_model="numpy")
def _switch_in_half(y: np.ndarray, p: np.ndarray, h: float, taut: bool, V: np.ndarray, at: np.ndarray) -> float:
    """Time in (0, h] at which the law ends along one step's polynomials, NONE for never. at: scratch (STORED,)."""
    rates = np.zeros((STAGES, 3))
    stage_rates(V, h, rates)
    before, x0, place0 = 0.0, stretch(y, p)[0], knot_of(y, p)
    for i in range(1, _SAMPLES + 1):
        s = i / _SAMPLES
        within(y, h, V, rates, s, at)
        margin, x = _margin(at, p, taut)
        place = knot_of(at, p)
        if (margin > 0.0) == taut:
            hidden = 0.0
            if not taut and x0 < 0.0 and x < 0.0:
                hidden = first_interval(place0, place, (s - before) * h, x0, p, False)[0] / h
            before_, x0, place0 = before, x, place
            before = s
            if hidden <= 0.0:
                continue
            s = before_ + hidden
            within(y, h, V, rates, s, at)
            if _margin(at, p, taut)[0] <= 0.0:
                continue
            before = before_
        low, high = before, s
        while high - low > 2.0**-40 * high:
            middle = 0.5 * (low + high)
            within(y, h, V, rates, middle, at)
            if (_margin(at, p, taut)[0] > 0.0) == taut:
                low = middle
            else:
                high = middle
        return high * h
    return NONE


@njit(cache=True, error_model="numpy")
def implicit_step(
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    h: float,
    whole_ns: int,
    taut: bool,
    elapsed: float,
    room: np.ndarray,
    out: np.ndarray,
) -> tuple[float, float]:
    """The longest step of at most h seconds from y into out that the accuracy allows, 0 when none was found, and the
    time within it at which the string's law ends, or NONE. Leaves in control what the next step may be, and what this
    one errs above its share.

    whole_ns: of a whole number of nanoseconds.
    """
    whole, first, second = room[0:5, 0:6], room[5:10, 0:6], room[10:15, 0:6]
    middle, at = room[15][:STORED], room[16][:STORED]
    accuracy = control[ctl.ACCURACY]
    last = math.inf
    while True:
        spent, error = _compared(y, p, h, taut, elapsed, whole, first, second, middle, out)
        control[ctl.PENDING] += spent
        allowed = max(accuracy * h, FLOOR)
        noisy = error < _NOISE and error > 0.5 * last
        if error <= allowed or noisy:
            break
        last = error
        factor = SAFETY * exponential_of(logarithm(allowed / error) * _EXPONENT) if math.isfinite(error) else 0.0
        h *= min(max(factor, _LEAST), 0.7)
        if whole_ns:
            h = math.floor(h * 1e9) * 1e-9
        if not h > _SHORTEST:
            control[ctl.NEXT] = 1e-10
            return 0.0, NONE
    control[ctl.PENDING_EXCESS] += max(error - accuracy * h, 0.0)
    # What is estimated below a quarter of the floor is rounding, and says nothing about a longer step.
    clear = error > 0.25 * FLOOR
    growth = SAFETY * exponential_of(logarithm(allowed / error) * _EXPONENT) if clear else _MOST_GROWTH
    control[ctl.NEXT] = min(h * min(max(growth, 0.2), _MOST_GROWTH), ctl.LONGEST)
    switch = NONE
    if is_one_sided(p):
        switch = _switch_in_half(y, p, 0.5 * h, taut, first, at)
        if switch == NONE:
            switch = _switch_in_half(middle, p, 0.5 * h, taut, second, at)
            switch = switch if switch == NONE else 0.5 * h + switch
    return h, switch
