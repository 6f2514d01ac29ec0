# SPDX-License-Identifier: MIT
"""Runs the node in this process with counters on what it does, and prints them as JSON: python node_work.py SCENARIO."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from rigid_proto_ros.live.warm_up import warm_up
from rigid_proto_ros.ros.node import RigidBodyNode
from rigid_proto_ros.scene import cdr

SPIN = {"initial.angular_velocity": [0.05, 0.1, 12.0], "publish_rate": 500.0}
STATES = ("/rigid_body/pose", "/rigid_body/twist", "/rigid_body/odom", "/rigid_body/imu")


def main(scenario: str) -> None:
    """Fly for a simulated second and count in the next."""
    imported_before = sorted(name for name in ("rerun", "trimesh", "pyarrow") if name in sys.modules)
    rclpy.init()
    counts: Counter[str] = Counter()
    parameters = dict(SPIN) if scenario != "at_rest" else {"publish_rate": 500.0}
    node = RigidBodyNode(parameters)
    node.states.pack_all(warm_up(node.loop.scenario.setup))
    count_publications(counts)
    messages = count_messages(counts)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    listener = rclpy.create_node("listener")
    publisher = listener.create_publisher(WrenchStamped, "/rigid_body/wrench", QoSProfile(depth=100))
    if scenario == "listened_to":
        for message_type, topic in ((PoseStamped, "pose"), (TwistStamped, "twist"), (Odometry, "odom")):
            listener.create_subscription(message_type, f"/rigid_body/{topic}", lambda m: None, 10, raw=True)
        while publisher.get_subscription_count() == 0 or not all(map(subscribers(node), STATES[:3])):
            time.sleep(0.02)
    node.live.start()
    while steps_and_time(node)[1] < 1e9:
        executor.spin_once(timeout_sec=0.05)
    messages.clear()
    before, counts_before = look(node, counts)
    wrenches_before = node.live.commands.received["wrench"]
    while steps_and_time(node)[1] - before[1] < 1e9 or (
        scenario == "listened_to" and node.live.commands.received["wrench"] < wrenches_before + 30
    ):
        if scenario == "listened_to":
            publisher.publish(cdr.wrench_stamped(0, "world", (1e-4, 0.0, 0.0), (0.0, 0.0, 0.0)))
        time.sleep(0.02)
    after, counts = look(node, counts)
    node.live.stop()
    print(
        json.dumps(
            {
                "imported": imported_before + sorted(n for n in ("rerun", "trimesh", "pyarrow") if n in sys.modules),
                "steps": after[0] - before[0],
                "simulated_ns": after[1] - before[1],
                "publications": {topic: counts[topic] - counts_before[topic] for topic in STATES},
                "message_objects": dict(messages),
                "wrenches": node.live.commands.received["wrench"],
            }
        )
    )
    node.destroy_node()
    listener.destroy_node()
    rclpy.try_shutdown()


def subscribers(node: RigidBodyNode) -> Callable[[str], int]:
    """How many a topic has, as the node knows."""
    publishers = {publisher.topic_name: publisher for publisher in node.publishers}
    return lambda topic: publishers[topic].get_subscription_count()


def steps_and_time(node: RigidBodyNode) -> tuple[int, int]:
    """Committed steps and simulated time, read on the physics thread."""
    return node.call(lambda: (node.loop.simulation.steps, node.loop.simulation.time_ns))


def look(node: RigidBodyNode, counts: Counter) -> tuple[tuple[int, int], Counter]:
    """The same and the counts of one moment: states are published by the physics thread."""
    simulation = node.loop.simulation
    return node.call(lambda: ((simulation.steps, simulation.time_ns), Counter(counts)))


def count_publications(counts: Counter) -> None:
    """Count every publish call by topic."""
    publish = Publisher.publish

    def counted(self, message) -> None:
        counts[self.topic_name] += 1
        publish(self, message)

    Publisher.publish = counted


def count_messages(counts: Counter) -> Counter:
    """Count every message object of the types that a plain node would make in its steady state."""
    made: Counter[str] = Counter()
    for message_type in (PoseStamped, TwistStamped, Odometry, WrenchStamped):
        construct = message_type.__init__

        def counted(self, *args, _construct=construct, _name=message_type.__name__, **kwargs) -> None:
            made[_name] += 1
            _construct(self, *args, **kwargs)

        message_type.__init__ = counted
    return made


if __name__ == "__main__":
    main(sys.argv[1])
