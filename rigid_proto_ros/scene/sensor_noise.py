# SPDX-License-Identifier: MIT
"""Errors of the IMU that ~/imu stands for: white noise, and a gyroscope's and an accelerometer's bias.

What it errs is a function of seed and stamp alone: the same whoever listened when. White noise of density N [unit/√Hz]
has the standard deviation N√f at f samples a second. Motion, recordings and all other topics are exact.
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
    """Of gyroscope [rad/s] and accelerometer [m/s²]. sigma (2,): standard deviation of a sample's white noise; its
    square is the covariance, since a bias a filter has to estimate. bias (2, 3): what each axis always errs.
    """

    sigma: FloatArray
    bias: FloatArray
    seed: int

    def measured(self, time_ns: int, rate: Sequence[float], felt: Sequence[float]) -> list[list[float]]:
        """Angular velocity and specific force (3,) in body axes, as the IMU tells them."""
        errors = self.sigma[:, None] * _normal(self.seed, _WHITE, time_ns) + self.bias
        shown: list[list[float]] = (np.array([rate, felt]) + errors).tolist()
        return shown


def _normal(seed: int, kind: int, place: int) -> FloatArray:
    """Normal numbers (2, 3) of their own for each kind and place."""
    bits = np.random.Philox(key=seed, counter=[0, 0, place, kind])
    return np.random.Generator(bits).standard_normal((2, 3))


def imu_noise(parameters: Parameters) -> ImuNoise | None:
    """The noise that the parameters ask for; None where they ask for none."""
    numbers, seed = np.array(parameters.noise.imu), parameters.noise.seed
    if not numbers.any():
        return None
    sigma = numbers[:2] * math.sqrt(parameters.publish_rate)
    return ImuNoise(sigma, numbers[2:, None] * _normal(seed, _BIAS, 0), seed)
