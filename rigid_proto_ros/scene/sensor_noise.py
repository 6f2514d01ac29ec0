# SPDX-License-Identifier: MIT
"""Errors of the sensors that the node's messages stand for: white noise, and a gyroscope's and accelerometer's bias.

What a sensor errs is a function of seed and stamp alone: the same whoever listened when, and again in a replay. White
noise of density N [unit/√Hz] has the standard deviation N√f at f samples a second. Motion and recordings stay exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.elementary import cosine, sine
from ..base.rotation import rotate, rotate_inverse
from .parameters import Parameters

GYROSCOPE, ACCELEROMETER, POSITION, ORIENTATION, LINEAR_VELOCITY, ANGULAR_VELOCITY = range(6)
SENSORS = 6

_WHITE, _BIAS = 0, 2


@dataclass(frozen=True)
class SensorNoise:
    """sigma (SENSORS,): standard deviation of a sample's white noise; bias (SENSORS, 3): what each axis always errs."""

    sigma: np.ndarray
    bias: np.ndarray
    seed: int

    def measured(self, topic: str, time_ns: int, row: Sequence[float]) -> list[float]:
        """The state row (13,) as ``pose``, ``twist`` or ``odom`` publishes it.

        What is measured of the velocities errs in the axes that it is published in, and not by the error of the
        attitude, too.
        """
        errors = self._errors(time_ns)
        position = _sum(row[0:3], errors[POSITION])
        velocity = _sum(row[7:10], errors[LINEAR_VELOCITY])
        rate = _sum(row[10:13], errors[ANGULAR_VELOCITY])
        attitude = row[3:7] if topic == "twist" else _turned(row[3:7], errors[ORIENTATION])
        if topic == "odom":
            # The message has it in body axes: the true ones.
            x, y, z, w = attitude
            velocity = list(rotate(x, y, z, w, *rotate_inverse(row[3], row[4], row[5], row[6], *velocity)))
        return [*position, *attitude, *velocity, *rate]

    def imu(self, time_ns: int, rate: Sequence[float], felt: Sequence[float]) -> tuple[list[float], list[float]]:
        """Angular velocity [rad/s] and specific force [m/s²] (3,) in body axes, as the IMU tells them."""
        errors = self._errors(time_ns)
        return _sum(rate, errors[GYROSCOPE]), _sum(felt, errors[ACCELEROMETER])

    def variance(self, sensor: int) -> float:
        """Expected square of an axis's error, but for its bias, which a filter has to estimate."""
        return float(self.sigma[sensor]) ** 2

    def _errors(self, time_ns: int) -> list[list[float]]:
        """Of all sensors (SENSORS, 3)."""
        return (self.sigma[:, None] * _normal(self.seed, _WHITE, time_ns) + self.bias).tolist()


def _normal(seed: int, kind: int, place: int) -> np.ndarray:
    """Normal numbers (SENSORS, 3) of their own for each kind and place."""
    bits = np.random.Philox(key=seed, counter=[0, 0, place, kind])
    return np.random.Generator(bits).standard_normal((SENSORS, 3))


def _sum(values: Sequence[float], errors: Sequence[float]) -> list[float]:
    return [value + error for value, error in zip(values, errors, strict=True)]


def _turned(q: Sequence[float], turn: Sequence[float]) -> list[float]:
    """The attitude xyzw turned by a small rotation vector (3,) in body axes."""
    # Not by sum(), which adds otherwise from Python 3.12 on.
    angle = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
    if angle == 0.0:
        return list(q)
    s, w = sine(0.5 * angle) / angle, cosine(0.5 * angle)
    x, y, z = (s * component for component in turn)
    a, b, c, d = q
    return [
        a * w + d * x + b * z - c * y,
        b * w + d * y + c * x - a * z,
        c * w + d * z + a * y - b * x,
        d * w - a * x - b * y - c * z,
    ]


def sensor_noise(parameters: Parameters) -> SensorNoise | None:
    """The noise that the parameters ask for; None where they ask for none."""
    noise = parameters.noise
    density = np.array([*noise.imu[:2], *noise.state])
    bias = np.array([*noise.imu[2:], *np.zeros(SENSORS - 2)])
    if not density.any() and not bias.any():
        return None
    sigma = density * math.sqrt(parameters.publish_rate)
    return SensorNoise(sigma, bias[:, None] * _normal(noise.seed, _BIAS, 0), noise.seed)
