# SPDX-License-Identifier: MIT
"""Multiple shooting: every segment of a flight has its own start, and all segments have the same body.

One compiled call simulates a segment and its variations, which gives the residuals and their derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.vectors import FloatArray, IntArray, Points, Records
from ..mass.tensor import six_from_tensor
from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr
from .trajectories import STATE
from .unknowns import Unknowns, Values

START = 12
"""Number of unknowns of a segment's start: position [m], rotation [rad] and velocity [m/s] in world axes, angular
velocity [rad/s] in body axes. They are followed by those of the sampled loads: the time of each change minus its
assumed time [s].
"""
STEP = 2e-6
"""Step of difference quotients, in units in which 1 is a large change. Long flights are so nonlinear that 1e-5 is too
large for some, and 1e-7 is too close to rounding.
"""
MOST_TURN = 20.0
"""Largest rotation in a segment for which these steps are short enough [rad]. The quotients' error is half of the angle
between the flights at the end, 4e-5. For larger rotations the steps are shorter, which keeps the error.
"""
CLOCK_STEP_S = 1e-5
SENSOR_GROUPS = ("gyro_bias", "accel_bias", "imu_place")
"""Unknowns that change an IMU's samples but not the flight."""


@dataclass(frozen=True)
class Segment:
    """A part of a flight. series: the flight's samples within it. begin_ns: its start, no later than its first sample.
    end_ns: loads count until then. is_whole: it is the whole flight, and its start includes the changes of the sampled
    loads.
    """

    flight: ms.MeasuredFlight
    begin_ns: int
    end_ns: int
    series: tuple[ms.Series, ...]
    is_whole: bool

    @property
    def samples(self) -> int:
        """Number of samples of all series."""
        return sum(len(series.times_ns) for series in self.series)

    @property
    def duration_s(self) -> float:
        """Time from its begin to the last sample [s]."""
        return 1e-9 * (max(int(series.times_ns[-1]) for series in self.series) - self.begin_ns)

    @property
    def change_sds_s(self) -> FloatArray:
        """Standard deviations (e,) of the times at which its sampled loads changed [s]."""
        return self.flight.load_history.changes.sds_s if self.is_whole else np.zeros(0)

    def begin(self, state: FloatArray) -> FloatArray:
        """The start (13 + e,) with this state (13,)."""
        return np.concatenate([state[:STATE], np.zeros(len(self.change_sds_s))])

    def wrenches(self, start: FloatArray, values: Values) -> tr.Wrenches:
        """The loads that act in the segment."""
        history = self.flight.load_history
        return history.moved(values.offset(history.topic), start[STATE:]).within(self.begin_ns, self.end_ns)


def cut(flights: Sequence[ms.MeasuredFlight], length_s: float, margin_s: float = 0.0) -> list[Segment]:
    """Cut flights into segments of about this length. The number for each flight is a power of two, so that longer
    segments begin where shorter ones do. margin_s: time by which segments start before their samples.
    """
    margin = round(margin_s * 1e9)
    segments = []
    for flight in flights:
        count = 2 ** round(math.log2(max(flight.duration_s / length_s, 1.0)))
        # In integers, since a double of nanoseconds since 1970 is only accurate to 256 ns.
        edges = [flight.begin_ns + (flight.end_ns + 1 - flight.begin_ns) * k // count for k in range(count + 1)]
        for first, last in zip(edges[:-1], edges[1:], strict=True):
            inside = [series.within(first, last - 1) for series in flight.series]
            if own := tuple(series for series in inside if len(series.times_ns)):
                segments.append(Segment(flight, first - margin, last + margin, own, count == 1))
    return segments


def moved_starts(starts: FloatArray, changes: FloatArray) -> FloatArray:
    """Starts (n, 13 + e) of the tracked frame, changed by (n, 12 + e)."""
    moved = starts.copy()
    moved[:, :3] += changes[:, :3]
    q = rot.product(rot.exponential(changes[:, 3:6]), starts[:, 3:7])
    moved[:, 3:7] = q / np.linalg.norm(q, axis=1, keepdims=True)
    moved[:, 7:] += changes[:, 6:]
    return moved


def flown_rows(starts: FloatArray, values: Sequence[Values]) -> tuple[Records, FloatArray]:
    """Scenes for ``trajectories.fly_rows`` (n,), and starts (n, 13) converted from the tracked frame to the centre of
    mass.
    """
    rows = tr.blank_scenes(len(values))
    for row, v in zip(rows, values, strict=True):
        row["explicit_inertia_mass"], row["explicit_inertia_center_of_mass"] = v.mass, v.center_of_mass
        row["explicit_inertia_tensor"], row["gravity"] = six_from_tensor(v.inertia), v.gravity
        row["linear_damping"], row["angular_damping"] = v.damping
    com, q, w, moved = (
        rows["explicit_inertia_center_of_mass"],
        starts[:, 3:7],
        starts[:, 10:STATE],
        starts[:, :STATE].copy(),
    )
    moved[:, :3] += rot.turned(q, com)
    moved[:, 7:10] += rot.turned(q, rot.cross(w, com))
    return rows, moved


COM, PLACE, GYRO_BIAS, ACCEL_BIAS = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
"""Indices in a row of ``sensor_numbers``."""


def sensor_numbers(values: Values) -> FloatArray:
    """What samples depend on besides the flight (12,): centre of mass and place of the IMU in the tracked frame [m],
    and the IMU's biases of rates [rad/s] and accelerations [m/s²].
    """
    return np.concatenate([values.center_of_mass, values.imu_place, values.gyro_bias, values.accel_bias])


def shown(series: ms.Series, s: FloatArray, sensor: FloatArray) -> FloatArray:
    """Predicted values of a series (..., 3), or (..., 4) xyzw, for samples s (..., SAMPLE) of the centre of mass.
    sensor: its ``sensor_numbers`` (..., 12).
    """
    q, w, com = s[..., 3:7], s[..., 10:13], sensor[..., COM]
    if series.kind == ms.ATTITUDE:
        return q
    if series.kind == ms.POSITION:
        return s[..., :3] - rot.turned(q, com)
    if series.kind == ms.RATE:
        return w + sensor[..., GYRO_BIAS]
    # Acceleration of the IMU minus gravity: a + ω' × r + ω × (ω × r), all in body axes.
    arm = sensor[..., PLACE] - com
    felt, angular = s[..., tr.SPECIFIC_FORCE : tr.SPECIFIC_FORCE + 3], s[..., tr.ANGULAR_ACCELERATION : tr.SAMPLE]
    return felt + rot.cross(angular, arm) + rot.cross(w, rot.cross(w, arm)) + sensor[..., ACCEL_BIAS]


def difference(series: ms.Series, one: FloatArray, other: FloatArray) -> FloatArray:
    """``other`` minus ``one`` (..., 3); for attitudes the rotation vector from one to the other in body axes [rad]."""
    if series.kind == ms.ATTITUDE:
        return rot.logarithm(rot.product(rot.inverse(one), other))
    return other - one


def segment_residuals(segment: Segment, start: FloatArray, values: Values) -> list[Points] | None:
    """Measured minus predicted values of each series (m, 3), in its own unit; None if the flight failed."""
    times, where = _times(segment, values)
    rows = flown_rows(start[None], [segment.flight.own(values)])
    samples, good = tr.fly_rows(*rows, times, segment.wrenches(start, values))
    if not good.all():
        return None
    sensor = sensor_numbers(values)
    pairs = zip(segment.series, where, strict=True)
    return [difference(series, shown(series, samples[0, own], sensor), series.values) for series, own in pairs]


def _times(segment: Segment, values: Values) -> tuple[IntArray, list[IntArray]]:
    """Times of samples from the segment's begin [ns], ascending, and for each series the indices of its own."""
    own = [one.times_ns - segment.begin_ns + round(values.offset(one.topic) * 1e9) for one in segment.series]
    times, where = np.unique(np.maximum(np.concatenate(own), 0), return_inverse=True)
    return times, np.split(where, np.cumsum([len(part) for part in own])[:-1])


class Variations:
    """The values, and the variations whose flights give difference quotients.

    values: ``unknowns.moved(given, scales * numbers)``, in which a number of 1 is a large change. turn: rotation in a
    segment [rad]. The larger it is, the shorter are the steps of unknowns that change the rate, so that the flights'
    ends stay equally close.
    """

    def __init__(self, unknowns: Unknowns, given: Values, numbers: FloatArray, turn: float) -> None:
        scales = unknowns.scales(given)
        self.unknowns, self.values = unknowns, unknowns.moved(given, scales * numbers)
        short = STEP * min(1.0, MOST_TURN / max(turn, 1e-9))
        start_steps = np.array([STEP] * 9 + [short] * 3)
        columns, steps = list(range(START)), start_steps.tolist()
        self._flown, flights, varied = [self.values] * (1 + START), list(range(1 + START)), [self.values] * (1 + START)
        for k, (group, _) in enumerate(unknowns.slots):
            if group == "offset":
                continue
            step = short if group in ("mass", "inertia", "com") else STEP
            moved = numbers + step * np.eye(len(numbers))[k]
            varied.append(unknowns.moved(given, scales * moved))
            flights.append(0 if group in SENSOR_GROUPS else len(self._flown))
            if group not in SENSOR_GROUPS:
                self._flown.append(varied[-1])
            columns.append(START + k)
            steps.append(step)
        self.columns = np.array(columns)
        """Columns of start and unknowns that difference quotients give."""
        self.steps = np.array(steps)
        self.flights = np.array(flights)
        """Indices in ``rows`` of the flight of the values and then of each column."""
        self.sensors = np.array([sensor_numbers(one) for one in varied])
        self._changes = np.zeros((len(self._flown), START))
        self._changes[1 : 1 + START] = np.diag(start_steps)

    def rows(self, flight: ms.MeasuredFlight, start: FloatArray) -> tuple[Records, FloatArray]:
        """The flight's variations (f,) around ``start``, for ``trajectories.fly_rows``."""
        starts = moved_starts(np.repeat(start[None, :STATE], len(self._flown), axis=0), self._changes)
        return flown_rows(starts, [flight.own(values) for values in self._flown])


def linearized(
    segment: Segment, start: FloatArray, sigmas: Mapping[str, float], variations: Variations
) -> FloatArray | None:
    """Derivatives of all residuals with respect to the start and the unknowns, and in the last row the residuals
    themselves: (12 + e + unknowns + 1, 3 m of all series), in standard deviations. sigmas: by name.

    None if a flight failed.
    """
    values, unknowns = variations.values, variations.unknowns
    extra = len(segment.change_sds_s)
    times, where = _times(segment, values)
    samples, good = tr.fly_rows(*variations.rows(segment.flight, start), times, segment.wrenches(start, values))
    if not good.all():
        return None
    columns = np.zeros((START + extra + len(unknowns) + 1, 3 * segment.samples))
    places = np.where(variations.columns < START, variations.columns, variations.columns + extra)
    for series, own, part in zip(segment.series, where, _parts(segment), strict=True):
        seen = shown(series, samples[:, own][variations.flights], variations.sensors[:, None])
        sigma = sigmas[series.name]
        columns[-1, part] = difference(series, seen[0], series.values).ravel() / sigma
        # The residual is measured minus predicted, so its derivative has the opposite sign.
        slopes = -difference(series, seen[:1], seen[1:]) / (sigma * variations.steps[:, None, None])
        columns[places, part] = slopes.reshape(len(places), -1)
    for k in range(extra):
        step = np.zeros(len(start))
        step[STATE + k] = CLOCK_STEP_S
        columns[START + k] = _by_clock(segment, sigmas, (start - step, values), (start + step, values))
    topics = {series.topic for series in segment.series} | {segment.flight.load_history.topic}
    for k, (group, topic) in enumerate(unknowns.slots):
        if group == "offset" and topic in topics:
            sides = [
                (start, replace(values, offsets={**values.offsets, topic: values.offset(topic) + step}))
                for step in (-CLOCK_STEP_S, CLOCK_STEP_S)
            ]
            columns[START + extra + k] = _by_clock(segment, sigmas, *sides)
    return columns


def _parts(segment: Segment) -> list[slice]:
    """Slices of the residuals by series."""
    ends = np.cumsum([3 * len(series.times_ns) for series in segment.series]).tolist()
    return [slice(first, last) for first, last in zip([0, *ends[:-1]], ends, strict=True)]


def _by_clock(
    segment: Segment, sigmas: Mapping[str, float], one: tuple[FloatArray, Values], other: tuple[FloatArray, Values]
) -> FloatArray:
    """Derivative of the residuals (3 m,) from two flights whose clocks differ by two CLOCK_STEP_S."""
    earlier, later = segment_residuals(segment, *one), segment_residuals(segment, *other)
    column = np.zeros(3 * segment.samples)
    if earlier is None or later is None:
        return column
    edges = segment.wrenches(*one).edges_ns
    for series, a, b, part in zip(segment.series, earlier, later, _parts(segment), strict=True):
        slope = (b - a) / (2.0 * CLOCK_STEP_S * sigmas[series.name])
        if series.kind == ms.ACCELERATION and len(edges):
            # Where a load begins or ends, the acceleration jumps and has no derivative.
            times = series.times_ns - segment.begin_ns + round(one[1].offset(series.topic) * 1e9)
            near = round(4e9 * CLOCK_STEP_S)
            slope[np.searchsorted(edges, times - near) < np.searchsorted(edges, times + near)] = 0.0
        column[part] = slope.ravel()
    return column
