# SPDX-License-Identifier: MIT
"""A flight's loads as small impulses, whose sums are the integrals that the balance of momentum needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import loads as ld
from . import measurements as ms
from . import rotations as rot

POINTS = 8
"""Impulses that stand for a load between two samples, and at least for each load."""
MOST_POINTS = 200


@dataclass(frozen=True)
class Impulses:
    """seconds (k,) ascending, impulses (k, 3) [N s, world], and angular ones about the tracked frame's origin (k, 3)
    [N m s, world], or about the centre of mass where ``at_com`` (k,); attitudes (k, 4): of the body then.
    """

    seconds: np.ndarray
    impulses: np.ndarray
    angular: np.ndarray
    at_com: np.ndarray
    attitudes: np.ndarray

    def about(self, com: np.ndarray) -> np.ndarray:
        """Angular impulses (k, 3) about the centre of mass [N m s, world]."""
        moved = self.angular - rot.cross(rot.turned(self.attitudes, com), self.impulses)
        return np.where(self.at_com[:, None], self.angular, moved)

    def momentum(self, seconds: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Sums (n, 3) of ``impulses`` (k, 3) up to each time."""
        sums = np.vstack([np.zeros(3), np.cumsum(impulses, axis=0)])
        return sums[np.searchsorted(self.seconds, seconds, side="right")]

    def path(self, seconds: np.ndarray) -> np.ndarray:
        """∬ F dt² (n, 3) up to each time [N s²]."""
        sums = self.momentum(seconds, self.impulses * self.seconds[:, None])
        return self.momentum(seconds, self.impulses) * seconds[:, None] - sums


def attitudes_at(seconds: np.ndarray, known_s: np.ndarray, attitudes: np.ndarray) -> np.ndarray:
    """Attitudes (m, 4) at times between the samples (n, 4) at ``known_s`` (n,)."""
    after = np.clip(np.searchsorted(known_s, seconds), 1, len(known_s) - 1)
    first, last = attitudes[after - 1], attitudes[after]
    part = np.clip((seconds - known_s[after - 1]) / (known_s[after] - known_s[after - 1]), 0.0, 1.0)
    return rot.product(first, rot.exponential(part[:, None] * rot.logarithm(rot.product(rot.inverse(first), last))))


def impulses_of(history: ms.LoadHistory, begin_ns: int, seconds: np.ndarray, attitudes: np.ndarray) -> Impulses:
    """Of a flight's loads, turned by its attitudes (n, 4) at seconds (n,) since ``begin_ns``."""
    begin, end = (1e-9 * (edge - begin_ns) for edge in (history.begin_ns, history.end_ns))
    apart = float(np.median(np.diff(seconds)))
    counts = np.clip(np.ceil(POINTS * (end - begin) / apart), POINTS, MOST_POINTS).astype(int)
    counts[begin == end] = 1
    which = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = np.where(begin == end, 1.0, end - begin)[which] / counts[which]
    middles = begin[which] + (end - begin)[which] * (number + 0.5) / counts[which]
    order = np.argsort(middles, kind="stable")
    middles, length = middles[order], length[order, None]
    rows, turns = history.loads[which[order]], attitudes_at(middles, seconds, attitudes)
    in_body = rows[:, ld.LOAD_AXES, None] != ld.WORLD_AXES
    force, torque = (
        np.where(in_body, rot.turned(turns, vectors), vectors)
        for vectors in (rows[:, ld.FORCE : ld.FORCE + 3], rows[:, ld.TORQUE : ld.TORQUE + 3])
    )
    has_point = rows[:, ld.HAS_POINT] != 0.0
    arm = np.where(has_point[:, None], rot.turned(turns, rows[:, ld.POINT : ld.POINT + 3]), 0.0)
    return Impulses(middles, length * force, length * (torque + rot.cross(arm, force)), ~has_point, turns)
