# SPDX-License-Identifier: MIT
"""The keys of a track: what a format with straight lines and slerp between keys is given, and how far it errs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .interpolation import Keys, attitude_angles, fewest_keys, rounded
from .sampling import Motion, Tolerance, Track, single

SHARE = 0.7
"""Of the tolerance, for keys that are left out; the rest is for what happens between two samples, and for rounding."""


@dataclass(frozen=True)
class PoseKeys:
    """Keys of one body: its centre of mass [m, world] and its attitude xyzw."""

    places: Keys
    attitudes: Keys

    def errors(self, times: np.ndarray, poses: np.ndarray) -> tuple[float, float]:
        """The largest error of what is played at times (n,) [s] against poses (n, 7): [m] and [rad]."""
        shown = ~np.isnan(poses[:, 0])
        if not shown.any():
            return 0.0, 0.0
        times, poses = times[shown], poses[shown]
        apart = np.linalg.norm(self.places.played(times) - poses[:, :3], axis=1)
        attitudes = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        return float(apart.max()), float(attitude_angles(self.attitudes.played(times), attitudes).max())


def pose_keys(motion: Motion, track: Track, tolerance: Tolerance | None) -> PoseKeys:
    """The fewest keys within the tolerance; all samples without one. At a change of what is drawn the centre of mass
    may jump: from one single-precision time to the next.
    """
    poses = _without_gaps(track.poses)
    times: list[np.ndarray] = []
    places: list[np.ndarray] = []
    attitudes: list[tuple[np.ndarray, np.ndarray]] = []
    spans = motion.spans(track)
    for number, span in enumerate(spans):
        own = motion.seconds[span.begin : span.end].copy()
        if number + 1 < len(spans):
            last = single(np.array([spans[number + 1].drawn.time_ns - motion.times_ns[0]]))[0]
            own[-1] = np.nextafter(np.float32(last), np.float32(-1.0))
        # Of samples at equal times, and of those that the end was moved before, the last counts.
        at = np.flatnonzero(np.append(np.minimum.accumulate(own[::-1])[::-1][1:] > own[:-1], True))
        own, rows = own[at], poses[span.begin : span.end][at]
        chosen = _all(own), _all(own)
        if tolerance is not None:
            chosen = (
                fewest_keys(own, rows[:, :3], SHARE * tolerance.position),
                fewest_keys(own, rows[:, 3:], SHARE * tolerance.angle),
            )
        times.append(own[chosen[0]])
        places.append(rows[chosen[0], :3])
        attitudes.append((own[chosen[1]], rows[chosen[1], 3:]))
    return PoseKeys(
        Keys(np.concatenate(times), rounded(np.concatenate(places))),
        Keys(np.concatenate([t for t, _ in attitudes]), rounded(np.concatenate([q for _, q in attitudes]))),
    )


def _all(times: np.ndarray) -> np.ndarray:
    return np.arange(len(times))


def _without_gaps(poses: np.ndarray) -> np.ndarray:
    """Poses (n, 7) with the nearest known one, of those before if there are, where there is none."""
    known = np.flatnonzero(~np.isnan(poses[:, 0]))
    at = np.clip(np.searchsorted(known, np.arange(len(poses)), side="right") - 1, 0, None)
    return poses[known[at]]
