# SPDX-License-Identifier: MIT
"""The law of a pull-only string, and the time at which it changes, along a Taylor series or a fixed step.

The string is slack while x = l − rest length ≤ 0; otherwise it pulls while k x + c l' > 0; otherwise it is stretched,
but shortens too fast for its damper to let it pull. A step of a series ends where a polynomial first rises above zero
(``first_rise``). A slack string becomes taut where |a|² − rest² does, with a the vector from free end to knot; this is
a polynomial however near the knot passes the free end. The other two laws end where the tension, or the stretch,
changes sign, whose series are known. A fixed step with different laws at start and end is repeated until the time of
the change is known to double precision (integrators/runge_kutta.py).

A bilateral string with a rest length pushes with k times this length when its knot meets the free end, along n = a/l,
which has no limit at l = 0. A knot that passes straight through meets no pole of its series, which continue as if l
became negative. So no step comes near the free end, and a knot that meets it to within a nanosecond ends the motion,
since the force is undefined.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import local_matrix, local_numbers, njit
from ...base.rotation import norm
from ...base.vectors import FloatArray
from ..problem import Variables, knot, parts_of, stretch
from ..string import NO_DIRECTION
from .series import A_KNOT, DISTANCE, MAX_DEGREE, STRETCH, TENSION, Knot, distance_series, stretch_at

SLACK, PULLS, SHORTENS = 0.0, 1.0, 2.0

_AGREEMENT = 0.03
_AGREEMENT_SLACK = 1e-3
"""Tolerance in units of √accuracy times the tension's terms: by this much the series of the distance may differ from
the result of the motion's series, which converge where it may not. The law changes at tension zero, so a tension of the
wrong sign has an effect of second order. Smaller for a string that doesn't pull, whose step length doesn't depend on
this series.
"""

_NEGLIGIBLE = 1e-19
"""Fraction of the squared rest length below which the highest terms of |a|² are neglected."""

APPROACH = 0.75
"""Largest motion of the knot of a string that pushes in one step, as a fraction of its distance from the free end."""


@njit(error_model="numpy", allocates=False)
def is_one_sided(p: np.record) -> bool:
    """Whether a string is tied whose law can change, that is, a pull-only one."""
    return p.has_string and not p.bilateral


@njit(error_model="numpy", allocates=False)
def knot_at(y: Variables, p: np.record) -> Knot:
    """The knot of the string at variables y; zeros without a string."""
    if not p.has_string:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    a, _ = knot(*parts_of(y), p)
    length = norm(*a)
    return *a, length, length - p.rest_length


@njit(error_model="numpy", allocates=False)
def law_of(y: Variables, p: np.record) -> float:
    """The law at variables y: SLACK, PULLS or SHORTENS."""
    if not is_one_sided(p):
        return PULLS
    x, rate = stretch(y, p)
    if x <= 0.0:
        return SLACK
    return PULLS if p.stiffness * x + p.string_damping * rate > 0.0 else SHORTENS


@njit(error_model="numpy", allocates=False)
def shortening_heat(p: np.record, before: float, after: float) -> float:
    """Energy that the damper dissipates while the string doesn't pull [J]: the loss of ½ k x² between two stretches."""
    before, after = max(before, 0.0), max(after, 0.0)
    return float(0.5 * p.stiffness * (before - after) * (before + after))


# The first time at which a polynomial rises above zero, not just any root. On an interval a polynomial lies within the
# convex hull of its Bernstein coefficients, and with one change of sign among them it has exactly one root there (Lane
# and Riesenfeld, BIT 21 (1981) 112). So intervals without a positive coefficient are skipped, in those with one change
# the root is refined, and all others are bisected, the earlier half first. Bisection averages neighbours (de
# Casteljau), so its rounding is small relative to the values in the interval, and a double root is distinguished from
# none as well as the coefficients allow.

_DEEPEST = 110
"""Maximum number of bisections of an interval: they resolve 1e-15 s within 1e6 s to 12 digits."""

_LEVELS = _DEEPEST + 1
_MOST_COEFFICIENTS = 2 * MAX_DEGREE + 1
"""Coefficients of |a|², the polynomial of the highest degree."""

_RESOLUTION = 2.0**-51
"""Smallest width of an interval relative to its position in time."""

_NEWTONS = 40
_MOST_TRIALS = 1200
"""Newton steps for a root before bisection, and maximum number of all trials: as often as a double can be halved."""

NONE = -1.0


@njit(error_model="numpy", allocates=False)
def first_rise(g: FloatArray, degree: int) -> float:
    """First s in [0, 1] after which Σ gₖ sᵏ is positive, for a polynomial that isn't at 0; NONE if it never is.

    degree: at most 2 MAX_DEGREE.
    """
    while degree > 0 and g[degree] == 0.0:
        degree -= 1
    reach = g[0]
    for k in range(1, degree + 1):
        reach += max(g[k], 0.0)
    if not reach > 0.0:
        return NONE
    b = local_matrix(_LEVELS, _MOST_COEFFICIENTS)
    _bernstein(g, degree, b[0])
    begins, widths = local_numbers(_LEVELS), local_numbers(_LEVELS)
    begins[0], widths[0] = 0.0, 1.0
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


@njit(error_model="numpy", allocates=False)
def _bernstein(g: FloatArray, degree: int, b: FloatArray) -> None:
    """Bernstein coefficients b on [0, 1]: bᵢ = Σ C(i, k)/C(n, k) gₖ."""
    scale = 1.0
    for k in range(degree + 1):
        b[k] = g[k] * scale
        scale *= (k + 1.0) / (degree - k) if k < degree else 1.0
    for j in range(1, degree + 1):
        for i in range(degree, j - 1, -1):
            b[i] += b[i - 1]


@njit(error_model="numpy", allocates=False)
def _signs(b: FloatArray, degree: int) -> tuple[int, int]:
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


@njit(error_model="numpy", allocates=False)
def _halve(b: FloatArray, left: FloatArray, degree: int) -> None:
    """Bisection: coefficients of the left half into ``left``, those of the right one into b."""
    left[0] = b[0]
    for j in range(1, degree + 1):
        for i in range(degree - j + 1):
            b[i] = 0.5 * (b[i] + b[i + 1])
        left[j] = b[0]


@njit(error_model="numpy", allocates=False)
def _root(g: FloatArray, degree: int, low: float, high: float) -> float:
    """The only root in an interval over which the polynomial rises: Newton's method, safeguarded by bisection."""
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


# Along a series


@njit(error_model="numpy", allocates=False)
def next_law(
    c: FloatArray, p: np.record, degree: int, h: float, law: float, accuracy: float
) -> tuple[float, float, float]:
    """Time of the first change of law within h seconds, NONE for never; the law that follows; and the part of h [s] for
    which this is known, 0 if that is less than a nanosecond.
    """
    if law == SLACK:
        return _tautens(c, p, degree, h), PULLS, h
    g = c[degree + 1]  # scratch memory
    tolerance = math.sqrt(accuracy) * (_AGREEMENT if law == PULLS else _AGREEMENT_SLACK)
    if law == SHORTENS:
        distance_series(c, degree)
    while True:
        if law == PULLS:
            power = 1.0
            for k in range(degree):
                g[k] = -c[k, TENSION] * power
                power *= h
            g[0] = min(g[0], 0.0)
            time, after = first_rise(g, degree - 1), SHORTENS if p.string_damping > 0.0 else SLACK
            told = time if time == NONE else time * h
        else:
            time, after = _stops_shortening(c, p, degree, h, g)
            told = h if time == NONE else time * h
        if told == NONE or _converges(c, p, degree, told, tolerance):
            return NONE if time == NONE else time * h, after, h
        h = 0.5 * told
        if not h * 1e9 >= 1.0:
            return NONE, law, 0.0


@njit(error_model="numpy", allocates=False)
def _square_less_rest(a: FloatArray, last: int, x: float, rest: float, g: FloatArray) -> None:
    """Coefficients g of |a|² − rest² from those of a (≥ last + 1, 3); x: the stretch at 0."""
    for k in range(2 * last + 1):
        g[k] = 0.0
    for i in range(last + 1):
        for j in range(last + 1):
            g[i + j] += a[i, 0] * a[j, 0] + a[i, 1] * a[j, 1] + a[i, 2] * a[j, 2]
    g[0] = x * (2.0 * rest + x)


@njit(error_model="numpy", allocates=False)
def _tautens(c: FloatArray, p: np.record, degree: int, h: float) -> float:
    """Time at which |a|² first rises above the square of the rest length; NONE if it doesn't within h seconds."""
    rest = p.rest_length
    reach, power, last = c[0, DISTANCE], 1.0, 0
    for k in range(1, degree + 1):
        power *= h
        x, y, z = abs(c[k, A_KNOT]), abs(c[k, A_KNOT + 1]), abs(c[k, A_KNOT + 2])
        if x + y + z > 0.0:
            reach += (x + y + z) * power
            last = k
    if reach < rest:
        return NONE
    a, g = local_matrix(_MOST_COEFFICIENTS, 3), local_numbers(_MOST_COEFFICIENTS)
    power = 1.0
    for k in range(last + 1):
        for j in range(3):
            a[k, j] = c[k, A_KNOT + j] * power
        power *= h
    _square_less_rest(a, last, min(c[0, STRETCH], 0.0), rest, g)
    left_out, top = 0.0, 2 * last
    while top > 2:
        left_out += abs(g[top])
        if left_out > _NEGLIGIBLE * rest * rest:
            break
        top -= 1
    time = first_rise(g, top)
    return time if time == NONE else time * h


@njit(error_model="numpy", allocates=False)
def _stops_shortening(c: FloatArray, p: np.record, degree: int, h: float, g: FloatArray) -> tuple[float, float]:
    """Fraction of h at which the string's stretch is zero or it begins to pull, whichever is first, and the law after
    that.
    """
    power = 1.0
    for k in range(1, degree + 1):
        power *= h
        g[k] = -c[k, DISTANCE] * power
    g[0] = -max(c[0, STRETCH], 0.0)
    gone = first_rise(g, degree)
    # It begins to pull before its stretch is zero, or not at all.
    end = h if gone == NONE else gone * h
    power = 1.0
    for k in range(degree):
        x = c[k, DISTANCE] if k > 0 else c[0, STRETCH]
        g[k] = (p.stiffness * x + p.string_damping * (k + 1) * c[k + 1, DISTANCE]) * power
        power *= end
    g[0] = min(g[0], 0.0)
    pulls = first_rise(g, degree - 1)
    if pulls == NONE:
        return gone, SLACK
    return pulls * end / h, PULLS


@njit(error_model="numpy", allocates=False)
def _converges(c: FloatArray, p: np.record, degree: int, t: float, tolerance: float) -> bool:
    """Whether the series of the knot's distance gives the same tension as the motion's series."""
    stiffness, damping = p.stiffness, p.string_damping
    tension, terms, power = stiffness * c[0, STRETCH], 0.0, 1.0
    for k in range(1, degree + 1):
        slope = damping * k * c[k, DISTANCE] * power
        power *= t
        spring = stiffness * c[k, DISTANCE] * power
        tension += slope + spring
        terms += abs(slope) + abs(spring)
    x, rate = stretch_at(c, p, degree, t)
    wrong = abs(stiffness * x + damping * rate - tension)
    speed = abs(c[1, A_KNOT]) + abs(c[1, A_KNOT + 1]) + abs(c[1, A_KNOT + 2])
    return bool(wrong <= tolerance * terms + 1e-14 * stiffness * c[0, DISTANCE] + 2e-15 * damping * speed)


@njit(error_model="numpy", allocates=False)
def clear_of_the_end(c: FloatArray, p: np.record, degree: int, distance: float, h: float) -> float:
    """h, reduced so that along the series c the knot of a string that pushes, which starts at this distance from the
    free end, stays clear of it.
    """
    if p.has_string and p.bilateral and p.rest_length != 0.0:
        while h * 1e9 >= 1.0 and _moves(c, degree, h) > max(APPROACH * distance, NO_DIRECTION * p.rest_length):
            h *= 0.5
    return h


@njit(error_model="numpy", allocates=False)
def _moves(c: FloatArray, degree: int, h: float) -> float:
    """Upper bound of the knot's displacement within h seconds [m]."""
    reach = 0.0
    for k in range(degree, 0, -1):
        reach = (reach + abs(c[k, A_KNOT]) + abs(c[k, A_KNOT + 1]) + abs(c[k, A_KNOT + 2])) * h
    return reach
