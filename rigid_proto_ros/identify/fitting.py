# SPDX-License-Identifier: MIT
"""The fit: the initial estimate is improved on short segments, which converge from far, then on ever longer ones, until
each flight is one segment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import InputError
from . import shooting as sh
from .initial_estimate import initial_values
from .least_squares import SMALL_STEP, Problem, best_unknowns
from .local_motion import high_rate, least_noise, local_start, noise_by_differences, spread
from .measurements import MeasuredFlight
from .psd_projection import is_possible, possible_step
from .unknowns import Unknowns, Values, possible_tensor

LEAST_NOISE = 1e-4
"""Part of what a series shows that is taken for noise at first: a simulated flight leaves nothing at the end."""
WIDER = 8.0
"""Of steps of difference quotients: of what is rounding alone so much less is left."""
MOST_RIM_STEPS = 6
ROUGH = 1e-3
"""Tolerance of a stage that only leads on to the next one."""
OFFSET_MARGIN_S = 0.05
"""The largest difference of two clocks that is looked for."""
FIRST_ANGLES = (6.0, 3.0)
"""Turn of the first segments [rad], of which the initial estimate's errors of some hundredths aren't much: the next one
where the one before leaves more than noise.
"""
FITS = 2.0
"""Residuals so many times what neighbouring samples say are no noise."""
NEAR = 1e-3
"""Part of what a series shows, or radians, within which a stage that leads on to the next one is near enough."""
MOST_SEGMENTS = 40
"""Of all flights together in the first stage."""
FEWEST_SAMPLES = 6
"""Of a segment in the first stage: a start has 12 numbers."""
ENOUGH_SAMPLES, ENOUGH_IN_A_RADIAN = 300, 2.0
"""Of a series until the last stage, or so many in a radian of its turn, where that is more."""
LENGTHENING = (4.0, 2.0)
"""Segments become so many times longer from stage to stage: the second where the first leaves more than noise."""
GROWN = 1.5
"""Residuals of longer segments so many times those of shorter ones are no noise."""


class CannotFlyError(InputError):
    """An estimate with which a flight can't be simulated."""

    def __init__(self, cause: str = "--from and --to exclude parts that are no free motion") -> None:
        super().__init__("identify", f"the estimate can't be simulated; {cause}")


@dataclass(frozen=True)
class Estimate:
    """values: what came out. segments and starts: one for each flight. sigmas: of each series by its name.

    root (m, n): rootᵀ root is the Fisher information of the unknowns, the starts eliminated; root_wide by steps WIDER
    times as long, which shows what of it is rounding. cost: sum of squares in standard deviations.
    """

    values: Values
    unknowns: Unknowns
    segments: list[sh.Segment]
    starts: list[np.ndarray]
    sigmas: dict[str, float]
    root: np.ndarray
    root_wide: np.ndarray
    cost: float

    def rise(self, change: np.ndarray) -> float:
        """By how much the squares rise with the unknowns changed (n,), whatever the starts are then; without end for a
        body that can't exist.
        """
        problem = Problem(self.segments, self.unknowns.moved(self.values, change), self.unknowns)
        if not is_possible(problem.given.inertia):
            return np.inf
        none = np.zeros(len(change))
        there = problem.linear(none, problem.settled(none, self.starts))
        return np.inf if there is None else there.cost - self.cost


def fit_flights(
    flights: Sequence[MeasuredFlight],
    unknowns: Unknowns,
    values: Values,
) -> Estimate:
    """The most likely values, from these on; raises InputError where they can't be flown."""
    fit = _Fit(flights, unknowns, values)
    starts = _approached(fit)
    fit.sigmas = fit.noise_left(fit.cut(math.inf), starts)
    for _ in range(4):
        segments, before = fit.cut(math.inf), fit.sigmas
        starts = fit.improve(segments, starts, 60, 1e-7)
        fit.sigmas = fit.noise_left(segments, starts)
        if all(abs(fit.sigmas[key] - before[key]) < 0.01 * before[key] for key in before):
            break
    return _estimate(fit, fit.cut(math.inf), starts)


class _Fit:
    """Values as far as they have come, and the noise by series' name."""

    def __init__(self, flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> None:
        self.flights, self.unknowns, self.values = flights, unknowns, values
        self.series = [one for flight in flights for one in flight.series]
        self.sigmas = {one.name: max(noise_by_differences(one), LEAST_NOISE * spread(one)) for one in self.series}
        self.near = {one.name: NEAR * spread(one) for one in self.series}
        every = {}
        for flight in flights:
            enough = max(ENOUGH_SAMPLES, round(ENOUGH_IN_A_RADIAN * high_rate(flight) * flight.duration_s))
            every.update({id(series): max(len(series.times_ns) // enough, 1) for series in flight.series})
        self._every = every

    def cut(self, length_s: float, is_thin: bool = False) -> list[sh.Segment]:
        """Segments of about this length. is_thin: with as many samples as stages before the last one need."""
        is_open = "offset" in self.unknowns
        margin = OFFSET_MARGIN_S if is_open else max(0.0, -min(self.values.offsets.values(), default=0.0))
        return sh.cut(
            self.flights,
            length_s,
            self.sigmas,
            margin,
            lambda series: self._every[id(series)] if is_thin else 1,
        )

    def improve(
        self, segments: Sequence[sh.Segment], starts: Sequence[np.ndarray], most: int, tolerance: float
    ) -> list[np.ndarray]:
        """Improve the values; returns the starts that go with them."""
        problem = Problem(segments, self.values, self.unknowns)
        found = best_unknowns(problem, starts, most, tolerance)
        if found is None:
            raise CannotFlyError
        numbers, starts = found
        self.values = problem.values(numbers)
        is_inside = is_possible(self.values.inertia)
        self.values = replace(self.values, inertia=possible_tensor(self.values.inertia))
        return starts if is_inside or tolerance > ROUGH else self._along_the_rim(segments, starts)

    def _along_the_rim(self, segments: Sequence[sh.Segment], starts: list[np.ndarray]) -> list[np.ndarray]:
        """Improve the values among the bodies that can exist, where the best of all tensors is none of these."""
        first = self.unknowns.slots.index(("inertia", 0))
        for _ in range(MOST_RIM_STEPS):
            problem = Problem(segments, self.values, self.unknowns)
            here = problem.linear(np.zeros(len(self.unknowns)), starts)
            if here is None:
                raise CannotFlyError
            step = possible_step(here.jacobian, here.residuals, slice(first, first + 6), self.values.inertia)
            values, starts = problem.values(step), here.starts_for(step)
            self.values = replace(values, inertia=possible_tensor(values.inertia))
            if np.linalg.norm(here.jacobian @ step) < SMALL_STEP:
                break
        return starts

    def noise_left(self, segments: Sequence[sh.Segment], starts: Sequence[np.ndarray]) -> dict[str, float]:
        """Standard deviation of each series from its residuals; those of one topic and quantity share it over all
        flights.
        """
        sums = {one.name: 0.0 for one in self.series}
        counts = dict(sums)
        for segment, start in zip(segments, starts, strict=True):
            for piece, residual in zip(segment.pieces, residuals_of(segment, start, self.values), strict=True):
                sums[piece.series.name] += float((residual**2).sum())
                counts[piece.series.name] += residual.size
        samples = 3 * sum(segment.samples for segment in segments)
        left = max(1.0 - (sh.START * len(segments) + len(self.unknowns)) / samples, 0.1)
        found = {}
        for one in self.series:
            found[one.name] = max(math.sqrt(sums[one.name] / (left * counts[one.name])), least_noise(one))
        return found


def residuals_of(segment: sh.Segment, start: np.ndarray, values: Values) -> list[np.ndarray]:
    """Measured minus shown of each piece (m, 3), in its own unit; raises InputError where it can't be flown."""
    found = sh.segment_residuals(segment, start, values)
    if found is None:
        raise CannotFlyError
    return found


def residuals_by_series(
    segments: Sequence[sh.Segment], starts: Sequence[np.ndarray], values: Values
) -> dict[int, np.ndarray]:
    """Residuals (n, 3) of each series in its own unit, by ``id``, of segments that are whole flights."""
    return {
        id(piece.series): residual
        for segment, start in zip(segments, starts, strict=True)
        for piece, residual in zip(segment.pieces, residuals_of(segment, start, values), strict=True)
    }


def short_misfit(flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> float:
    """How much larger the residuals of short segments are than any noise, at most 1 where they fit; infinite where they
    can't be flown.
    """
    try:
        return _short(_Fit(flights, unknowns, values), FIRST_ANGLES[-1:])[3]
    except CannotFlyError:
        return np.inf


def _short(
    fit: _Fit, angles: Sequence[float] = FIRST_ANGLES
) -> tuple[float, list[sh.Segment], list[np.ndarray], float]:
    """Bring ``fit`` near the truth by short segments: their length [s], they, their starts, and their misfit."""
    sigmas = fit.sigmas
    initial = initial_values(fit.flights, fit.unknowns, fit.values)
    for angle in angles:
        fit.values, fit.sigmas = initial, sigmas
        length = _first_length(fit.flights, angle)
        segments = fit.cut(length, is_thin=True)
        starts = fit.improve(segments, _starts(segments), 12, 1e-2)
        fit.sigmas = fit.noise_left(segments, starts)
        misfit = max(fit.sigmas[key] / max(FITS * sigmas[key], fit.near[key]) for key in sigmas)
        if misfit <= 1.0:
            break
    return length, segments, starts, misfit


def _approached(fit: _Fit) -> list[np.ndarray]:
    """Bring ``fit`` near the truth by ever longer segments; returns starts of whole flights."""
    length, segments, starts, _ = _short(fit)
    while len(segments) > len(fit.flights):
        values, sigmas = fit.values, fit.sigmas
        for factor in LENGTHENING:
            fit.values, fit.sigmas = values, sigmas
            longer = fit.cut(factor * length, is_thin=True)
            joined = fit.improve(longer, _starts(longer, segments, starts), 12, 1e-2)
            fit.sigmas = fit.noise_left(longer, joined)
            if all(fit.sigmas[key] <= GROWN * max(sigmas[key], fit.near[key]) for key in sigmas):
                break
        length, segments, starts = factor * length, longer, joined
    return [segment.begin(start) for segment, start in zip(fit.cut(math.inf), starts, strict=True)]


def _starts(
    segments: Sequence[sh.Segment], before: Sequence[sh.Segment] = (), starts: Sequence[np.ndarray] = ()
) -> list[np.ndarray]:
    """Those of the segments before that begin at the same time, or what the samples nearby say."""
    known = {(id(one.flight), one.begin_ns): start for one, start in zip(before, starts, strict=True)}
    found = []
    for one in segments:
        start = known.get((id(one.flight), one.begin_ns))
        found.append(one.begin(local_start(one.flight, one.begin_ns) if start is None else start))
    return found


def _first_length(flights: Sequence[MeasuredFlight], angle: float) -> float:
    total = sum(flight.duration_s for flight in flights)
    samples = sum(len(flight.pose[0].times_ns) for flight in flights if flight.pose is not None)
    rate = max(high_rate(flight) for flight in flights)
    return max(angle / max(rate, 1e-9), total / MOST_SEGMENTS, FEWEST_SAMPLES * total / samples)


def _estimate(fit: _Fit, segments: list[sh.Segment], starts: list[np.ndarray]) -> Estimate:
    roots, cost = [], 0.0
    for wider in (1.0, WIDER):
        variations = sh.Variations(fit.unknowns, fit.values, wider=wider)
        parts = []
        for segment, start in zip(segments, starts, strict=True):
            columns = sh.linearized(segment, start, variations)
            if columns is None:
                raise CannotFlyError
            triangle = sh.compressed(columns, segment, start, is_held=False)
            # Rows that are left when the start has taken all that it can.
            own = len(columns) - 1 - len(fit.unknowns)
            parts.append(triangle[own:-1, own:-1])
            cost += float(triangle[:, -1] @ triangle[:, -1]) if wider == 1.0 else 0.0
        roots.append(np.concatenate(parts))
    return Estimate(fit.values, fit.unknowns, segments, starts, fit.sigmas, roots[0], roots[1], cost)
