# SPDX-License-Identifier: MIT
"""A flight's loads as small pushes, whose sums are the integrals that the balance of momentum needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import loads as ld
from . import rotations as rot
from .poses import Poses

POINTS = 8
"""At which a load is looked at for each time between two samples, and at least."""
MOST_POINTS = 200


@dataclass(frozen=True)
class Pushes:
    """seconds (k,) ascending, impulses (k, 3) [N s, world], and angular ones about the tracked frame's origin (k, 3)
    [N m s, world]; where their forces attack is given by ``about``. in_body (k,): given along the body's axes.
    """

    seconds: np.ndarray
    impulses: np.ndarray
    angular: np.ndarray
    at_com: np.ndarray
    in_body: np.ndarray
    attitudes: np.ndarray

    def about(self, com: np.ndarray) -> np.ndarray:
        """Angular impulses (k, 3) about the centre of mass [N m s, world]."""
        moved = self.angular - rot.cross(rot.turned(self.attitudes, com), self.impulses)
        return np.where(self.at_com[:, None], self.angular, moved)

    def momentum(self, seconds: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Sums (n, 3) of ``pushes`` (k, 3) up to each time."""
        sums = np.vstack([np.zeros(3), np.cumsum(pushes, axis=0)])
        return sums[np.searchsorted(self.seconds, seconds, side="right")]

    def way(self, seconds: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """∬ F dt² (n, 3) up to each time [N s²]."""
        return self.momentum(seconds, impulses) * seconds[:, None] - self.momentum(
            seconds, impulses * self.seconds[:, None]
        )


def pushes_of(poses: Poses) -> Pushes:
    """Of the flight's loads, turned by its attitudes."""
    history, begin_ns = poses.flight.load_history, poses.flight.begin_ns
    begin, end = (1e-9 * (edge - begin_ns) for edge in (history.begin_ns, history.end_ns))
    apart = float(np.median(np.diff(poses.seconds)))
    counts = np.clip(np.ceil(POINTS * (end - begin) / apart), POINTS, MOST_POINTS).astype(int)
    counts[begin == end] = 1
    which = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = np.where(begin == end, 1.0, end - begin)[which] / counts[which]
    seconds = begin[which] + (end - begin)[which] * (number + 0.5) / counts[which]
    order = np.argsort(seconds, kind="stable")
    which, seconds, length = which[order], seconds[order], length[order, None]
    rows, attitudes = history.loads[which], poses.attitude_at(seconds)
    in_body = rows[:, ld.LOAD_AXES] != ld.WORLD_AXES
    force, torque = (
        np.where(in_body[:, None], rot.turned(attitudes, vectors), vectors)
        for vectors in (rows[:, ld.FORCE : ld.FORCE + 3], rows[:, ld.TORQUE : ld.TORQUE + 3])
    )
    has_point = rows[:, ld.HAS_POINT] != 0.0
    arm = np.where(has_point[:, None], rot.turned(attitudes, rows[:, ld.POINT : ld.POINT + 3]), 0.0)
    angular = length * (torque + rot.cross(arm, force))
    return Pushes(seconds, length * force, angular, ~has_point, in_body, attitudes)
