# SPDX-License-Identifier: MIT
"""What each kind of sensor shows of a flight, and how far a sample is from that."""

from __future__ import annotations

import numpy as np

from . import measurements as ms
from . import rotations as rot
from . import trajectories as tr
from .unknowns import Values

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
    if series.kind == ms.VELOCITY:
        velocity = s[..., 7:10] - rot.turned(q, rot.cross(w, com))
        return rot.turned_back(q, velocity) if series.in_body else velocity
    if series.kind == ms.RATE:
        if not series.in_body:
            return rot.turned(q, w)
        return w + sensor[..., GYRO_BIAS] if series.is_imu else w
    # v' at the IMU less gravity: a + ω' × r + ω × (ω × r), all along body axes.
    arm = sensor[..., PLACE] - com
    felt, angular = s[..., tr.SPECIFIC_FORCE : tr.SPECIFIC_FORCE + 3], s[..., tr.ANGULAR_ACCELERATION : tr.SAMPLE]
    return felt + rot.cross(angular, arm) + rot.cross(w, rot.cross(w, arm)) + sensor[..., ACCEL_BIAS]


def difference(series: ms.Series, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """``other`` less ``one`` (..., 3); of attitudes the rotation vector from one to the other in body axes [rad]."""
    if series.kind == ms.ATTITUDE:
        return rot.logarithm(rot.product(rot.inverse(one), other))
    return other - one
