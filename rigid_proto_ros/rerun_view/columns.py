# SPDX-License-Identifier: MIT
"""Small pieces that every writer of columns needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr

from . import entities as e

Send = Callable[[str, list[Any], Any], None]
"""Sends (entity, time columns, component columns) to whoever is to get them."""


def time_columns(times_ns: np.ndarray, walls_ns: np.ndarray) -> list[Any]:
    """Both timelines: simulated times (n,) and wall clock times (n,), in ns."""
    return [
        rr.TimeColumn(e.SIM_TIME, duration=np.asarray(times_ns, np.int64).astype("timedelta64[ns]")),
        rr.TimeColumn(e.ROS_TIME, timestamp=np.asarray(walls_ns, np.int64).astype("datetime64[ns]")),
    ]


def one_time(time_ns: int, wall_ns: int) -> list[Any]:
    """Both timelines for a single row."""
    return time_columns(np.array([time_ns]), np.array([wall_ns]))


def scalar_columns(values: np.ndarray) -> Any:
    """Scalars of the rows of values (n, k)."""
    return rr.Scalars.columns(scalars=np.ascontiguousarray(values).ravel()).partition([values.shape[1]] * len(values))


class Ticks:
    """Picks the states of a picture that needn't have every one: the first in each 1/rate s of simulated time."""

    def __init__(self, rate: int) -> None:
        self._period_ns = 1_000_000_000 // rate
        self._last: int | None = None

    def choose(self, times_ns: np.ndarray) -> np.ndarray:
        """Indices into times (n,) of the states to show."""
        ticks = times_ns // self._period_ns
        before = int(ticks[0]) - 1 if self._last is None else self._last
        self._last = int(ticks[-1])
        return np.flatnonzero(np.diff(ticks, prepend=before) > 0)
