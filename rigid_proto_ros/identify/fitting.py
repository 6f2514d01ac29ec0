# SPDX-License-Identifier: MIT
"""The fit: the initial estimate is improved on short segments, which converge from far, then on ever longer ones, until
each flight is one segment.

With [J_start J r] = Q R the start of a segment takes what it can of the residuals, and the rows of R below its own are
what is left: so every segment finds its own start while the steps are of the few numbers that all share (variable
projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's derivative). The steps are Levenberg's and
Marquardt's, among the bodies that can exist.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, Points
from . import shooting as sh
from .initial_estimate import initial_values, least_noise, local_start, noise_by_differences
from .measurements import MeasuredFlight
from .trajectories import STATE
from .unknowns import Unknowns, Values, is_possible, possible_step, possible_tensor

START_WIDTHS = np.repeat([1e3, 0.1, 1e3, 1e3], 3)
"""Standard deviations of what is assumed of a start beforehand, little: what too few samples leave open stays where it
is, and takes nothing of the residuals.
"""
SETTLING = 6
"""Most steps of the starts alone before the first step of the unknowns."""
CONVERGED = 0.1
"""Part of the squares that starts could still take away, by a step that is then the last one."""
SMALL_STEP = 0.03
"""Of all residuals together, in standard deviations: such a step is the last one."""
POOR, GOOD = 0.25, 0.75
"""Parts of what a step promised that it kept: below the first the damping grows, above the second it shrinks."""
SLICE = 128
"""Rows of a QR decomposition at once."""
FIRST_DAMPING, MOST_DAMPING = 1.0, 1e12
LONGEST_STEP = 1.0
"""In what counts as a large change of each unknown: farther away the body may spin so fast that no flight ends."""
FIRST_ANGLE = 3.0
"""Turn of the first segments [rad], of which the initial estimate's errors of some hundredths aren't much."""
MOST_SEGMENTS = 40
"""Of all flights together in the first stage."""
FEWEST_SAMPLES = 6
"""Of a segment in the first stage: a start has 12 numbers."""
OFFSET_MARGIN_S = 0.05
"""The largest difference of two clocks that is looked for."""


USUAL = (
    "usual causes: positions that aren't in m, rates in degrees, accelerations in g, gravity along another axis"
    " (--gravity), quaternions that begin with w, a wrench along other axes (--wrench TOPIC@FRAME), clocks"
)


class CannotFlyError(InputError):
    """An estimate with which a flight can't be simulated."""

    def __init__(self) -> None:
        super().__init__("identify", f"the estimate can't be simulated; {USUAL}")


@dataclass(frozen=True)
class Linear:
    """numbers (n,): the unknowns. starts: where the segments were flown from. triangles: R of each segment.

    residuals (k,) and their jacobian (k, n): of all segments together, the starts eliminated.
    """

    numbers: FloatArray
    starts: list[FloatArray]
    triangles: list[FloatArray]
    residuals: FloatArray
    jacobian: FloatArray

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def could_take(self) -> float:
        """Sum of the squares that the starts could still take away."""
        own = [triangle[: len(start) - 1, -1] for triangle, start in zip(self.triangles, self.starts, strict=True)]
        return sum(float(part @ part) for part in own)

    def starts_for(self, numbers: FloatArray) -> list[FloatArray]:
        """The best starts for other unknowns, as far as the derivatives say."""
        change = np.append(numbers - self.numbers, 1.0)
        found = []
        for start, triangle in zip(self.starts, self.triangles, strict=True):
            own = len(start) - 1
            step = -np.linalg.solve(triangle[:own, :own], triangle[:own, own:] @ change)
            found.append(sh.moved_starts(start[None], step[None])[0])
        return found


@dataclass(frozen=True)
class Problem:
    """Segments flown with ``unknowns`` about the values ``given``, in numbers (n,) of which 1 is a large change.
    sigmas: standard deviation of the noise by name of the series. prior: 1 for a wide one about what was given, which
    holds what the motion can't tell and hardly moves the rest; 0 for none.
    """

    segments: Sequence[sh.Segment]
    sigmas: Mapping[str, float]
    given: Values
    unknowns: Unknowns
    prior: float = 1.0

    def values(self, numbers: FloatArray) -> Values:
        """With these numbers."""
        return self.unknowns.moved(self.given, self.unknowns.scales(self.given) * numbers)

    def linear(self, numbers: FloatArray, starts: Sequence[FloatArray]) -> Linear | None:
        """The residuals and their derivatives about these numbers and starts; None where a flight failed."""
        turn = max(segment.flight.high_rate * segment.duration_s for segment in self.segments)
        variations = sh.Variations(self.unknowns, self.given, numbers, turn)
        triangles, rows = [], [self.prior * np.column_stack([np.eye(len(numbers)), numbers])]
        for segment, start in zip(self.segments, starts, strict=True):
            columns = sh.linearized(segment, start, self.sigmas, variations)
            if columns is None or not np.isfinite(columns).all():
                return None
            own, sds = len(start) - 1, segment.change_sds_s
            known = np.zeros((own, len(columns)))
            known[:, :own] = np.diag(1.0 / np.concatenate([START_WIDTHS, sds]))
            known[sh.START :, -1] = start[STATE:] / sds
            triangles.append(upper_triangle(np.vstack([known, columns.T])))
            rows.append(triangles[-1][own:, own:])
        left = upper_triangle(np.concatenate(rows))
        return Linear(numbers, list(starts), triangles, left[:, -1], left[:, :-1])

    def settled(self, numbers: FloatArray, starts: Sequence[FloatArray]) -> list[FloatArray]:
        """Starts improved by steps of their own; raises CannotFlyError."""
        alone = replace(self, given=self.values(numbers), unknowns=Unknowns(()))
        for _ in range(SETTLING):
            linear = alone.linear(np.zeros(0), starts)
            if linear is None:
                raise CannotFlyError
            starts = linear.starts_for(np.zeros(0))
            if linear.could_take <= CONVERGED * linear.cost:
                break
        return list(starts)

    def step(self, here: Linear, damping: float) -> FloatArray:
        """The best step (n,) with at least this damping, not too long and to a body that can exist."""
        width = len(here.numbers)
        residuals = np.concatenate([here.residuals, np.zeros(width)])
        while True:
            jacobian = np.vstack([here.jacobian, math.sqrt(damping) * np.eye(width)])
            step: FloatArray = -np.linalg.lstsq(jacobian, residuals, rcond=None)[0]
            if np.linalg.norm(step) <= LONGEST_STEP:
                break
            damping *= 10.0
        if "inertia" not in self.unknowns or is_possible(self.values(here.numbers + step).inertia):
            return step
        first = self.unknowns.slots.index(("inertia", 0))
        tensor = slice(first, first + 6)
        return possible_step(jacobian, residuals, tensor, self.given.inertia, here.numbers[tensor])

    def solved(
        self, starts: Sequence[FloatArray], most: int = 12, tolerance: float = 1e-2
    ) -> tuple[Values, list[FloatArray]]:
        """The best values and starts, until a step promises less than this part of the squares: it is taken unseen.
        Raises CannotFlyError.
        """
        zero, damping = np.zeros(len(self.unknowns)), FIRST_DAMPING
        # What a start could still take counts as taken already: so it has to be near before steps are measured by what
        # is left.
        here = self.linear(zero, self.settled(zero, starts))
        if here is None:
            raise CannotFlyError
        numbers = zero
        for _ in range(most):
            step = self.step(here, damping)
            numbers = here.numbers + step
            promised = here.cost - float(np.sum((here.residuals + here.jacobian @ step) ** 2))
            if promised < max(SMALL_STEP**2, tolerance * here.cost):
                break
            there = self.linear(numbers, here.starts_for(numbers))
            kept = -np.inf if there is None else (here.cost - there.cost) / promised
            if kept > GOOD:
                damping /= 10.0
            elif kept < POOR:
                damping *= 10.0
            if there is not None and kept > 0.0:
                here = there
            numbers = here.numbers
            if damping > MOST_DAMPING:
                break
        values = self.values(numbers)
        # Rounding may have left it a little outside.
        return replace(values, inertia=possible_tensor(values.inertia)), here.starts_for(numbers)

    def noise_left(self, values: Values, starts: Sequence[FloatArray]) -> dict[str, float]:
        """Standard deviation of each series from its residuals; those of one topic and quantity share it over all
        flights.
        """
        found: dict[str, list[FloatArray]] = {name: [] for name in self.sigmas}
        for segment, start in zip(self.segments, starts, strict=True):
            for series, residual in zip(segment.series, residuals_of(segment, start, values), strict=True):
                found[series.name].append(residual.ravel())
        samples = 3 * sum(segment.samples for segment in self.segments)
        left = max(1.0 - (sh.START * len(self.segments) + len(self.unknowns)) / samples, 0.1)
        least = {one.name: least_noise(one) for segment in self.segments for one in segment.flight.series}
        squares = {name: float(np.mean(np.concatenate(parts) ** 2)) for name, parts in found.items()}
        return {name: max(math.sqrt(square / left), least[name]) for name, square in squares.items()}


def upper_triangle(rows: FloatArray) -> FloatArray:
    """R of a QR decomposition of rows (n, k).

    In slices, as LAPACK would share more rows out among threads that wait for one another: eight times as much
    processor time was seen.
    """
    triangle = np.zeros((0, rows.shape[1]))
    for first in range(0, len(rows), SLICE):
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, rows[first : first + SLICE]]), mode="r"))
    return triangle


def residuals_of(segment: sh.Segment, start: FloatArray, values: Values) -> list[Points]:
    """Measured minus shown of each series (m, 3), in its own unit; raises CannotFlyError."""
    found = sh.segment_residuals(segment, start, values)
    if found is None:
        raise CannotFlyError
    return found


class Estimate:
    """values: what came out of a problem whose segments are whole flights, with their starts.

    root (k, n): rootᵀ root is the Fisher information of the unknowns, the starts eliminated. Raises CannotFlyError.
    """

    def __init__(self, problem: Problem, values: Values, starts: list[FloatArray]) -> None:
        self.problem, self.values, self.starts = replace(problem, given=values, prior=0.0), values, starts
        self.unknowns = problem.unknowns
        self._zero = np.zeros(len(problem.unknowns))
        linear = self.problem.linear(self._zero, starts)
        if linear is None:
            raise CannotFlyError
        self.root = linear.jacobian / problem.unknowns.scales(values)
        self._cost = linear.cost

    def rise(self, change: FloatArray) -> float:
        """By how much the squares rise with the unknowns changed (n,), whatever the starts are then; without end for a
        body that can't exist.
        """
        problem = replace(self.problem, given=self.unknowns.moved(self.values, change))
        if not is_possible(problem.given.inertia):
            return np.inf
        try:
            there = problem.linear(self._zero, problem.settled(self._zero, self.starts))
        except CannotFlyError:
            return np.inf
        return np.inf if there is None else there.cost - self._cost


def fit_flights(flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> Estimate:
    """The most likely values, from these on; raises CannotFlyError."""
    total = sum(flight.duration_s for flight in flights)
    samples = sum(len(flight.pose[0].times_ns) for flight in flights)
    rate = max(flight.high_rate for flight in flights)
    length = max(FIRST_ANGLE / max(rate, 1e-9), total / MOST_SEGMENTS, FEWEST_SAMPLES * total / samples)
    margin = OFFSET_MARGIN_S if "offset" in unknowns else 0.0
    sigmas = {one.name: noise_by_differences(one) for flight in flights for one in flight.series}
    values = initial_values(flights, unknowns, values)
    known: dict[tuple[int, int], FloatArray] = {}
    while True:
        problem = Problem(sh.cut(flights, length, margin), sigmas, values, unknowns)
        starts = []
        for one in problem.segments:
            state = known.get((id(one.flight), one.begin_ns))
            starts.append(one.begin(local_start(one.flight, one.begin_ns) if state is None else state))
        if len(problem.segments) <= len(flights):
            break
        values, starts = problem.solved(starts)
        sigmas = problem.noise_left(values, starts)
        # Segments twice as long begin where every second of these does.
        known = {(id(one.flight), one.begin_ns): start for one, start in zip(problem.segments, starts, strict=True)}
        length *= 2.0
    for _ in range(5):
        values, starts = problem.solved(starts, 60, 1e-7)
        before, sigmas = problem.sigmas, problem.noise_left(values, starts)
        problem = replace(problem, given=values, sigmas=sigmas)
        if all(abs(sigmas[key] - before[key]) < 0.01 * before[key] for key in before):
            break
    return Estimate(problem, values, starts)
