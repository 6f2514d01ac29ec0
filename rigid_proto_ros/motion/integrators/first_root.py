# SPDX-License-Identifier: MIT
"""The first time at which a polynomial rises above zero: never just some root of it.

On an interval a polynomial lies within the hull of its Bernstein coefficients, and with one change of sign among them
it has exactly one root there (Lane and Riesenfeld, BIT 21 (1981) 112). So intervals without a positive coefficient are
passed over, those with one change are closed in on, and all others are halved, the earlier half first. Halving averages
neighbours (de Casteljau), so what it rounds is small against the interval's own values, and a double root is told from
none as well as its coefficients can tell it.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit

_DEEPEST = 110
"""Halvings of an interval: a millionth of a nanosecond in a million seconds, to all digits."""

_RESOLUTION = 2.0**-51
"""Of an interval against its place in time."""

_NEWTONS = 40
_MOST_TRIALS = 1200
"""Newton's steps that a root is given before it is halved in on, and all together: as often as a double
can be halved.
"""

NONE = -1.0


@njit(cache=True, error_model="numpy")
def first_rise(g: np.ndarray, degree: int) -> float:
    """First s in [0, 1] past which Σ gₖ sᵏ is above zero, which it isn't at 0; NONE if it never is."""
    while degree > 0 and g[degree] == 0.0:
        degree -= 1
    reach = g[0]
    for k in range(1, degree + 1):
        reach += max(g[k], 0.0)
    if not reach > 0.0:
        return NONE
    b = np.empty((_DEEPEST + 1, degree + 1))
    _bernstein(g, degree, b[0])
    begins, widths = np.zeros(_DEEPEST + 1), np.zeros(_DEEPEST + 1)
    widths[0] = 1.0
    top = 0
    while top >= 0:
        begin, width = begins[top], widths[top]
        first, changes = _signs(b[top], degree)
        if first > 0:
            return float(begin)
        if changes == 0:
            top -= 1
        elif changes == 1:
            return _root(g, degree, begin, begin + width)
        elif width <= _RESOLUTION * (begin + width) or top == _DEEPEST:
            if b[top, degree] > 0.0:
                return float(begin + width)
            top -= 1
        else:
            half = 0.5 * width
            _halve(b[top], b[top + 1], degree)
            begins[top], widths[top] = begin + half, half
            begins[top + 1], widths[top + 1] = begin, half
            top += 1
    return NONE


@njit(cache=True, error_model="numpy")
def _bernstein(g: np.ndarray, degree: int, b: np.ndarray) -> None:
    """Coefficients b on [0, 1]: bᵢ = Σ C(i, k)/C(n, k) gₖ."""
    scale = 1.0
    for k in range(degree + 1):
        b[k] = g[k] * scale
        scale *= (k + 1.0) / (degree - k) if k < degree else 1.0
    for j in range(1, degree + 1):
        for i in range(degree, j - 1, -1):
            b[i] += b[i - 1]


@njit(cache=True, error_model="numpy")
def _signs(b: np.ndarray, degree: int) -> tuple[int, int]:
    """Sign of the first coefficient that isn't zero, and how often the sign changes."""
    first, before, changes = 0, 0, 0
    for k in range(degree + 1):
        sign = 1 if b[k] > 0.0 else (-1 if b[k] < 0.0 else 0)
        if sign == 0:
            continue
        if before == 0:
            first = sign
        elif sign != before:
            changes += 1
        before = sign
    return first, changes


@njit(cache=True, error_model="numpy")
def _halve(b: np.ndarray, left: np.ndarray, degree: int) -> None:
    """Coefficients of the left half into ``left``, those of the right one in place."""
    left[0] = b[0]
    for j in range(1, degree + 1):
        for i in range(degree - j + 1):
            b[i] = 0.5 * (b[i] + b[i + 1])
        left[j] = b[0]


@njit(cache=True, error_model="numpy")
def _root(g: np.ndarray, degree: int, low: float, high: float) -> float:
    """The one root in an interval over which the polynomial rises: Newton's steps kept within it, or halving."""
    t = 0.5 * (low + high)
    for trial in range(_MOST_TRIALS):
        value, slope = g[degree], 0.0
        for k in range(degree - 1, -1, -1):
            slope = slope * t + value
            value = value * t + g[k]
        if value > 0.0:
            high = t
        else:
            low = t
        new = 0.5 * (low + high)
        if trial < _NEWTONS and slope > 0.0 and low < t - value / slope < high:
            new = t - value / slope
        if abs(new - t) <= _RESOLUTION * t:
            return new
        t = new
    return high
