# SPDX-License-Identifier: MIT
"""What ``ros2 bag record -s mcap`` leaves, from messages that a plain subscriber took off a real node.

rosbag2 itself isn't to be had from PyPI. The layout is that of its Jazzy release: profile ros2, a schema and a channel per
topic with its quality of service, messages logged at the time they were received.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_client import LATCHED, TOPICS, RosClient

from rigid_proto_ros.session.messages import DEFINITIONS
from rigid_proto_ros.session.messages import TOPICS as WRITTEN

ODOMETRY = "nav_msgs/msg/Odometry"
RECORDED = {**WRITTEN, "odom": ODOMETRY}
DEFINED = {**DEFINITIONS, ODOMETRY: "std_msgs/Header header\nstring child_frame_id\n"}
"""Odometry's own definition is longer; nothing here decodes it by its schema."""


@dataclass(frozen=True)
class Logged:
    """A message as a recorder has it."""

    topic: str
    type: str
    log_time: int
    data: bytes


class BagRecorder(RosClient):
    """Subscribes to a node's topics before the node is there, and keeps every message's bytes."""

    def __init__(self, environment: dict[str, str], name: str = "rigid_body", topics: Iterable[str] = RECORDED) -> None:
        super().__init__(environment, f"/{name}")
        self.messages: list[Logged] = []
        for topic in topics:
            latched = DurabilityPolicy.TRANSIENT_LOCAL if topic in LATCHED else DurabilityPolicy.VOLATILE
            self.own.create_subscription(
                TOPICS[topic], self.name(topic), self._keep(topic), QoSProfile(depth=1000, durability=latched), raw=True
            )

    def _keep(self, topic: str):
        name, message_type = self.name(topic), RECORDED[topic]
        return lambda data: self.messages.append(Logged(name, message_type, time.time_ns(), bytes(data)))

    def finish(self) -> list[Logged]:
        """After the node's end: take what is here already, stop, and return what was received."""
        taken = -1
        while taken != len(self.messages):
            taken = len(self.messages)
            time.sleep(0.2)
        self.close()
        return self.messages


def write_bag_file(
    path: Path,
    messages: list[Logged],
    *,
    compression: CompressionType = CompressionType.NONE,
    chunked: bool = True,
    chunk_size: int = 768 * 1024,
    finish: bool = True,
) -> None:
    """One .mcap file as rosbag2_storage_mcap writes it; its default is chunks without compression."""
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=compression, use_chunking=chunked)
        writer.start(profile="ros2", library="libmcap 1.3.0")
        channels: dict[str, int] = {}
        schemas: dict[str, int] = {}
        for message in messages:
            if message.topic not in channels:
                if message.type not in schemas:
                    schemas[message.type] = writer.register_schema(
                        message.type, "ros2msg", DEFINED[message.type].encode()
                    )
                qos = {"offered_qos_profiles": "- history: unknown\n  depth: 0\n  reliability: reliable\n"}
                channels[message.topic] = writer.register_channel(
                    message.topic, "cdr", schemas[message.type], {**qos, "topic_type_hash": "RIHS01_0"}
                )
            writer.add_message(channels[message.topic], message.log_time, message.data, message.log_time)
        if finish:
            writer.add_metadata("rosbag2", {"serialized_metadata": "version: 9\n"})
            writer.finish()
        else:
            writer.flush()


def write_bag(folder: Path, messages: list[Logged], *, files: int = 1, **options) -> Path:
    """A bag's folder; ``files`` as after splitting."""
    folder.mkdir()
    size = -(-len(messages) // files)
    for k in range(files):
        write_bag_file(folder / f"{folder.name}_{k}.mcap", messages[k * size : (k + 1) * size], **options)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    return folder
