# SPDX-License-Identifier: MIT
"""Torque-free rotation by Taylor series in double-double arithmetic, some 30 digits: fast enough to judge 10⁵ random steps.

Arithmetic after Dekker, A floating-point technique for extending the available precision (1971), and Hida, Li and Bailey,
Algorithms for quad-double precision floating point arithmetic (2001). Checked against mpmath in test_reference_motion.py.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

ORDER = 28
TURN_PER_STEP = 0.2
"""rad. |ω'| ≤ |ω|² for moments of a body, so series converge at least to |ω|t = 1, and .2²⁸ is 3e-20 of what is left."""


@njit(cache=True)
def _add(a, b, c, d):
    """(a + b) + (c + d), each pair a double-double."""
    s = a + c
    t = s - a
    e = (a - (s - t)) + (c - t)
    u = b + d
    v = u - b
    f = (b - (u - v)) + (d - v)
    e += u
    high = s + e
    e = e - (high - s) + f
    total = high + e
    return total, e - (total - high)


@njit(cache=True)
def _multiply(a, b, c, d):
    p = a * c
    s = 134217729.0 * a
    ah = s - (s - a)
    al = a - ah
    s = 134217729.0 * c
    ch = s - (s - c)
    cl = c - ch
    e = ((ah * ch - p) + ah * cl + al * ch) + al * cl
    e += a * d + b * c
    total = p + e
    return total, e - (total - p)


@njit(cache=True)
def _divide(a, b, c, d):
    q = a / c
    x, y = _multiply(q, 0.0, c, d)
    x, y = _add(a, b, -x, -y)
    r = x / c
    x2, y2 = _multiply(r, 0.0, c, d)
    x, y = _add(x, y, -x2, -y2)
    high, low = _add(q, 0.0, r, 0.0)
    return _add(high, low, x / c, 0.0)


@njit(cache=True)
def _product(u, v, k):
    """Coefficient k of the product of two series (n, 2)."""
    high, low = 0.0, 0.0
    for i in range(k + 1):
        x, y = _multiply(u[i, 0], u[i, 1], v[k - i, 0], v[k - i, 1])
        high, low = _add(high, low, x, y)
    return high, low


@njit(cache=True)
def _step(state, ratios, h):
    """One Taylor step of state (7, 2): q xyzw, ω; h seconds."""
    c = np.zeros((7, ORDER + 1, 2))
    c[:, 0, :] = state
    for k in range(ORDER):
        n = float(k + 1)
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            x, y = _product(c[4 + a], c[4 + b], k)
            x, y = _multiply(ratios[i, 0], ratios[i, 1], x, y)
            c[4 + i, k + 1, 0], c[4 + i, k + 1, 1] = _divide(x, y, n, 0.0)
            x, y = _product(c[3], c[4 + i], k)
            x2, y2 = _product(c[a], c[4 + b], k)
            x, y = _add(x, y, x2, y2)
            x2, y2 = _product(c[b], c[4 + a], k)
            x, y = _add(x, y, -x2, -y2)
            c[i, k + 1, 0], c[i, k + 1, 1] = _divide(x, y, 2.0 * n, 0.0)
        high, low = 0.0, 0.0
        for i in range(3):
            x, y = _product(c[i], c[4 + i], k)
            high, low = _add(high, low, -x, -y)
        c[3, k + 1, 0], c[3, k + 1, 1] = _divide(high, low, 2.0 * n, 0.0)
    for j in range(7):
        high, low = c[j, ORDER, 0], c[j, ORDER, 1]
        for k in range(ORDER - 1, -1, -1):
            high, low = _multiply(high, low, h, 0.0)
            high, low = _add(high, low, c[j, k, 0], c[j, k, 1])
        state[j, 0], state[j, 1] = high, low


@njit(cache=True)
def free_step(moments, q, w, h):
    """q xyzw (4,), ω (3,) in principal axes with these moments (3,): state (7, 2) after h [s] as double-doubles.

    ω is scaled to about 1 and time with it, by a power of two, so that slow and fast spins keep their digits.
    """
    state = np.zeros((7, 2))
    size = max(abs(w[0]), abs(w[1]), abs(w[2]))
    if size == 0.0 or h == 0.0:
        state[:4, 0], state[4:, 0] = q, w
        return state
    exponent = math.frexp(size)[1]
    ratios = np.empty((3, 2))
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        x, y = _add(moments[a], 0.0, -moments[b], 0.0)
        ratios[i, 0], ratios[i, 1] = _divide(x, y, moments[i], 0.0)
        state[4 + i, 0] = math.ldexp(w[i], -exponent)
    for i in range(4):
        state[i, 0] = q[i]
    time = math.ldexp(h, exponent)
    steps = 2 ** max(0, math.frexp(abs(time) * 1.8 / TURN_PER_STEP)[1])
    for _ in range(steps):
        _step(state, ratios, time / steps)
    for i in range(4, 7):
        state[i, 0], state[i, 1] = math.ldexp(state[i, 0], exponent), math.ldexp(state[i, 1], exponent)
    return state


@njit(cache=True)
def attitude_angle(q, reference):
    """Angle [rad] from a reference attitude (4, 2) to q (4,) of doubles, any lengths; good to 1e-30."""
    v = np.zeros((4, 2))
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        x, y = _multiply(reference[3, 0], reference[3, 1], q[i], 0.0)
        x2, y2 = _multiply(reference[i, 0], reference[i, 1], -q[3], 0.0)
        x, y = _add(x, y, x2, y2)
        x2, y2 = _multiply(reference[a, 0], reference[a, 1], -q[b], 0.0)
        x, y = _add(x, y, x2, y2)
        x2, y2 = _multiply(reference[b, 0], reference[b, 1], q[a], 0.0)
        v[i, 0], v[i, 1] = _add(x, y, x2, y2)
    for i in range(4):
        x, y = _multiply(reference[i, 0], reference[i, 1], q[i], 0.0)
        v[3, 0], v[3, 1] = _add(v[3, 0], v[3, 1], x, y)
    return 2.0 * math.atan2(math.sqrt(v[0, 0] ** 2 + v[1, 0] ** 2 + v[2, 0] ** 2), abs(v[3, 0]))
