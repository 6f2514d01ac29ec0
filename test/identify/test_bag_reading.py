# SPDX-License-Identifier: MIT
"""Anybody's bags: types, frames, gaps, jitter and clocks; and one line for each that can't be used."""

from __future__ import annotations

from pathlib import Path

import calibration_study as study
import foreign_bags as fb
import measured_flights as mf
import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.identify import rotations as rot
from rigid_proto_ros.identify.bag_reading import Choice, bag_flight
from rigid_proto_ros.identify.identification import Identification, identify

INERTIA = np.diag([2.0, 3.0, 4.0]) * 1e-3
COM = (0.01, -0.02, 0.03)
EARTH = (0.0, 0.0, -9.81)
FORCE, TORQUE = (0.3, 0.5, 2.0), (0.01, 0.0, 0.02)


def _truth():
    return mf.values_of(0.5, COM, INERTIA, EARTH)


def _near(found: Identification) -> None:
    told = [found.mass, *found.center_of_mass, *found.inertia]
    true = [0.5, *COM, 2e-3, 0.0, 0.0, 3e-3, 0.0, 4e-3]
    errors = [(one.value - x) / one.sd for one, x in zip(told, true, strict=True)]
    assert np.abs(errors).max() < 4.5
    assert found.mass.sd < 0.02 * 0.5


def _thruster(rng: np.random.Generator, topic_frame: str) -> tuple[list, object]:
    """A body force from .5 to 1.2 s as 50 Hz messages with jitter, and the load that the messages say."""
    times = np.sort(0.5 + 0.02 * np.arange(36) + 0.004 * rng.random(36))
    times_ns = np.round(times * 1e9).astype(np.int64)
    messages = [(t, fb.wrench(t, FORCE, TORQUE, topic_frame)) for t in times_ns[:-1]]
    messages.append((times_ns[-1], fb.wrench(times_ns[-1], (0, 0, 0), (0, 0, 0), topic_frame)))
    begin, end = 1e-9 * times_ns[0], 1e-9 * times_ns[-1]
    return messages, mf.load_history((begin, end - begin, "body", (0.0, 0.0, 0.0), FORCE, TORQUE))


def test_odometry_with_gaps_and_jitter_beside_a_thruster_gives_the_body(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    messages, load = _thruster(rng, "base_link")
    times = np.sort(np.arange(0.0, 3.0, 0.01) + 0.003 * rng.random(300))[fb.keep(300, rng)]
    times_ns, samples = mf.flown(_truth(), mf.tumbling(), times, load)
    q, com = samples[:, 3:7], np.array(COM)
    p = samples[:, :3] - rot.turned(q, com) + 5e-4 * rng.standard_normal((len(times), 3))
    noisy = rot.product(q, rot.exponential(3e-3 * rng.standard_normal((len(times), 3))))
    odom = [(t, fb.odometry(t, *row)) for t, *row in zip(times_ns, p, noisy, strict=True)]
    bag = fb.write(
        tmp_path / "rov.mcap",
        {
            "/rov/odometry": ("nav_msgs/msg/Odometry", odom),
            "/rov/thrust": ("geometry_msgs/msg/WrenchStamped", messages),
        },
    )
    flight = bag_flight(bag, Choice())
    assert [series.kind for series in flight.series] == ["position", "attitude"]
    _near(identify([flight]))


def test_tf_and_an_imu_with_another_clock_give_the_body_and_the_clocks_offset(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    messages, load = _thruster(rng, "base_link")
    truth = _truth()
    flight = mf.with_imu(
        truth, mf.tumbling(), rng, 2.0, load, offset_s=0.013, place=(0.05, 0.0, 0.02), bias=(0.02, 0.1)
    )
    position, attitude, rate, acceleration = flight.series
    tf = []
    for t, p, q in zip(position.times_ns, position.values, attitude.values, strict=True):
        other = fb.transform(t, (1, 2, 3), (0, 0, 0, 1), "map", "camera")
        tf.append((t, {"transforms": [other, fb.transform(t, p, q, "map", "base_link")]}))
    imu = [(t, fb.imu(t, *row)) for t, *row in zip(rate.times_ns, rate.values, acceleration.values, strict=True)]
    bag = fb.write(
        tmp_path / "phone.mcap",
        {
            "/tf": ("tf2_msgs/msg/TFMessage", tf),
            "/phone/imu": ("sensor_msgs/msg/Imu", imu),
            "/thrust": ("geometry_msgs/msg/WrenchStamped", messages),
        },
    )
    choice = Choice({"pose": "/tf@base_link", "imu": "/phone/imu", "wrench": "/thrust"})
    fit = ("mass", "com", "inertia", "offset", "gyro_bias", "accel_bias", "imu_place")
    found = identify([bag_flight(bag, choice)], fit)
    _near(found)
    offset = found.others["offset of /phone/imu"]
    assert abs(offset.value - 0.013) < 4.5 * offset.sd
    assert offset.sd < 1e-3
    place = [found.others[f"imu_place.{axis}"] for axis in "xyz"]
    assert all(abs(one.value - x) < 4.5 * one.sd for one, x in zip(place, (0.05, 0.0, 0.02), strict=True))


def _pushed(tmp_path: Path, seed: int, shape: str, clock_s: float = 0.0) -> tuple[Path, Choice]:
    """A throw with a push of .05 s that was sampled at 500 Hz, by a clock that is behind."""
    rng = np.random.default_rng(seed)
    point, begin = "0.05,0.02,0.0", 0.4 + 0.002 * rng.random()

    def force(seconds: np.ndarray) -> np.ndarray:
        part = (seconds - begin) / 0.05
        strength = np.sin(np.pi * part) if shape == "half a sine" else 1.0
        return np.where((part > 0.0) & (part < 1.0), strength, 0.0)[:, None] * np.array(FORCE)

    steps = begin + 1e-4 * np.arange(500)
    pokes = [
        (t, 1e-4, "world", (0.05, 0.02, 0.0), f, (0, 0, 0)) for t, f in zip(steps, force(steps + 5e-5), strict=True)
    ]
    position, attitude = mf.mocap(_truth(), mf.tumbling(), rng, 1.0, load=mf.load_history(*pokes)).series
    stamps = np.arange(0.0, 1.0, 0.002)
    wrenches = [(round(1e9 * t), f) for t, f in zip(stamps - clock_s + 0.1, force(stamps), strict=True)]
    samples = zip(position.times_ns + 10**8, position.values, attitude.values, strict=True)
    topics = {
        "/pose": ("geometry_msgs/msg/PoseStamped", [(t, fb.pose(t, p, q)) for t, p, q in samples]),
        "/w": ("geometry_msgs/msg/WrenchStamped", [(t, fb.wrench(t, f, (0, 0, 0), "map")) for t, f in wrenches]),
    }
    return fb.write(tmp_path / "pushed.mcap", topics), Choice({"pose": "/pose", "wrench": f"/w@world@point/{point}"})


@pytest.mark.parametrize("shape", ["rectangle", "half a sine"])
def test_a_sampled_push_is_no_more_certain_than_its_samples(tmp_path: Path, shape: str) -> None:
    errors = []
    for seed in range(2):
        found = identify([bag_flight(*_pushed(tmp_path, seed, shape))])
        assert found.fits
        assert any(line.startswith("/w was sampled") for line in found.assumed)
        errors.append(study.normalised_errors(found, _truth()))
    assert np.mean(np.square(errors)) < 2.0  # .7; 30 as commands that hold from their stamps on


def test_the_clock_of_a_wrench_is_estimated_like_that_of_a_sensor(tmp_path: Path) -> None:
    found = identify(
        [bag_flight(*_pushed(tmp_path, 1, "rectangle", clock_s=0.03))], ("mass", "com", "inertia", "offset")
    )
    _near(found)
    assert abs(found.others["offset of /w"].value - 0.03) < 4.0 * found.others["offset of /w"].sd < 0.01


def _throw() -> list[tuple]:
    """Time [ns], position and attitude of samples."""
    position, attitude = mf.mocap(_truth(), mf.tumbling(), np.random.default_rng(3), 0.5).series
    return list(zip(position.times_ns, position.values, attitude.values, strict=True))


def _poses(tmp_path: Path, **others) -> Path:
    messages = [(t, fb.pose(t, p, q)) for t, p, q in _throw()]
    return fb.write(tmp_path / "bag.mcap", {"/pose": ("geometry_msgs/msg/PoseStamped", messages)} | others)


def test_a_stamp_of_zero_among_others_is_the_begin_of_simulated_time(tmp_path: Path) -> None:
    """Recorders log such messages at the time of day; without a single stamp that time counts."""
    messages = []
    for time_ns in range(0, 200_000_000, 10_000_000):
        message = fb.pose(time_ns, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        message["header"]["stamp"]["sec"] = 0
        messages.append((time_ns, message))
    bag = fb.write(tmp_path / "sim.mcap", {"/pose": ("geometry_msgs/msg/PoseStamped", messages)})
    assert np.array_equal(bag_flight(bag, Choice()).series[0].times_ns, np.arange(20) * 10_000_000)
    for _, message in messages:
        message["header"]["stamp"]["nanosec"] = 0
    bag = fb.write(tmp_path / "none.mcap", {"/pose": ("geometry_msgs/msg/PoseStamped", messages)})
    assert np.array_equal(bag_flight(bag, Choice()).series[0].times_ns, fb.EPOCH_NS + np.arange(20) * 10_000_000)


def test_transforms_without_a_tree_are_poses(tmp_path: Path) -> None:
    rows = [(t, fb.transform(t, p, q, "map", "drone")) for t, p, q in _throw()]
    bag = fb.write(tmp_path / "vicon.mcap", {"/vicon/drone": ("geometry_msgs/msg/TransformStamped", rows)})
    position, attitude = bag_flight(bag, Choice()).series
    assert (position.kind, attitude.kind) == ("position", "attitude")
    assert np.array_equal(position.values, [p for _, p, _ in _throw()])
    assert np.abs(attitude.values - [q for _, _, q in _throw()]).max() < 1e-15


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_folder_of_rosbag2_says_what_the_bare_file_does_and_a_broken_one_is_refused(
    tmp_path: Path, storage: StoragePlugin
) -> None:
    bag = _poses(tmp_path)
    folder = fb.as_folder(bag, tmp_path / "flown", storage)
    [file] = [one for one in folder.iterdir() if one.suffix != ".yaml"]
    expected = bag_flight(bag, Choice()).series
    for path in (folder, file):
        for one, other in zip(bag_flight(path, Choice()).series, expected, strict=True):
            assert one.name == other.name
            assert np.array_equal(one.times_ns, other.times_ns)
            assert np.array_equal(one.values, other.values)
    file.write_bytes(file.read_bytes()[:3000])
    with pytest.raises(InputError, match="a bag that rosbags can read"):
        bag_flight(file, Choice())


def test_a_bag_that_defines_poses_in_its_own_way_is_refused(tmp_path: Path) -> None:
    writer = Writer(str(tmp_path / "own.mcap"))
    writer.start(profile="ros2")
    schema = writer.register_schema(POSE, "ros2msg", b"float64 x")
    writer.add_message(writer.register_channel("/pose", "cdr", schema), 0, b"\0\1\0\0" + bytes(8), 0)
    writer.finish()
    with pytest.raises(InputError, match="no attribute 'header'"):
        bag_flight(tmp_path / "own.mcap", Choice())


POSE, IMU, WRENCH = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Imu", "geometry_msgs/msg/WrenchStamped"
THRUST = {"/w": (WRENCH, [(0, fb.wrench(0, FORCE, TORQUE, "thruster_7"))])}
NAN = [(t, fb.pose(t, (0, y, 0), (0, 0, 0, 1))) for t, y in ((0, 0.0), (10**8, np.nan))]
LATE = [(t, fb.imu(t, (0, 0, 0), (0, 0, 0))) for t in range(100 * 10**9, 101 * 10**9, 10**8)]


@pytest.mark.parametrize(
    ("others", "topics", "message"),
    [
        (THRUST, {"pose": "/nothing"}, "a topic of the bag: /pose"),
        (THRUST, {"pose": "/pose", "imu": "/pose"}, "it has no topic of such a type"),
        (THRUST, {"pose": "/pose@drone"}, f"/pose alone, since a {POSE} has no choice of frames"),
        (THRUST, {"pose": "/pose", "wrench": "/w"}, "in frame 'thruster_7'"),
        ({"/late": (IMU, LATE)}, {}, "clocks: got '/late begins 100 s after /pose"),
        ({"/pose": (POSE, NAN)}, {}, r"/pose: the message 0\.1 s after the first"),
        ({**THRUST, "/pose": (IMU, LATE)}, {}, "has no poses, transforms or odometry"),
    ],
)
def test_a_topic_that_cannot_be_used_is_named(tmp_path: Path, others: dict, topics: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        bag_flight(_poses(tmp_path, **others), Choice(topics))


def test_naming_one_topic_leaves_the_others_to_be_found(tmp_path: Path) -> None:
    pushes = [(t, fb.wrench(t, FORCE, TORQUE, "base")) for t in (0, 10**8)]
    bag = _poses(tmp_path, **{"/w": (WRENCH, pushes)})
    for topics in ({"wrench": "/w@body"}, {"pose": "/pose", "wrench": "/w@body"}):
        flight = bag_flight(bag, Choice(topics))
        assert flight.pose[0].topic == "/pose"
        assert len(flight.load_history.loads)
    with pytest.raises(InputError, match="/w in frame 'base'"):
        bag_flight(bag, Choice({"pose": "/pose"}))
    several = _poses(tmp_path, **{"/w": (WRENCH, pushes), "/v": (WRENCH, pushes)})
    with pytest.raises(InputError, match="several wrench topics, /v, /w; say which with --wrench"):
        bag_flight(several, Choice({"pose": "/pose"}))
