# SPDX-License-Identifier: MIT
"""Multiple shooting: every segment of a flight has a start of its own, and all have the same body.

The residuals of a segment and their derivatives come from one compiled call that flies the body beside its variations.
Only what a least-squares step needs is kept of them: with [J r] = Q R, R alone, which has as many rows as there are
unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import InputError
from ..base.rotation import matrix_from_quaternion
from . import mass_parameters as mp
from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr
from .sensors import deviation, predicted
from .triangles import upper_triangle
from .unknowns import Unknowns, Values

START = 12
"""Unknowns of a segment's start: position [m, world], turn [rad], velocity [m/s] and angular velocity [rad/s], these
three in body axes: so a turn alone, which nothing shows of a flight without attitudes, changes nothing else.
"""
START_STEPS = np.array([0.0] * 3 + [mp.STEP] * 3 + [0.0] * 3 + [mp.STEP] * 3)
"""For difference quotients; how a flight shifts with its position and velocity is known in closed form."""
OFFSET_STEP_S = 1e-5
FAILED = 1e20
"""Residual of a flight that didn't come through, in standard deviations: the step is then taken back."""


@dataclass(frozen=True)
class Piece:
    """Samples of a series within a segment. weights (n,): of robust fits, else 1."""

    series: ms.Series
    topic: int
    times_ns: np.ndarray
    values: np.ndarray
    sigma: float
    weights: np.ndarray


@dataclass(frozen=True)
class ShootingInterval:
    """flight: which one it is of. begin_ns: when it starts, no later than its first sample."""

    flight: ms.MeasuredFlight
    begin_ns: int
    pieces: tuple[Piece, ...]
    wrenches: tr.Wrenches

    @property
    def samples(self) -> int:
        """How many there are in all."""
        return sum(len(piece.times_ns) for piece in self.pieces)


def cut(
    flights: Sequence[ms.MeasuredFlight],
    lengths_s: float,
    topics: Sequence[str],
    sigma: Callable[[ms.Series], float],
    weights: Callable[[ms.Series], np.ndarray],
    margin_s: float = 0.0,
    every: Callable[[ms.Series], int] = lambda _: 1,
) -> list[ShootingInterval]:
    """Segments of about this length, alike within a flight; margin_s: how much earlier they start than
    their samples. every: each so-many-th sample of a series is used.
    """
    margin = round(margin_s * 1e9)
    segments = []
    for flight in flights:
        count = max(1, round(flight.duration_s / lengths_s))
        # In integers: a double of the nanoseconds since 1970 is 256 ns off.
        edges = flight.begin_ns + (flight.end_ns + 1 - flight.begin_ns) * np.arange(count + 1) // count
        for first, last in zip(edges[:-1], edges[1:], strict=True):
            pieces = []
            for series in flight.series:
                begun, ended = np.searchsorted(series.times_ns, (first, last))
                inside = slice(begun, ended, every(series))
                if ended > begun:
                    times, values = series.times_ns[inside], series.values[inside]
                    topic = topics.index(series.topic)
                    pieces.append(Piece(series, topic, times, values, sigma(series), weights(series)[inside]))
            if pieces:
                begin = int(first) - margin
                loads = flight.load_history.within(begin, int(last) + margin)
                segments.append(ShootingInterval(flight, begin, tuple(pieces), loads))
    return segments


def moved_starts(starts: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Starts (n, 13) of the tracked frame changed by (n, 12)."""
    moved = starts.copy()
    moved[:, :3] += changes[:, :3]
    attitude = rot.product(starts[:, 3:7], rot.exponential(changes[:, 3:6]))
    moved[:, 3:7] = attitude = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    moved[:, 7:10] = rot.turned(attitude, rot.turned_back(starts[:, 3:7], starts[:, 7:10]) + changes[:, 6:9])
    moved[:, 10:13] += changes[:, 9:12]
    return moved


def flown_rows(starts: np.ndarray, values: Sequence[Values]) -> np.ndarray:
    """Rows of ``trajectories.fly_rows`` (n, FLOWN): starts (n, 13) of the tracked frame as those of the
    centre of mass.
    """
    rows = np.empty((len(starts), tr.FLOWN))
    for row, v in zip(rows, values, strict=True):
        mass = v.body
        row[tr.MASS] = mass.mass
        row[tr.COM : tr.COM + 3] = mass.center_of_mass
        row[tr.INERTIA : tr.INERTIA + 9] = mass.inertia.ravel()
        row[tr.GRAVITY : tr.GRAVITY + 3] = v.gravity
        row[tr.LINEAR_DAMPING], row[tr.ANGULAR_DAMPING] = v.damping
    at, com = tr.START, rows[:, tr.COM : tr.COM + 3]
    q, w = starts[:, 3:7], starts[:, 10:13]
    rows[:, at : at + 13] = starts
    rows[:, at : at + 3] += rot.turned(q, com)
    rows[:, at + 7 : at + 10] += rot.turned(q, rot.cross(w, com))
    return rows


def _times(segment: ShootingInterval, offsets: Sequence[float]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times to look at, ascending from the segment's begin [ns], and for each piece which of them are its own."""
    own = [piece.times_ns - segment.begin_ns + round(offsets[piece.topic] * 1e9) for piece in segment.pieces]
    times, where = np.unique(np.maximum(np.concatenate(own), 0), return_inverse=True)
    ends = np.cumsum([len(part) for part in own])
    return times, np.split(where, ends[:-1])


def _shown(
    segment: ShootingInterval, starts: np.ndarray, values: Sequence[Values]
) -> tuple[list[np.ndarray], np.ndarray | None]:
    """What each piece would show of each flight, (n, m, 3 or 4), and the samples of the first one; None
    where one failed.
    """
    times, where = _times(segment, values[0].offsets)
    rows = flown_rows(starts, values)
    # An IMU's biases and place change what it shows and not the flight.
    others = np.any(rows != rows[0], axis=1)
    others[0] = True
    samples, good = tr.fly_rows(rows[others], times, segment.wrenches)
    if not good.all():
        return [], None
    flown = np.where(others, np.cumsum(others) - 1, 0)[:, None]
    com = np.array([v.theta[mp.COM] for v in values])[:, None]
    place = np.array([v.imu_place for v in values])[:, None]
    shown = []
    for piece, index in zip(segment.pieces, where, strict=True):
        series = piece.series
        name = "accel_bias" if series.kind == ms.ACCELERATION else "gyro_bias"
        bias = np.array([getattr(v, name) for v in values])[:, None] * (1.0 if series.is_imu else 0.0)
        shown.append(predicted(series, samples[flown, index], com, place, bias))
    return shown, samples[0]


def segment_residuals(segment: ShootingInterval, start: np.ndarray, values: Values) -> list[np.ndarray] | None:
    """Measured minus shown of each piece (m, 3), in its own unit; None where the flight failed."""
    shown, _ = _shown(segment, start[None], [values])
    if not shown:
        return None
    return [deviation(p.series.kind, s[0], p.values) for p, s in zip(segment.pieces, shown, strict=True)]


def flown_poses(
    segment: ShootingInterval, start: np.ndarray, values: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,) [ns from the segment's begin] of all samples, and what the tracked frame's poses are there: positions
    (n, 3) [m] and attitudes (n, 4) xyzw; raises InputError where the flight failed.
    """
    times, _ = _times(segment, values.offsets)
    samples, good = tr.fly_rows(flown_rows(start[None], [values]), times, segment.wrenches)
    if not good.all():
        raise InputError("identify", "the estimate can't be simulated; see --from and --to")
    attitudes = samples[0, :, 3:7]
    return times, samples[0, :, :3] - rot.turned(attitudes, values.theta[mp.COM]), attitudes


class Variations:
    """Values and those beside them whose flights give difference quotients.

    central: to both sides, which costs twice as much. wider: by how much the steps are longer.
    """

    def __init__(self, values: Values, unknowns: Unknowns, central: bool = True, wider: float = 1.0) -> None:
        self.values, self.unknowns = values, unknowns
        self.sides = (1.0, -1.0) if central else (1.0,)
        self.start_widths = wider * START_STEPS
        self.widths = np.concatenate([self.start_widths, wider * unknowns.steps(values)])
        turned = np.flatnonzero(START_STEPS)
        varied = [k for k, (name, _) in enumerate(unknowns.slots) if name != "offsets"]
        self.columns = [*turned.tolist(), *(START + k for k in varied)]
        """Which columns of the derivatives they give, in their order."""
        self._changes = (np.diag(self.start_widths)[turned][:, None] * np.array(self.sides)[:, None]).reshape(-1, START)
        base = unknowns.read(values)
        self.each = [values] * (1 + len(self._changes))
        """Of each flight: the base, then those to each side of each column."""
        for k in varied:
            for sign in self.sides:
                numbers = base.copy()
                numbers[k] += sign * self.widths[START + k]
                self.each.append(unknowns.put(values, numbers))

    def starts(self, start: np.ndarray) -> np.ndarray:
        """Of each flight, (n, 13)."""
        starts = np.repeat(start[None], len(self.each), axis=0)
        count = len(self._changes)
        starts[1 : 1 + count] = moved_starts(starts[:count], self._changes)
        return starts


def _shift_columns(
    piece: Piece, base: np.ndarray, seconds: np.ndarray, rate: float, attitude: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How a piece changes with its start's position and velocity, (m, 3, 3) each; base (m, SAMPLE), rate c/m [1/s].

    attitude (4,): the start's, in whose axes its velocity changes.
    """
    m, kind = len(base), piece.series.kind
    position, velocity = np.zeros((m, 3, 3)), np.zeros((m, 3, 3))
    decay = np.exp(-rate * seconds)[:, None, None]
    back = rot.turned_back(base[:, None, 3:7], np.eye(3)[None]).transpose(0, 2, 1)
    if kind == ms.POSITION:
        position[:] = np.eye(3)
        way = -np.expm1(-rate * seconds) / rate if rate else seconds
        velocity[:] = np.eye(3) * way[:, None, None]
    elif kind == ms.VELOCITY:
        velocity[:] = (back if piece.series.in_body else np.eye(3)) * decay
    elif kind == ms.ACCELERATION:
        velocity[:] = -rate * back * decay
    return position, velocity @ matrix_from_quaternion(attitude)


def linearized(
    segment: ShootingInterval, start: np.ndarray, variations: Variations
) -> tuple[list[np.ndarray], np.ndarray] | None:
    """Departures of each piece, and how all of them change with the start and the unknowns, (3 m of all pieces, 12 +
    unknowns).

    Both in units of the standard deviations, weighted. None where a flight failed.
    """
    values, unknowns, columns = variations.values, variations.unknowns, variations.columns
    shown, base = _shown(segment, variations.starts(start), variations.each)
    if base is None:
        return None
    times, where = _times(segment, values.offsets)
    rate = values.damping[0] / values.body.mass
    central, widths = len(variations.sides) > 1, len(variations.sides) * variations.widths
    blocks, found = [], []
    for piece, own, index in zip(segment.pieces, shown, where, strict=True):
        kind = piece.series.kind
        block = np.zeros((len(index), 3, START + len(unknowns)))
        block[:, :, 0:3], block[:, :, 6:9] = _shift_columns(piece, base[index], 1e-9 * times[index], rate, start[3:7])
        # The derivative of what a flight shows is minus that of its deviation from a nearby flight.
        difference = deviation(kind, own[2::2] if central else own[:1], own[1 :: len(variations.sides)])
        block[:, :, columns] = (difference / widths[columns][:, None, None]).transpose(1, 2, 0)
        weight = np.sqrt(piece.weights)[:, None] / piece.sigma
        blocks.append(-block * weight[:, :, None])
        found.append(deviation(kind, own[0], piece.values) * weight)
    for k, (name, topic) in enumerate(unknowns.slots):
        if name == "offsets":
            _fill_offset(segment, start, values, topic, [block[:, :, START + k] for block in blocks])
    return found, np.concatenate([block.reshape(-1, START + len(unknowns)) for block in blocks])


def _fill_offset(
    segment: ShootingInterval, start: np.ndarray, values: Values, topic: int, columns: Sequence[np.ndarray]
) -> None:
    """How what a topic shows changes with its clock, into a column (m, 3) of each piece."""
    sides = []
    for sign in (1.0, -1.0):
        offsets = list(values.offsets)
        offsets[topic] += sign * OFFSET_STEP_S
        moved = replace(values, offsets=tuple(offsets))
        sides.append(_shown(segment, start[None], [moved])[0])
    for number, (piece, column) in enumerate(zip(segment.pieces, columns, strict=True)):
        if piece.topic == topic:
            change = deviation(piece.series.kind, sides[1][number][0], sides[0][number][0])
            weight = np.sqrt(piece.weights)[:, None] / piece.sigma
            column[:] = -weight * change / (2.0 * OFFSET_STEP_S)
            # Where a load begins or ends an accelerometer's curve jumps, and says nothing about its slope.
            times = piece.times_ns - segment.begin_ns + round(values.offsets[topic] * 1e9)
            column[segment.wrenches.is_near_edge(times, round(2e9 * OFFSET_STEP_S))] = 0.0


def compressed(found: Sequence[np.ndarray], jacobian: np.ndarray) -> np.ndarray:
    """[J r] as an upper triangle (k, k), k the columns of J and one, with the same products of its columns."""
    return upper_triangle(np.vstack([jacobian.T, np.concatenate([part.ravel() for part in found])]))


PRIOR_STEPS = 1.0 / mp.STEP
"""Widths of the prior in steps of difference quotients: moments by a factor e, the COM by the body's size. It holds
what the motion can't tell; the rest it hardly moves, as it is about the last stage's estimate.
"""


class Problem:
    """Residuals of all segments and of a wide prior as SciPy takes them, of the unknowns alone.

    With [J_start J r] = Q R the start of a segment takes what it can of the residuals, and the rows of R below the
    twelfth are what is left: so every segment finds its own start while SciPy steps in the few numbers that all share
    (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's derivative).
    """

    def __init__(
        self, segments: Sequence[ShootingInterval], starts: np.ndarray, values: Values, unknowns: Unknowns
    ) -> None:
        self.segments, self.unknowns, self._given = segments, unknowns, values
        self.first = unknowns.read(values)
        self.widths = PRIOR_STEPS * unknowns.steps(values)
        self._base: _Linearized | None = None
        self._trial: _Linearized | None = None
        self._starts = starts

    def values(self, numbers: np.ndarray) -> Values:
        """With these unknowns."""
        return self.unknowns.put(self._given, numbers)

    def starts(self, numbers: np.ndarray) -> np.ndarray:
        """The best starts (k, 13) for these unknowns, at which the last step ended."""
        at = self._at(numbers)
        return at.starts_for(numbers) if at.triangles is not None else at.starts

    def residuals(self, numbers: np.ndarray) -> np.ndarray:
        """For SciPy."""
        return self._at(numbers).residuals

    def jacobian(self, numbers: np.ndarray) -> np.ndarray:
        """For SciPy, which asks only where it stays: later starts are foretold from here."""
        self._base = self._at(numbers)
        return self._base.jacobian

    def _at(self, numbers: np.ndarray) -> _Linearized:
        for known in (self._trial, self._base):
            if known is not None and np.array_equal(known.numbers, numbers):
                return known
        if self._base is not None:
            self._trial = self._linearized(numbers, self._base.starts_for(numbers))
            return self._trial
        # What a start could still take counts as taken already: so it has to be near before steps are measured by
        # what is left.
        self._trial = self._linearized(numbers, self._starts)
        for _ in range(SETTLING):
            if self._trial.is_converged:
                break
            self._trial = self._linearized(numbers, self._trial.starts_for(numbers))
        return self._trial

    def _linearized(self, numbers: np.ndarray, starts: np.ndarray) -> _Linearized:
        values, free = self.values(numbers), len(self.unknowns)
        triangles: list[np.ndarray] = []
        variations = Variations(values, self.unknowns, central=False)
        prior = ((numbers - self.first) / self.widths, np.diag(1.0 / self.widths))
        for segment, start in zip(self.segments, starts, strict=True):
            flown = linearized(segment, start, variations)
            if flown is None:
                rows = len(self.segments) * (free + 1)
                failed = np.concatenate([np.full(rows, FAILED), prior[0]])
                return _Linearized(numbers, starts, None, failed, np.vstack([np.zeros((rows, free)), prior[1]]))
            triangles.append(compressed(*flown))
        below = np.concatenate([triangle[START:, START:] for triangle in triangles])
        residuals = np.concatenate([below[:, -1], prior[0]])
        return _Linearized(numbers, starts, triangles, residuals, np.vstack([below[:, :-1], prior[1]]))


@dataclass(frozen=True)
class _Linearized:
    """numbers: the unknowns. starts (k, 13): where the segments were flown from. triangles:
    ``compressed`` ones, None where one failed.
    """

    numbers: np.ndarray
    starts: np.ndarray
    triangles: list[np.ndarray] | None
    residuals: np.ndarray
    jacobian: np.ndarray

    @property
    def is_converged(self) -> bool:
        """Whether the starts are as good as they can be for these unknowns, or so bad that they can't be flown."""
        if self.triangles is None:
            return True
        could = sum(float(triangle[:START, -1] @ triangle[:START, -1]) for triangle in self.triangles)
        return could <= CONVERGED * float(self.residuals @ self.residuals)

    def starts_for(self, numbers: np.ndarray) -> np.ndarray:
        """The best starts for other unknowns, as far as the derivatives say."""
        if self.triangles is None:
            return self.starts
        change = np.append(numbers - self.numbers, 1.0)
        steps = []
        for triangle in self.triangles:
            own, rest = triangle[:START, :START], triangle[:START, START:] @ change
            # Tiny prior on the start: what too few samples leave open stays where it is.
            prior = np.diag(1.0 / START_WIDTHS)
            whole = np.vstack([own, prior])
            steps.append(-np.linalg.lstsq(whole, np.concatenate([rest, np.zeros(START)]), rcond=None)[0])
        return moved_starts(self.starts, np.array(steps))


SETTLING = 6
"""Most steps of the starts alone before the first step of the unknowns."""
CONVERGED = 0.01
"""Part of the squares that starts could still take away."""

START_WIDTHS = np.repeat([1e3, 1.0, 1e3, 1e3], 3)
"""Of what is assumed of a start beforehand."""
