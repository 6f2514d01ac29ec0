# SPDX-License-Identifier: MIT
"""What ``ros2 bag record -s mcap`` leaves, from messages that a plain subscriber took off a real node.

rosbag2 itself isn't to be had from PyPI. The layout is that of its Jazzy release: profile ros2, a schema and a channel per
topic with its quality of service, messages logged at the time they were received.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer

from rigid_proto_ros.session.messages import DEFINITIONS, TOPICS

ODOMETRY = "nav_msgs/msg/Odometry"
RECORDED = {**TOPICS, "odom": ODOMETRY}
DEFINED = {**DEFINITIONS, ODOMETRY: "std_msgs/Header header\nstring child_frame_id\n"}
"""Odometry's own definition is longer; nothing here decodes it by its schema."""


@dataclass(frozen=True)
class Logged:
    """A message as a recorder has it."""

    topic: str
    type: str
    log_time: int
    data: bytes


class BagRecorder:
    """Subscribes to a node's topics before the node is there, and keeps every message's bytes."""

    def __init__(self, environment: dict[str, str], name: str = "rigid_body", topics: Iterable[str] = RECORDED) -> None:
        import rclpy
        from geometry_msgs.msg import InertiaStamped, PoseStamped, TwistStamped, WrenchStamped
        from nav_msgs.msg import Odometry
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from rclpy.signals import SignalHandlerOptions
        from std_msgs.msg import String

        types = {
            "scene": String,
            "events": String,
            "pose": PoseStamped,
            "twist": TwistStamped,
            "odom": Odometry,
            "applied": WrenchStamped,
            "inertia": InertiaStamped,
        }
        before = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = environment["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        try:
            self._context = rclpy.Context()
            domain = int(environment["ROS_DOMAIN_ID"])
            no_handlers = SignalHandlerOptions.NO
            rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=no_handlers)
            self._node = rclpy.create_node("bag_recorder", context=self._context)
        finally:
            if before is None:
                del os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
            else:
                os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = before
        self.messages: list[Logged] = []
        for topic in topics:
            durability = (
                DurabilityPolicy.TRANSIENT_LOCAL if topic in ("scene", "inertia") else DurabilityPolicy.VOLATILE
            )
            profile = QoSProfile(depth=1000, durability=durability)
            self._node.create_subscription(
                types[topic], f"/{name}/{topic}", self._keep(f"/{name}/{topic}", RECORDED[topic]), profile, raw=True
            )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _keep(self, topic: str, message_type: str):
        return lambda data: self.messages.append(Logged(topic, message_type, time.time_ns(), bytes(data)))

    def _spin(self) -> None:
        while not self._stop.is_set():
            self._executor.spin_once(timeout_sec=0.05)
        # What is here already and hasn't been taken.
        taken = -1
        while taken != len(self.messages):
            taken = len(self.messages)
            self._executor.spin_once(timeout_sec=0.2)

    def close(self) -> list[Logged]:
        """Stop, and return what was received."""
        self._stop.set()
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
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
