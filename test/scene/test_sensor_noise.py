# SPDX-License-Identifier: MIT
"""Sensors err as their data sheets say, alike for the same seed and stamp, and say honestly how much."""

from dataclasses import fields

import numpy as np
import pytest

from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.scene.parameters import NoiseParameters
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
RATE = 100.0
EVERYTHING = {
    "noise.gyroscope": [2e-3, 1e-3, 0.3],
    "noise.accelerometer": [3e-2],
    "noise.position": [1e-3],
    "noise.orientation": [1e-3],
    "noise.linear_velocity": [1e-2],
    "noise.seed": 5,
}


def noise(**changes) -> SensorNoise:
    made = sensor_noise(make_scenario({"publish_rate": RATE, **EVERYTHING, **changes}).parameters)
    assert made is not None
    return made


def gyroscope(own: SensorNoise, count: int, period_ns: int = 10_000_000) -> np.ndarray:
    """Errors (count, 3)."""
    zero = [0.0, 0.0, 0.0]
    return np.array([own.imu(k * period_ns, zero, zero)[0] for k in range(count)])


def test_without_noise_there_is_none() -> None:
    assert sensor_noise(make_scenario({}).parameters) is None
    assert all(not np.any(field.default) for field in fields(NoiseParameters))


def test_white_noise_and_bias_are_what_the_densities_say() -> None:
    own = noise(**{"noise.gyroscope": [2e-3, 0.0, 0.3]})
    errors = gyroscope(own, 4000)
    # The bias is one of its own for each seed and axis.
    biases = [
        noise(**{"noise.gyroscope": [0.0, 0.0, 0.3], "noise.seed": k}).imu(0, [0.0] * 3, [0.0] * 3)[0]
        for k in range(500)
    ]
    assert np.std(biases, axis=0) == pytest.approx([0.3] * 3, rel=0.15)
    assert errors.mean(axis=0) == pytest.approx(biases[5], abs=4 * 0.02 / 4000**0.5)
    assert errors.std(axis=0) == pytest.approx([0.02] * 3, rel=0.05)  # 2e-3 rad/s/√Hz at 100 Hz
    lagged = (errors[1:] - errors.mean(axis=0)) * (errors[:-1] - errors.mean(axis=0))
    assert np.abs(lagged.mean(axis=0)).max() < 4 * 0.02**2 / 4000**0.5


def test_a_walk_has_independent_steps_that_grow_with_the_root_of_time() -> None:
    for step_ns in (1_000_000_000, 10_000_000_000):
        walked = np.diff(gyroscope(noise(**{"noise.gyroscope": [0.0, 0.5]}), 3000, step_ns), axis=0)
        assert walked.std() == pytest.approx(0.5 * (step_ns * 1e-9) ** 0.5, rel=0.05)
        assert abs((walked[1:] * walked[:-1]).mean()) < 4 * walked.var() / 9000**0.5


def test_an_error_belongs_to_seed_and_stamp_alone() -> None:
    one, again, other = noise(), noise(), noise(**{"noise.seed": 6})
    for time_ns in (2**45, 0, 10_000_000, 7_123_456_789, 2**40):
        again.imu(2**44 + time_ns, ROW[:3], ROW[3:6])  # whatever else was asked for before
        later = one.measured("odom", time_ns + 10_000_000, ROW)
        assert one.measured("odom", time_ns, ROW) == again.measured("odom", time_ns, ROW) != later
        assert one.measured("odom", time_ns, ROW) != other.measured("odom", time_ns, ROW)
        assert one.imu(time_ns, ROW[:3], ROW[3:6]) == again.imu(time_ns, ROW[:3], ROW[3:6])


def test_covariances_are_the_mean_squares_of_the_errors() -> None:
    own, times = noise(), [k * 10_000_000 for k in range(4000)]
    true = {name: np.array(project(ROW)) for name, project in PROJECTIONS.items()}
    told = np.array([PROJECTIONS["odom"](own.measured("odom", t, ROW)) for t in times])
    pose = (told[:, :3] - true["odom"][:3]) ** 2
    assert pose.mean() == pytest.approx(own.variance(POSITION, 0), rel=0.05)
    # Velocities in the axes of the message err by their own noise alone, though the attitude errs.
    velocity = (told[:, 7:10] - true["odom"][7:10]) ** 2
    assert velocity.mean() == pytest.approx(own.variance(LINEAR_VELOCITY, 0), rel=0.05)
    angles = np.array([2.0 * np.linalg.norm(np.abs(_turn(t[3:7]))[:3]) for t in told])
    assert (angles**2).mean() / 3.0 == pytest.approx(own.variance(ORIENTATION, 0), rel=0.05)
    felt = np.array([own.imu(t, [0.0] * 3, ROW[:3])[1] for t in times]) - ROW[:3]
    assert (felt**2).mean() == pytest.approx(own.variance(ACCELEROMETER, 0), rel=0.05)
    assert own.variance(GYROSCOPE, 100 * 10**9) == pytest.approx(0.02**2 + 1e-6 * 100)


def _turn(attitude: np.ndarray) -> np.ndarray:
    """Vector part of the rotation from ROW's attitude."""
    q = np.array(ROW[3:7])
    x = np.array([*(-q[:3]), q[3]])
    vector = x[3] * attitude[:3] + attitude[3] * x[:3] + np.cross(x[:3], attitude[:3])
    assert np.linalg.norm(rotate(*attitude, 1.0, 0.0, 0.0)) == pytest.approx(1.0)
    return vector


def allan_deviation(rates: np.ndarray, size: int) -> float:
    """Of averages over so many samples."""
    means = rates[: len(rates) // size * size].reshape(-1, size, rates.shape[1]).mean(axis=1)
    return float(np.sqrt(0.5 * (np.diff(means, axis=0) ** 2).mean()))


@pytest.mark.stress
def test_allan_deviation_shows_density_and_walk_where_the_standard_has_them() -> None:
    density, walk = 2e-3, 1e-3
    rates = gyroscope(noise(**{"noise.gyroscope": [density, walk]}), 1_000_000)
    for seconds in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
        expected = np.sqrt(density**2 / seconds + walk**2 * seconds / 3.0)
        assert allan_deviation(rates, round(seconds * RATE)) == pytest.approx(expected, rel=0.15)
