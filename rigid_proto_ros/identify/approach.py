# SPDX-License-Identifier: MIT
"""From any first values to near the truth: short segments first, which converge from far, then longer ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from . import mass_parameters as mp
from . import measurements as ms
from . import rotations as rot
from . import shooting as sh
from .first_attitude import first_attitude
from .fit_state import FitState, noise_left, segments_of, solved
from .local_motion import high_rate, local_start
from .momentum_balance import balanced_values
from .poses import poses_of
from .unknowns import Values

FIRST_ANGLE = 3.0
"""Turn of the first segments [rad]: within it even the flight of a wrong body stays near enough for
Gauss-Newton steps.
"""
BALANCED_ANGLES = (6.0, 3.0)
"""The same where the balance of momentum has told the body to some hundredths [rad]: the next one where the one before
leaves more than noise.
"""
FITS = 2.0
"""Departures so many times what neighbouring samples say are no noise."""
NEAR = 1e-3
"""Part of what a series shows, or radians, within which a stage that leads on to the next one is near enough."""
MOST_SEGMENTS = 40
"""Of all flights together in the first stage."""
FEWEST_SAMPLES = 6
"""Of a segment in the first stage: a start has 12 numbers."""
ENOUGH_SAMPLES = 300
"""Of a series while the body is only approached, or ENOUGH_IN_A_RADIAN of its turn, where that is more."""
ENOUGH_IN_A_RADIAN = 2.0
LENGTHENING = 4.0
"""Segments become so many times longer from stage to stage, or the root of it where that is too much."""
COARSE = 0.01
"""Part of what a series shows, or radians, below which a scan doesn't look."""
MOST_WORSE = 2
"""Scans go on for so many steps, of a factor 1.8 each, after the best one."""
GROWN = 1.5
"""Departures of longer segments so many times those of shorter ones are no noise."""


def spread(series: ms.Series) -> float:
    """How much a series shows, in its own unit."""
    return 1.0 if series.kind == ms.ATTITUDE else float(np.std(series.values))


def _near_enough(fit: FitState) -> dict[int, float]:
    """Departures of each series that are none to a stage which leads on to the next one."""
    return {id(one): NEAR * spread(one) for flight in fit.flights for one in flight.series}


def approached(fit: FitState, whole: float) -> np.ndarray:
    """Bring ``fit`` near by ever longer segments; returns starts of one segment for each flight."""
    values, sigmas = fit.values, fit.sigmas
    balanced = _balanced(fit)
    least = _near_enough(fit)
    for angle in BALANCED_ANGLES:
        if balanced is None:
            break
        fit.values, fit.sigmas = balanced, sigmas
        length = min(_first_length(fit.flights, angle), whole)
        segments = _thin_segments(fit, length)
        starts = solved(fit, segments, _local_starts(fit, segments), 12, 1e-2)
        fit.sigmas = noise_left(fit, segments, starts)
        if all(fit.sigmas[key] < max(FITS * sigmas[key], least[key]) for key in sigmas):
            return _lengthened(fit, segments, starts, length, whole)
    fit.values, fit.sigmas = values, sigmas
    length = min(_first_length(fit.flights, FIRST_ANGLE), whole)
    segments = _thin_segments(fit, length)
    starts = _local_starts(fit, segments)
    free = [k for k, segment in enumerate(segments) if not len(segment.wrenches.commands)]
    if free and len(free) < len(segments):
        # Shape and centre of mass first, where no load hides them: what a load does then tells mass and size at once.
        starts[free] = solved(fit, [segments[k] for k in free], starts[free], 12, 1e-2, far=True)
    fit.values = _scanned(fit, segments, starts)
    starts = solved(fit, segments, starts, 12, 1e-2, far=True)
    fit.sigmas = noise_left(fit, segments, starts)
    return _lengthened(fit, segments, starts, length, whole)


def _balanced(fit: FitState) -> Values | None:
    """What the balance of momentum says, None where a flight has no attitudes and none can be reckoned."""
    offsets = dict(zip(fit.topics, fit.values.offsets, strict=True))
    damped = any(name == "damping" for name, _ in fit.unknowns.slots)
    poses = []
    for flight in fit.flights:
        one = poses_of(flight, offsets, fit.values)
        if one is None:
            return None
        if one.is_reckoned:
            one = fit.reckoned[id(flight)] = one.begun_at(first_attitude(one, fit.values, damped))
        poses.append(one)
    return balanced_values(poses, fit.unknowns, fit.values)


def _local_starts(fit: FitState, segments: Sequence[sh.ShootingInterval]) -> np.ndarray:
    return np.array([_local_start(fit, segment) for segment in segments])


def _local_start(fit: FitState, segment: sh.ShootingInterval) -> np.ndarray:
    return local_start(segment.flight, segment.begin_ns, fit.reckoned.get(id(segment.flight)))


def _lengthened(
    fit: FitState, segments: list[sh.ShootingInterval], starts: np.ndarray, length: float, whole: float
) -> np.ndarray:
    """Join segments step by step; returns starts of one segment for each flight."""
    factor = LENGTHENING
    least = _near_enough(fit)
    while len(segments) > len(fit.flights):
        values, sigmas = fit.values, fit.sigmas
        starts = _of_one_heading(fit, segments, starts)
        longer = _thin_segments(fit, min(factor * length, whole))
        joined = np.array([_start_of(fit, segment, segments, starts) for segment in longer])
        joined = solved(fit, longer, joined, 12, 1e-2)
        fit.sigmas = noise_left(fit, longer, joined)
        if factor > 2.0 and any(fit.sigmas[key] > GROWN * max(sigmas[key], least[key]) for key in sigmas):
            # Too long at once: the flight has left the way to the truth. Back, and on in smaller steps.
            fit.values, fit.sigmas, factor = values, sigmas, math.sqrt(factor)
            continue
        length, segments, starts = factor * length, longer, joined
    return starts


def _of_one_heading(fit: FitState, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> np.ndarray:
    """Starts (k, 13) of flights without attitudes turned about the vertical, to agree with the one upon which a load
    acts: what such a segment shows doesn't depend on that turn unless a load in world axes acts on it, so that steps
    let it wander.
    """
    starts = starts.copy()
    for flight in fit.flights:
        reckoned = fit.reckoned.get(id(flight))
        own = [k for k, segment in enumerate(segments) if segment.flight is flight]
        loaded = [k for k in own if len(segments[k].wrenches.commands)]
        if reckoned is None or not loaded:
            continue
        seconds = np.array([1e-9 * (segments[k].begin_ns - flight.begin_ns) for k in own])
        corrections = rot.product(starts[own, 3:7], rot.inverse(reckoned.attitude_at(seconds)))
        turns = rot.product(corrections[own.index(loaded[0])], rot.inverse(corrections))
        down = np.linalg.norm(reckoned.gravity)
        if down > 0.0:
            # The tilt is seen in every segment: only the turn about the vertical is corrected.
            axis = reckoned.gravity / down
            turns[:, :3] = (turns[:, :3] @ axis)[:, None] * axis
            sizes = np.linalg.norm(turns, axis=1, keepdims=True)
            turns = np.where(sizes > 0.0, turns / np.maximum(sizes, 1e-300), [0.0, 0.0, 0.0, 1.0])
        starts[own, 3:7] = rot.product(turns, starts[own, 3:7])
        starts[own, 7:10] = rot.turned(turns, starts[own, 7:10])
    return starts


def _first_length(flights: Sequence[ms.MeasuredFlight], angle: float) -> float:
    total = sum(flight.duration_s for flight in flights)
    samples = sum(len(flight.series[0].times_ns) for flight in flights)
    rate = max(high_rate(flight) for flight in flights)
    turning = angle / rate if rate > 0.0 else total
    return max(turning, total / MOST_SEGMENTS, FEWEST_SAMPLES * total / samples)


def _thin_segments(fit: FitState, length_s: float) -> list[sh.ShootingInterval]:
    """With as many samples as an approach needs."""
    every = {}
    for flight in fit.flights:
        enough = max(ENOUGH_SAMPLES, round(ENOUGH_IN_A_RADIAN * high_rate(flight) * flight.duration_s))
        every.update({id(series): max(len(series.times_ns) // enough, 1) for series in flight.series})
    return segments_of(fit, length_s, lambda series: every[id(series)])


def _start_of(
    fit: FitState, segment: sh.ShootingInterval, before: Sequence[sh.ShootingInterval], starts: np.ndarray
) -> np.ndarray:
    """Where that of the earlier segments which this one begins in has come to by then, or a guess."""
    for other, start in zip(reversed(before), reversed(starts), strict=True):
        if other.flight is segment.flight and other.begin_ns <= segment.begin_ns:
            come = sh.flown_state(other, start, fit.values, segment.begin_ns)
            return _local_start(fit, segment) if come is None else come
    return _local_start(fit, segment)


def _sum_of_squares(segments: Sequence[sh.ShootingInterval], starts: np.ndarray, values: Values) -> float:
    total = 0.0
    for segment, start in zip(segments, starts, strict=True):
        found = sh.segment_residuals(segment, start, values)
        if found is None:
            return np.inf
        for piece, residual in zip(segment.pieces, found, strict=True):
            # Few samples that nothing could bring near must not hide what the others say, nor a noise of nothing all of
            # them.
            scaled = residual / max(piece.sigma, COARSE * spread(piece.series))
            total += float(np.sum(np.log1p(scaled * scaled)))
    return total


def _scanned(fit: FitState, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> Values:
    """The values with mass and size of the tensor about right, where a load tells them: Gauss-Newton
    steps don't come from far.
    """
    loaded = [k for k, segment in enumerate(segments) if len(segment.wrenches.commands)]
    free = {index for _, index in fit.unknowns.theta_columns}
    values = fit.values
    if not loaded:
        return values
    chosen, theirs = [segments[k] for k in loaded], starts[loaded]
    for index, of_mass in ((mp.MASS, True), (mp.SIZE, False)):
        if index not in free:
            continue
        best, best_cost, worse = values, np.inf, 0
        # From too heavy to too light, which would be spun up beyond measure: the best one lies before it gets worse.
        for power in range(24, -25, -1):
            factor = 10.0 ** (0.25 * power)
            # The mass changes alone, then the tensor alone.
            theta = mp.scaled(values.theta, factor if of_mass else 1.0, factor**-0.5 if of_mass else factor**0.5)
            if of_mass and mp.SIZE not in free:
                theta = mp.scaled(values.theta, factor, 1.0)
            tried = replace(values, theta=theta)
            cost = _sum_of_squares(chosen, theirs, tried)
            worse = 0 if cost <= 1.001 * best_cost else worse + 1
            if cost < best_cost:
                best, best_cost = tried, cost
            if worse > MOST_WORSE:
                break
        values = best
    return values
