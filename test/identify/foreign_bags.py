# SPDX-License-Identifier: MIT
"""Bags as other people's robots record them, written by mcap_ros2: their own topic names, rates, gaps,
jitter and clocks.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
EPOCH_NS = 1_760_000_000_000_000_000


def xyz(vector: Any) -> dict:
    return dict(zip("xyz", map(float, vector), strict=True))


def xyzw(q: Any) -> dict:
    return dict(zip("xyzw", map(float, q), strict=True))


def header(time_ns: int, frame_id: str) -> dict:
    seconds, nanoseconds = divmod(EPOCH_NS + int(time_ns), 10**9)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame_id}


def pose(time_ns: int, p: Any, q: Any, frame: str = "map") -> dict:
    return {"header": header(time_ns, frame), "pose": {"position": xyz(p), "orientation": xyzw(q)}}


def transform(time_ns: int, p: Any, q: Any, frame: str, child: str) -> dict:
    moved = {"translation": xyz(p), "rotation": xyzw(q)}
    return {"header": header(time_ns, frame), "child_frame_id": child, "transform": moved}


def wrench(time_ns: int, force: Any, torque: Any, frame: str) -> dict:
    return {"header": header(time_ns, frame), "wrench": {"force": xyz(force), "torque": xyz(torque)}}


def odometry(time_ns: int, p: Any, q: Any) -> dict:
    return {
        "header": header(time_ns, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": {"position": xyz(p), "orientation": xyzw(q)}, "covariance": [0.0] * 36},
        "twist": {"twist": {"linear": xyz((0, 0, 0)), "angular": xyz((0, 0, 0))}, "covariance": [0.0] * 36},
    }


def imu(time_ns: int, rate: Any, acceleration: Any) -> dict:
    return {
        "header": header(time_ns, "imu_link"),
        "orientation": xyzw((0, 0, 0, 1)),
        "orientation_covariance": [-1.0] + [0.0] * 8,
        "angular_velocity": xyz(rate),
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": xyz(acceleration),
        "linear_acceleration_covariance": [0.0] * 9,
    }


def write(path: Path, topics: dict[str, tuple[str, list[tuple[int, dict]]]]) -> Path:
    """A bag of topics: type, and (time [ns], message) each."""
    with open(path, "wb") as stream:
        writer = McapWriter(stream)
        for topic, (message_type, messages) in topics.items():
            schema = writer.register_msgdef(message_type, STORE.generate_msgdef(message_type, ros_version=2)[0])
            for number, (time_ns, message) in enumerate(messages):
                stamp = EPOCH_NS + int(time_ns)
                writer.write_message(topic, schema, message, stamp, stamp, number)
        writer.finish()
    return path


def as_folder(bag: Path, folder: Path, storage: StoragePlugin) -> Path:
    """The same messages as ``ros2 bag record`` would have kept them in one of its storages."""
    with AnyReader([bag]) as reader, Writer(folder, version=9, storage_plugin=storage) as writer:
        made = {
            one.id: writer.add_connection(one.topic, one.msgtype, typestore=reader.typestore)
            for one in reader.connections
        }
        for connection, time_ns, data in reader.messages():
            writer.write(made[connection.id], time_ns, data)
    return folder


def keep(count: int, rng: np.random.Generator) -> np.ndarray:
    """Which samples came through: a fifth is lost, and a gap of a tenth of all."""
    kept = rng.random(count) > 0.2
    kept[count // 2 : count // 2 + count // 10] = False
    return kept
