# SPDX-License-Identifier: MIT
"""Guesses from a few neighbouring samples, without any body: where a segment starts, and how noisy a series is."""

from __future__ import annotations

import math

import numpy as np

from . import measurements as ms
from . import rotations as rot

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


def turns_of(attitudes: np.ndarray) -> np.ndarray:
    """Rotation vectors (n - 1, 3) from each attitude (n, 4) to the next one, in body axes [rad]."""
    return rot.logarithm(rot.product(rot.inverse(attitudes[:-1]), attitudes[1:]))


def noise_by_differences(series: ms.Series) -> float:
    """Standard deviation of one component of the noise, from third and higher differences, in which a smooth
    motion hardly shows.

    Rough where the samples aren't evenly spaced, and an upper bound where there is no noise.
    """
    if len(series.values) < 5:
        return 1.0
    differences = turns_of(series.values) if series.kind == ms.ATTITUDE else np.diff(series.values, axis=0)
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


def spread(series: ms.Series) -> float:
    """How much a series shows, in its own unit."""
    return 1.0 if series.kind == ms.ATTITUDE else float(np.std(series.values))


def local_start(flight: ms.MeasuredFlight, time_ns: int) -> np.ndarray:
    """The tracked frame's state (13,) at a time: position, attitude xyzw, velocity, angular velocity in body axes."""
    assert flight.pose is not None
    position, attitude = flight.pose
    start = np.zeros(13)
    start[:3], start[7:10] = _parabola(position.times_ns, position.values, time_ns, NEIGHBOURS)
    turn = float(np.median(np.linalg.norm(turns_of(attitude.values), axis=1)))
    # Farther away the body has turned so much that a parabola doesn't follow.
    count = min(NEIGHBOURS, max(3, int(NEAR_TURN / max(turn, 1e-9)) + 1))
    near = int(np.clip(np.searchsorted(attitude.times_ns, time_ns), 0, len(attitude.values) - 1))
    middle = attitude.values[near]
    around = slice(max(near - count, 0), near + count + 1)
    turns = rot.logarithm(rot.product(rot.inverse(middle), attitude.values[around]))
    turn_now, slope = _parabola(attitude.times_ns[around], turns, time_ns, count)
    # A vector's rate is the angular velocity but for half its product with it, and so on; of a small turn nothing is
    # left of that.
    start[3:7] = rot.product(middle, rot.exponential(turn_now))
    start[10:13] = slope - 0.5 * rot.cross(turn_now, slope)
    return start


def _parabola(times_ns: np.ndarray, values: np.ndarray, time_ns: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Value (3,) and slope (3,) [1/s] at a time, of the ``count`` samples (n, 3) nearest to it."""
    count = min(count, len(times_ns))
    first = int(np.clip(np.searchsorted(times_ns, time_ns) - count // 2, 0, len(times_ns) - count))
    seconds = 1e-9 * (times_ns[first : first + count] - time_ns)
    span = max(float(np.ptp(seconds)), 1e-9)
    fit = np.polynomial.polynomial.polyfit(seconds / span, values[first : first + count], min(2, count - 1))
    return fit[0], fit[1] / span


def high_rate(flight: ms.MeasuredFlight) -> float:
    """Angular speed that four of five samples don't pass [rad/s]."""
    assert flight.pose is not None
    _, attitude = flight.pose
    seconds = 1e-9 * np.diff(attitude.times_ns)
    return float(np.quantile(np.linalg.norm(turns_of(attitude.values), axis=1) / np.maximum(seconds, 1e-9), 0.8))
