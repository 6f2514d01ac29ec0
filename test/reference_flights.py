# SPDX-License-Identifier: MIT
"""Flights on a string by plain small steps, thousands of them in a minute, sharing nothing with what they judge.

Written from docs/physics.md alone: position, attitude, velocity and angular momentum in world axes, an explicit Runge-Kutta
method of order 8 at steps far below every time scale of the flight, summed with compensation, and a search of its own for slack and taut:
a step in which the string's law changes, or in which the cubic through its ends says that it does, is taken once more up to
there.

A flight can be disturbed all along by errors of a given rate, always in the same direction for a while: what comes of
them at the end is the flight's condition.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.integrate import DOP853

STAGES = 12
A, B = DOP853.A.copy(), DOP853.B.copy()
C = np.array([math.fsum(row) for row in A])

FINENESS = 0.06
"""Of the shortest time scale of a flight: smaller steps than its order needs, as a slack or taut spell within one must show."""
LONGEST_S = 2e-3
SAME_DIRECTION_S = 0.25
DIRECTIONS = 16
"""Ways in which a flight is disturbed, one after the other and then anew."""

_THREE = [
    *("gravity", "force_world", "point_world", "torque_world", "force_body", "point_body", "torque_body"),
    *("arm", "target", "moved"),
]
_ONE = ["mass", "length", "linear_damping", "angular_damping", "stiffness", "damping", "rest_length"]
NUMBERS = np.dtype(
    [
        ("row", np.float64, 13),  # x, q xyzw, v, ω body
        ("inertia", np.float64, 9),  # body axes
        *((name, np.float64, 3) for name in _THREE),
        *((name, np.float64) for name in _ONE),
        ("tied", np.bool_),
        ("one_sided", np.bool_),
    ],
    align=True,
)
"""A flight in SI units. A wrench is a force at a point, and a torque, in world axes and in body axes; points in body axes from
the COM. The string's free end is at ``target`` until it moves, and at ``moved`` after; ``length`` is ℓ.
"""


def numbers(scene: dict) -> np.ndarray:
    """A scene's numbers by name as an array (1,) of NUMBERS."""
    record = np.zeros(1, NUMBERS)
    for name in NUMBERS.names:
        record[name] = np.ravel(scene[name]) if NUMBERS[name].shape else scene[name]
    return record


@njit(cache=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _turned(q, v, sign):
    """From body to world axes, or back for sign −1."""
    u = (sign * q[0], sign * q[1], sign * q[2])
    s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    t = _cross(u, v)
    t = (s * t[0], s * t[1], s * t[2])
    e = _cross(u, t)
    return v[0] + q[3] * t[0] + e[0], v[1] + q[3] * t[1] + e[1], v[2] + q[3] * t[2] + e[2]


@njit(cache=True)
def _solved(P, v):
    """I⁻¹ v in body axes, by Cramer's rule."""
    I = P.inertia
    a, b, c = (I[0], I[3], I[6]), (I[1], I[4], I[7]), (I[2], I[5], I[8])
    bc = _cross(b, c)
    det = _dot(a, bc)
    return _dot(v, bc) / det, _dot(v, _cross(c, a)) / det, _dot(v, _cross(a, b)) / det


@njit(cache=True)
def _spin_of(P, q, momentum):
    """World axes."""
    return _turned(q, _solved(P, _turned(q, momentum, -1.0)), 1.0)


@njit(cache=True)
def _three(Y, at):
    return Y[at], Y[at + 1], Y[at + 2]


@njit(cache=True)
def _rates(Y, P, hand, time, loaded, pulls, dY, law):
    """Y' into dY; into law: l² − rest² and its rate, k x + c l' and its rate."""
    q, v, momentum = (Y[3], Y[4], Y[5], Y[6]), _three(Y, 7), _three(Y, 10)
    w = _spin_of(P, q, momentum)
    mass, linear, angular = P.mass, P.linear_damping, P.angular_damping
    F = np.empty(3)
    T = np.empty(3)
    for j in range(3):
        F[j] = mass * P.gravity[j] - linear * v[j]
        T[j] = -angular * w[j]
    if loaded:
        force, body, own = P.force_world, _turned(q, P.force_body, 1.0), _turned(q, P.torque_body, 1.0)
        one, two = _cross(_turned(q, P.point_world, 1.0), force), _cross(_turned(q, P.point_body, 1.0), body)
        for j in range(3):
            F[j] += force[j] + body[j]
            T[j] += P.torque_world[j] + own[j] + one[j] + two[j]
    r, a, rate, l = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
    if P.tied:
        k, c, rest = P.stiffness, P.damping, P.rest_length
        r = _turned(q, P.arm, 1.0)
        t = _cross(w, r)
        a = (
            Y[0] - hand[0] - time * hand[3] + r[0],
            Y[1] - hand[1] - time * hand[4] + r[1],
            Y[2] - hand[2] - time * hand[5] + r[2],
        )
        rate = (v[0] + t[0] - hand[3], v[1] + t[1] - hand[4], v[2] + t[2] - hand[5])
        l = math.sqrt(_dot(a, a))
        speed = _dot(a, rate) / l if l > 0.0 else 0.0
        tension = k * (l - rest) + c * speed
        law[0], law[1], law[2] = (l - rest) * (l + rest), 2.0 * _dot(a, rate), tension
        if pulls:
            for j in range(3):
                law[4 + j] = 0.0
                if rest == 0.0:
                    law[4 + j] = -k * a[j] - c * rate[j]
                elif l > 0.0:
                    law[4 + j] = -tension * a[j] / l
                F[j] += law[4 + j]
            t = _cross(r, (law[4], law[5], law[6]))
            for j in range(3):
                T[j] += t[j]
    for j in range(3):
        dY[j], dY[7 + j], dY[10 + j] = v[j], F[j] / mass, T[j]
    e = _cross(w, (q[0], q[1], q[2]))
    for j in range(3):
        dY[3 + j] = 0.5 * (q[3] * w[j] + e[j])
    dY[6] = -0.5 * _dot(w, q)
    if P.tied and l > 0.0:
        t = _cross(w, momentum)
        turn = _turned(q, _solved(P, _turned(q, (T[0] - t[0], T[1] - t[1], T[2] - t[2]), -1.0)), 1.0)
        one, two = _cross(turn, r), _cross(w, _cross(w, r))
        second = (F[0] / mass + one[0] + two[0], F[1] / mass + one[1] + two[1], F[2] / mass + one[2] + two[2])
        speed = _dot(a, rate) / l
        bend = (_dot(rate, rate) + _dot(a, second) - speed * speed) / l
        law[3] = P.stiffness * speed + P.damping * bend


@njit(cache=True)
def _step(Y, low, P, hand, time, h, loaded, pulls, K, Z, law, out, out_low, a, b, c):
    """From Y + low into out + out_low, h seconds on."""
    _rates(Y, P, hand, time, loaded, pulls, K[0], law)
    for i in range(1, STAGES):
        for j in range(13):
            total = 0.0
            for m in range(i):
                if a[i, m] != 0.0:
                    total += a[i, m] * K[m, j]
            Z[j] = Y[j] + h * total
        _rates(Z, P, hand, time + c[i] * h, loaded, pulls, K[i], law)
    for j in range(13):
        total = 0.0
        for m in range(STAGES):
            if b[m] != 0.0:
                total += b[m] * K[m, j]
        change = h * total + low[j]
        s = Y[j] + change
        t = s - Y[j]
        out[j], out_low[j] = s, (Y[j] - (s - t)) + (change - t)


@njit(cache=True)
def _step_size(Y, P, hand, time, pulls):
    q = (Y[3], Y[4], Y[5], Y[6])
    w = _spin_of(P, q, _three(Y, 10))
    softest = 0.0
    for j in range(3):
        unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        softest += _solved(P, unit)[j]
    rate = math.sqrt(_dot(w, w)) + 0.5 * (P.angular_damping * softest + P.linear_damping / P.mass)
    if P.tied and (pulls or P.rest_length > 0.0):
        r = _turned(q, P.arm, 1.0)
        t = _cross(w, r)
        a = (
            Y[0] - hand[0] - time * hand[3] + r[0],
            Y[1] - hand[1] - time * hand[4] + r[1],
            Y[2] - hand[2] - time * hand[5] + r[2],
        )
        along = (Y[7] + t[0] - hand[3], Y[8] + t[1] - hand[4], Y[9] + t[2] - hand[5])
        l = math.sqrt(_dot(a, a))
        if not pulls:
            return min(FINENESS / max(rate + math.sqrt(_dot(along, along)) / P.rest_length, 1e-3), LONGEST_S)
        turning = _dot(r, r) * softest
        if P.rest_length > 0.0 and l > 0.0:
            lever = _cross(r, a)
            body = _turned(q, lever, -1.0)
            turning = _dot(body, _solved(P, body)) / (l * l)
            rate += math.sqrt(_dot(along, along)) / l
        light = 1.0 / P.mass + turning
        rate += math.sqrt(P.stiffness * light) + 0.5 * P.damping * light
    return min(FINENESS / max(rate, 1e-3), LONGEST_S)


@njit(cache=True)
def _guard(law, state, second):
    """What ends a state by rising above zero, and its rate: slack (0), pulls (1), shortens (2, of two)."""
    if state == 0 or second:
        sign = -1.0 if second else 1.0
        return sign * law[0], sign * law[1]
    sign = -1.0 if state == 1 else 1.0
    return sign * law[2], sign * law[3]


@njit(cache=True)
def _hidden(g0, r0, g1, r1, h):
    """Where the cubic through both ends of a step has its top, if it rises above zero between two ends below it; else 0."""
    if not (r0 > 0.0 and r1 < 0.0):
        return 0.0
    r0, r1, rise = r0 * h, r1 * h, g1 - g0
    a, b = 3.0 * (r0 + r1 - 2.0 * rise), 2.0 * (3.0 * rise - 2.0 * r0 - r1)
    denominator = -b + math.sqrt(max(b * b - 4.0 * a * r0, 0.0))
    if denominator == 0.0:
        return 0.0
    s = 2.0 * r0 / denominator
    top = g0 + s * (r0 + s * (0.5 * b + s * a / 3.0))
    return s * h if 0.0 < s < 1.0 and top > 0.0 else 0.0


@njit(cache=True)
def _fly_span(Y, low, P, hand, begin, span, loaded, disturbance, ways, a, b, c):
    """Y, low on by ``span`` seconds in place; returns how many steps were taken."""
    K, Z, out, out_low = np.zeros((STAGES, 13)), np.zeros(13), np.zeros(13), np.zeros(13)
    before, after, dY = np.zeros(8), np.zeros(8), np.zeros(13)
    may = P.tied and P.one_sided
    state, time, steps = 1, 0.0, 0
    if may:
        _rates(Y, P, hand, 0.0, loaded, False, dY, before)
        state = 0 if before[0] <= 0.0 else (1 if before[2] > 0.0 else 2)
    while time < span:
        pulls = state == 1
        h = min(_step_size(Y, P, hand, time, pulls), span - time)
        if span - time - h < 1e-12:
            h = span - time
        _step(Y, low, P, hand, time, h, loaded, pulls, K, Z, after, out, out_low, a, b, c)
        steps += 1
        ended = -1
        if may:
            _rates(Y, P, hand, time, loaded, pulls, dY, before)
            _rates(out, P, hand, time + h, loaded, pulls, dY, after)
            high = h
            for second in range(2 if state == 2 else 1):
                g0, r0 = _guard(before, state, second == 1)
                g1, r1 = _guard(after, state, second == 1)
                until = h if g1 > 0.0 else _hidden(min(g0, 0.0), r0, g1, r1, h)
                if until > 0.0 and (ended < 0 or until < high):
                    ended, high = second, until
        if ended >= 0:
            bottom, at, real, trial = 0.0, high, True, 0
            while True:
                _step(Y, low, P, hand, time, at, loaded, pulls, K, Z, after, out, out_low, a, b, c)
                _rates(out, P, hand, time + at, loaded, pulls, dY, after)
                g, r = _guard(after, state, ended == 1)
                if trial == 0 and not g > 0.0:
                    real = False
                    break
                bottom, high = (bottom, at) if g > 0.0 else (at, high)
                new = at - g / r if r > 0.0 and trial < 30 else -1.0
                if not bottom < new < high:
                    new = 0.5 * (bottom + high)
                found = abs(new - at) <= 1e-17 + 2.0**-51 * at or not bottom < new < high
                if found and state == 2 and ended == 0 and after[0] <= 0.0:
                    # Before it would have pulled again its stretch was gone.
                    bottom, high, ended, trial = 0.0, at, 1, 1
                    continue
                if found:
                    break
                at = new
                trial += 1
            if real:
                h = at
                state = 0 if ended == 1 else (1 if state != 1 else (2 if P.damping > 0.0 else 0))
            else:
                _step(Y, low, P, hand, time, h, loaded, pulls, K, Z, after, out, out_low, a, b, c)
        if disturbance > 0.0:
            _disturb(out, P, disturbance * h, ways[int((begin + time) / SAME_DIRECTION_S) % DIRECTIONS])
        Y[:], low[:] = out, out_low
        time = span if h == span - time else time + h
    return steps


@njit(cache=True)
def _disturb(Y, P, size, ways):
    """Move Y by an error of this size in the measure of ``error``."""
    q = (Y[3], Y[4], Y[5], Y[6])
    w, v = _spin_of(P, q, _three(Y, 10)), _three(Y, 7)
    spin, speed = max(math.sqrt(_dot(w, w)), 1.0), max(math.sqrt(_dot(v, v)), P.length)
    for j in range(3):
        Y[j] += size * P.length * ways[0, j]
        Y[7 + j] += size * speed * ways[1, j]
    body = _turned(q, (size * spin * ways[2, 0], size * spin * ways[2, 1], size * spin * ways[2, 2]), -1.0)
    I = P.inertia
    more = _turned(q, (_dot(I[0:3], body), _dot(I[3:6], body), _dot(I[6:9], body)), 1.0)
    turn = (0.5 * size * ways[3, 0], 0.5 * size * ways[3, 1], 0.5 * size * ways[3, 2])
    e = _cross(turn, (q[0], q[1], q[2]))
    for j in range(3):
        Y[10 + j] += more[j]
        Y[3 + j] += q[3] * turn[j] + e[j]
    Y[6] -= _dot(turn, q)


@njit(cache=True)
def _begun(P):
    """x, q, v and the angular momentum in world axes of the row in P."""
    Y = P.row.copy()
    Y[3:7] /= math.sqrt(Y[3] * Y[3] + Y[4] * Y[4] + Y[5] * Y[5] + Y[6] * Y[6])
    q, w, I = (Y[3], Y[4], Y[5], Y[6]), (Y[10], Y[11], Y[12]), P.inertia
    Y[10:13] = np.array(_turned(q, (_dot(I[0:3], w), _dot(I[3:6], w), _dot(I[6:9], w)), 1.0))
    return Y


@njit(cache=True)
def _row(P, Y):
    """x, q, v and ω in body axes."""
    row, q = Y.copy(), (Y[3], Y[4], Y[5], Y[6])
    row[10:13] = np.array(_solved(P, _turned(q, (Y[10], Y[11], Y[12]), -1.0)))
    return row


@njit(cache=True)
def _fly(P, load, move, end, disturbance, ways, a, b, c):
    Y, low, hand = _begun(P), np.zeros(13), np.zeros(6)
    cuts = np.sort(np.array([0.0, load[0], load[1], move[0], move[1], end]))
    for n in range(5):
        begin, span = cuts[n], cuts[n + 1] - cuts[n]
        if begin >= end or span <= 0.0:
            continue
        moving = move[0] <= begin < move[1]
        for j in range(3):
            rate = (P.moved[j] - P.target[j]) / (move[1] - move[0])
            hand[j] = P.moved[j] if begin >= move[1] else P.target[j]
            hand[3 + j] = 0.0
            if moving:
                hand[j], hand[3 + j] = P.target[j] + (begin - move[0]) * rate, rate
        _fly_span(Y, low, P, hand, begin, span, load[0] <= begin < load[1], disturbance, ways, a, b, c)
    return _row(P, Y)


NO_WAYS = np.zeros((DIRECTIONS, 4, 3))


def fly(
    P: np.ndarray, load_s, move_s, end_s: float, disturbance: float = 0.0, ways: np.ndarray = NO_WAYS
) -> np.ndarray:
    """The row (13,) at end_s: x, q, v, ω in body axes, of a flight with numbers P.

    Its wrench acts from load_s[0] to load_s[1], its free end moves evenly from move_s[0] to move_s[1], to zero of which it all counts.
    disturbance: rate [1/s] in the measure of ``error``, along ways (DIRECTIONS, 4, 3) of unit vectors.
    """
    return _fly(P[0], np.array(load_s, float), np.array(move_s, float), float(end_s), disturbance, ways, A, B, C)


def error(row, exact, length: float) -> float:
    """max(attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1), |Δv|/max(|v|, ℓ)) of a row (13,) against another."""
    q, p = row[3:7] / np.linalg.norm(row[3:7]), exact[3:7] / np.linalg.norm(exact[3:7])
    angle = 4.0 * np.arcsin(min(0.5 * min(np.linalg.norm(q - p), np.linalg.norm(q + p)), 1.0))
    moved, sped, spun = (np.linalg.norm(row[k : k + 3] - exact[k : k + 3]) for k in (0, 7, 10))
    speed, spin = np.linalg.norm(exact[7:10]), np.linalg.norm(exact[10:13])
    return float(max(angle, moved / length, sped / max(speed, length), spun / max(spin, 1.0)))
