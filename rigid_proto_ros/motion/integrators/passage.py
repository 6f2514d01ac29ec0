# SPDX-License-Identifier: MIT
"""A bilateral string whose knot passes its free end, so near that the string's direction turns within nanoseconds.

Such a string with a rest length pushes at the full length of that, whose direction n = a/l has no limit at l = 0. A
knot that goes straight through meets no pole of its series, which lead on as if l became negative; one that passes at a
small distance b meets a pair of them at b/|a'| from the nearest point, too weak to show in any coefficient. So steps
end before the nearest point, and the nanoseconds around it are one step of their own, along which the knot goes
straight, a = b + v s: there the integrals over time of

    F = −k a + k rest n − c (n·v) n

have closed forms. What the path curves within that time τ is left out: of the impulse about its part |a''| τ/|v|.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import inverse_tangent, logarithm
from ...base.rotation import multiply, normalize, rotate_inverse
from ...base.simd import filled, load, number
from .. import problem as of
from ..string import NO_DIRECTION
from ..variables import HAND_WORK, HEAT, LOW, SPIN
from .equations import accelerations
from .equations import knot as moving_knot
from .knot import Knot, knot_and_stretch, moved_pair, unit_attitude
from .motion_series import A_KNOT, COLUMNS

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
_NO_TIME = 1e-24
"""b/|v| [s]: below it the knot goes straight through."""


_MOST_TURN = 0.1
"""rad that a step past the free end may turn the body: its few terms leave 1e-12 of that."""


@njit(cache=True, error_model="numpy")
def may_pass(p: np.ndarray) -> bool:
    """Whether the string is one that pushes at no length."""
    return p[of.HAS_STRING] != 0.0 and p[of.BILATERAL] != 0.0 and p[of.REST_LENGTH] != 0.0


@njit(cache=True, error_model="numpy")
def before_passage(c: np.ndarray, p: np.ndarray, degree: int, knot: Knot, h: float) -> tuple[float, int]:
    """h cut down so that a step along the series c ends before the knot passes its free end; or, where that is at hand,
    the length [ns] of the step that passes it, else 0. knot: at the series' start.
    """
    ax, ay, az, length, _ = knot
    vx, vy, vz = c[1, A_KNOT], c[1, A_KNOT + 1], c[1, A_KNOT + 2]
    square = vx * vx + vy * vy + vz * vz
    speed, shortest = math.sqrt(square), NO_DIRECTION * p[of.REST_LENGTH]
    if speed > 0.0 and length <= FARTHEST * speed:
        nearest = -(ax * vx + ay * vy + az * vz) / square
        bx, by, bz = ax + vx * nearest, ay + vy * nearest, az + vz * nearest
        straight = math.sqrt(bx * bx + by * by + bz * bz) <= MISSES * speed
        inside = length < shortest and speed * 1e-9 > shortest
        if h * 1e9 < 1.0 or inside or (straight and 0.0 <= nearest <= AT_ONCE):
            length_ns = max(int(math.ceil((2.0 * nearest if nearest > 0.0 else -nearest) * 1e9)), 2)
            spin = math.sqrt(c[0, SPIN] ** 2 + c[0, SPIN + 1] ** 2 + c[0, SPIN + 2] ** 2)
            if spin * length_ns * 1e-9 <= _MOST_TURN:
                return h, length_ns
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


@njit(cache=True, error_model="numpy")
def _impulse(knot: tuple[float, ...], p: np.ndarray, h: float, J: np.ndarray) -> float:
    """Into J (2, 3) the integral of F over h seconds [N s] and the integral of that [N s²]; returns the damper's heat
    [J]. knot: a and v.
    """
    ax, ay, az, vx, vy, vz = knot
    square = vx * vx + vy * vy + vz * vz
    speed = math.sqrt(square)
    start = (ax * vx + ay * vy + az * vz) / square
    end = start + h
    miss = (ax - vx * start, ay - vy * start, az - vz * start)
    b = math.sqrt(miss[0] ** 2 + miss[1] ** 2 + miss[2] ** 2)
    before, after = math.sqrt(b * b + square * start * start), math.sqrt(b * b + square * end * end)
    # ∫ s/l, ∫ 1/l, ∫ s²/l², ∫ s/l², times powers of |v|; and the integrals over time of the first two.
    along, across, along_twice, across_twice = (after - before) / square, 0.0, h, 0.0
    path, turn = 0.5 * (end * after - start * before), 0.0
    if b > _NO_TIME * speed:
        first, last = speed * start / b, speed * end / b
        across_first = math.copysign(logarithm(abs(first) + math.sqrt(first * first + 1.0)), first) / speed
        across_last = math.copysign(logarithm(abs(last) + math.sqrt(last * last + 1.0)), last) / speed
        across = across_last - across_first
        along_twice = h - b / speed * (inverse_tangent(last) - inverse_tangent(first))
        across_twice = logarithm(after / before)
        path += 0.5 * b * b * across
        turn = end * across_last - start * across_first - (after - before) / square - across_first * h
    path = (path - before * h) / square
    k, c, push = p[of.STIFFNESS], p[of.STRING_DAMPING], p[of.STIFFNESS] * p[of.REST_LENGTH]
    a, v = (ax, ay, az), (vx, vy, vz)
    for i in range(3):
        damped = c * (v[i] * along_twice + miss[i] * across_twice)
        J[0, i] = push * (v[i] * along + miss[i] * across) - k * h * (a[i] + 0.5 * h * v[i]) - damped
        J[1, i] = push * (v[i] * path + miss[i] * turn) - k * h * h * (0.5 * a[i] + h * v[i] / 6.0) - 0.5 * h * damped
    return c * square * along_twice


@njit(cache=True, error_model="numpy")
def pass_by(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray) -> None:
    """The variables h seconds after y into out (STORED,), the knot going straight past its free end all along."""
    start = y.copy()
    q, w = (y[0], y[1], y[2], y[3]), (y[4], y[5], y[6])
    d, u = (y[7], y[8], y[9]), (y[10], y[11], y[12])
    _, _, _, vx, vy, vz = moving_knot(*q, *w, *d, *u, p)
    ax, ay, az, _, _ = knot_and_stretch(y, p)
    J = np.zeros((2, 3))
    heat = _impulse((ax, ay, az, vx, vy, vz), p, h, J)
    ex, ey, ez, gx, gy, gz, _, _ = accelerations(*q, *w, *d, *u, p, False)
    # The impulse turns the body as it lies halfway.
    mx, my, mz, mw = multiply(*q, 0.25 * h * w[0], 0.25 * h * w[1], 0.25 * h * w[2], 1.0)
    mx, my, mz, mw = normalize(mx, my, mz, mw)
    e, g, r = (ex, ey, ez), (gx, gy, gz), (p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2])
    kicks = np.zeros((2, 3))
    for i in range(2):
        fx, fy, fz = rotate_inverse(mx, my, mz, mw, J[i, 0], J[i, 1], J[i, 2])
        kicks[i, 0] = (r[1] * fz - r[2] * fy) / p[of.MOMENTS]
        kicks[i, 1] = (r[2] * fx - r[0] * fz) / p[of.MOMENTS + 1]
        kicks[i, 2] = (r[0] * fy - r[1] * fx) / p[of.MOMENTS + 2]
    out[:] = start
    turn = np.zeros(3)
    for i in range(3):
        turn[i] = h * (w[i] + 0.5 * h * e[i]) + kicks[1, i]
        out[4 + i] = w[i] + h * e[i] + kicks[0, i]
        moved_pair(start, out, 7 + i, LOW + 4 + i, h * (u[i] + 0.5 * h * g[i]) + J[1, i] / p[of.MASS])
        out[10 + i] = u[i] + h * g[i] + J[0, i] / p[of.MASS]
    # exp of half the turn, less 1: a few nanoseconds' turn needs few terms.
    x = turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2
    s, less = 0.5 - x * (1.0 / 48.0 - x / 3840.0), -x * (0.125 - x * (1.0 / 384.0 - x / 46080.0))
    qx, qy, qz, qw = multiply(*q, s * turn[0], s * turn[1], s * turn[2], less)
    moved_pair(start, out, 0, LOW, qx)
    moved_pair(start, out, 1, LOW + 1, qy)
    moved_pair(start, out, 2, LOW + 2, qz)
    moved_pair(start, out, 3, LOW + 3, qw)
    unit_attitude(out)
    work = J[0, 0] * p[of.HAND_VELOCITY] + J[0, 1] * p[of.HAND_VELOCITY + 1] + J[0, 2] * p[of.HAND_VELOCITY + 2]
    out[HAND_WORK] += work
    out[HEAT] += heat
