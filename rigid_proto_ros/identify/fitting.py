# SPDX-License-Identifier: MIT
"""The fit. It improves the initial estimate on short segments, which converge from far away, then on ever longer ones,
until each flight is one segment.

With [J_start J r] = Q R, the start of a segment fits what it can of the residuals, and the rows of R below its own hold
the rest. Every segment thus has its optimal start while steps are made only in the few unknowns that all segments share
(variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's derivative). The steps are
Levenberg-Marquardt steps, restricted to bodies that can exist.
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
"""Standard deviations of a weak prior of a start: what too few samples leave undetermined stays where it is and doesn't
affect the residuals.
"""
SETTLING = 6
"""Largest number of steps of the starts alone before the first step of the unknowns."""
CONVERGED = 0.1
"""A step of the starts is the last one if they could reduce the squares by less than this fraction."""
SMALL_STEP = 0.03
"""Norm of a step's change of all residuals [standard deviations]; a smaller step is the last one."""
POOR, GOOD = 0.25, 0.75
"""Ratio of a step's actual to its promised reduction: below the first the damping grows, above the second it
shrinks.
"""
SLICE = 128
"""Number of rows in one QR decomposition."""
FIRST_DAMPING, MOST_DAMPING = 1.0, 1e12
LONGEST_STEP = 1.0
"""Largest step, in units in which 1 is a large change of each unknown. Farther away the body may spin so fast that no
flight ends.
"""
FIRST_ANGLE = 3.0
"""Rotation in a segment of the first stage [rad]; the initial estimate's errors of some hundredths are small in
comparison.
"""
MOST_SEGMENTS = 40
"""Largest number of segments of all flights in the first stage."""
FEWEST_SAMPLES = 6
"""Least number of samples of a segment in the first stage: a start has 12 numbers."""
OFFSET_MARGIN_S = 0.05
"""Largest difference of two clocks that is considered [s]."""


USUAL = (
    "usual causes: positions that aren't in m, rates in degrees, accelerations in g, gravity along another axis"
    " (--gravity), quaternions that begin with w, a wrench along other axes (--wrench TOPIC@FRAME), clocks"
)


class CannotFlyError(InputError):
    """A flight can't be simulated with an estimate."""

    def __init__(self) -> None:
        super().__init__("identify", f"the estimate can't be simulated; {USUAL}")


@dataclass(frozen=True)
class Linear:
    """The problem linearized. numbers (n,): the unknowns. starts: of the segments. triangles: R of each segment.

    residuals (k,) and their jacobian (k, n): of all segments together, with the starts eliminated.
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
        """Sum of the squares that a change of the starts could still remove."""
        own = [triangle[: len(start) - 1, -1] for triangle, start in zip(self.triangles, self.starts, strict=True)]
        return sum(float(part @ part) for part in own)

    def starts_for(self, numbers: FloatArray) -> list[FloatArray]:
        """The best starts for other unknowns, to first order."""
        change = np.append(numbers - self.numbers, 1.0)
        found = []
        for start, triangle in zip(self.starts, self.triangles, strict=True):
            own = len(start) - 1
            step = -np.linalg.solve(triangle[:own, :own], triangle[:own, own:] @ change)
            found.append(sh.moved_starts(start[None], step[None])[0])
        return found


@dataclass(frozen=True)
class Problem:
    """Segments and the unknowns to fit, as numbers (n,) relative to ``given``, in which 1 is a large change. sigmas:
    standard deviation of the noise by name of the series. prior: 1 for a wide one around ``given``, which fixes what
    the motion doesn't determine and hardly affects the rest; 0 for none.
    """

    segments: Sequence[sh.Segment]
    sigmas: Mapping[str, float]
    given: Values
    unknowns: Unknowns
    prior: float = 1.0

    def values(self, numbers: FloatArray) -> Values:
        """The values for these numbers."""
        return self.unknowns.moved(self.given, self.unknowns.scales(self.given) * numbers)

    def linear(self, numbers: FloatArray, starts: Sequence[FloatArray]) -> Linear | None:
        """The residuals and their derivatives at these numbers and starts; None if a flight failed."""
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
        """Improve the starts with the unknowns fixed. Raises CannotFlyError."""
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
        """The best step (n,) with at least this damping, limited in length and to bodies that can exist."""
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
        """Iterate to the best values and starts, until a step promises to reduce the squares by less than this
        fraction; that step is taken unchecked. Raises CannotFlyError.
        """
        zero, damping = np.zeros(len(self.unknowns)), FIRST_DAMPING
        # The residuals leave out what the starts could still fit, so the starts must be close to their optimum before a
        # step is judged by the residuals.
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
        # Rounding may have left it slightly outside.
        return replace(values, inertia=possible_tensor(values.inertia)), here.starts_for(numbers)

    def noise_left(self, values: Values, starts: Sequence[FloatArray]) -> dict[str, float]:
        """Standard deviation of each series from its residuals. Series of the same topic and quantity share it over all
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

    Computed in slices: LAPACK would distribute more rows to threads that wait for one another, which took eight times
    as much processor time.
    """
    triangle = np.zeros((0, rows.shape[1]))
    for first in range(0, len(rows), SLICE):
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, rows[first : first + SLICE]]), mode="r"))
    return triangle


def residuals_of(segment: sh.Segment, start: FloatArray, values: Values) -> list[Points]:
    """Measured minus predicted values of each series (m, 3), in its own unit. Raises CannotFlyError."""
    found = sh.segment_residuals(segment, start, values)
    if found is None:
        raise CannotFlyError
    return found


class Estimate:
    """The solution of a problem whose segments are whole flights. values: the estimate. starts: of the segments.

    root (k, n): rootᵀ root is the Fisher information of the unknowns, with the starts eliminated. Raises
    CannotFlyError.
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
        """Increase of the squares if the unknowns change by (n,) and the starts are fitted again; infinite for a body
        that can't exist.
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
    """The most likely values, starting from ``values``. Raises CannotFlyError."""
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
        # Segments of twice the length begin where every second one of these does.
        known = {(id(one.flight), one.begin_ns): start for one, start in zip(problem.segments, starts, strict=True)}
        length *= 2.0
    for _ in range(5):
        values, starts = problem.solved(starts, 60, 1e-7)
        before, sigmas = problem.sigmas, problem.noise_left(values, starts)
        problem = replace(problem, given=values, sigmas=sigmas)
        if all(abs(sigmas[key] - before[key]) < 0.01 * before[key] for key in before):
            break
    return Estimate(problem, values, starts)
