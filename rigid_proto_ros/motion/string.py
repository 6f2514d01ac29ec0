# SPDX-License-Identifier: MIT
"""The string: a massless spring with a damper between a knot on the body and a free end that a hand moves.

With the distance l from free end to knot and x = l − rest length, its tension pulls the knot towards the free end with

    T = max(0, k x + c l') while x > 0, else 0;        bilateral: T = k x + c l' always.

Rest length 0: F = −k a − c a' with a the vector from free end to knot, regular at distance 0. Otherwise the force is
zero within 1e-12 rest lengths of the free end, where its direction is undefined. k and c follow from the effective mass
of the knot along the string, 1/m_eff = 1/m + (r × n)ᵀ I⁻¹ (r × n), computed when the string is tied and when the body
or the string changes, and constant in between: c = 2ζ√(k m_eff), and k = m_eff ω² if a frequency is given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit
from ..base.rotation import matrix_elements, norm
from ..base.vectors import FloatArray, StateRow, Vector, Vector3, vector
from .body import MASS, Body, BodyRow, angular_acceleration
from .state import State

# Where the numbers of a tied string stand in its row.
KNOT = 0  # (3,) [mesh coordinates]
ORIGIN = 3  # (3,) of the free end's way [m, world]
TARGET = 6  # (3,) [m, world]
K, C, REST, PUSHES = 9, 10, 11, 12
STRING = 13

RAMP_NS = 100_000_000
"""Longest time [ns] in which the free end moves to a new target: a hand in steady motion sends targets at 10 Hz or
more.
"""

NO_DIRECTION = 1e-12
"""Distance from the free end, in rest lengths, within which the string exerts no force."""

ROUNDINGS = 4.0
"""Largest computed length of a span of zero, in units of ε (|position| + |arm|)."""


@njit(error_model="numpy", allocates=False)
def most_yielding(mass: float, i1: float, i2: float, i3: float, x: float, y: float, z: float) -> float:
    """Upper bound of 1/m_eff [1/kg] over all directions for a knot at x, y, z [m] from the COM, in principal axes with
    moments i1 ≤ i2 ≤ i3: 1/m and the largest eigenvalue of [r]×ᵀ I⁻¹ [r]×, bounded by its trace or by |r|²/i1.
    """
    xx, yy, zz = x * x, y * y, z * z
    trace = (yy + zz) / i1 + (zz + xx) / i2 + (xx + yy) / i3
    return 1.0 / mass + min(trace, (xx + yy + zz) / i1)


@njit(error_model="numpy", allocates=False)
def length_of(x: float, y: float, z: float) -> float:
    """|v| without overflow or underflow of squares."""
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        return 0.0
    return largest * norm(x / largest, y / largest, z / largest)


@njit(error_model="numpy", allocates=False)
def free_end_at(
    now_ns: int, origin: FloatArray, target: FloatArray, begin_ns: int, end_ns: int
) -> tuple[Vector, Vector]:
    """The free end's position [m, world] and, from then on, its velocity [m/s, world], for uniform motion from origin
    (≥ 3,) at begin_ns to target (≥ 3,) at end_ns, where it stays.
    """
    if now_ns >= end_ns:
        return (target[0], target[1], target[2]), (0.0, 0.0, 0.0)
    elapsed, seconds = (now_ns - begin_ns) * 1e-9, (end_ns - begin_ns) * 1e-9
    x, y, z = (target[0] - origin[0]) / seconds, (target[1] - origin[1]) / seconds, (target[2] - origin[2]) / seconds
    return (origin[0] + elapsed * x, origin[1] + elapsed * y, origin[2] + elapsed * z), (x, y, z)


@njit(error_model="numpy", allocates=False)
def span_of(rx: float, ry: float, rz: float, row: StateRow, ex: float, ey: float, ez: float) -> Vector:
    """Vector from the free end at e [m, world] to the knot at r [m from the COM, body axes] for a state row (13,):
    three numbers [m, world].
    """
    a, b, c, d, e, f, g, h, i = matrix_elements(row[3], row[4], row[5], row[6])
    return (
        (row[0] + (a * rx + b * ry + c * rz)) - ex,
        (row[1] + (d * rx + e * ry + f * rz)) - ey,
        (row[2] + (g * rx + h * ry + i * rz)) - ez,
    )


@njit(error_model="numpy", allocates=False)
def _turning(body: BodyRow, rx: float, ry: float, rz: float, x: float, y: float, z: float) -> float:
    """(r × n)ᵀ I⁻¹ (r × n) for a unit vector n, body axes."""
    lx, ly, lz = ry * z - rz * y, rz * x - rx * z, rx * y - ry * x
    ax, ay, az = angular_acceleration(body, lx, ly, lz)
    return lx * ax + ly * ay + lz * az


@njit(error_model="numpy", allocates=False)
def least_span(rx: float, ry: float, rz: float, row: StateRow, rest_length: float) -> float:
    """Length [m] up to which a span from the point r [m, body axes] has no direction: NO_DIRECTION rest lengths, or the
    rounding error of the positions that it connects.
    """
    size = length_of(row[0], row[1], row[2]) + length_of(rx, ry, rz)
    return max(NO_DIRECTION * rest_length, ROUNDINGS * 2.0**-52 * size)


@njit(error_model="numpy", allocates=False)
def effective_mass(
    body: BodyRow, rx: float, ry: float, rz: float, row: StateRow, span: Vector, rest_length: float
) -> float:
    """m_eff [kg] of the point r [m, body axes] of a body (BODY,) along ``span`` [world]. The mean of 1/m_eff over all
    directions is used if the span has no direction (``least_span``).
    """
    x, y, z = span
    length = length_of(x, y, z)
    if length > least_span(rx, ry, rz, row, rest_length):
        a, b, c, d, e, f, g, h, i = matrix_elements(row[3], row[4], row[5], row[6])
        nx, ny, nz = a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z
        turning = _turning(body, rx, ry, rz, nx / length, ny / length, nz / length)
    else:
        third = 1.0 / 3.0
        turning = third * _turning(body, rx, ry, rz, 1.0, 0.0, 0.0)
        turning += third * _turning(body, rx, ry, rz, 0.0, 1.0, 0.0)
        turning += third * _turning(body, rx, ry, rz, 0.0, 0.0, 1.0)
    return float(1.0 / (1.0 / body[MASS] + turning))


@njit(error_model="numpy", allocates=False)
def spring_of(mass: float, stiffness: float, frequency: float, damping_ratio: float) -> tuple[float, float]:
    """k [N/m] and c [N s/m] for this effective mass; a frequency [rad/s] > 0 overrides the stiffness."""
    k = mass * (frequency * frequency) if frequency > 0.0 else stiffness
    return k, 2.0 * damping_ratio * math.sqrt(k * mass)


@njit(error_model="numpy", allocates=False)
def energy_of(span: Vector, stiffness: float, rest_length: float, bilateral: bool) -> float:
    """½ k x² [J]; 0 while a pull-only string is slack."""
    stretch = length_of(*span) - rest_length
    if stretch < 0.0 and not bilateral:
        return 0.0
    return 0.5 * stiffness * stretch * stretch


@dataclass(frozen=True)
class StringState:
    """A tied string. attach: the knot in mesh coordinates. The free end moves at constant velocity from ``origin`` at
    begin_ns to ``target`` at end_ns [m, world] and stays there. last_target_ns: time of the last target; release_ns:
    time of release, or None. effective_mass [kg], stiffness [N/m], damping [N s/m].
    """

    attach: Vector
    origin: Vector3
    target: Vector3
    begin_ns: int
    end_ns: int
    last_target_ns: int
    release_ns: int | None
    effective_mass: float
    stiffness: float
    damping: float
    rest_length: float
    bilateral: bool

    @property
    def frequency(self) -> float:
        """ω_s = √(k/m_eff) [rad/s]."""
        return math.sqrt(self.stiffness / self.effective_mass)

    def arm(self, body: Body) -> Vector3:
        """Vector from the COM to the knot (3,) [m, body axes]."""
        return body.point(self.attach)

    def free_end(self, time_ns: int) -> Vector3:
        """Position of the free end (3,) [m, world]."""
        origin, target = self.origin.tolist(), self.target.tolist()
        return np.array(free_end_at(time_ns, origin, target, self.begin_ns, self.end_ns)[0])

    def potential_energy(self, body: Body, state: State) -> float:
        """½ k x² [J]; 0 while a pull-only string is slack."""
        x, y, z = self.arm(body).tolist()
        ex, ey, ez = self.free_end(state.time_ns).tolist()
        span = span_of(x, y, z, state.row, ex, ey, ez)
        return energy_of(span, self.stiffness, self.rest_length, self.bilateral)


def string_of(flight: np.record, never_ns: int) -> StringState:
    """The tied string of a flight (simulation/flight.py), in which it isn't released at never_ns."""
    numbers, release_ns = flight.string.tolist(), int(flight.string_release_ns)
    return StringState(
        vector(numbers[KNOT : KNOT + 3]),
        np.array(numbers[ORIGIN : ORIGIN + 3]),
        np.array(numbers[TARGET : TARGET + 3]),
        int(flight.string_begin_ns),
        int(flight.string_end_ns),
        int(flight.string_last_ns),
        None if release_ns == never_ns else release_ns,
        float(flight.string_mass),
        numbers[K],
        numbers[C],
        numbers[REST],
        numbers[PUSHES] != 0.0,
    )
