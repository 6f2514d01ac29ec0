# SPDX-License-Identifier: MIT
"""A flight's poses: as they were measured or, where no attitude or no position was, by dead reckoning from rates,
velocities and accelerations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.compilation import njit
from ..base.rotation import multiply
from . import measurements as ms
from . import rotations as rot
from .unknowns import Values

FEWEST = 8
"""Poses of a flight, and rates of one whose poses are reckoned."""


@dataclass(frozen=True)
class Poses:
    """What a flight's series say of its poses. seconds (n,) from its begin, positions (n, 3) [m] or None, attitudes
    (n, 4) xyzw.

    is_reckoned: the attitudes are those since the first one, which is not known and stands as no turn at all. gravity
    (3,) [m/s²]: what of it the positions show. velocities: what the positions are reckoned from, where they are.
    """

    flight: ms.MeasuredFlight
    seconds: np.ndarray
    positions: np.ndarray | None
    attitudes: np.ndarray
    gravity: np.ndarray
    is_reckoned: bool = False
    reckon_positions: Callable[[np.ndarray], np.ndarray] | None = None

    def attitude_at(self, seconds: np.ndarray) -> np.ndarray:
        """Attitudes (m, 4) between the samples."""
        after = np.clip(np.searchsorted(self.seconds, seconds), 1, len(self.seconds) - 1)
        first, last = self.attitudes[after - 1], self.attitudes[after]
        begin, end = self.seconds[after - 1], self.seconds[after]
        part = np.clip((seconds - begin) / (end - begin), 0.0, 1.0)
        return rot.product(first, rot.exponential(part[:, None] * rot.logarithm(rot.product(rot.inverse(first), last))))

    def begun_at(self, attitude: np.ndarray) -> Poses:
        """Reckoned poses from this first attitude (4,) on."""
        attitudes = rot.product(attitude, self.attitudes)
        positions = None if self.reckon_positions is None else self.reckon_positions(attitudes)
        return replace(self, attitudes=attitudes, positions=positions)


def poses_of(flight: ms.MeasuredFlight, offsets: dict[str, float], values: Values) -> Poses | None:
    """None where there is neither an attitude nor a rate in body axes. offsets [s]: by topic."""
    attitude = flight.first(ms.ATTITUDE)
    rate = flight.first(ms.RATE, in_body=True)
    source = attitude if attitude is not None else rate
    if source is None or len(source.times_ns) < FEWEST:
        return None
    seconds = 1e-9 * (source.times_ns - flight.begin_ns) + offsets[source.topic]
    attitudes = source.values if attitude is not None else _turned_by(seconds, source.values - _bias(source, values))
    gravity = np.array(flight.gravity, float)
    position = next((s for s in flight.series if s.kind == ms.POSITION and s.topic == source.topic), None)
    if position is not None:
        return Poses(flight, seconds, position.values, attitudes, gravity)
    reckon, shown = _reckoning(flight, offsets, values, seconds)
    positions = reckon(attitudes) if reckon is not None else None
    return Poses(flight, seconds, positions, attitudes, shown * gravity, attitude is None, reckon)


def _bias(rate: ms.Series, values: Values) -> np.ndarray:
    return values.gyro_bias if rate.is_imu else np.zeros(3)


def _reckoning(
    flight: ms.MeasuredFlight, offsets: dict[str, float], values: Values, seconds: np.ndarray
) -> tuple[Callable[[np.ndarray], np.ndarray] | None, float]:
    """How positions (n, 3) follow from attitudes (n, 4), and how much of gravity they show: 1, or 0 of an
    accelerometer's, which doesn't feel it.
    """
    velocity, felt = flight.first(ms.VELOCITY), flight.first(ms.ACCELERATION)
    source = velocity if velocity is not None else felt
    if source is None or len(source.times_ns) < FEWEST:
        return None, 1.0
    own = 1e-9 * (source.times_ns - flight.begin_ns) + offsets[source.topic]
    vectors = np.stack([np.interp(seconds, own, column) for column in source.values.T], axis=1)
    if velocity is not None:
        return lambda q: integral(seconds, rot.turned(q, vectors) if velocity.in_body else vectors), 1.0
    vectors = vectors - values.accel_bias

    def from_specific_force(q: np.ndarray) -> np.ndarray:
        moved = integral(seconds, integral(seconds, rot.turned(q, vectors)))
        return moved - rot.turned(q, values.imu_place)

    return from_specific_force, 0.0


def integral(seconds: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """∫ (n, 3) of vectors (n, 3) from the first time on."""
    return np.vstack([np.zeros(3), np.cumsum(_steps(seconds, vectors), axis=0)])


def _steps(seconds: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The integral from each time to the next (n - 1, 3), by trapezoids and what the slopes at their ends add to them:
    velocities along the axes of a body that spins bend too much for trapezoids alone.
    """
    apart = np.diff(seconds)[:, None]
    slopes = np.gradient(vectors, seconds, axis=0)
    return 0.5 * apart * (vectors[1:] + vectors[:-1]) + apart**2 / 12.0 * (slopes[:-1] - slopes[1:])


def _turned_by(seconds: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Attitudes (n, 4) since the first one, of rates (n, 3) in body axes: their integrals, and what the axis itself
    turns within a step (Bortz, IEEE Trans. Aerospace and Electronic Systems 7, 1971).
    """
    turns = _steps(seconds, rates) + np.diff(seconds)[:, None] ** 2 / 12.0 * rot.cross(rates[:-1], rates[1:])
    attitudes = np.zeros((len(seconds), 4))
    attitudes[0, 3] = 1.0
    _multiply_up(rot.exponential(turns), attitudes)
    return attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)


@njit(cache=True)
def _multiply_up(steps: np.ndarray, attitudes: np.ndarray) -> None:
    for k in range(steps.shape[0]):
        a, b = attitudes[k], steps[k]
        x, y, z, w = multiply(a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3])
        attitudes[k + 1, 0], attitudes[k + 1, 1], attitudes[k + 1, 2], attitudes[k + 1, 3] = x, y, z, w
