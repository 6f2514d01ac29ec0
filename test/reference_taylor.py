# SPDX-License-Identifier: MIT
"""Motion under loads by Taylor series: the equations of motion are polynomial, so their series follow by recurrence.

Source of the method: Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods (2005). The full tensor is used in body axes, so that principal axes found elsewhere are not trusted either. Numbers
are long doubles for up to 18 digits, and those of mpmath for more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpmath import mp, mpf

ZERO = (0.0, 0.0, 0.0)
DIGITS = 18
"""As many as a long double has."""


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
    """The target is where it is said at time 0."""


@dataclass(frozen=True)
class ReferenceProblem:
    """A body and constant loads. moment = Σ r Fᵀ of world forces F at body points r; damping [N s/m] and [N m s]. A flywheel
    has the momentum rotor + t rotor_torque, body axes.
    """

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
    rotor: tuple = ZERO
    rotor_torque: tuple = ZERO


def reference_motion(problem: ReferenceProblem, row, times, digits: int = 40) -> list[list]:
    """Rows (13 mpf) x, q xyzw, v, ω body at the given times [s], ascending, from such a row at time 0; doubles are exact."""
    numbers = _long_doubles if digits <= DIGITS else _high_precision
    with mp.workdps(digits + 5):
        motion = _Motion(problem, digits, numbers)
        state, now, rows = _unit(numbers(row)), numbers(0), []
        taut = motion.starts_taut(state)
        for time in numbers(times):
            while now < time:
                series = motion.series(state, taut, now)
                h, turns = min(series.step, time - now), False
                if motion.may_turn:
                    h, turns = motion.first_turn(series, h, taut)
                state, now, taut = series.at(h), now + h, taut != turns
                if not turns and time - now < 10.0**-digits:
                    break
            rows.append([_as_mpf(x) for x in state])
        return rows


def _high_precision(values):
    """mpf of doubles or mpf, in an array of objects."""
    return np.vectorize(lambda x: x if isinstance(x, mpf) else mpf(float(x)), otypes=[object])(values)[()]


def _long_doubles(values):
    """Long doubles of doubles or mpf."""
    high = np.vectorize(float, otypes=[np.longdouble])(values)
    return (high + np.vectorize(lambda x: float(x - float(x)), otypes=[np.longdouble])(values))[()]


def _as_mpf(x):
    return x if isinstance(x, mpf) else mpf(float(x)) + mpf(float(x - np.longdouble(float(x))))


def _unit(row):
    """A row with its quaternion normalized."""
    row[3:7] /= (row[3:7] ** 2).sum() ** 0.5
    return row


def _product(a, b, k):
    """Coefficient k of the products of series a [i, order] and b [j, order], or of a single one [order] each."""
    return a[..., : k + 1] @ b[..., k::-1].T


def _polynomial(coefficients, t):
    """Values at t of series, index [..., order]."""
    value = coefficients[..., -1]
    for k in range(coefficients.shape[-1] - 2, -1, -1):
        value = value * t + coefficients[..., k]
    return value


def _crossed(p):
    """a × b of the products p[i, j] = aᵢ bⱼ."""
    return np.array([p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]])


def _rotation(p):
    """Body to world, of the products p[i, j] = qᵢ qⱼ of a unit quaternion xyzw."""
    one = p[0, 0] + p[1, 1] + p[2, 2] + p[3, 3]
    return np.array(
        [
            [one - 2 * (p[1, 1] + p[2, 2]), 2 * (p[0, 1] - p[2, 3]), 2 * (p[0, 2] + p[1, 3])],
            [2 * (p[0, 1] + p[2, 3]), one - 2 * (p[0, 0] + p[2, 2]), 2 * (p[1, 2] - p[0, 3])],
            [2 * (p[0, 2] - p[1, 3]), 2 * (p[1, 2] + p[0, 3]), one - 2 * (p[0, 0] + p[1, 1])],
        ]
    )


@dataclass
class _Series:
    """Taylor coefficients about one time: of the row (13, order), and of the string's span and its rate (3, order)."""

    row: np.ndarray
    span: np.ndarray
    rate: np.ndarray
    digits: int

    @property
    def step(self):
        """At which the last two terms fall below 10⁻ᵈ of the leading size of each variable."""
        found, last = [], self.row.shape[1] - 1
        for part in (slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)):
            sizes = np.abs(self.row[part]).max(axis=0)
            for k in (last - 1, last):
                if sizes[k] > 0:
                    leading = max(sizes[0], sizes[1], type(sizes[k])(1e-3))
                    found.append((leading * 10.0**-self.digits / sizes[k]) ** (1.0 / k))
        return min(found, default=1e300)

    def at(self, h):
        """The row at h; the flow keeps the quaternion's norm, and normalizing removes the series' remainder only."""
        return _unit(_polynomial(self.row, h))


class _Motion:
    """A problem's series, in numbers of one kind."""

    def __init__(self, problem: ReferenceProblem, digits: int, numbers) -> None:
        self.problem, self.digits, self.numbers = problem, digits, numbers
        self.order = int(1.2 * digits) + 6
        self.inertia = numbers(problem.inertia)
        a, b, c = self.inertia
        adjugate = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)]).T
        self.inverse = adjugate / (a * adjugate[:, 0]).sum()
        string = problem.string
        self.may_turn = string is not None and not string.bilateral and string.rest_length > 0.0

    def starts_taut(self, state) -> bool:
        if not self.may_turn:
            return True
        series = self.series(state, False, self.numbers(0))
        stretch, tension = self._stretch_and_tension(series, self.numbers(0))
        if stretch == 0 or tension == 0:
            # Only a start exactly on the switch needs a look ahead.
            stretch, tension = self._stretch_and_tension(series, series.step * 1e-6)
        return bool(stretch > 0 and tension > 0)

    def _stretch_and_tension(self, series, t):
        """l − rest length and k(l − rest length) + c l' at t, from the span itself: the series of l has poles of its own."""
        string = self.problem.string
        span, rate = _polynomial(series.span, t), _polynomial(series.rate, t)
        length = (span * span).sum(axis=0) ** 0.5
        stretch, speed = length - string.rest_length, (span * rate).sum(axis=0)
        return stretch, string.stiffness * stretch + string.damping * speed / (length or 1)

    def first_turn(self, series, h, taut: bool):
        """First time in (0, h] at which the string turns taut, which is stretched and pulling, or slack; or h, and whether it does.

        The grid is far finer than an oscillation, of which a step spans few.
        """
        string, points = self.problem.string, 200
        # Doubles find the interval, full precision the time in it.
        grid = np.linspace(0.0, 1.0, points + 1)[1:]
        powers = float(h) ** np.arange(self.order + 1)
        span, rate = (
            np.polynomial.polynomial.polyval(grid, (part.astype(float) * powers).T)
            for part in (series.span, series.rate)
        )
        length = np.sqrt((span * span).sum(axis=0))
        stretch = length - string.rest_length
        tension = string.stiffness * stretch + string.damping * (span * rate).sum(axis=0) / np.maximum(length, 1e-300)
        turned = np.flatnonzero(((stretch > 0.0) & (tension > 0.0)) != taut)
        if turned.size == 0:
            return h, False
        low, high = (h * (int(turned[0]) + k) / points for k in range(2))
        for _ in range(int(3.4 * self.digits) + 30):
            middle = (low + high) / 2
            stretch, tension = self._stretch_and_tension(series, middle)
            low, high = (low, middle) if (stretch > 0 and tension > 0) != taut else (middle, high)
        return high, True

    def series(self, state, taut: bool, now) -> _Series:
        p, numbers, order = self.problem, self.numbers, self.order
        row = np.zeros((13, order + 1), dtype=object if numbers is _high_precision else np.longdouble)
        row[:, 0] = state
        x, q, v, w = row[0:3], row[3:7], row[7:10], row[10:13]
        L, R = np.zeros_like(x), np.zeros((3, *x.shape), dtype=row.dtype)
        moment, force_body, torque_world = map(numbers, (p.moment, p.force_body, p.torque_world))
        added_force, torque_body = numbers(p.force_world), numbers(p.torque_body)
        mass, gravity = numbers(p.mass), numbers(p.gravity)
        linear, angular = numbers(p.linear_damping), numbers(p.angular_damping)
        rotor, rotor_torque = numbers(p.rotor), numbers(p.rotor_torque)
        string = _StringSeries(p.string, row, R, now, numbers) if p.string else None
        for k in range(order):
            L[:, k] = self.inertia @ w[:, k]
            if k < 2:
                L[:, k] = L[:, k] + (rotor + now * rotor_torque if k == 0 else rotor_torque)
            R[:, :, k] = turn = _rotation(_product(q, q, k))
            force = turn @ force_body
            torque = turn.T @ torque_world + _crossed(moment @ turn)
            if k == 0:
                force, torque = force + added_force + mass * gravity, torque + torque_body - rotor_torque
            if string is not None:
                pull, twist = string.append(k, taut)
                force, torque = force + pull, torque + twist
            if p.gyroscopic:
                torque = torque - _crossed(_product(w, L, k))
            torque = torque - angular * w[:, k]
            v[:, k + 1] = (force - linear * v[:, k]) / mass / (k + 1)
            x[:, k + 1] = v[:, k] / (k + 1)
            turned = _product(q, w, k)
            q[:3, k + 1] = (turned[3] + _crossed(turned)) / (2 * (k + 1))
            q[3, k + 1] = -(turned[0, 0] + turned[1, 1] + turned[2, 2]) / (2 * (k + 1))
            w[:, k + 1] = self.inverse @ torque / (k + 1)
        return _Series(row, string and string.span, string and string.rate, self.digits)


class _StringSeries:
    """Series of the string's span from point to target, its length and tension, and what it does to the body."""

    def __init__(self, string: ReferenceString, row, R, now, numbers) -> None:
        self.string, self.R = string, R
        self.x, self.v, self.w = row[0:3], row[7:10], row[10:13]
        self.point, self.velocity = numbers(string.point), numbers(string.target_velocity)
        self.target = numbers(string.target) + now * self.velocity
        x, y, z = self.point
        self.lever = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        self.stiffness, self.damping, self.rest = map(numbers, (string.stiffness, string.damping, string.rest_length))
        self.span, self.rate, self.unit, self.pull, self.speed = (np.zeros_like(self.x) for _ in range(5))
        self.length, self.inverse, self.tension = (np.zeros_like(self.x[0]) for _ in range(3))

    def append(self, k: int, taut: bool):
        """Order k of the force on the body (world) and of the torque about the COM (body axes)."""
        R = self.R
        self.speed[:, k] = -self.lever @ self.w[:, k]
        self.span[:, k] = -self.x[:, k] - R[:, :, k] @ self.point
        self.rate[:, k] = -self.v[:, k] - (R[:, :, : k + 1] * self.speed[:, k::-1]).sum(axis=(1, 2))
        if k == 0:
            self.span[:, 0] += self.target
            self.rate[:, 0] += self.velocity
        if k == 1:
            self.span[:, 1] += self.velocity
        if self.string.rest_length == 0.0:
            # Regular at zero length, and always taut: the force is linear in the span and its rate.
            self.pull[:, k] = self.stiffness * self.span[:, k] + self.damping * self.rate[:, k]
        elif taut:
            self._append_length(k)
            stretch = self.length[k] - self.rest if k == 0 else self.length[k]
            self.tension[k] = self.stiffness * stretch + self.damping * np.trace(_product(self.unit, self.rate, k))
            self.pull[:, k] = _product(self.unit, self.tension, k)
        body = (R[:, :, : k + 1] * self.pull[:, None, k::-1]).sum(axis=(0, 2))
        return self.pull[:, k], self.lever @ body

    def _append_length(self, k: int) -> None:
        length, inverse, square = self.length, self.inverse, np.trace(_product(self.span, self.span, k))
        if k == 0:
            length[0], inverse[0] = square**0.5, 1 / square**0.5
        else:
            # Coefficient k itself is 0 yet in both products.
            length[k] = (square - _product(length, length, k)) / (2 * length[0])
            inverse[k] = -inverse[0] * _product(length, inverse, k)
        self.unit[:, k] = _product(self.span, inverse, k)
