# SPDX-License-Identifier: MIT
"""What was measured of flights: series of samples, the loads that acted, and what is known beforehand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..motion.loads import LOAD
from ..simulation.flight import IMPULSE, PULSE
from .trajectories import Wrenches

POSITION, ATTITUDE, VELOCITY, RATE, ACCELERATION = "position", "attitude", "velocity", "rate", "acceleration"
UNITS = {POSITION: "m", ATTITUDE: "rad", VELOCITY: "m/s", RATE: "rad/s", ACCELERATION: "m/s²"}


@dataclass(frozen=True)
class Series:
    """Samples of one quantity of one topic. kind: POSITION and the others. times_ns (n,) ascending; values (n, 3), or
    (n, 4) xyzw.

    in_body: velocities and rates are in axes of the tracked frame, else in the world's. All are of the tracked frame's
    origin but ACCELERATION and an IMU's RATE, which are of the place and in the axes of that sensor (``is_imu``).
    """

    topic: str
    kind: str
    times_ns: np.ndarray
    values: np.ndarray
    in_body: bool = False
    is_imu: bool = False

    @property
    def name(self) -> str:
        """Topic and quantity."""
        return f"{self.topic} {self.kind}"


@dataclass(frozen=True)
class LoadHistory:
    """Loads that acted: begin_ns (c,), end_ns (c,), the same for an impulse, and loads (c, LOAD), points
    in the tracked frame.
    """

    begin_ns: np.ndarray
    end_ns: np.ndarray
    loads: np.ndarray

    def within(self, first_ns: int, last_ns: int) -> Wrenches:
        """Those that act between two times, from the first on."""
        impulse = self.begin_ns == self.end_ns
        acts = (self.begin_ns < last_ns) & np.where(impulse, self.begin_ns >= first_ns, self.end_ns > first_ns)
        begin, end = np.maximum(self.begin_ns[acts], first_ns), np.minimum(self.end_ns[acts], last_ns)
        kinds = np.where(impulse[acts], IMPULSE, PULSE)
        order = np.argsort(begin, kind="stable")
        commands = np.stack([begin - first_ns, np.where(impulse[acts], 0, end - begin), kinds], axis=1)[order]
        return Wrenches(np.ascontiguousarray(commands, np.int64), np.ascontiguousarray(self.loads[acts][order]))


def no_loads() -> LoadHistory:
    """Of a free flight."""
    return LoadHistory(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, LOAD)))


@dataclass(frozen=True)
class MeasuredFlight:
    """One flight: where it is from, its series, the loads, gravity (3,) [m/s²] and damping [N s/m, N m s] as they are
    known.

    gravity_from and damping_from say from where.
    """

    name: str
    series: tuple[Series, ...]
    load_history: LoadHistory = field(default_factory=no_loads)
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    linear_damping: float = 0.0
    angular_damping: float = 0.0
    gravity_from: str = "from the scene"

    @property
    def begin_ns(self) -> int:
        """The first sample of all."""
        return min(int(series.times_ns[0]) for series in self.series)

    @property
    def end_ns(self) -> int:
        """The last sample of all."""
        return max(int(series.times_ns[-1]) for series in self.series)

    def first(self, kind: str, in_body: bool = False) -> Series | None:
        """The first series of a kind. in_body: along body axes alone."""
        return next((one for one in self.series if one.kind == kind and (one.in_body or not in_body)), None)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return 1e-9 * (self.end_ns - self.begin_ns)
