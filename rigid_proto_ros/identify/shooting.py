# SPDX-License-Identifier: MIT
"""Multiple shooting: every segment of a flight has a start of its own, and all have the same body.

The residuals of a segment and their derivatives come from one compiled call that flies the body beside its variations.
Only what a least-squares step needs is kept of them: with [J r] = Q R, R alone, which has as many rows as there are
unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.compilation import njit
from ..base.errors import InputError
from ..base.rotation import exponential, multiply, normalize, rotate, rotate_inverse
from . import mass_parameters as mp
from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr
from .sensors import CODES, fill_columns, fill_residuals, fill_shift_columns, fill_time_column
from .triangles import upper_triangle
from .unknowns import Unknowns, Values
from .varied_flights import fly_variations

START = 12
"""Unknowns of a segment's start: position [m, world], turn [rad, world], velocity [m/s, body axes] and angular velocity
[rad/s, body axes]: so a turn about the vertical alone, which nothing shows of a flight without attitudes unless a load
along world axes acts, is one of them and changes nothing else.
"""
START_STEPS = np.array([0.0] * 3 + [mp.STEP] * 3 + [0.0] * 3 + [mp.STEP] * 3)
"""For difference quotients; how a flight shifts with its position and velocity is known in closed form."""
MOST_TURN = 20.0
"""Of a segment for whose difference quotients to one side the steps are short enough [rad]: their error is half of the
angle by which the flights end apart, 4e-5, and of longer turns too, as the steps are shorter then.
"""
OFFSET_STEP_S = 1e-5


@dataclass(frozen=True)
class Piece:
    """Samples of a series within a segment. weights (n,): of robust fits, else 1."""

    series: ms.Series
    topic: int
    times_ns: np.ndarray
    values: np.ndarray
    sigma: float
    weights: np.ndarray

    @cached_property
    def scale(self) -> np.ndarray:
        """Standard deviations for each unit, weighted, (n,)."""
        return np.sqrt(self.weights) / self.sigma

    @property
    def sensor(self) -> tuple[int, bool, bool]:
        """Kind, ``in_body`` and ``is_imu``, as the kernels of ``sensors`` take them."""
        return CODES[self.series.kind], self.series.in_body, self.series.is_imu


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

    @property
    def duration_s(self) -> float:
        """From its begin to the last sample [s]."""
        return 1e-9 * (max(int(piece.times_ns[-1]) for piece in self.pieces) - self.begin_ns)


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
                    times, values = series.times_ns[inside], np.ascontiguousarray(series.values[inside], float)
                    topic = topics.index(series.topic)
                    pieces.append(Piece(series, topic, times, values, sigma(series), weights(series)[inside]))
            if pieces:
                begin = int(first) - margin
                loads = flight.load_history.within(begin, int(last) + margin)
                segments.append(ShootingInterval(flight, begin, tuple(pieces), loads))
    return segments


@njit(cache=True, error_model="numpy")
def _move(starts: np.ndarray, changes: np.ndarray) -> None:
    for k in range(starts.shape[0]):
        start, change = starts[k], changes[k]
        qx, qy, qz, qw = start[3], start[4], start[5], start[6]
        u, v, w = rotate_inverse(qx, qy, qz, qw, start[7], start[8], start[9])
        turn = exponential(change[3], change[4], change[5])
        qx, qy, qz, qw = normalize(*multiply(turn[0], turn[1], turn[2], turn[3], qx, qy, qz, qw))
        start[3], start[4], start[5], start[6] = qx, qy, qz, qw
        u, v, w = rotate(qx, qy, qz, qw, u + change[6], v + change[7], w + change[8])
        start[7], start[8], start[9] = u, v, w
        for i in range(3):
            start[i] += change[i]
            start[10 + i] += change[9 + i]


def moved_starts(starts: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Starts (n, 13) of the tracked frame changed by (n, 12)."""
    moved = np.array(starts)
    _move(moved, changes)
    return moved


@njit(cache=True, error_model="numpy")
def _begin(rows: np.ndarray, starts: np.ndarray) -> None:
    """The start of the centre of mass of each of ``rows`` (n, FLOWN), from the tracked frame's (n, 13)."""
    for k in range(rows.shape[0]):
        row, start = rows[k], starts[k]
        x, y, z = row[tr.COM], row[tr.COM + 1], row[tr.COM + 2]
        wx, wy, wz = start[10], start[11], start[12]
        px, py, pz = rotate(start[3], start[4], start[5], start[6], x, y, z)
        u, v, w = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        vx, vy, vz = rotate(start[3], start[4], start[5], start[6], u, v, w)
        for i in range(13):
            row[tr.START + i] = start[i]
        row[tr.START] += px
        row[tr.START + 1] += py
        row[tr.START + 2] += pz
        row[tr.START + 7] += vx
        row[tr.START + 8] += vy
        row[tr.START + 9] += vz


def _body_rows(values: Sequence[Values]) -> np.ndarray:
    """Rows of ``trajectories.fly_rows`` (n, FLOWN) without their starts."""
    rows = np.zeros((len(values), tr.FLOWN))
    for row, v in zip(rows, values, strict=True):
        mass = v.body
        row[tr.MASS] = mass.mass
        row[tr.COM : tr.COM + 3] = mass.center_of_mass
        row[tr.INERTIA : tr.INERTIA + 9] = mass.inertia.ravel()
        row[tr.GRAVITY : tr.GRAVITY + 3] = v.gravity
        row[tr.LINEAR_DAMPING], row[tr.ANGULAR_DAMPING] = v.damping
    return rows


def flown_rows(starts: np.ndarray, values: Sequence[Values]) -> np.ndarray:
    """Rows of ``trajectories.fly_rows`` (n, FLOWN): starts (n, 13) of the tracked frame as those of the
    centre of mass.
    """
    rows = _body_rows(values)
    _begin(rows, starts)
    return rows


def _sensor_row(values: Values) -> np.ndarray:
    """(SENSOR,) of ``sensors``."""
    return np.concatenate([values.theta[mp.COM], values.imu_place, values.gyro_bias, values.accel_bias])


def _times(
    segment: ShootingInterval, offsets: Sequence[float], topic: int | None = None
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Times to look at, ascending from the segment's begin [ns], and for each piece, or each of one topic, which of
    them are its own.
    """
    pieces = [piece for piece in segment.pieces if topic in (None, piece.topic)]
    own = [piece.times_ns - segment.begin_ns + round(offsets[piece.topic] * 1e9) for piece in pieces]
    times, where = np.unique(np.maximum(np.concatenate(own), 0), return_inverse=True)
    ends = np.cumsum([len(part) for part in own])
    return times, np.split(where, ends[:-1])


def _flown(segment: ShootingInterval, start: np.ndarray, values: Values, times_ns: np.ndarray) -> np.ndarray | None:
    """Samples (m, SAMPLE) at times_ns (m,) from the segment's begin; None where the flight failed."""
    samples, good = tr.fly_rows(flown_rows(start[None], [values]), times_ns, segment.wrenches)
    return samples[0] if good.all() else None


def segment_residuals(segment: ShootingInterval, start: np.ndarray, values: Values) -> list[np.ndarray] | None:
    """Measured minus shown of each piece (m, 3), in its own unit; None where the flight failed."""
    times, where = _times(segment, values.offsets)
    samples = _flown(segment, start, values, times)
    if samples is None:
        return None
    sensor, found = _sensor_row(values), []
    for piece, own in zip(segment.pieces, where, strict=True):
        found.append(np.empty((len(own), 3)))
        fill_residuals(*piece.sensor, samples, own, sensor, piece.values, found[-1])
    return found


def flown_state(segment: ShootingInterval, start: np.ndarray, values: Values, time_ns: int) -> np.ndarray | None:
    """The tracked frame's state (13,) at a time within the segment, or None where the flight failed."""
    if time_ns == segment.begin_ns:
        return start
    samples = _flown(segment, start, values, np.array([time_ns - segment.begin_ns], np.int64))
    if samples is None:
        return None
    state, com = samples[0, :13], values.theta[mp.COM]
    state[7:10] -= rot.turned(state[3:7], rot.cross(state[10:13], com))
    state[:3] -= rot.turned(state[3:7], com)
    return state


def flown_poses(
    segment: ShootingInterval, start: np.ndarray, values: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,) [ns from the segment's begin] of all samples, and what the tracked frame's poses are there: positions
    (n, 3) [m] and attitudes (n, 4) xyzw; raises InputError where the flight failed.
    """
    times, _ = _times(segment, values.offsets)
    samples = _flown(segment, start, values, times)
    if samples is None:
        raise InputError("identify", "the estimate can't be simulated; see --from and --to")
    attitudes = samples[:, 3:7]
    return times, samples[:, :3] - rot.turned(attitudes, values.theta[mp.COM]), attitudes


class Variations:
    """Values and those beside them whose flights give difference quotients.

    central: to both sides, which costs twice as much. wider: by how much the steps are longer. turn: of a segment
    [rad], by which the steps of what changes its rate are shorter, so that flights end no farther apart.
    """

    def __init__(
        self, values: Values, unknowns: Unknowns, central: bool = True, wider: float = 1.0, turn: float = 0.0
    ) -> None:
        self.values, self.unknowns = values, unknowns
        shorter = min(1.0, MOST_TURN / turn) if turn > 0.0 else 1.0
        of_turn = np.array([shorter if name in ("theta", "tensor_change") else 1.0 for name, _ in unknowns.slots])
        start_widths = wider * START_STEPS * np.repeat([1.0, 1.0, 1.0, shorter], 3)
        widths = np.concatenate([start_widths, wider * of_turn * unknowns.steps(values)])
        sides = (1.0, -1.0) if central else (1.0,)
        base, each, changes = unknowns.read(values), [values], [np.zeros(START)]
        differences = []
        for column, width in enumerate(widths.tolist()):
            if width == 0.0 or (column >= START and unknowns.slots[column - START][0] == "offsets"):
                continue
            differences.append((column, len(each), len(each) + 1 if central else 0))
            for sign in sides:
                change, other = np.zeros(START), values
                if column < START:
                    change[column] = sign * width
                else:
                    numbers = base.copy()
                    numbers[column - START] += sign * width
                    other = unknowns.put(values, numbers)
                each.append(other)
                changes.append(change)
        self.differences = np.array(differences, np.int64)
        """Of each column that they give: which one, and the two variations whose difference it is."""
        self.widths = len(sides) * widths[self.differences[:, 0]]
        self.sensors = np.array([_sensor_row(one) for one in each])
        rows, moved = _body_rows(each), np.array(changes)
        # An IMU's biases and place change what it shows and not the flight.
        own = np.any(rows != rows[0], axis=1) | moved.any(axis=1)
        own[0] = True
        self.flights = np.where(own, np.cumsum(own) - 1, 0)
        """Which flight is that of each variation."""
        self._rows, self._changes = rows[own], moved[own]

    def rows(self, start: np.ndarray) -> np.ndarray:
        """Of each flight from about ``start`` (13,), as ``trajectories.fly_rows`` takes them."""
        rows = self._rows.copy()
        _begin(rows, moved_starts(np.repeat(start[None], len(rows), axis=0), self._changes))
        return rows


def linearized(segment: ShootingInterval, start: np.ndarray, variations: Variations) -> np.ndarray | None:
    """How the residuals of all pieces change with the start and the unknowns, and as the last row the residuals
    themselves: (12 + unknowns + 1, 3 m of all pieces), in units of the standard deviations, weighted.

    None where a flight failed.
    """
    values, unknowns = variations.values, variations.unknowns
    times, where = _times(segment, values.offsets)
    samples = fly_variations(variations.rows(start), times, segment.wrenches)
    if samples is None:
        return None
    rate, seconds = values.damping[0] / values.body.mass, 1e-9 * times
    columns = np.zeros((START + len(unknowns) + 1, 3 * segment.samples))
    first = 0
    for piece, own in zip(segment.pieces, where, strict=True):
        of_all = (variations.flights, variations.sensors, variations.differences, variations.widths)
        fill_columns(*piece.sensor, samples, own, *of_all, piece.values, piece.scale, columns, first)
        kind, in_body, _ = piece.sensor
        fill_shift_columns(kind, in_body, samples[0], own, seconds, rate, start, piece.scale, columns, first)
        first += 3 * len(own)
    present = {piece.topic for piece in segment.pieces}
    for k, (name, topic) in enumerate(unknowns.slots):
        if name == "offsets" and topic in present:
            _fill_offset(segment, start, variations, topic, columns[START + k])
    return columns


def _fill_offset(
    segment: ShootingInterval, start: np.ndarray, variations: Variations, topic: int, column: np.ndarray
) -> None:
    """How what a topic shows changes with its clock."""
    values, row, sides = variations.values, variations.rows(start)[:1], []
    for sign in (-1.0, 1.0):
        offsets = list(values.offsets)
        offsets[topic] += sign * OFFSET_STEP_S
        times, where = _times(segment, offsets, topic)
        samples, _ = tr.fly_rows(row, times, segment.wrenches)
        sides.append([samples[0, own] for own in where])
    first = 0
    both = iter(zip(*sides, strict=True))
    for piece in segment.pieces:
        part = column[first : first + 3 * len(piece.times_ns)]
        first += len(part)
        if piece.topic == topic:
            earlier, later = next(both)
            between_s = 2.0 * OFFSET_STEP_S
            fill_time_column(*piece.sensor, earlier, later, between_s, variations.sensors[0], piece.scale, part)
            # Where a load begins or ends an accelerometer's curve jumps, and says nothing about its slope.
            times = piece.times_ns - segment.begin_ns + round(values.offsets[topic] * 1e9)
            near = segment.wrenches.is_near_edge(times, round(2e9 * OFFSET_STEP_S))
            part.reshape(-1, 3)[near] = 0.0


def compressed(columns: np.ndarray, prior: np.ndarray | None = None) -> np.ndarray:
    """[J r] of ``linearized`` as an upper triangle (k, k) with the same products of its columns.

    prior (12,): standard deviations of what is assumed of the start beforehand, nothing without it.
    """
    diagonal = np.zeros(len(columns))
    if prior is not None:
        diagonal[:START] = 1.0 / prior
    return upper_triangle(columns, diagonal)
