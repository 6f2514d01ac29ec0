# SPDX-License-Identifier: MIT
"""The string: a massless spring with a damper from a knot on the body to a free end that a hand moves.

With l the distance from free end to knot and x = l − rest length, it pulls the knot towards the free end with

    T = max(0, k x + c l') while x > 0, else 0;        bilateral: T = k x + c l' always.

Rest length 0: F = −k a − c a' with a the vector from free end to knot, regular at distance 0. Otherwise there is no
pull within 1e-12 rest lengths of the free end, where it has no direction. k and c come from the effective mass that the
knot shows along the string, 1/m_eff = 1/m + (r × n)ᵀ I⁻¹ (r × n), taken when the string is tied and when the body or
the string changes, then held: c = 2ζ√(k m_eff), and k = m_eff ω² when a frequency is asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..base.compilation import njit
from ..base.rotation import Numbers, cross, dot, times, transposed_times, vector
from .body import Body
from .state import State

RAMP_NS = 100_000_000
"""The free end takes at most this long to a new target: targets come at 10 Hz and more from a hand that
moves evenly.
"""

NO_DIRECTION = 1e-12
"""Rest lengths from the free end within which the string doesn't pull."""

ROUNDINGS = 4.0
"""Of position and arm, that a span of zero may come to when it is computed."""


@njit(cache=True, error_model="numpy", allocates=False)
def most_yielding(mass: float, i1: float, i2: float, i3: float, x: float, y: float, z: float) -> float:
    """A bound of 1/m_eff [1/kg] over all directions for the knot at x, y, z [m] from the COM, in principal axes with
    moments i1 ≤ i2 ≤ i3: 1/m and the largest eigenvalue of [r]×ᵀ I⁻¹ [r]×, by its trace or by |r|²/i1.
    """
    xx, yy, zz = x * x, y * y, z * z
    trace = (yy + zz) / i1 + (zz + xx) / i2 + (xx + yy) / i3
    return 1.0 / mass + min(trace, (xx + yy + zz) / i1)


@dataclass(frozen=True)
class StringSettings:
    """What parameters say of the string.

    attached: tied from the start, at ``attach`` (mesh coordinates) to ``target`` [m, world], without timeout. stiffness
    [N/m]; frequency [rad/s], > 0 wins over stiffness; rest_length [m]; timeout_ns after the last target, 0 never.
    """

    attached: bool = False
    attach: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stiffness: float = 50.0
    frequency: float = 0.0
    damping_ratio: float = 0.1
    rest_length: float = 0.0
    bilateral: bool = False
    timeout_ns: int = 1_000_000_000


@dataclass(frozen=True)
class Tied:
    """A tied string. attach: the knot in mesh coordinates. The free end goes evenly from ``origin`` at begin_ns to
    ``target`` at end_ns [m, world] and stays there. last_target_ns: time of the last target; release_ns: when it lets
    go, or None. effective_mass [kg], stiffness [N/m], damping [N s/m], frequency ω_s = √(k/m_eff) [rad/s] as computed.
    """

    attach: tuple[float, float, float]
    origin: np.ndarray
    target: np.ndarray
    begin_ns: int
    end_ns: int
    last_target_ns: int
    release_ns: int | None
    effective_mass: float
    stiffness: float
    damping: float
    frequency: float
    rest_length: float
    bilateral: bool

    @property
    def row(self) -> np.ndarray:
        """The string as compiled functions read it (STRING,), see motion/problem.py."""
        numbers = (self.stiffness, self.damping, self.rest_length, float(self.bilateral))
        return np.array([*self.attach, *self.origin, *self.target, *numbers])

    def arm(self, body: Body) -> np.ndarray:
        """From the COM to the knot (3,) [m, body axes]."""
        return body.point(self.attach)

    def hand_velocity(self, time_ns: int) -> np.ndarray:
        """Velocity of the free end (3,) [m/s, world] from ``time_ns`` on."""
        if time_ns >= self.end_ns:
            return np.zeros(3)
        return (self.target - self.origin) / ((self.end_ns - self.begin_ns) * 1e-9)

    def free_end(self, time_ns: int) -> np.ndarray:
        """Where the free end is (3,) [m, world]."""
        if time_ns >= self.end_ns:
            return self.target
        return self.origin + ((time_ns - self.begin_ns) * 1e-9) * self.hand_velocity(time_ns)

    def span(self, body: Body, state: State) -> np.ndarray:
        """From the free end to the knot (3,) [m, world]."""
        knot = state.position + times(state.rotation, self.arm(body))
        return knot - self.free_end(state.time_ns)

    def stretch(self, body: Body, state: State) -> float:
        """x = l − rest length [m]; negative when slack."""
        return _length(self.span(body, state)) - self.rest_length

    def potential_energy(self, body: Body, state: State) -> float:
        """½ k x² while it pulls [J]."""
        stretch = self.stretch(body, state)
        if stretch < 0.0 and not self.bilateral:
            return 0.0
        return 0.5 * self.stiffness * stretch * stretch

    def moved(self, target: Numbers, time_ns: int, timeout_ns: int) -> Tied:
        """The hand goes to a new target: over the time since the last one, at most RAMP_NS."""
        ramp_ns = min(time_ns - self.last_target_ns, RAMP_NS)
        return replace(
            self,
            origin=self.free_end(time_ns),
            target=np.asarray(target, dtype=float),
            begin_ns=time_ns,
            end_ns=time_ns + ramp_ns,
            last_target_ns=time_ns,
            release_ns=time_ns + timeout_ns if timeout_ns else None,
        )

    def with_spring(self, settings: StringSettings, body: Body, state: State, mass: float = 0.0) -> Tied:
        """With stiffness and damping taken anew from the settings and ``mass`` [kg], or where that is 0 from the
        effective mass of the body as it is.
        """
        least = NO_DIRECTION * settings.rest_length
        mass = mass or effective_mass(body, self.arm(body), state, self.span(body, state), least)
        stiffness = mass * (settings.frequency * settings.frequency) if settings.frequency > 0.0 else settings.stiffness
        return replace(
            self,
            effective_mass=mass,
            stiffness=stiffness,
            damping=2.0 * settings.damping_ratio * math.sqrt(stiffness * mass),
            frequency=math.sqrt(stiffness / mass),
            rest_length=settings.rest_length,
            bilateral=settings.bilateral,
        )


def tie(
    settings: StringSettings,
    attach: Numbers,
    target: Numbers,
    body: Body,
    state: State,
    timeout_ns: int,
    mass: float = 0.0,
) -> Tied:
    """Tie the string at ``attach`` (mesh coordinates) with its free end at ``target`` [m, world] at once.

    timeout_ns 0 never lets go. mass: as ``with_spring`` takes it.
    """
    now_ns = state.time_ns
    point = np.asarray(target, dtype=float)
    tied = Tied(
        attach=vector(attach),
        origin=point,
        target=point,
        begin_ns=now_ns,
        end_ns=now_ns,
        last_target_ns=now_ns,
        release_ns=now_ns + timeout_ns if timeout_ns else None,
        effective_mass=0.0,
        stiffness=0.0,
        damping=0.0,
        frequency=0.0,
        rest_length=settings.rest_length,
        bilateral=settings.bilateral,
    )
    return tied.with_spring(settings, body, state, mass)


def effective_mass(body: Body, arm: np.ndarray, state: State, span: np.ndarray, least: float) -> float:
    """m_eff [kg] of the point ``arm`` (3,) [m, body] along ``span`` (3,) [world]; over all directions when the span is
    none: shorter than ``least`` [m] or what rounding of the places that it lies between makes of zero.
    """
    length = _length(span)
    if length > max(least, ROUNDINGS * 2.0**-52 * (_length(state.position) + _length(np.asarray(arm)))):
        R = state.rotation
        direction = transposed_times(R, span)
        directions, weight = [direction / length], 1.0
    else:
        directions, weight = list(np.eye(3)), 1.0 / 3.0
    turning = 0.0
    for direction in directions:
        lever = cross(arm, direction)
        turning += weight * dot(lever, body.angular_acceleration(lever))
    return 1.0 / (1.0 / body.mass + turning)


def _length(vector: np.ndarray) -> float:
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        return 0.0
    scaled = vector / largest
    return largest * math.sqrt(dot(scaled, scaled))
