# SPDX-License-Identifier: MIT
"""Sensors err as their data sheets say, alike for the same seed and stamp, and say honestly how much."""

import numpy as np
import pytest

from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.sensor_noise import (
    ACCELEROMETER,
    GYROSCOPE,
    LINEAR_VELOCITY,
    ORIENTATION,
    POSITION,
    SensorNoise,
    sensor_noise,
)
from rigid_proto_ros.session.messages import PROJECTIONS

ROW = [1.0, -2.0, 3.0, 0.5, 0.5, -0.5, 0.5, 4.0, 5.0, -6.0, 0.1, 0.2, -0.3]
ZERO = [0.0, 0.0, 0.0]
TIMES = [k * 10_000_000 for k in range(4000)]


def noise(seed: int = 5) -> SensorNoise:
    values = {"noise.imu": [2e-3, 3e-2, 0.3, 0.0], "noise.state": [1e-3, 1e-3, 1e-2, 0.0]}
    made = sensor_noise(make_scenario({"publish_rate": 100.0, "noise.seed": seed, **values}).parameters)
    assert made is not None
    return made


def test_without_noise_there_is_none() -> None:
    assert sensor_noise(make_scenario({}).parameters) is None


def test_white_noise_and_bias_are_what_the_parameters_say() -> None:
    own = noise()
    errors = np.array([own.imu(t, ZERO, ZERO)[0] for t in TIMES])
    # The bias is one of its own for each seed and axis.
    biases = np.array([noise(k).bias[GYROSCOPE] for k in range(500)])
    assert np.std(biases, axis=0) == pytest.approx([0.3] * 3, rel=0.15)
    assert errors.mean(axis=0) == pytest.approx(biases[5], abs=4 * 0.02 / 4000**0.5)
    assert errors.std(axis=0) == pytest.approx([0.02] * 3, rel=0.05)  # 2e-3 rad/s/√Hz at 100 Hz
    lagged = (errors[1:] - errors.mean(axis=0)) * (errors[:-1] - errors.mean(axis=0))
    assert np.abs(lagged.mean(axis=0)).max() < 4 * 0.02**2 / 4000**0.5


def test_an_error_belongs_to_seed_and_stamp_alone() -> None:
    one, again, other = noise(), noise(), noise(6)
    for time_ns in (2**45, 0, 10_000_000, 7_123_456_789, 2**40):
        again.imu(2**44 + time_ns, ROW[:3], ROW[3:6])  # whatever else was asked for before
        later = one.measured("odom", time_ns + 10_000_000, ROW)
        assert one.measured("odom", time_ns, ROW) == again.measured("odom", time_ns, ROW) != later
        assert one.measured("odom", time_ns, ROW) != other.measured("odom", time_ns, ROW)
        assert one.imu(time_ns, ROW[:3], ROW[3:6]) == again.imu(time_ns, ROW[:3], ROW[3:6])


def test_covariances_are_the_mean_squares_of_the_errors() -> None:
    own = noise()
    true = np.array(PROJECTIONS["odom"](ROW))
    told = np.array([PROJECTIONS["odom"](own.measured("odom", t, ROW)) for t in TIMES])
    # Velocities in the axes of the message err by their own noise alone, though the attitude errs.
    for sensor, part in ((POSITION, slice(0, 3)), (LINEAR_VELOCITY, slice(7, 10))):
        assert ((told[:, part] - true[part]) ** 2).mean() == pytest.approx(own.variance(sensor), rel=0.05)
    # Half the angle's square, from |q·q'| = cos(angle/2).
    cosines = np.minimum(1.0, np.abs(told[:, 3:7] @ true[3:7]))
    assert ((2.0 * np.arccos(cosines)) ** 2).mean() / 3.0 == pytest.approx(own.variance(ORIENTATION), rel=0.05)
    felt = np.array([own.imu(t, ZERO, ROW[:3])[1] for t in TIMES]) - ROW[:3]
    assert (felt**2).mean() == pytest.approx(own.variance(ACCELEROMETER), rel=0.05)
