# SPDX-License-Identifier: MIT
"""Which law a pull-only string obeys, and the first time at which it changes along a power series of the motion.

It is slack while x = l − rest length ≤ 0; else it pulls while k x + c l' > 0; else it is stretched but shortens faster
than its damper lets it pull. Each law ends where a polynomial rises above zero, and the first such time is found
(integrators/first_root.py): slack ends where |a|² − rest² does, a the way from free end to knot, a polynomial however
near the knot passes its free end; the other two where the tension, or the stretch, changes sign, whose series are at
hand.

A bilateral string with a rest length pushes at the full length of that when its knot meets the free end, in a
direction n = a/l that has no limit at l = 0. A knot that goes straight through meets no pole of its series, which lead
on as if l became negative; one that passes at a small distance b meets a pair of them at b/|a'| from the nearest point,
too weak to show in any coefficient. So steps end before the nearest point, and the nanoseconds around it are a step of
their own, without the string: before and after that point it pushes alike, in opposite directions, so that little is
lost of its impulse, but no accuracy is kept, and that is reported.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.simd import filled, load, number
from ..string import NO_DIRECTION
from .equations import knot as moving_knot
from .first_root import NONE, first_rise
from .knot import Knot, knot_and_stretch
from .motion_series import (
    A_KNOT,
    COLUMNS,
    DISTANCE,
    STRETCH,
    TENSION,
    distance_series,
    stretch_at,
)

SLACK, PULLS, SHORTENS, PASSES = 0.0, 1.0, 2.0, 3.0
"""PASSES: of a step past the free end of a string that pushes at no length."""

_AGREEMENT = 0.03
_AGREEMENT_SLACK = 1e-3
"""Times the root of the accuracy, of the tension's terms: by so much the series of the distance may differ from what
the motion's series give, which converge where it may not. The law changes where the tension is zero, so that a tension
of the wrong sign counts by its square. Less where the string doesn't pull: there the length of the step knows nothing
of it.
"""

_NEGLIGIBLE = 1e-19
"""Of the square of the rest length: what the highest terms of |a|² may come to before they are left out."""

AT_ONCE = 4e-9
"""Before the nearest point [s]: nearer than this a step of a series would be too short."""
FARTHEST = 64e-9
"""From the nearest point [s], by the knot's speed: farther than this steps of series are always long enough."""
MISSES = 1e-9
"""Distance of the nearest point by the knot's speed [s], below which series say nothing of it."""

_NEAR = 0.2
"""Of the distance at a step's start: a point no nearer than this shows in the coefficients."""
_SAMPLES = 8
_HALVINGS = 40
_BEFORE = 0.75
"""Of the time until the nearest point, a step is no longer."""


@njit(cache=True, error_model="numpy")
def is_one_sided(p: np.record) -> bool:
    """Whether the string's law may change at all."""
    return p.has_string and not p.bilateral


@njit(cache=True, error_model="numpy")
def knot_at(y: np.ndarray, p: np.record) -> Knot:
    """The knot of a string at variables y; zeros where none is tied."""
    if not p.has_string:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    return knot_and_stretch(y, p)


@njit(cache=True, error_model="numpy")
def law_of(y: np.ndarray, p: np.record, knot: Knot) -> float:
    """The law at variables y with the knot there."""
    if not is_one_sided(p):
        return PULLS
    ax, ay, az, length, x = knot
    if x <= 0.0:
        return SLACK
    _, _, _, vx, vy, vz = moving_knot(
        y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12], p
    )
    rate = (ax * vx + ay * vy + az * vz) / length
    return PULLS if p.stiffness * x + p.string_damping * rate > 0.0 else SHORTENS


@njit(cache=True, error_model="numpy")
def next_law(
    c: np.ndarray, p: np.record, degree: int, h: float, law: float, accuracy: float
) -> tuple[float, float, float]:
    """When within h seconds the law first changes, NONE for never; the one that follows; and how far of h
    that is known.
    """
    if law == SLACK:
        return _tautens(c, p, degree, h), PULLS, h
    g = c[degree + 1]  # spare
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


@njit(cache=True, error_model="numpy")
def _tautens(c: np.ndarray, p: np.record, degree: int, h: float) -> float:
    """When |a|² first rises above the square of the rest length; NONE if it doesn't within h seconds."""
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
    a = np.empty((last + 1, 3))
    power = 1.0
    for k in range(last + 1):
        for j in range(3):
            a[k, j] = c[k, A_KNOT + j] * power
        power *= h
    g = np.zeros(2 * last + 1)
    for i in range(last + 1):
        x, y, z = a[i]
        for j in range(last + 1):
            g[i + j] += x * a[j, 0] + y * a[j, 1] + z * a[j, 2]
    # l² − rest² from the stretch, which is known to more digits than l.
    x = min(c[0, STRETCH], 0.0)
    g[0] = x * (2.0 * rest + x)
    left_out, top = 0.0, 2 * last
    while top > 2:
        left_out += abs(g[top])
        if left_out > _NEGLIGIBLE * rest * rest:
            break
        top -= 1
    time = first_rise(g, top)
    return time if time == NONE else time * h


@njit(cache=True, error_model="numpy")
def _stops_shortening(c: np.ndarray, p: np.record, degree: int, h: float, g: np.ndarray) -> tuple[float, float]:
    """At which part of h the string's stretch is gone or it begins to pull, whichever is first, and the
    law after that.
    """
    power = 1.0
    for k in range(1, degree + 1):
        power *= h
        g[k] = -c[k, DISTANCE] * power
    g[0] = -max(c[0, STRETCH], 0.0)
    gone = first_rise(g, degree)
    # It pulls before its stretch is gone, or not at all.
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


@njit(cache=True, error_model="numpy")
def _converges(c: np.ndarray, p: np.record, degree: int, t: float, tolerance: float) -> bool:
    """Whether the series of the knot's distance gives the tension that the motion's series give."""
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
    return wrong <= tolerance * terms + 1e-14 * stiffness * c[0, DISTANCE] + 2e-15 * damping * speed


@njit(cache=True, error_model="numpy")
def may_pass(p: np.record) -> bool:
    """Whether the string is one that pushes at no length."""
    return p.has_string and p.bilateral and p.rest_length != 0.0


@njit(cache=True, error_model="numpy")
def before_passage(c: np.ndarray, p: np.record, degree: int, knot: Knot, h: float) -> tuple[float, int]:
    """h cut down so that a step along the series c ends before the knot passes its free end; or, where that is at hand,
    the length [ns] of the step that passes it, else 0. knot: at the series' start.
    """
    ax, ay, az, length, _ = knot
    vx, vy, vz = c[1, A_KNOT], c[1, A_KNOT + 1], c[1, A_KNOT + 2]
    square = vx * vx + vy * vy + vz * vz
    speed, shortest = math.sqrt(square), NO_DIRECTION * p.rest_length
    if speed > 0.0 and length <= FARTHEST * speed:
        nearest = -(ax * vx + ay * vy + az * vz) / square
        bx, by, bz = ax + vx * nearest, ay + vy * nearest, az + vz * nearest
        straight = math.sqrt(bx * bx + by * by + bz * bz) <= MISSES * speed
        inside = length < shortest and speed * 1e-9 > shortest
        if h * 1e9 < 1.0 or inside or (straight and 0.0 <= nearest <= AT_ONCE):
            return h, max(int(math.ceil((2.0 * nearest if nearest > 0.0 else -nearest) * 1e9)), 2)
    if length < shortest:
        # No direction, no tension: not for longer than until there is one.
        push = abs(c[2, A_KNOT]) + abs(c[2, A_KNOT + 1]) + abs(c[2, A_KNOT + 2])
        leaves = math.inf
        if speed > 0.0:
            leaves = shortest / speed
        if push > 0.0:
            leaves = min(leaves, math.sqrt(shortest / push))
        return min(h, max(leaves, 1.1e-9)), 0
    return min(h, _BEFORE * _nearest_time(c, degree, length, h)), 0


@njit(cache=True, error_model="numpy")
def _at(c: np.ndarray, degree: int, t: float) -> tuple[float, float]:
    """l² and a·a' at time t of the series."""
    a, b = filled(0.0, 4), filled(0.0, 4)
    at = degree * COLUMNS + A_KNOT
    for _ in range(degree + 1):
        b = b * t + a
        a = a * t + load(c, at, a)
        at -= COLUMNS
    x, y, z = number(a, 0), number(a, 1), number(a, 2)
    return x * x + y * y + z * z, x * number(b, 0) + y * number(b, 1) + z * number(b, 2)


@njit(cache=True, error_model="numpy")
def _nearest_time(c: np.ndarray, degree: int, length: float, h: float) -> float:
    """When the knot first is much nearer to its free end than before and after, infinite if never within h seconds."""
    reach, power = 0.0, 1.0
    for k in range(1, degree + 1):
        power *= h
        reach += (abs(c[k, A_KNOT]) + abs(c[k, A_KNOT + 1]) + abs(c[k, A_KNOT + 2])) * power
    if reach < (1.0 - _NEAR) * length:
        return math.inf
    low, approaches = 0.0, _at(c, degree, 0.0)[1] < 0.0
    for i in range(1, _SAMPLES + 1):
        high = h * (i / _SAMPLES)
        approached = approaches
        approaches = _at(c, degree, high)[1] < 0.0
        if approached and not approaches:
            least = math.inf
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                square, slope = _at(c, degree, middle)
                least = min(least, square)
                if slope < 0.0:
                    low = middle
                else:
                    high = middle
            if least < (_NEAR * length) ** 2:
                return low
        low = h * (i / _SAMPLES)
    return math.inf
