# SPDX-License-Identifier: MIT
"""The estimate: short segments first, which converge from far, then longer ones, at last one per flight,
which uses all there is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from ..base.errors import InputError
from . import mass_parameters as mp
from . import measurements as ms
from . import possible_bodies as pb
from . import rotations as rot
from . import shooting as sh
from .first_attitude import first_attitude
from .local_motion import high_rate, least_noise, local_start, noise_by_differences
from .momentum_balance import balanced_values
from .poses import Poses, poses_of
from .unknowns import Unknowns, Values

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
LEAST_NOISE = 1e-4
"""The same that is taken for noise at first: of a simulated flight nothing is left at the end, but not yet then."""
MOST_SEGMENTS = 40
"""Of all flights together in the first stage."""
FEWEST_SAMPLES = 6
"""Of a segment in the first stage: a start has 12 numbers."""
ENOUGH_SAMPLES = 300
"""Of a series while the body is only approached, or ENOUGH_IN_A_RADIAN of its turn, where that is more."""
ENOUGH_IN_A_RADIAN = 2.0
FIRST_STEP = 1.0
"""In units of the prior: moments by a factor e."""
LENGTHENING = 4.0
"""Segments become so many times longer from stage to stage, or the root of it where that is too much."""
COARSE = 0.01
"""Part of what a series shows, or radians, below which a scan doesn't look."""
MOST_WORSE = 2
"""Scans go on for so many steps, of a factor 1.8 each, after the best one."""
GROWN = 1.5
"""Departures of longer segments so many times those of shorter ones are no noise."""
HUBER = 1.5
"""Robust fits: residuals beyond so many standard deviations count by their size alone (95 % efficient at
1.345, Huber 1981).
"""
OFFSET_MARGIN_S = 0.05
"""The largest difference of two clocks that is looked for."""
ROUGH = 1e-3
"""Tolerance of a stage that only leads on to the next one."""
MOST_RIM_STEPS = 6
THINNEST = 1e-9
"""Least second moment of an estimate, of the largest: of none at all there may be a rod, whose least moment is 0."""
SMALL_STEP = 0.03
"""Of all residuals together, in standard deviations: such a step is the last one."""
WIDER = 8.0
"""Of steps of difference quotients: of what is rounding alone so much less is left."""


@dataclass(frozen=True)
class Estimate:
    """values: what came out. segments and starts (k, 13): one for each flight. sigmas: of each series by flight's
    number and name.

    root (m, n): rootᵀ root is the Fisher information of the unknowns, the starts eliminated; root_wide by steps WIDER
    times as long, which shows what of it is rounding. cost: sum of squares in standard deviations. evaluations: of the
    residuals.
    """

    values: Values
    unknowns: Unknowns
    segments: list[sh.ShootingInterval]
    starts: np.ndarray
    sigmas: dict[int, float]
    root: np.ndarray
    root_wide: np.ndarray
    cost: float
    evaluations: int

    @property
    def mass(self) -> mp.MassEstimate:
        """The body."""
        return mp.mass_of(self.values.theta)


@dataclass
class _Work:
    """What stages hand on. reckoned: poses by ``id`` of the flights that have no attitudes."""

    flights: Sequence[ms.MeasuredFlight]
    topics: Sequence[str]
    unknowns: Unknowns
    values: Values
    sigmas: dict[int, float]
    weights: dict[int, np.ndarray]
    reckoned: dict[int, Poses] = field(default_factory=dict)
    evaluations: int = 0


def topics_of(flights: Sequence[ms.MeasuredFlight]) -> list[str]:
    """All topics in their order."""
    return list(dict.fromkeys(series.topic for flight in flights for series in flight.series))


def fit_flights(
    flights: Sequence[ms.MeasuredFlight],
    unknowns: Unknowns,
    values: Values,
    robust: bool = False,
    known: Estimate | None = None,
) -> Estimate:
    """The most likely values, from these on; raises InputError where they can't be flown.

    known: an estimate of the same flights whose noise counts and whose starts are near.
    """
    series = [one for flight in flights for one in flight.series]
    noise = {id(one): max(noise_by_differences(one), LEAST_NOISE * _spread(one)) for one in series}
    ones = {id(one): np.ones(len(one.times_ns)) for one in series}
    work = _Work(flights, topics_of(flights), unknowns, values, dict(known.sigmas if known else noise), ones)
    whole = 2.0 * max(flight.duration_s for flight in flights)
    if known is not None:
        segments = _segments(work, whole)
        return _estimate(work, segments, _solved(work, segments, known.starts, 30, 1e-7))
    starts = _approached(work, whole)
    work.sigmas = _noise(work, _segments(work, whole), starts)
    for turn in range(4):
        segments = _segments(work, whole)
        starts = _solved(work, segments, starts, 60, 1e-7)
        before = dict(work.sigmas)
        if robust:
            work.weights = _huber_weights(work, segments, starts)
        work.sigmas = _noise(work, segments, starts)
        if all(abs(work.sigmas[key] - before[key]) < 0.01 * before[key] for key in before) and (turn or not robust):
            break
    return _estimate(work, _segments(work, whole), starts)


def _spread(series: ms.Series) -> float:
    """How much a series shows, in its own unit."""
    return 1.0 if series.kind == ms.ATTITUDE else float(np.std(series.values))


def _near_enough(work: _Work) -> dict[int, float]:
    """Departures of each series that are none to a stage which leads on to the next one."""
    return {id(one): NEAR * _spread(one) for flight in work.flights for one in flight.series}


def _approached(work: _Work, whole: float) -> np.ndarray:
    """Bring ``work`` near by ever longer segments; returns starts of one segment for each flight."""
    values, sigmas = work.values, work.sigmas
    balanced = _balanced(work)
    least = _near_enough(work)
    for angle in BALANCED_ANGLES:
        if balanced is None:
            break
        work.values, work.sigmas = balanced, sigmas
        length = min(_first_length(work.flights, angle), whole)
        segments = _thin_segments(work, length)
        starts = _solved(work, segments, _local_starts(work, segments), 12, 1e-2)
        work.sigmas = _noise(work, segments, starts)
        if all(work.sigmas[key] < max(FITS * sigmas[key], least[key]) for key in sigmas):
            return _lengthened(work, segments, starts, length, whole)
    work.values, work.sigmas = values, sigmas
    length = min(_first_length(work.flights, FIRST_ANGLE), whole)
    segments = _thin_segments(work, length)
    starts = _local_starts(work, segments)
    free = [k for k, segment in enumerate(segments) if not len(segment.wrenches.commands)]
    if free and len(free) < len(segments):
        # Shape and centre of mass first, where no load hides them: what a load does then tells mass and size at once.
        starts[free] = _solved(work, [segments[k] for k in free], starts[free], 12, 1e-2, far=True)
    work.values = _scanned(work, segments, starts)
    starts = _solved(work, segments, starts, 12, 1e-2, far=True)
    work.sigmas = _noise(work, segments, starts)
    return _lengthened(work, segments, starts, length, whole)


def _balanced(work: _Work) -> Values | None:
    """What the balance of momentum says, None where a flight has no attitudes and none can be reckoned."""
    offsets = dict(zip(work.topics, work.values.offsets, strict=True))
    damped = any(name == "damping" for name, _ in work.unknowns.slots)
    poses = []
    for flight in work.flights:
        one = poses_of(flight, offsets, work.values)
        if one is None:
            return None
        if one.is_reckoned:
            one = work.reckoned[id(flight)] = one.begun_at(first_attitude(one, work.values, damped))
        poses.append(one)
    return balanced_values(poses, work.unknowns, work.values)


def _local_starts(work: _Work, segments: Sequence[sh.ShootingInterval]) -> np.ndarray:
    return np.array([_local_start(work, segment) for segment in segments])


def _local_start(work: _Work, segment: sh.ShootingInterval) -> np.ndarray:
    return local_start(segment.flight, segment.begin_ns, work.reckoned.get(id(segment.flight)))


def _lengthened(
    work: _Work, segments: list[sh.ShootingInterval], starts: np.ndarray, length: float, whole: float
) -> np.ndarray:
    """Join segments step by step; returns starts of one segment for each flight."""
    factor = LENGTHENING
    least = _near_enough(work)
    while len(segments) > len(work.flights):
        values, sigmas = work.values, work.sigmas
        starts = _of_one_heading(work, segments, starts)
        longer = _thin_segments(work, min(factor * length, whole))
        joined = np.array([_start_of(work, segment, segments, starts) for segment in longer])
        joined = _solved(work, longer, joined, 12, 1e-2)
        work.sigmas = _noise(work, longer, joined)
        if factor > 2.0 and any(work.sigmas[key] > GROWN * max(sigmas[key], least[key]) for key in sigmas):
            # Too long at once: the flight has left the way to the truth. Back, and on in smaller steps.
            work.values, work.sigmas, factor = values, sigmas, math.sqrt(factor)
            continue
        length, segments, starts = factor * length, longer, joined
    return starts


def _of_one_heading(work: _Work, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> np.ndarray:
    """Starts (k, 13) of flights without attitudes turned about the vertical, to agree with the one upon which a load
    acts: what such a segment shows doesn't depend on that turn unless a load in world axes acts on it, so that steps
    let it wander.
    """
    starts = starts.copy()
    for flight in work.flights:
        reckoned = work.reckoned.get(id(flight))
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


def _thin_segments(work: _Work, length_s: float) -> list[sh.ShootingInterval]:
    """With as many samples as an approach needs."""
    every = {}
    for flight in work.flights:
        enough = max(ENOUGH_SAMPLES, round(ENOUGH_IN_A_RADIAN * high_rate(flight) * flight.duration_s))
        every.update({id(series): max(len(series.times_ns) // enough, 1) for series in flight.series})
    return _segments(work, length_s, lambda series: every[id(series)])


def _segments(
    work: _Work, length_s: float, every: Callable[[ms.Series], int] = lambda _: 1
) -> list[sh.ShootingInterval]:
    offset = any(name == "offsets" for name, _ in work.unknowns.slots)
    margin = OFFSET_MARGIN_S if offset else max(0.0, -min(work.values.offsets, default=0.0))
    return sh.cut(
        work.flights,
        length_s,
        work.topics,
        lambda series: work.sigmas[id(series)],
        lambda series: work.weights[id(series)],
        margin,
        every,
    )


def _start_of(
    work: _Work, segment: sh.ShootingInterval, before: Sequence[sh.ShootingInterval], starts: np.ndarray
) -> np.ndarray:
    """Where that of the earlier segments which this one begins in has come to by then, or a guess."""
    for other, start in zip(reversed(before), reversed(starts), strict=True):
        if other.flight is segment.flight and other.begin_ns <= segment.begin_ns:
            come = sh.flown_state(other, start, work.values, segment.begin_ns)
            return _local_start(work, segment) if come is None else come
    return _local_start(work, segment)


def _sum_of_squares(segments: Sequence[sh.ShootingInterval], starts: np.ndarray, values: Values) -> float:
    total = 0.0
    for segment, start in zip(segments, starts, strict=True):
        found = sh.segment_residuals(segment, start, values)
        if found is None:
            return np.inf
        for piece, residual in zip(segment.pieces, found, strict=True):
            # Few samples that nothing could bring near must not hide what the others say, nor a noise of nothing all of
            # them.
            scaled = residual / max(piece.sigma, COARSE * _spread(piece.series))
            total += float(np.sum(np.log1p(scaled * scaled)))
    return total


def _scanned(work: _Work, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> Values:
    """The values with mass and size of the tensor about right, where a load tells them: Gauss-Newton
    steps don't come from far.
    """
    loaded = [k for k, segment in enumerate(segments) if len(segment.wrenches.commands)]
    free = {index for _, index in work.unknowns.theta_columns}
    values = work.values
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


def _solved(
    work: _Work,
    segments: Sequence[sh.ShootingInterval],
    starts: np.ndarray,
    most: int,
    tolerance: float,
    far: bool = False,
) -> np.ndarray:
    """Improve ``work.values``; returns the starts that go with them.

    far: step in log-Cholesky coordinates, in which no step from far away is impossible, else in the tensor itself.
    """
    unknowns = work.unknowns if far else work.unknowns.physical
    problem = sh.Problem(segments, starts, work.values, unknowns)
    if np.max(np.abs(problem.residuals(problem.first))) >= sh.FAILED:
        raise InputError("identify", "the first guess of the motion can't be simulated; see --from and --to")
    numbers = _least_squares(problem, most, tolerance)
    work.evaluations += problem.evaluations
    work.values, starts = _possible(problem.values(numbers)), problem.starts(numbers)
    if tolerance > ROUGH or pb.is_possible(problem.values(numbers).body.inertia):
        return starts
    return _along_the_rim(work, segments, starts)


class _LastStepError(Exception):
    """Ends SciPy's search where the next step changes hardly anything any more; numbers: where it leads."""

    def __init__(self, numbers: np.ndarray) -> None:
        super().__init__("the search has ended")
        self.numbers = numbers


def _least_squares(problem: sh.Problem, most: int, tolerance: float) -> np.ndarray:
    """The best unknowns, by SciPy, until a step promises less than this part of the squares: it is taken unseen."""
    # In units of the prior, and away from 0: SciPy takes the length of the first numbers for how far a first step may
    # go.
    widths, away = problem.widths, np.full(len(problem.first), FIRST_STEP / np.sqrt(len(problem.first)))

    def jacobian(z: np.ndarray) -> np.ndarray:
        numbers = problem.first + widths * (z - away)
        matrix, right = problem.jacobian(numbers) * widths, problem.residuals(numbers)
        # Of all steps the best one takes from the residuals what isn't below the triangle.
        step, gain = -np.linalg.solve(matrix[:-1], right[:-1]), float(right[:-1] @ right[:-1])
        if gain < max(SMALL_STEP**2, tolerance * float(right @ right)):
            raise _LastStepError(numbers + widths * step)
        return matrix

    try:
        found = least_squares(
            lambda z: problem.residuals(problem.first + widths * (z - away)),
            away,
            jacobian,
            max_nfev=most,
            ftol=tolerance,
        )
    except _LastStepError as end:
        return end.numbers
    return problem.first + widths * (found.x - away)


def _possible(values: Values) -> Values:
    """The same in log-Cholesky coordinates, where the tensor is outside of what can exist the nearest on its rim."""
    body = values.body
    theta = mp.parameters_of(body.mass, body.center_of_mass, mp.possible_tensor(body.inertia, THINNEST))
    return replace(values, theta=theta, tensor_change=np.zeros(6))


def _along_the_rim(work: _Work, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> np.ndarray:
    """Improve ``work.values`` among the bodies that can exist, where the best of all tensors is none of these."""
    unknowns = work.unknowns.physical
    first = unknowns.slots.index(("tensor_change", 0))
    for _ in range(MOST_RIM_STEPS):
        problem = sh.Problem(segments, starts, work.values, unknowns)
        jacobian = problem.jacobian(problem.first)
        step = pb.possible_step(jacobian, problem.residuals(problem.first), slice(first, first + 6), work.values.body)
        work.evaluations += 1
        work.values, starts = _possible(problem.values(problem.first + step)), problem.starts(problem.first + step)
        if np.linalg.norm(jacobian @ step) < SMALL_STEP:
            break
    return starts


def residuals_by_series(
    segments: Sequence[sh.ShootingInterval], starts: np.ndarray, values: Values
) -> dict[int, np.ndarray]:
    """Departures (n, 3) of each series in its own unit, by ``id``."""
    parts: dict[int, list[np.ndarray]] = {}
    for segment, start in zip(segments, starts, strict=True):
        for piece, residual in zip(segment.pieces, _residuals(segment, start, values), strict=True):
            parts.setdefault(id(piece.series), []).append(residual)
    return {key: np.concatenate(part) for key, part in parts.items()}


def _residuals(segment: sh.ShootingInterval, start: np.ndarray, values: Values) -> list[np.ndarray]:
    """Of a segment that can be flown."""
    found = sh.segment_residuals(segment, start, values)
    if found is None:
        raise InputError("identify", "the estimate can't be simulated; see --from and --to")
    return found


def _noise(work: _Work, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> dict[int, float]:
    """Standard deviation of each series from its residuals; series of one topic and quantity share it
    over all flights.
    """
    sums: dict[str, float] = {}
    counts: dict[str, float] = {}
    for segment, start in zip(segments, starts, strict=True):
        for piece, residual in zip(segment.pieces, _residuals(segment, start, work.values), strict=True):
            name, weights = piece.series.name, piece.weights
            sums[name] = sums.get(name, 0.0) + float((weights[:, None] * residual**2).sum())
            counts[name] = counts.get(name, 0.0) + 3.0 * float(weights.sum())
    samples = 3 * sum(segment.samples for segment in segments)
    left = max(1.0 - (sh.START * len(segments) + len(work.unknowns)) / samples, 0.1)
    return {
        id(one): max(math.sqrt(sums[one.name] / (left * counts[one.name])), least_noise(one))
        for flight in work.flights
        for one in flight.series
    }


def _huber_weights(work: _Work, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> dict[int, np.ndarray]:
    """1, or less for samples that lie too far off; too far is relative to the median size of the residuals."""
    weights = {}
    for key, part in residuals_by_series(segments, starts, work.values).items():
        size = np.linalg.norm(part, axis=1)
        # The median length of three normal numbers is 1.538.
        scale = max(float(np.median(size)) / 1.538, 1e-300)
        weights[key] = np.minimum(1.0, HUBER * np.sqrt(3.0) * scale / np.maximum(size, 1e-300))
    return weights


def _estimate(work: _Work, segments: list[sh.ShootingInterval], starts: np.ndarray) -> Estimate:
    roots: dict[float, list[np.ndarray]] = {1.0: [], WIDER: []}
    cost = 0.0
    for wider, parts in roots.items():
        variations = sh.Variations(work.values, work.unknowns.physical, wider=wider)
        for segment, start in zip(segments, starts, strict=True):
            flown = sh.linearized(segment, start, variations)
            if flown is None:
                raise InputError("identify", "the estimate can't be simulated; see --from and --to")
            triangle = sh.compressed(flown)
            # Rows that are left when the start has taken all that it can.
            parts.append(triangle[sh.START : -1, sh.START : -1])
            cost += float(flown[-1] @ flown[-1]) if wider == 1.0 else 0.0
    near, far = (np.concatenate(parts) for parts in roots.values())
    return Estimate(work.values, work.unknowns, segments, starts, work.sigmas, near, far, cost, work.evaluations)
