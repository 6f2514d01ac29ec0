# SPDX-License-Identifier: MIT
"""Errors of the sensors that the node's messages stand for: white noise, bias, its random walk, range and resolution.

What a sensor errs is a function of seed and stamp alone: the same whoever listened when, and again in a replay. White
noise of density N [unit/√Hz] has the standard deviation N√f at f samples a second; a bias that walks with K
[unit/s/√Hz] has K√t after t seconds (IEEE Std 952, annex C). The walk is Lévy's construction of Brownian motion: known
at the ends of an interval, it is drawn in the middle, down to a microsecond.

Motion and recordings stay exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import uint64

from ..base.compilation import njit
from ..base.elementary import cosine, logarithm, sine
from ..base.rotation import Vector, rotate, rotate_inverse
from .parameters import Parameters

GYROSCOPE, ACCELEROMETER, POSITION, ORIENTATION, LINEAR_VELOCITY, ANGULAR_VELOCITY = range(6)
SENSORS = 6

_ROOT = 61
"""The walk is drawn over 2⁶¹ ns, more than a stamp can hold, ..."""
_FINEST = 10
"""... and is straight within 2¹⁰ ns."""


@njit(cache=True)
def _scrambled(x: uint64) -> uint64:
    """The finalizer of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014)."""
    x = x + uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> uint64(27))) * uint64(0x94D049BB133111EB)
    return x ^ (x >> uint64(31))


@njit(cache=True)
def _normal(seed: int, channel: int, level: int, index: int) -> float:
    """A normal number that belongs to these four (Box, Muller, 1958)."""
    key = _scrambled(uint64(seed) ^ _scrambled(uint64(64 * channel + level)))
    key = _scrambled(key ^ uint64(index))
    first = (float(key >> uint64(11)) + 1.0) * 2.0**-53
    second = float(_scrambled(key) >> uint64(11)) * 2.0**-53
    return math.sqrt(-2.0 * logarithm(first)) * cosine(2.0 * math.pi * second)


@njit(cache=True)
def _walk(seed: int, channel: int, time_ns: int) -> float:
    """Brownian motion [√s] at a time."""
    begin, width_s = 0, 2.0**_ROOT * 1e-9
    left, right = 0.0, math.sqrt(width_s) * _normal(seed, channel, 0, 0)
    for level in range(_ROOT, _FINEST, -1):
        middle = begin + (1 << (level - 1))
        drawn = 0.5 * (left + right) + 0.5 * math.sqrt(width_s) * _normal(seed, channel, level, middle)
        width_s *= 0.5
        if time_ns >= middle:
            begin, left = middle, drawn
        else:
            right = drawn
    return left + (right - left) * ((time_ns - begin) / (1 << _FINEST))


@njit(cache=True)
def _errors(seed: int, time_ns: int, sigma: np.ndarray, walk: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Of all sensors (SENSORS, 3), before range and resolution."""
    errors = bias.copy()
    for sensor in range(SENSORS):
        for axis in range(3):
            channel = 3 * sensor + axis
            if sigma[sensor] > 0.0:
                errors[sensor, axis] += sigma[sensor] * _normal(seed, channel, 63, time_ns)
            if walk[sensor] > 0.0:
                errors[sensor, axis] += walk[sensor] * _walk(seed, channel, time_ns)
    return errors


@dataclass(frozen=True)
class SensorNoise:
    """sigma, walk (SENSORS,), bias (SENSORS, 3), range and resolution (SENSORS,), 0 for none; seed."""

    sigma: np.ndarray
    walk: np.ndarray
    bias: np.ndarray
    range: tuple[float, ...]
    resolution: tuple[float, ...]
    seed: int

    def measured(self, topic: str, time_ns: int, row: Sequence[float]) -> list[float]:
        """The state row (13,) as ``pose``, ``twist`` or ``odom`` publishes it.

        What is measured of the velocities errs in the axes that it is published in, and not by the error of the
        attitude, too.
        """
        errors = _errors(self.seed, time_ns, self.sigma, self.walk, self.bias).tolist()
        position = self._read(POSITION, row[0:3], errors)
        velocity = self._read(LINEAR_VELOCITY, row[7:10], errors)
        rate = self._read(ANGULAR_VELOCITY, row[10:13], errors)
        attitude = row[3:7] if topic == "twist" else _turned(row[3:7], errors[ORIENTATION])
        if topic == "odom":
            # The message has it in body axes: the true ones.
            x, y, z, w = attitude
            velocity = list(rotate(x, y, z, w, *rotate_inverse(row[3], row[4], row[5], row[6], *velocity)))
        return [*position, *attitude, *velocity, *rate]

    def imu(self, time_ns: int, rate: Sequence[float], felt: Sequence[float]) -> tuple[list[float], list[float]]:
        """Angular velocity [rad/s] and specific force [m/s²] (3,) in body axes, as the IMU tells them."""
        errors = _errors(self.seed, time_ns, self.sigma, self.walk, self.bias).tolist()
        return self._read(GYROSCOPE, rate, errors), self._read(ACCELEROMETER, felt, errors)

    def variance(self, sensor: int, time_ns: int) -> float:
        """Expected square of an axis's error, but for the constant bias and what lies beyond the range."""
        walk, sigma, step = float(self.walk[sensor]), float(self.sigma[sensor]), self.resolution[sensor]
        return sigma * sigma + walk * walk * time_ns * 1e-9 + step * step / 12.0

    def _read(self, sensor: int, values: Sequence[float], errors: list[list[float]]) -> list[float]:
        limit, resolution = self.range[sensor], self.resolution[sensor]
        read = [value + error for value, error in zip(values, errors[sensor], strict=True)]
        if limit:
            read = [max(-limit, min(limit, value)) for value in read]
        return [round(value / resolution) * resolution for value in read] if resolution else read


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
    imu, pose = parameters.imu_noise, parameters.pose_noise
    none: Vector = (0.0, 0.0, 0.0)
    # Density, walk, bias, range, resolution of each sensor.
    table: list[tuple[float, float, Vector, float, float]] = [
        (
            *(imu.gyroscope_density, imu.gyroscope_bias_walk, imu.gyroscope_bias),
            *(imu.gyroscope_range, imu.gyroscope_resolution),
        ),
        (
            *(imu.accelerometer_density, imu.accelerometer_bias_walk, imu.accelerometer_bias),
            *(imu.accelerometer_range, imu.accelerometer_resolution),
        ),
        (
            *(pose.position_density, pose.position_bias_walk, pose.position_bias),
            *(pose.position_range, pose.position_resolution),
        ),
        (pose.orientation_density, pose.orientation_bias_walk, pose.orientation_bias, 0.0, 0.0),
        (pose.linear_velocity_density, 0.0, none, 0.0, 0.0),
        (pose.angular_velocity_density, 0.0, none, 0.0, 0.0),
    ]
    if not any(density or walk or any(bias) or limit or step for density, walk, bias, limit, step in table):
        return None
    density, walk, bias, limits, resolution = zip(*table, strict=True)
    sigma = np.array(density) * math.sqrt(parameters.publish_rate)
    return SensorNoise(sigma, np.array(walk), np.array(bias), limits, resolution, parameters.noise_seed)
