# SPDX-License-Identifier: MIT
"""Errors of the sensors that the node's messages stand for: white noise, and a bias that walks.

What a sensor errs is a function of seed and stamp alone: the same whoever listened when, and again in a replay. White
noise of density N [unit/√Hz] has the standard deviation N√f at f samples a second; a bias that walks with K
[unit/s/√Hz] has K√t after t seconds (IEEE Std 952, annex C).

Motion and recordings stay exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.elementary import cosine, sine
from ..base.rotation import rotate, rotate_inverse
from .parameters import Parameters

GYROSCOPE, ACCELEROMETER, POSITION, ORIENTATION, LINEAR_VELOCITY, ANGULAR_VELOCITY = range(6)
SENSORS = 6

_WHITE, _WALK, _BIAS = range(3)
SECOND = 1_000_000_000
PART = 1000
"""Seconds of a walk that are drawn at once."""


@dataclass
class SensorNoise:
    """sigma, walk, bias (SENSORS,): standard deviation of a sample, walk after a second and bias at time 0; seed."""

    sigma: np.ndarray
    walk: np.ndarray
    bias: np.ndarray
    seed: int
    _part: int = -1
    _knots: np.ndarray = field(default_factory=lambda: np.zeros((1, SENSORS, 3)))

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

    def variance(self, sensor: int, time_ns: int) -> float:
        """Expected square of an axis's error, but for the bias at time 0."""
        walk, sigma = float(self.walk[sensor]), float(self.sigma[sensor])
        return sigma * sigma + walk * walk * time_ns * 1e-9

    def _errors(self, time_ns: int) -> list[list[float]]:
        """Of all sensors (SENSORS, 3)."""
        errors = self.sigma[:, None] * self._normal(_WHITE, time_ns, 1)[0]
        errors += self.bias[:, None] * self._normal(_BIAS, 0, 1)[0]
        if self.walk.any():
            errors += self.walk[:, None] * self._walk(time_ns)
        return errors.tolist()

    def _walk(self, time_ns: int) -> np.ndarray:
        """Brownian motion [√s] (SENSORS, 3): drawn at whole seconds, straight between them."""
        second, rest_ns = divmod(time_ns, SECOND)
        part, first = divmod(second, PART)
        if part < self._part:
            self._part, self._knots = -1, np.zeros((1, SENSORS, 3))
        while self._part < part:
            self._part += 1
            steps = self._normal(_WALK, self._part, PART)
            self._knots = self._knots[-1] + np.concatenate([np.zeros((1, SENSORS, 3)), np.cumsum(steps, axis=0)])
        before, after = self._knots[first : first + 2]
        return before + (after - before) * (rest_ns / SECOND)

    def _normal(self, kind: int, place: int, count: int) -> np.ndarray:
        """Normal numbers (count, SENSORS, 3) of their own for each kind and place."""
        bits = np.random.Philox(key=self.seed, counter=[0, 0, place, kind])
        return np.random.Generator(bits).standard_normal((count, SENSORS, 3))


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
    profiles = (
        *(noise.gyroscope, noise.accelerometer, noise.position, noise.orientation),
        *(noise.linear_velocity, noise.angular_velocity),
    )
    table = np.zeros((SENSORS, 3))
    for sensor, profile in enumerate(profiles):
        table[sensor, : len(profile)] = profile
    if not table.any():
        return None
    density, walk, bias = table.T
    return SensorNoise(density * math.sqrt(parameters.publish_rate), walk, bias, noise.seed)
