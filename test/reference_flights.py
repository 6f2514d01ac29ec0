# SPDX-License-Identifier: MIT
"""Flights on a string by plain small steps, thousands of them in a minute, sharing nothing with what they judge.

Written from docs/physics.md alone: position, attitude, velocity and angular momentum in world axes, an explicit Runge-Kutta
method of order 8 at steps far below every time scale of the flight, and a search of its own for slack and taut: a step in which
the string's law changes, or in which the cubic through its ends says that it does, is taken once more up to there.

A flight can be disturbed all along by errors of a given rate, always in the same direction for a while: what comes of
them at the end is the flight's condition.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from scipy.integrate import DOP853

from rigid_proto_ros.base import compilation


class _Kept(compilation.KernelLocator):
    """Where the package's kernels are: another checkout compiles none of these, which takes half a minute."""

    @classmethod
    def from_function(cls, function, file):
        return cls(file, function.__code__.co_firstlineno)


class _Files(compilation.CompileResultCacheImpl):
    _locator_classes = [_Kept]


class _Cache(compilation.KernelCache):
    _impl_class = _Files


def kernel(function):
    compiled = numba.njit(function)
    compiled._cache = _Cache(function)
    return compiled


STAGES = 12
A, B = DOP853.A.copy(), DOP853.B.copy()
C = np.array([math.fsum(row) for row in A])

FINENESS = 0.06
"""Of the shortest time scale of a flight: smaller steps than its order needs, as a slack or taut spell within one must show."""
LONGEST_S = 2e-3
SAME_DIRECTION_S = 0.25
DIRECTIONS = 16
"""Ways in which a flight is disturbed, one after the other and then anew."""

SLACK, PULLS, SHORTENS = range(3)

_THREE = [
    *("gravity", "force_world", "point_world", "torque_world", "force_body", "point_body", "torque_body"),
    *("arm", "target", "moved"),
]
_ONE = ["mass", "length", "linear_damping", "angular_damping", "stiffness", "damping", "rest_length"]
NUMBERS = np.dtype(
    [
        ("row", np.float64, 13),  # x, q xyzw, v, ω body
        ("inertia", np.float64, (3, 3)),  # body axes
        ("inverse", np.float64, (3, 3)),  # its inverse
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
    for name, value in {**scene, "inverse": np.linalg.inv(scene["inertia"])}.items():
        record[name] = value
    return record


@kernel
def _times(M, v):
    return np.array([_dot(M[0], v), _dot(M[1], v), _dot(M[2], v)])


@kernel
def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _size(a):
    return math.sqrt(_dot(a, a))


@kernel
def _rotation(q):
    """Body to world, of a quaternion xyzw of any length."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ]
    )


@kernel
def _world(R, tensor, v):
    """A tensor of body axes times v in world axes."""
    return _times(R, _times(tensor, _times(R.T, v)))


@kernel
def _turning(w, q):
    """q' of a spin w in world axes."""
    e = _cross(w, q)
    return 0.5 * np.array([q[3] * w[0] + e[0], q[3] * w[1] + e[1], q[3] * w[2] + e[2], -_dot(w, q)])


@kernel
def _knot(Y, P, hand, time):
    """R, ω, the arm, the way from the free end to the knot and its rate, in world axes."""
    R = _rotation(Y[3:7])
    w, r = _world(R, P.inverse, Y[10:13]), _times(R, P.arm)
    return R, w, r, Y[0:3] + r - (hand[0] + time * hand[1]), Y[7:10] + _cross(w, r) - hand[1]


@kernel
def _law(P, a, rate):
    """l, l² − rest² and the tension k x + c l' of a knot at a from the free end."""
    l = _size(a)
    speed = _dot(a, rate) / l if l > 0.0 else 0.0
    return l, (l - P.rest_length) * (l + P.rest_length), P.stiffness * (l - P.rest_length) + P.damping * speed


@kernel
def _rates(Y, P, hand, time, loaded, pulls):
    R, w, r, a, rate = _knot(Y, P, hand, time)
    force, torque = P.mass * P.gravity - P.linear_damping * Y[7:10], -P.angular_damping * w
    if loaded:
        own = _times(R, P.force_body)
        force = force + P.force_world + own
        torque = torque + P.torque_world + _times(R, P.torque_body)
        torque = torque + _cross(_times(R, P.point_world), P.force_world) + _cross(_times(R, P.point_body), own)
    if P.tied and pulls:
        pull = -P.stiffness * a - P.damping * rate
        if P.rest_length > 0.0:
            l, _, tension = _law(P, a, rate)
            pull = -tension / l * a if l > 0.0 else np.zeros(3)
        force, torque = force + pull, torque + _cross(r, pull)
    found = np.empty(13)
    found[0:3], found[3:7], found[7:10], found[10:13] = Y[7:10], _turning(w, Y[3:7]), force / P.mass, torque
    return found


@kernel
def _step(Y, P, hand, time, h, loaded, pulls, a, b, c):
    """Y after h seconds."""
    K = np.zeros((STAGES, 13))
    for i in range(STAGES):
        Z = np.zeros(13)
        for m in range(i):
            if a[i, m] != 0.0:
                Z += a[i, m] * K[m]
        K[i] = _rates(Y + h * Z, P, hand, time + c[i] * h, loaded, pulls)
    Z = np.zeros(13)
    for m in range(STAGES):
        Z += b[m] * K[m]
    return Y + h * Z


@kernel
def _step_size(Y, P, hand, time, pulls):
    _, w, r, a, along = _knot(Y, P, hand, time)
    softest = P.inverse[0, 0] + P.inverse[1, 1] + P.inverse[2, 2]
    rate = _size(w) + 0.5 * (P.angular_damping * softest + P.linear_damping / P.mass)
    if P.tied and pulls:
        light = 1.0 / P.mass + _dot(r, r) * softest
        rate += math.sqrt(P.stiffness * light) + 0.5 * P.damping * light
        if P.rest_length > 0.0 and _size(a) > 0.0:
            rate += _size(along) / _size(a)
    elif P.tied and P.rest_length > 0.0:
        rate += _size(along) / P.rest_length
    return min(FINENESS / max(rate, 1e-3), LONGEST_S)


DIFFERENCE_S = 1e-7
"""Over which the law's rate is taken, of a flight's shortest time scale a small part."""


@kernel
def _guard(Y, P, hand, time, loaded, state, second):
    """What ends a state by rising above zero, and its rate: slack, pulls, shortens (of two: it pulls again, or its stretch is gone)."""
    found = np.zeros(3)
    dY = _rates(Y, P, hand, time, loaded, state == PULLS)
    for k in range(3):
        t = (0.0, -DIFFERENCE_S, DIFFERENCE_S)[k]
        _, _, _, a, rate = _knot(Y + t * dY, P, hand, time + t)
        _, stretch, tension = _law(P, a, rate)
        found[k] = stretch if state == SLACK else -stretch if second else -tension if state == PULLS else tension
    return found[0], (found[2] - found[1]) / (2.0 * DIFFERENCE_S)


@kernel
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


@kernel
def _end_of_state(Y, P, hand, time, h, loaded, state, a, b, c):
    """When within a step of h seconds the string's law changes, and the state that follows; h and the same for never."""
    after = state
    for second in range(2 if state == SHORTENS else 1):
        end = _step(Y, P, hand, time, h, loaded, state == PULLS, a, b, c)
        g0, r0 = _guard(Y, P, hand, time, loaded, state, second == 1)
        g1, r1 = _guard(end, P, hand, time + h, loaded, state, second == 1)
        low, high = 0.0, h if g1 > 0.0 else _hidden(min(g0, 0.0), r0, g1, r1, h)
        at, trial = high, 0
        while high > 0.0:
            reached = _step(Y, P, hand, time, at, loaded, state == PULLS, a, b, c)
            g, r = _guard(reached, P, hand, time + at, loaded, state, second == 1)
            if trial == 0 and not g > 0.0:
                high = 0.0
                break
            low, high = (low, at) if g > 0.0 else (at, high)
            new = at - g / r if r > 0.0 and trial < 30 else -1.0
            if not low < new < high:
                new = 0.5 * (low + high)
            if abs(new - at) <= 1e-17 + 2.0**-51 * at or not low < new < high:
                break
            at = new
            trial += 1
        if high > 0.0:
            h = at
            after = (
                SLACK if second == 1 or (state == PULLS and P.damping == 0.0) else SHORTENS if state == PULLS else PULLS
            )
    return h, after


@kernel
def _fly_span(Y, P, hand, begin, span, loaded, disturbance, ways, a, b, c):
    """Y after ``span`` seconds."""
    may, time, state = P.tied and P.one_sided, 0.0, PULLS
    if may:
        _, _, _, away, rate = _knot(Y, P, hand, 0.0)
        _, stretch, tension = _law(P, away, rate)
        state = SLACK if stretch <= 0.0 else (PULLS if tension > 0.0 else SHORTENS)
    while time < span:
        h, after = min(_step_size(Y, P, hand, time, state == PULLS), span - time), state
        if may:
            h, after = _end_of_state(Y, P, hand, time, h, loaded, state, a, b, c)
        Y = _step(Y, P, hand, time, h, loaded, state == PULLS, a, b, c)
        if disturbance > 0.0:
            _disturb(Y, P, disturbance * h, ways[int((begin + time) / SAME_DIRECTION_S) % DIRECTIONS])
        state, time = after, span if span - time - h < 1e-12 else time + h
    return Y


@kernel
def _disturb(Y, P, size, ways):
    """Move Y by an error of this size in the measure of ``error``."""
    R = _rotation(Y[3:7])
    spin, speed = max(_size(_world(R, P.inverse, Y[10:13])), 1.0), max(_size(Y[7:10]), P.length)
    Y[0:3] += size * P.length * ways[0]
    Y[7:10] += size * speed * ways[1]
    Y[10:13] += _world(R, P.inertia, size * spin * ways[2])
    Y[3:7] += _turning(size * ways[3], Y[3:7])


@kernel
def _fly(P, load, move, end, cuts, disturbance, ways, a, b, c):
    Y, hand = P.row.copy(), np.zeros((2, 3))
    Y[3:7] /= math.sqrt(_dot(Y[3:6], Y[3:6]) + Y[6] * Y[6])
    # Angular momentum in world axes, until the end.
    Y[10:13] = _times(_rotation(Y[3:7]), _times(P.inertia, Y[10:13]))
    for n in range(5):
        begin, span = cuts[n], cuts[n + 1] - cuts[n]
        if begin >= end or span <= 0.0:
            continue
        rate = (P.moved - P.target) / (move[1] - move[0])
        hand[0], hand[1] = P.moved if begin >= move[1] else P.target, 0.0
        if move[0] <= begin < move[1]:
            hand[0], hand[1] = P.target + (begin - move[0]) * rate, rate
        Y = _fly_span(Y, P, hand, begin, span, load[0] <= begin < load[1], disturbance, ways, a, b, c)
    Y[10:13] = _times(P.inverse, _times(_rotation(Y[3:7]).T, Y[10:13]))
    return Y


NO_WAYS = np.zeros((DIRECTIONS, 4, 3))


def fly(
    P: np.ndarray, load_s, move_s, end_s: float, disturbance: float = 0.0, ways: np.ndarray = NO_WAYS
) -> np.ndarray:
    """The row (13,) at end_s: x, q, v, ω in body axes, of a flight with numbers P.

    Its wrench acts from load_s[0] to load_s[1], its free end moves evenly from move_s[0] to move_s[1], to zero of which it all counts.
    disturbance: rate [1/s] in the measure of ``error``, along ways (DIRECTIONS, 4, 3) of unit vectors.
    """
    cuts = np.sort([0.0, *load_s, *move_s, end_s])
    return _fly(P[0], load_s, move_s, float(end_s), cuts, disturbance, ways, A, B, C)


def error(row, exact, length: float) -> float:
    """max(attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1), |Δv|/max(|v|, ℓ)) of a row (13,) against another."""
    q, p = row[3:7] / np.linalg.norm(row[3:7]), exact[3:7] / np.linalg.norm(exact[3:7])
    angle = 4.0 * np.arcsin(min(0.5 * min(np.linalg.norm(q - p), np.linalg.norm(q + p)), 1.0))
    moved, sped, spun = (np.linalg.norm(row[k : k + 3] - exact[k : k + 3]) for k in (0, 7, 10))
    speed, spin = np.linalg.norm(exact[7:10]), np.linalg.norm(exact[10:13])
    return float(max(angle, moved / length, sped / max(speed, length), spun / max(spin, 1.0)))
