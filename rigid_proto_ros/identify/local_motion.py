# SPDX-License-Identifier: MIT
"""Guesses from a few neighbouring samples, without any body: where a segment starts, and how noisy a series is."""

from __future__ import annotations

import math

import numpy as np

from . import measurements as ms
from . import rotations as rot
from .poses import Poses

NEIGHBOURS = 9
"""Samples for a local parabola: at 100 Hz and .2 degrees of noise its slope errs by some hundredths rad/s."""
NEAR_TURN = 1.5
"""Over which rotation vectors change nearly as the angular velocity does [rad]."""
FEWEST_DIFFERENCES, MOST_DIFFERENCES = 3, 7
"""Of noise all orders have the same spread, but for their factor; of a motion the higher ones leave less."""
MEDIAN = 0.6745
"""Of the size of a normal number, in standard deviations."""
LEAST_NOISE = 1e-10
"""Of the largest value of a series: less can't be told from the rounding of a simulated flight."""


def noise_by_differences(series: ms.Series) -> float:
    """Standard deviation of one component of the noise, from third and higher differences, in which a smooth
    motion hardly shows.

    Rough where the samples aren't evenly spaced, and an upper bound where there is no noise.
    """
    if len(series.values) < 5:
        return 1.0
    if series.kind == ms.ATTITUDE:
        # The differences of attitudes are turns in body axes.
        differences = rot.logarithm(rot.product(rot.inverse(series.values[:-1]), series.values[1:]))
    else:
        differences = np.diff(series.values, axis=0)
    spread = np.inf
    for order in range(2, min(MOST_DIFFERENCES, len(series.values) - 2) + 1):
        differences = np.diff(differences, axis=0)
        if order >= FEWEST_DIFFERENCES:
            own = float(np.median(np.abs(differences))) / MEDIAN / math.sqrt(math.comb(2 * order, order))
            spread = min(spread, own)
    return max(spread, least_noise(series))


def least_noise(series: ms.Series) -> float:
    """What rounding alone may leave."""
    return LEAST_NOISE * max(1.0, float(np.max(np.abs(series.values))))


def _window(series: ms.Series, time_ns: int, most: int = NEIGHBOURS) -> slice:
    """The samples nearest to a time."""
    count = min(most, len(series.times_ns))
    first = int(np.searchsorted(series.times_ns, time_ns)) - count // 2
    first = min(max(first, 0), len(series.times_ns) - count)
    return slice(first, first + count)


def _parabola(series: ms.Series, window: slice, time_ns: int, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope at a time, of values (k, 3)."""
    seconds = 1e-9 * (series.times_ns[window] - time_ns)
    span = max(float(np.ptp(seconds)), 1e-9)
    degree = min(2, len(seconds) - 1)
    fit = np.polynomial.polynomial.polyfit(seconds / span, values, degree)
    return fit[0], fit[1] / span if degree else np.zeros(3)


def local_start(flight: ms.MeasuredFlight, time_ns: int, reckoned: Poses | None = None) -> np.ndarray:
    """The tracked frame's state (13,) at a time: position, attitude xyzw, velocity, angular velocity in body axes.

    reckoned: poses that say the attitude where none was measured.
    """
    start = np.zeros(13)
    start[6] = 1.0
    if reckoned is not None:
        start[3:7] = reckoned.attitude_at(np.array([1e-9 * (time_ns - flight.begin_ns)]))[0]
    position, attitude = flight.first(ms.POSITION), flight.first(ms.ATTITUDE)
    if position is not None:
        window = _window(position, time_ns)
        start[:3], start[7:10] = _parabola(position, window, time_ns, position.values[window])
    if attitude is not None:
        start[3:7], start[10:13] = _local_turn(attitude, time_ns)
    rate = next((s for s in flight.series if s.kind == ms.RATE and (s.in_body or attitude is not None)), None)
    if rate is not None:
        window = _window(rate, time_ns)
        value = _parabola(rate, window, time_ns, rate.values[window])[0]
        start[10:13] = value if rate.in_body else rot.turned_back(start[3:7], value)
    velocity = flight.first(ms.VELOCITY)
    if velocity is not None:
        window = _window(velocity, time_ns)
        value = _parabola(velocity, window, time_ns, velocity.values[window])[0]
        start[7:10] = rot.turned(start[3:7], value) if velocity.in_body else value
    return start


def _local_turn(attitude: ms.Series, time_ns: int) -> tuple[np.ndarray, np.ndarray]:
    """Attitude xyzw and angular velocity [rad/s, body axes] at a time."""
    window = _window(attitude, time_ns)
    q = attitude.values[window]
    if len(q) < 2:
        return q[0], np.zeros(3)
    turns = rot.logarithm(rot.product(rot.inverse(q[:-1]), q[1:]))
    largest = float(np.median(np.linalg.norm(turns, axis=1)))
    if largest * len(turns) > NEAR_TURN:
        # Farther away the body has turned so much that a parabola doesn't follow.
        window = _window(attitude, time_ns, max(3, int(NEAR_TURN / largest) + 1))
        q = attitude.values[window]
    middle = q[len(q) // 2]
    turns = rot.logarithm(rot.product(rot.inverse(middle), q))
    turn, slope = _parabola(attitude, window, time_ns, turns)
    # A vector's rate is the angular velocity but for half its product with it, and so on; of a small turn nothing is
    # left of that.
    return rot.product(middle, rot.exponential(turn)), slope - 0.5 * rot.cross(turn, slope)


def high_rate(flight: ms.MeasuredFlight) -> float:
    """Angular speed that four of five samples don't pass [rad/s]."""
    rate, attitude = flight.first(ms.RATE), flight.first(ms.ATTITUDE)
    if rate is not None:
        return float(np.quantile(np.linalg.norm(rate.values, axis=1), 0.8))
    if attitude is None or len(attitude.values) < 2:
        return 0.0
    turns = rot.logarithm(rot.product(rot.inverse(attitude.values[:-1]), attitude.values[1:]))
    seconds = 1e-9 * np.diff(attitude.times_ns)
    return float(np.quantile(np.linalg.norm(turns, axis=1) / np.maximum(seconds, 1e-9), 0.8))
