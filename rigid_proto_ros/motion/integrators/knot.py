# SPDX-License-Identifier: MIT
"""Attitude, displacement and the string's stretch to more digits than a double has.

A stiff string weighs a rounding δ of its knot's place by its tension, ΔE = T δ, at every step, and these add up. So
where a string is tied, attitude and displacement are kept as unevaluated sums of two doubles (the low words of
motion/variables.py), and what is small, the stretch l − rest length, is taken from them with errors far below one
rounding of l.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.exact_arithmetic import fast_two_sum, two_product, two_sum
from ..variables import LOW

Pair = tuple[float, float]
"""high + low."""
Knot = tuple[float, float, float, float, float]
"""From the free end to the knot (3,) [m, world], its length l, and l − rest length [m]."""


@njit(cache=True, error_model="numpy", allocates=False)
def _difference(a: Pair, b: float, c: Pair, d: float) -> Pair:
    """a b − c d."""
    x, e = two_product(a[0], b)
    y, f = two_product(c[0], d)
    s, g = two_sum(x, -y)
    return s, g + (e - f) + (a[1] * b - c[1] * d)


@njit(cache=True, error_model="numpy", allocates=False)
def knot_and_stretch(y: np.ndarray, p: np.record) -> Knot:
    """The knot at variables y, l − rest length with an error of 1e-30 m and not of 1e-16 m."""
    r1, r2, r3 = p.attach[0], p.attach[1], p.attach[2]
    qx, qy, qz, qw = (y[0], y[LOW]), (y[1], y[LOW + 1]), (y[2], y[LOW + 2]), (y[3], y[LOW + 3])
    # t = u × r, R r = r + 2 (w t + u × t) with q = (u, w).
    t1, t2, t3 = _difference(qy, r3, qz, r2), _difference(qz, r1, qx, r3), _difference(qx, r2, qy, r1)
    a1, b1 = _moved(y, p, 0, r1, qw, t1, qy, t3, qz, t2)
    a2, b2 = _moved(y, p, 1, r2, qw, t2, qz, t1, qx, t3)
    a3, b3 = _moved(y, p, 2, r3, qw, t3, qx, t2, qy, t1)
    s1, e1 = two_product(a1, a1)
    s2, e2 = two_product(a2, a2)
    s3, e3 = two_product(a3, a3)
    s, e = two_sum(s1, s2)
    s, g = two_sum(s, s3)
    rest = 2.0 * (a1 * b1 + a2 * b2 + a3 * b3) + (e1 + e2 + e3) + (e + g)
    length = math.sqrt(s)
    if length == 0.0:
        return a1, a2, a3, 0.0, -p.rest_length
    square, f = two_product(length, length)
    low = ((s - square) - f + rest) / (2.0 * length)
    return a1, a2, a3, length + low, (length - p.rest_length) + low


@njit(cache=True, error_model="numpy", allocates=False)
def _moved(
    y: np.ndarray, p: np.record, k: int, r: float, w: Pair, t: Pair, ua: Pair, ta: Pair, ub: Pair, tb: Pair
) -> Pair:
    """Component k of start + d + r + 2 (w t + ua ta − ub tb)."""
    x1, e1 = two_product(w[0], t[0])
    x2, e2 = two_product(ua[0], ta[0])
    x3, e3 = two_product(ub[0], tb[0])
    low = (
        (e1 + e2 - e3) + (w[1] * t[0] + w[0] * t[1]) + (ua[1] * ta[0] + ua[0] * ta[1]) - (ub[1] * tb[0] + ub[0] * tb[1])
    )
    s, g1 = two_sum(x1, x2)
    s, g2 = two_sum(s, -x3)
    low = 2.0 * (low + g1 + g2)
    s, g1 = two_sum(2.0 * s, r)
    s, g2 = two_sum(s, y[7 + k])
    s, g3 = two_sum(s, p.string_start[k])
    return fast_two_sum(s, low + y[LOW + 4 + k] + (g1 + g2 + g3))


@njit(cache=True, error_model="numpy", allocates=False)
def moved_pair(y: np.ndarray, out: np.ndarray, at: int, low: int, change: float) -> None:
    """out = y + change for the variable ``at`` with its low word."""
    out[at], out[low] = two_sum(y[at], change + y[low])


@njit(cache=True, error_model="numpy", allocates=False)
def unit_attitude(out: np.ndarray) -> None:
    """Attitude and low words scaled to unit length."""
    excess, low = -1.0, 0.0
    for k in range(4):
        x, e = two_product(out[k], out[k])
        excess, f = two_sum(excess, x)
        low += e + f + 2.0 * out[k] * out[LOW + k]
    excess += low
    root = math.sqrt(1.0 + excess)
    less = -excess / (root * (1.0 + root))
    for k in range(4):
        out[k], out[LOW + k] = two_sum(out[k], out[LOW + k] + less * out[k])
