# SPDX-License-Identifier: MIT
"""Multiple shooting: every segment of a flight has a start of its own, and all have the same body.

The residuals of a segment and their derivatives come from one compiled call that flies the body beside its variations.
Only what a least-squares step needs is kept of them: with [J r] = Q R, R alone, which has as many rows as there are
unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr
from .incremental_qr import upper_triangle
from .unknowns import STEP, Unknowns, Values

STATE = 13
START = 12
"""Unknowns of a segment's start: position [m], turn [rad] and velocity [m/s] in world axes, angular velocity [rad/s] in
body axes. Behind them those of its sampled loads: when each changed, less the time that it is taken for [s].
"""
START_WIDTHS = np.repeat([1e3, 0.1, 1e3, 1e3], 3)
"""Standard deviations of what is assumed of a start beforehand, little: what too few samples leave open stays where it
is, and takes nothing of the residuals.
"""
MOST_TURN = 20.0
"""Of a segment for whose difference quotients to one side the steps are short enough [rad]: their error is half of the
angle by which the flights end apart, 4e-5, and of longer turns too, as the steps are shorter then.
"""
CLOCK_STEP_S = 1e-5


@dataclass(frozen=True)
class Piece:
    """Samples of a series within a segment: its rows, and the standard deviation of their noise."""

    series: ms.Series
    rows: slice
    sigma: float

    @property
    def times_ns(self) -> np.ndarray:
        """Of the samples (n,)."""
        return self.series.times_ns[self.rows]

    @property
    def values(self) -> np.ndarray:
        """Of the samples (n, 3 or 4)."""
        return self.series.values[self.rows]


@dataclass(frozen=True)
class Segment:
    """flight: which one it is of. begin_ns: when it starts, no later than its first sample; loads count until end_ns.
    is_whole: it is all of its flight, and its start has the changes of the sampled loads.
    """

    flight: ms.MeasuredFlight
    begin_ns: int
    end_ns: int
    pieces: tuple[Piece, ...]
    is_whole: bool

    @property
    def samples(self) -> int:
        """How many there are in all."""
        return sum(len(piece.times_ns) for piece in self.pieces)

    @property
    def duration_s(self) -> float:
        """From its begin to the last sample [s]."""
        return 1e-9 * (max(int(piece.times_ns[-1]) for piece in self.pieces) - self.begin_ns)

    @property
    def change_sds_s(self) -> np.ndarray:
        """How well the times are known when its sampled loads changed (e,) [s]."""
        return self.flight.load_history.changes.sds_s if self.is_whole else np.zeros(0)

    def begin(self, state: np.ndarray) -> np.ndarray:
        """A start (13 + e,) of this state (13,)."""
        return np.concatenate([state[:STATE], np.zeros(len(self.change_sds_s))])

    def wrenches(self, start: np.ndarray, values: Values) -> tr.Wrenches:
        """The loads that act in it."""
        history = self.flight.load_history
        return history.moved(values.offset(history.topic), start[STATE:]).within(self.begin_ns, self.end_ns)


def cut(
    flights: Sequence[ms.MeasuredFlight],
    length_s: float,
    sigmas: Mapping[str, float],
    margin_s: float = 0.0,
    every: Callable[[ms.Series], int] = lambda _: 1,
) -> list[Segment]:
    """Segments of about this length, of a flight a power of two, so that longer ones begin where shorter ones do.

    sigmas: standard deviation of the noise by name of the series. margin_s: how much earlier segments start
    than their samples. every: each so-many-th sample of a series is used.
    """
    margin = round(margin_s * 1e9)
    segments = []
    for flight in flights:
        count = 2 ** round(math.log2(max(flight.duration_s / length_s, 1.0)))
        # In integers: a double of the nanoseconds since 1970 is 256 ns off.
        edges = [flight.begin_ns + (flight.end_ns + 1 - flight.begin_ns) * k // count for k in range(count + 1)]
        for first, last in zip(edges[:-1], edges[1:], strict=True):
            pieces = []
            for series in flight.series:
                begun, ended = np.searchsorted(series.times_ns, (first, last))
                rows = slice(int(begun), int(ended), every(series))
                if ended > begun:
                    pieces.append(Piece(series, rows, sigmas[series.name]))
            if pieces:
                segments.append(Segment(flight, first - margin, last + margin, tuple(pieces), count == 1))
    return segments


def moved_starts(starts: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Starts (n, 13 + e) of the tracked frame changed by (n, 12 + e)."""
    moved = starts.copy()
    moved[:, :3] += changes[:, :3]
    q = rot.product(rot.exponential(changes[:, 3:6]), starts[:, 3:7])
    moved[:, 3:7] = q / np.linalg.norm(q, axis=1, keepdims=True)
    moved[:, 7:] += changes[:, 6:]
    return moved


def flown_rows(starts: np.ndarray, values: Sequence[Values]) -> np.ndarray:
    """Rows of ``trajectories.fly_rows`` (n, FLOWN): starts (n, 13) of the tracked frame as those of the
    centre of mass.
    """
    rows = np.zeros((len(values), tr.FLOWN))
    for row, v in zip(rows, values, strict=True):
        row[tr.MASS] = v.mass
        row[tr.COM : tr.COM + 3] = v.center_of_mass
        row[tr.INERTIA : tr.INERTIA + 9] = v.inertia.ravel()
        row[tr.GRAVITY : tr.GRAVITY + 3] = v.gravity
        row[tr.LINEAR_DAMPING], row[tr.ANGULAR_DAMPING] = v.damping
    com, q, w = rows[:, tr.COM : tr.COM + 3], starts[:, 3:7], starts[:, 10:STATE]
    rows[:, tr.START :] = starts[:, :STATE]
    rows[:, tr.START : tr.START + 3] += rot.turned(q, com)
    rows[:, tr.START + 7 : tr.START + 10] += rot.turned(q, rot.cross(w, com))
    return rows


COM, PLACE, GYRO_BIAS, ACCEL_BIAS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
"""Of a row of ``sensor_numbers``."""


def sensor_numbers(values: Values) -> np.ndarray:
    """What samples depend on beside the flight (12,): centre of mass and place of the IMU in the tracked frame [m], and
    what the IMU adds to rates [rad/s] and accelerations [m/s²].
    """
    return np.concatenate([values.center_of_mass, values.imu_place, values.gyro_bias, values.accel_bias])


def shown(series: ms.Series, s: np.ndarray, sensor: np.ndarray) -> np.ndarray:
    """What a series shows (..., 3), or (..., 4) xyzw, of samples s (..., SAMPLE) of the centre of mass. sensor: its
    ``sensor_numbers`` (..., 12).
    """
    q, w, com = s[..., 3:7], s[..., 10:13], sensor[..., COM]
    if series.kind == ms.ATTITUDE:
        return q
    if series.kind == ms.POSITION:
        return s[..., :3] - rot.turned(q, com)
    if series.kind == ms.RATE:
        return w + sensor[..., GYRO_BIAS]
    # v' at the IMU less gravity: a + ω' × r + ω × (ω × r), all along body axes.
    arm = sensor[..., PLACE] - com
    felt, angular = s[..., tr.SPECIFIC_FORCE : tr.SPECIFIC_FORCE + 3], s[..., tr.ANGULAR_ACCELERATION : tr.SAMPLE]
    return felt + rot.cross(angular, arm) + rot.cross(w, rot.cross(w, arm)) + sensor[..., ACCEL_BIAS]


def difference(series: ms.Series, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """``other`` less ``one`` (..., 3); of attitudes the rotation vector from one to the other in body axes [rad]."""
    if series.kind == ms.ATTITUDE:
        return rot.logarithm(rot.product(rot.inverse(one), other))
    return other - one


def _times(segment: Segment, values: Values) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times to look at, ascending from the segment's begin [ns], and for each piece which of them are its own."""
    own = [p.times_ns - segment.begin_ns + round(values.offset(p.series.topic) * 1e9) for p in segment.pieces]
    times, where = np.unique(np.maximum(np.concatenate(own), 0), return_inverse=True)
    return times, np.split(where, np.cumsum([len(part) for part in own])[:-1])


def flown(
    segment: Segment, start: np.ndarray, values: Values
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]] | None:
    """Times (m,) [ns from the segment's begin], samples (m, SAMPLE) of the centre of mass, and for each piece which of
    them are its own; None where the flight failed.
    """
    times, where = _times(segment, values)
    samples, good = tr.fly_rows(flown_rows(start[None], [values]), times, segment.wrenches(start, values))
    return (times, samples[0], where) if good.all() else None


def segment_residuals(segment: Segment, start: np.ndarray, values: Values) -> list[np.ndarray] | None:
    """Measured minus shown of each piece (m, 3), in its own unit; None where the flight failed."""
    expected = _expected(segment, start, values)
    if expected is None:
        return None
    return [difference(piece.series, one, piece.values) for piece, one in zip(segment.pieces, expected, strict=True)]


def _expected(segment: Segment, start: np.ndarray, values: Values) -> list[np.ndarray] | None:
    """What each piece shows of the flight."""
    found = flown(segment, start, values)
    if found is None:
        return None
    _, samples, where = found
    sensor = sensor_numbers(values)
    return [shown(piece.series, samples[own], sensor) for piece, own in zip(segment.pieces, where, strict=True)]


class Variations:
    """Values and those beside them whose flights give difference quotients.

    values: ``unknowns.moved(given, numbers)``. is_central: to both sides, which costs twice as much. wider: by how much
    the steps are longer. turn: of a segment [rad], by which the steps of what changes its rate are shorter, so that
    flights end no farther apart.
    """

    def __init__(
        self,
        unknowns: Unknowns,
        given: Values,
        numbers: np.ndarray | None = None,
        is_central: bool = True,
        wider: float = 1.0,
        turn: float = 0.0,
    ) -> None:
        numbers = np.zeros(len(unknowns)) if numbers is None else numbers
        self.unknowns, self.values = unknowns, unknowns.moved(given, numbers)
        shorter = min(1.0, MOST_TURN / turn) if turn > 0.0 else 1.0
        widths = wider * STEP * np.concatenate([np.ones(START), unknowns.scales(given)])
        turns = [False] * 9 + [True] * 3 + [group in ("mass", "inertia", "com") for group, _ in unknowns.slots]
        widths[turns] *= shorter
        columns, values, changes = [], [self.values], [np.zeros(START)]
        for column, width in enumerate(widths.tolist()):
            if column >= START and unknowns.slots[column - START][0] == "offset":
                continue
            columns.append(column)
            for sign in (1.0, -1.0) if is_central else (1.0,):
                change, moved = np.zeros(START), numbers.copy()
                if column < START:
                    change[column] = sign * width
                else:
                    moved[column - START] += sign * width
                changes.append(change)
                values.append(unknowns.moved(given, moved))
        self.columns = np.array(columns)
        """That the difference quotients give, of start and unknowns."""
        sides = 2 if is_central else 1
        self.widths = sides * widths[self.columns]
        self.plus = 1 + sides * np.arange(len(columns))
        self.minus = self.plus + 1 if is_central else np.zeros(len(columns), int)
        self.sensors = np.array([sensor_numbers(one) for one in values])
        self._each, self._changes = values, np.array(changes)

    def rows(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Flights from about ``start`` as ``trajectories.fly_rows`` takes them (f, FLOWN), and which of them is that of
        each variation (v,): an IMU's biases and place change what it shows and not the flight.
        """
        starts = moved_starts(np.repeat(start[None, :STATE], len(self._each), axis=0), self._changes)
        rows, which = np.unique(flown_rows(starts, self._each), axis=0, return_inverse=True)
        return rows, which.ravel()


def linearized(segment: Segment, start: np.ndarray, variations: Variations) -> np.ndarray | None:
    """How the residuals of all pieces change with the start and the unknowns, and as the last row the residuals
    themselves: (12 + e + unknowns + 1, 3 m of all pieces), in standard deviations.

    None where a flight failed.
    """
    values, unknowns = variations.values, variations.unknowns
    extra = len(segment.change_sds_s)
    times, where = _times(segment, values)
    rows, which = variations.rows(start)
    samples, good = tr.fly_rows(rows, times, segment.wrenches(start, values))
    if not good.all():
        return None
    columns = np.zeros((START + extra + len(unknowns) + 1, 3 * segment.samples))
    places = np.where(variations.columns < START, variations.columns, variations.columns + extra)
    for piece, own, part in zip(segment.pieces, where, _parts(segment), strict=True):
        seen = shown(piece.series, samples[:, own][which], variations.sensors[:, None])
        columns[-1, part] = difference(piece.series, seen[0], piece.values).ravel() / piece.sigma
        changed = difference(piece.series, seen[variations.minus], seen[variations.plus])
        # What a flight shows moves by that, what is measured less what it shows by minus that.
        columns[places, part] = -(changed / (piece.sigma * variations.widths[:, None, None])).reshape(len(places), -1)
    for k in range(extra):
        step = np.zeros(len(start))
        step[STATE + k] = CLOCK_STEP_S
        columns[START + k] = _by_clock(segment, (start - step, values), (start + step, values))
    topics = {piece.series.topic for piece in segment.pieces} | {segment.flight.load_history.topic}
    for k, (group, topic) in enumerate(unknowns.slots):
        if group == "offset" and topic in topics:
            sides = [
                replace(values, offsets={**values.offsets, topic: values.offset(topic) + sign * CLOCK_STEP_S})
                for sign in (-1.0, 1.0)
            ]
            columns[START + extra + k] = _by_clock(segment, (start, sides[0]), (start, sides[1]))
    return columns


def _parts(segment: Segment) -> list[slice]:
    """Where the residuals of each piece stand."""
    ends = np.cumsum([3 * len(piece.times_ns) for piece in segment.pieces]).tolist()
    return [slice(first, last) for first, last in zip([0, *ends[:-1]], ends, strict=True)]


def _by_clock(segment: Segment, one: tuple[np.ndarray, Values], other: tuple[np.ndarray, Values]) -> np.ndarray:
    """How the residuals (3 m,) change from one flight to the other, whose clocks are two CLOCK_STEP_S apart."""
    earlier, later = _expected(segment, *one), _expected(segment, *other)
    column = np.zeros(3 * segment.samples)
    if earlier is None or later is None:
        return column
    edges = segment.wrenches(*one).edges_ns
    for piece, a, b, part in zip(segment.pieces, earlier, later, _parts(segment), strict=True):
        slope = -difference(piece.series, a, b) / (2.0 * CLOCK_STEP_S * piece.sigma)
        if piece.series.kind == ms.ACCELERATION and len(edges):
            # Where a load begins or ends an accelerometer's curve jumps, and says nothing about its slope.
            times = piece.times_ns - segment.begin_ns + round(one[1].offset(piece.series.topic) * 1e9)
            near = round(4e9 * CLOCK_STEP_S)
            slope[np.searchsorted(edges, times - near) < np.searchsorted(edges, times + near)] = 0.0
        column[part] = slope.ravel()
    return column


def compressed(columns: np.ndarray, segment: Segment, start: np.ndarray, is_held: bool = True) -> np.ndarray:
    """[J r] of ``linearized`` as an upper triangle (k, k) with the same products of its columns, below what is known of
    the times of sampled loads and, where it ``is_held``, START_WIDTHS about the start.
    """
    sds, last = segment.change_sds_s, START + len(segment.change_sds_s)
    above = np.zeros((len(columns), len(columns)))
    above[range(START), range(START)] = 1.0 / START_WIDTHS if is_held else 0.0
    above[range(START, last), range(START, last)] = 1.0 / sds
    above[START:last, -1] = start[STATE:] / sds
    return upper_triangle(columns, above)
