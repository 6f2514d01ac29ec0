# SPDX-License-Identifier: MIT
"""An IMU errs as its data sheet says, alike for the same seed and stamp, and says honestly how much."""

import numpy as np
import pytest

from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.scene.sensor_noise import ImuNoise, imu_noise

ZERO = [0.0, 0.0, 0.0]


def noise(seed: int = 5) -> ImuNoise:
    values = {"publish_rate": 100.0, "noise.seed": seed, "noise.imu": [2e-3, 3e-2, 0.3, 0.0]}
    made = imu_noise(Parameters().replaced(values))
    assert made is not None
    return made


def test_without_noise_there_is_none() -> None:
    assert imu_noise(Parameters()) is None


def test_white_noise_and_bias_are_what_the_parameters_say() -> None:
    own = noise()
    told = np.array([own.measured(k * 10_000_000, ZERO, ZERO) for k in range(4000)])
    errors = told[:, 0]
    # The bias is one of its own for each seed and axis.
    biases = np.array([noise(k).bias[0] for k in range(500)])
    assert np.std(biases, axis=0) == pytest.approx([0.3] * 3, rel=0.15)
    assert errors.mean(axis=0) == pytest.approx(biases[5], abs=4 * 0.02 / 4000**0.5)
    assert errors.std(axis=0) == pytest.approx([0.02] * 3, rel=0.05)  # 2e-3 rad/s/√Hz at 100 Hz
    lagged = (errors[1:] - errors.mean(axis=0)) * (errors[:-1] - errors.mean(axis=0))
    assert np.abs(lagged.mean(axis=0)).max() < 4 * 0.02**2 / 4000**0.5
    # The covariance is the mean square but for the bias.
    squares = ((told - own.bias) ** 2).mean(axis=(0, 2))
    assert squares == pytest.approx(own.sigma**2, rel=0.05)


def test_an_error_belongs_to_seed_and_stamp_alone() -> None:
    one, again, other = noise(), noise(), noise(6)
    for time_ns in (2**45, 0, 10_000_000, 7_123_456_789, 2**40):
        again.measured(2**44 + time_ns, ZERO, ZERO)  # whatever else was asked for before
        told = one.measured(time_ns, ZERO, ZERO)
        assert told == again.measured(time_ns, ZERO, ZERO)
        assert told not in (other.measured(time_ns, ZERO, ZERO), one.measured(time_ns + 10_000_000, ZERO, ZERO))
