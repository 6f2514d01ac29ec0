# SPDX-License-Identifier: MIT
"""What each kind of sensor would show of a flight, and how far its samples are from that."""

from __future__ import annotations

import numpy as np

from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr


def predicted(
    series: ms.Series, samples: np.ndarray, com: np.ndarray, place: np.ndarray, bias: np.ndarray
) -> np.ndarray:
    """What the series would show, (..., m, 3) or (..., m, 4), of samples (..., m, SAMPLE).

    com, place and bias (..., 1, 3): of the centre of mass and of the IMU in the tracked frame [m], and what the IMU
    adds.
    """
    q, w = samples[..., 3:7], samples[..., 10:13]
    if series.kind == ms.ATTITUDE:
        return q
    if series.kind == ms.POSITION:
        return samples[..., :3] - rot.turned(q, com)
    if series.kind == ms.VELOCITY:
        velocity = samples[..., 7:10] - rot.turned(q, rot.cross(w, com))
        return rot.turned_back(q, velocity) if series.in_body else velocity
    if series.kind == ms.RATE:
        return w + bias if series.in_body else rot.turned(q, w)
    arm = place - com
    angular = samples[..., tr.ANGULAR_ACCELERATION : tr.ANGULAR_ACCELERATION + 3]
    force = samples[..., tr.SPECIFIC_FORCE : tr.SPECIFIC_FORCE + 3]
    return force + rot.cross(angular, arm) + rot.cross(w, rot.cross(w, arm)) + bias


def deviation(kind: str, shown: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Measured minus shown (..., m, 3); of attitudes the rotation vector between them, in the body's axes."""
    if kind == ms.ATTITUDE:
        return rot.logarithm(rot.product(rot.inverse(shown), measured))
    return measured - shown
