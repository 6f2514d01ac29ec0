# SPDX-License-Identifier: MIT
"""Motion under loads by Taylor series in mpmath: the equations of motion are polynomial, so their series follow by recurrence.

Source of the method: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods (2005). The full tensor is used in body axes, so that principal axes found elsewhere are not trusted either.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mpmath
import numpy as np
from mpmath import mp, mpf

ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ReferenceString:
    """Spring-damper from a world point to a body point (body axes, from the COM): stiffness k [N/m], damping c [N s/m]."""

    point: tuple
    target: tuple
    stiffness: float
    damping: float = 0.0
    rest_length: float = 0.0
    bilateral: bool = False
    target_velocity: tuple = ZERO


@dataclass(frozen=True)
class ReferenceProblem:
    """A body and constant loads. moment = Σ r Fᵀ of world forces F at body points r; damping [N s/m] and [N m s]."""

    mass: float
    inertia: tuple
    gravity: tuple = ZERO
    force_world: tuple = ZERO
    force_body: tuple = ZERO
    torque_world: tuple = ZERO
    torque_body: tuple = ZERO
    moment: tuple = (ZERO, ZERO, ZERO)
    linear_damping: float = 0.0
    angular_damping: float = 0.0
    gyroscopic: bool = True
    string: ReferenceString | None = None


@dataclass
class ReferenceState:
    """position, orientation_xyzw (body to world), linear velocity (world), angular velocity (body), as lists of mpf."""

    position: list
    orientation: list
    velocity: list
    angular_velocity: list

    @classmethod
    def of(cls, row) -> ReferenceState:
        """From the 13 numbers x, q, v, ω, doubles or mpf; the quaternion is normalized in high precision."""
        x = [c if isinstance(c, mpf) else mpf(float(c)) for c in row]
        size = mpmath.sqrt(sum(c * c for c in x[3:7]))
        return cls(x[0:3], [c / size for c in x[3:7]], x[7:10], x[10:13])

    @property
    def row(self) -> list:
        return [*self.position, *self.orientation, *self.velocity, *self.angular_velocity]


@dataclass
class _Series:
    """Taylor coefficients about one time; lists of lists, index [component][order]."""

    x: list
    q: list
    v: list
    w: list
    span: list = field(default_factory=list)
    rate: list = field(default_factory=list)


def reference_motion(problem: ReferenceProblem, row, times, digits: int = 40) -> list[list]:
    """Rows (13 mpf) at the given times [s], ascending, from a row of 13 doubles at time 0."""
    with mp.workdps(digits + 5):
        order = int(1.2 * digits) + 6
        state, now, rows = ReferenceState.of(row), mpf(0), []
        taut = _starts_taut(problem, state, order)
        for time in times:
            while now < time:
                series = _series(problem, state, order, taut)
                h = min(_step(series, digits), mpf(time) - now)
                switch = _switch(problem, series, h, taut)
                if switch is not None:
                    h = switch
                    taut = not taut
                state = _evaluate(series, h)
                now += h
                if switch is None and time - now < mpf(10) ** (-digits):
                    break
            rows.append(state.row)
        return rows


def _starts_taut(problem, state, order) -> bool:
    if problem.string is None or problem.string.bilateral:
        return True
    series = _series(problem, state, order, False)
    # Only a start exactly on the switch needs a look ahead.
    t = mpf(0) if all(_stretch_and_tension(problem.string, series, mpf(0))) else _step(series, 20) * mpf("1e-6")
    return _is_taut(problem.string, series, t)


def _stretch_and_tension(string, series, t):
    """l − rest length and k(l − rest length) + c l' at t, from the span itself: the series of l has poles of its own."""
    if string.rest_length == 0.0:
        return mpf(1), mpf(1)
    span, rate = ([_polynomial(c, t) for c in part] for part in (series.span, series.rate))
    length = mpmath.sqrt(mp.fdot(span, span))
    stretch = length - mpf(string.rest_length)
    return stretch, mpf(string.stiffness) * stretch + mpf(string.damping) * mp.fdot(span, rate) / length


def _is_taut(string, series, t) -> bool:
    return all(x > 0 for x in _stretch_and_tension(string, series, t))


def _switch(problem, series, h, taut):
    """First time in (0, h] at which a pull-only string becomes taut or slack, or None.

    Taut means stretched and pulling. The grid is far finer than an oscillation, of which a step spans few.
    """
    string = problem.string
    if string is None or string.bilateral or string.rest_length == 0.0:
        return None
    # Doubles find the interval, high precision the time in it.
    points = 200
    grid = np.linspace(0.0, 1.0, points + 1)[1:]
    span, rate = (
        np.array(
            [np.polynomial.polynomial.polyval(grid, [float(c * h**k) for k, c in enumerate(part)]) for part in row]
        )
        for row in (series.span, series.rate)
    )
    length = np.sqrt((span * span).sum(axis=0))
    stretch = length - string.rest_length
    tension = string.stiffness * stretch + string.damping * (span * rate).sum(axis=0) / length
    switched = np.flatnonzero(((stretch > 0.0) & (tension > 0.0)) != taut)
    if switched.size == 0:
        return None
    return _bisect(string, series, h * int(switched[0]) / points, h * int(switched[0] + 1) / points, taut)


def _bisect(string, series, low, high, taut):
    for _ in range(int(mp.prec) + 10):
        middle = (low + high) / 2
        low, high = (low, middle) if _is_taut(string, series, middle) != taut else (middle, high)
    return high


def _polynomial(coefficients, t):
    value = mpf(0)
    for c in reversed(coefficients):
        value = value * t + c
    return value


def _evaluate(series, h) -> ReferenceState:
    q = [_polynomial(c, h) for c in series.q]
    # The flow keeps the norm; this removes the series' own remainder only.
    size = mpmath.sqrt(sum(c * c for c in q))
    x, v, w = ([_polynomial(c, h) for c in part] for part in (series.x, series.v, series.w))
    return ReferenceState(x, [c / size for c in q], v, w)


def _step(series, digits):
    """Step at which the last two terms fall below 10⁻ᵈ of the leading size of each variable."""
    smallest = mpf("1e300")
    for part in (series.x, series.q, series.v, series.w):
        size = max(max(abs(c[0]) for c in part), max(abs(c[1]) for c in part), mpf("1e-3"))
        for k in (len(part[0]) - 2, len(part[0]) - 1):
            last = max(abs(c[k]) for c in part)
            if last:
                smallest = min(smallest, (size * mpf(10) ** (-digits) / last) ** (mpf(1) / k))
    return smallest


def _dot(a, b, k):
    """Coefficient k of the product of two series."""
    return mp.fdot(a[: k + 1], b[k::-1])


def _series(problem: ReferenceProblem, state: ReferenceState, order: int, taut: bool) -> _Series:
    inertia = mpmath.matrix([[mpf(c) for c in row] for row in problem.inertia])
    inverse = inertia**-1
    x, q, v, w = (
        [[c] for c in part] for part in (state.position, state.orientation, state.velocity, state.angular_velocity)
    )
    L = [[], [], []]
    products = {(i, j): [] for i in range(4) for j in range(i, 4)}
    R = [[[] for _ in range(3)] for _ in range(3)]
    string = _StringSeries(problem.string, R, x, v, w) if problem.string else None
    m, c_v, c_w = mpf(problem.mass), mpf(problem.linear_damping), mpf(problem.angular_damping)
    has_rotation = (
        string is not None
        or any(problem.force_body)
        or any(problem.torque_world)
        or any(any(row) for row in problem.moment)
    )
    for k in range(order):
        for i in range(3):
            L[i].append(sum(inertia[i, j] * w[j][k] for j in range(3)))
        torque = [mpf(c) if k == 0 else mpf(0) for c in problem.torque_body]
        force = [mpf(c) if k == 0 else mpf(0) for c in problem.force_world]
        if has_rotation:
            for (i, j), p in products.items():
                p.append(_dot(q[i], q[j], k))
            _append_rotation(R, products)
            for i in range(3):
                force[i] += sum(R[i][j][k] * mpf(problem.force_body[j]) for j in range(3))
                torque[i] += sum(R[j][i][k] * mpf(problem.torque_world[j]) for j in range(3))
            turned = [
                [sum(mpf(problem.moment[i][n]) * R[n][j][k] for n in range(3)) for j in range(3)] for i in range(3)
            ]
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                torque[i] += turned[a][b] - turned[b][a]
        if string is not None:
            pull, turn = string.append(k, taut)
            force = [f + p for f, p in zip(force, pull, strict=True)]
            torque = [f + p for f, p in zip(torque, turn, strict=True)]
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            torque[i] -= c_w * w[i][k]
            if problem.gyroscopic:
                torque[i] -= _dot(w[a], L[b], k) - _dot(w[b], L[a], k)
            gravity = mpf(problem.gravity[i]) if k == 0 else 0
            v[i].append((gravity + (force[i] - c_v * v[i][k]) / m) / (k + 1))
            x[i].append(v[i][k] / (k + 1))
        rates = [
            _dot(q[3], w[0], k) + _dot(q[1], w[2], k) - _dot(q[2], w[1], k),
            _dot(q[3], w[1], k) + _dot(q[2], w[0], k) - _dot(q[0], w[2], k),
            _dot(q[3], w[2], k) + _dot(q[0], w[1], k) - _dot(q[1], w[0], k),
            -_dot(q[0], w[0], k) - _dot(q[1], w[1], k) - _dot(q[2], w[2], k),
        ]
        for i in range(4):
            q[i].append(rates[i] / (2 * (k + 1)))
        for i in range(3):
            w[i].append(sum(inverse[i, j] * torque[j] for j in range(3)) / (k + 1))
    if string is None:
        return _Series(x, q, v, w)
    return _Series(x, q, v, w, string.d, string.rate)


def _append_rotation(R, products):
    p = {key: series[-1] for key, series in products.items()}
    one = p[0, 0] + p[1, 1] + p[2, 2] + p[3, 3]
    R[0][0].append(one - 2 * (p[1, 1] + p[2, 2]))
    R[1][1].append(one - 2 * (p[0, 0] + p[2, 2]))
    R[2][2].append(one - 2 * (p[0, 0] + p[1, 1]))
    for i, j, n, sign in ((0, 1, 2, -1), (1, 2, 0, -1), (2, 0, 1, -1)):
        a, b = (i, j) if i < j else (j, i)
        R[i][j].append(2 * (p[a, b] + sign * p[n, 3]))
        R[j][i].append(2 * (p[a, b] - sign * p[n, 3]))


class _StringSeries:
    """Series of the string's length l = |target − point|, its tension, and what it does to the body."""

    def __init__(self, string: ReferenceString, R, x, v, w) -> None:
        self.string, self.R, self.x, self.v, self.w = string, R, x, v, w
        self.r = [mpf(c) for c in string.point]
        self.spin = [[], [], []]
        self.d = [[], [], []]
        self.rate = [[], [], []]
        self.length, self.inverse, self.unit = [], [], [[], [], []]
        self.tension, self.pull = [], [[], [], []]

    def append(self, k: int, taut: bool):
        """Order k of the force on the body (world) and of the torque about the COM (body axes)."""
        s, R, r = self.string, self.R, self.r
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            self.spin[i].append(self.w[a][k] * r[b] - self.w[b][k] * r[a])
        for i in range(3):
            target = mpf(s.target[i]) if k == 0 else mpf(s.target_velocity[i]) if k == 1 else mpf(0)
            speed = mpf(s.target_velocity[i]) if k == 0 else mpf(0)
            self.d[i].append(target - self.x[i][k] - sum(R[i][j][k] * r[j] for j in range(3)))
            self.rate[i].append(speed - self.v[i][k] - sum(_dot(R[i][j], self.spin[j], k) for j in range(3)))
        stiffness, damping, rest = mpf(s.stiffness), mpf(s.damping), mpf(s.rest_length)
        if s.rest_length == 0.0:
            # Regular at zero length, and always taut: the force is linear in d and its rate.
            pull = [stiffness * self.d[i][k] + damping * self.rate[i][k] for i in range(3)]
        else:
            self._append_length(k)
            rate = sum(_dot(self.unit[i], self.rate[i], k) for i in range(3))
            stretch = self.length[k] - (rest if k == 0 else 0)
            self.tension.append(stiffness * stretch + damping * rate)
            pull = [_dot(self.tension, self.unit[i], k) if taut else mpf(0) for i in range(3)]
        for i in range(3):
            self.pull[i].append(pull[i])
        body = [sum(_dot(R[j][i], self.pull[j], k) for j in range(3)) for i in range(3)]
        turn = [r[1] * body[2] - r[2] * body[1], r[2] * body[0] - r[0] * body[2], r[0] * body[1] - r[1] * body[0]]
        return pull, turn

    def _append_length(self, k: int) -> None:
        square = sum(_dot(self.d[i], self.d[i], k) for i in range(3))
        if k == 0:
            self.length.append(mpmath.sqrt(square))
            self.inverse.append(1 / self.length[0])
        else:
            inner = mp.fdot(self.length[1:k], self.length[k - 1 : 0 : -1]) if k > 1 else mpf(0)
            self.length.append((square - inner) / (2 * self.length[0]))
            self.inverse.append(-self.inverse[0] * mp.fdot(self.length[1 : k + 1], self.inverse[k - 1 :: -1]))
        for i in range(3):
            self.unit[i].append(_dot(self.d[i], self.inverse, k))
