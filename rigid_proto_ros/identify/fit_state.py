# SPDX-License-Identifier: MIT
"""What an estimate has come to, and its steps: flights cut into segments, values improved upon them, the noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.errors import InputError
from . import mass_parameters as mp
from . import measurements as ms
from . import possible_bodies as pb
from . import shooting as sh
from .local_motion import least_noise
from .poses import Poses
from .unknowns import Unknowns, Values
from .variable_projection import FAILED, SMALL_STEP, Problem, best_unknowns

OFFSET_MARGIN_S = 0.05
"""The largest difference of two clocks that is looked for."""
ROUGH = 1e-3
"""Tolerance of a stage that only leads on to the next one."""
MOST_RIM_STEPS = 6
THINNEST = 1e-9
"""Least second moment of an estimate, of the largest: of none at all there may be a rod, whose least moment is 0."""


@dataclass
class FitState:
    """What stages of an estimate hand on. reckoned: poses by ``id`` of the flights that have no attitudes."""

    flights: Sequence[ms.MeasuredFlight]
    topics: Sequence[str]
    unknowns: Unknowns
    values: Values
    sigmas: dict[int, float]
    weights: dict[int, np.ndarray]
    reckoned: dict[int, Poses] = field(default_factory=dict)
    evaluations: int = 0


def segments_of(
    fit: FitState, length_s: float, every: Callable[[ms.Series], int] = lambda _: 1
) -> list[sh.ShootingInterval]:
    """The flights cut into segments of about this length. every: of a series one sample in so many."""
    offset = any(name == "offsets" for name, _ in fit.unknowns.slots)
    margin = OFFSET_MARGIN_S if offset else max(0.0, -min(fit.values.offsets, default=0.0))
    return sh.cut(
        fit.flights,
        length_s,
        fit.topics,
        lambda series: fit.sigmas[id(series)],
        lambda series: fit.weights[id(series)],
        margin,
        every,
    )


def solved(
    fit: FitState,
    segments: Sequence[sh.ShootingInterval],
    starts: np.ndarray,
    most: int,
    tolerance: float,
    far: bool = False,
) -> np.ndarray:
    """Improve ``fit.values``; returns the starts that go with them.

    far: step in log-Cholesky coordinates, in which no step from far away is impossible, else in the tensor itself.
    """
    unknowns = fit.unknowns if far else fit.unknowns.physical
    problem = Problem(segments, starts, fit.values, unknowns)
    if np.max(np.abs(problem.residuals(problem.first))) >= FAILED:
        raise InputError("identify", "the first guess of the motion can't be simulated; see --from and --to")
    numbers = best_unknowns(problem, most, tolerance)
    fit.evaluations += problem.evaluations
    fit.values, starts = _possible(problem.values(numbers)), problem.starts(numbers)
    if tolerance > ROUGH or pb.is_possible(problem.values(numbers).body.inertia):
        return starts
    return _along_the_rim(fit, segments, starts)


def _possible(values: Values) -> Values:
    """The same in log-Cholesky coordinates, where the tensor is outside of what can exist the nearest on its rim."""
    body = values.body
    theta = mp.parameters_of(body.mass, body.center_of_mass, mp.possible_tensor(body.inertia, THINNEST))
    return replace(values, theta=theta, tensor_change=np.zeros(6))


def _along_the_rim(fit: FitState, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> np.ndarray:
    """Improve ``fit.values`` among the bodies that can exist, where the best of all tensors is none of these."""
    unknowns = fit.unknowns.physical
    first = unknowns.slots.index(("tensor_change", 0))
    for _ in range(MOST_RIM_STEPS):
        problem = Problem(segments, starts, fit.values, unknowns)
        jacobian = problem.jacobian(problem.first)
        step = pb.possible_step(jacobian, problem.residuals(problem.first), slice(first, first + 6), fit.values.body)
        fit.evaluations += 1
        fit.values, starts = _possible(problem.values(problem.first + step)), problem.starts(problem.first + step)
        if np.linalg.norm(jacobian @ step) < SMALL_STEP:
            break
    return starts


def residuals_of(segment: sh.ShootingInterval, start: np.ndarray, values: Values) -> list[np.ndarray]:
    """Of a segment that can be flown."""
    found = sh.segment_residuals(segment, start, values)
    if found is None:
        raise InputError("identify", "the estimate can't be simulated; see --from and --to")
    return found


def noise_left(fit: FitState, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> dict[int, float]:
    """Standard deviation of each series from its residuals; series of one topic and quantity share it
    over all flights.
    """
    sums: dict[str, float] = {}
    counts: dict[str, float] = {}
    for segment, start in zip(segments, starts, strict=True):
        for piece, residual in zip(segment.pieces, residuals_of(segment, start, fit.values), strict=True):
            name, weights = piece.series.name, piece.weights
            sums[name] = sums.get(name, 0.0) + float((weights[:, None] * residual**2).sum())
            counts[name] = counts.get(name, 0.0) + 3.0 * float(weights.sum())
    samples = 3 * sum(segment.samples for segment in segments)
    left = max(1.0 - (sh.START * len(segments) + len(fit.unknowns)) / samples, 0.1)
    return {
        id(one): max(math.sqrt(sums[one.name] / (left * counts[one.name])), least_noise(one))
        for flight in fit.flights
        for one in flight.series
    }
