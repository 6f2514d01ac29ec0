# SPDX-License-Identifier: MIT
"""Errors of the simulated IMU on ~/imu: white noise, and the biases of gyroscope and accelerometer.

The errors are a function of seed and stamp only, so they don't depend on who subscribes or when. White noise of density
N [unit/√Hz] has the standard deviation N√f at f samples per second. Motion, recordings and all other topics are exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.vectors import FloatArray
from ..parameters.declarations import Parameters

_WHITE, _BIAS = 0, 2


@dataclass(frozen=True)
class ImuNoise:
    """Noise of gyroscope [rad/s] and accelerometer [m/s²]. sigma (2,): standard deviation of a sample's white noise;
    its square is the published covariance, which leaves out the bias because a filter estimates it. bias (2, 3):
    constant error of each axis.
    """

    sigma: FloatArray
    bias: FloatArray
    seed: int

    def measured(self, time_ns: int, rate: Sequence[float], felt: Sequence[float]) -> list[list[float]]:
        """Angular velocity and specific force (3,) in body axes, as the IMU measures them."""
        errors = self.sigma[:, None] * _normal(self.seed, _WHITE, time_ns) + self.bias
        shown: list[list[float]] = (np.array([rate, felt]) + errors).tolist()
        return shown


def _normal(seed: int, kind: int, place: int) -> FloatArray:
    """Standard normal numbers (2, 3), independent for each kind and place."""
    bits = np.random.Philox(key=seed, counter=[0, 0, place, kind])
    return np.random.Generator(bits).standard_normal((2, 3))


def imu_noise(parameters: Parameters) -> ImuNoise | None:
    """The noise that the parameters define; None if all of it is zero."""
    numbers, seed = np.array(parameters.noise.imu), parameters.noise.seed
    if not numbers.any():
        return None
    sigma = numbers[:2] * math.sqrt(parameters.publish_rate)
    return ImuNoise(sigma, numbers[2:, None] * _normal(seed, _BIAS, 0), seed)
