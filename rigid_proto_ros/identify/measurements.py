# SPDX-License-Identifier: MIT
"""Measurements of flights: series of samples, the loads that acted, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray
from ..motion.loads import LOAD
from ..simulation.commands import IMPULSE, PULSE
from . import rotations as rot
from .trajectories import Wrenches
from .unknowns import Values

POSITION, ATTITUDE, RATE, ACCELERATION = "position", "attitude", "rate", "acceleration"
UNITS = {POSITION: "m", ATTITUDE: "rad", RATE: "rad/s", ACCELERATION: "m/s²"}


@dataclass(frozen=True)
class Series:
    """Samples of one quantity of one topic. kind: POSITION, ATTITUDE, RATE or ACCELERATION. times_ns (n,): ascending.
    values (n, 3), or (n, 4) xyzw.

    POSITION and ATTITUDE are of the tracked frame in the world. RATE and ACCELERATION are an IMU's, in the axes of the
    tracked frame; the latter is at the place of the IMU.
    """

    topic: str
    kind: str
    times_ns: IntArray
    values: FloatArray

    @property
    def name(self) -> str:
        """Names of topic and quantity."""
        return f"{self.topic} {self.kind}"

    def within(self, first_ns: int, last_ns: int) -> Series:
        """The samples between two times, both included."""
        inside = slice(*np.searchsorted(self.times_ns, (first_ns, last_ns + 1)))
        return replace(self, times_ns=self.times_ns[inside], values=self.values[inside])


@dataclass(frozen=True)
class SampledChanges:
    """Times at which a sampled load changed between samples. before, after (e,): indices of the loads at each change,
    -1 for none. sds_s (e,): standard deviations of the times [s].
    """

    before: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    after: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    sds_s: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        return len(self.sds_s)


@dataclass(frozen=True)
class LoadHistory:
    """Loads that acted. begin_ns (c,), end_ns (c,): equal for an impulse. loads (c, LOAD): with points in the tracked
    frame. topic: whose clock gives these times; empty if they are exact.
    """

    begin_ns: IntArray
    end_ns: IntArray
    loads: FloatArray
    topic: str = ""
    changes: SampledChanges = field(default_factory=SampledChanges)

    def moved(self, offset_s: float, changes_s: FloatArray) -> LoadHistory:
        """The loads delayed by an offset. changes_s: additional delays of the sampled changes (e,); (0,) for none."""
        offset = round(1e9 * offset_s)
        begin, end = self.begin_ns + offset, self.end_ns + offset
        acts = np.ones(len(begin), bool)
        if changes_s.any():
            shifts = np.round(1e9 * changes_s).astype(np.int64)
            had, has = self.changes.before >= 0, self.changes.after >= 0
            end[self.changes.before[had]] += shifts[had]
            begin[self.changes.after[has]] += shifts[has]
            # A load that would end before it begins is dropped; it isn't an impulse.
            acts = (end > begin) | (self.begin_ns == self.end_ns)
        return LoadHistory(begin[acts], end[acts], self.loads[acts])

    def within(self, first_ns: int, last_ns: int) -> Wrenches:
        """The loads that act between two times, with times from the first."""
        impulse = self.begin_ns == self.end_ns
        acts = (self.begin_ns < last_ns) & np.where(impulse, self.begin_ns >= first_ns, self.end_ns > first_ns)
        begin, end = np.maximum(self.begin_ns[acts], first_ns), np.minimum(self.end_ns[acts], last_ns)
        kinds = np.where(impulse[acts], IMPULSE, PULSE)
        order = np.argsort(begin, kind="stable")
        commands = np.stack([begin - first_ns, np.where(impulse[acts], 0, end - begin), kinds], axis=1)[order]
        return Wrenches(np.ascontiguousarray(commands, np.int64), np.ascontiguousarray(self.loads[acts][order]))


def load_history(rows: Sequence[tuple[int, int, FloatArray]] = ()) -> LoadHistory:
    """The loads of (begin [ns], end [ns], load (LOAD,)); none for a free flight."""
    begin, end = (np.array([row[k] for row in rows], np.int64) for k in (0, 1))
    return LoadHistory(begin, end, np.array([row[2] for row in rows]).reshape(-1, LOAD))


@dataclass(frozen=True)
class MeasuredFlight:
    """One flight: its source, its series, the loads, and the known gravity (3,) [m/s²] and damping [N s/m, N m s].

    gravity_from: source of the gravity.
    """

    name: str
    series: tuple[Series, ...]
    load_history: LoadHistory = field(default_factory=load_history)
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    linear_damping: float = 0.0
    angular_damping: float = 0.0
    gravity_from: str = "from the scene"

    @property
    def begin_ns(self) -> int:
        """Time of the first sample [ns]."""
        return min(int(series.times_ns[0]) for series in self.series)

    @property
    def end_ns(self) -> int:
        """Time of the last sample [ns]."""
        return max(int(series.times_ns[-1]) for series in self.series)

    @property
    def duration_s(self) -> float:
        """Time from the first sample to the last [s]."""
        return 1e-9 * (self.end_ns - self.begin_ns)

    @property
    def pose(self) -> tuple[Series, Series]:
        """Positions and attitudes, with the same times, of the first topic that has both. Raises InputError if none
        has.
        """
        for attitude in self.series:
            for position in self.series:
                if (attitude.kind, position.kind, position.topic) == (ATTITUDE, POSITION, attitude.topic):
                    return position, attitude
        raise InputError("session", f"{self.name} has no poses", "poses, transforms or odometry")

    def from_first_position(self) -> MeasuredFlight:
        """The flight with positions relative to the first: far from the world's origin their size would determine the
        least noise.
        """
        first = self.pose[0].values[0]
        series = [replace(one, values=one.values - first) if one.kind == POSITION else one for one in self.series]
        return replace(self, series=tuple(series))

    def own(self, values: Values) -> Values:
        """``values`` with this flight's own gravity and damping, where each flight has its own."""
        gravity, damping = values.gravity, values.damping
        if "gravity" in values.by_flight:
            gravity = np.array(self.gravity, float)
        if "damping" in values.by_flight:
            damping = np.array([self.linear_damping, self.angular_damping])
        return replace(values, gravity=gravity, damping=damping)

    @cached_property
    def high_rate(self) -> float:
        """Angular speed that four of five samples don't exceed [rad/s]."""
        _, attitude = self.pose
        seconds = 1e-9 * np.diff(attitude.times_ns)
        return float(np.quantile(np.linalg.norm(rot.turns(attitude.values), axis=1) / seconds, 0.8))


def topics_of(flights: Sequence[MeasuredFlight]) -> list[str]:
    """Topics whose clocks may differ, those of poses first, since their clock is the reference."""
    poses = [flight.pose[0].topic for flight in flights]
    sensors = [series.topic for flight in flights for series in flight.series]
    loads = [flight.load_history.topic for flight in flights if flight.load_history.topic]
    return list(dict.fromkeys([*poses, *sensors, *loads]))
