# SPDX-License-Identifier: MIT
"""Runs nodes in this process with counters on what they do, and prints them as JSON, by scenario."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher

from rigid_proto_ros.live.live_simulation import warm_up
from rigid_proto_ros.ros.node import RigidBodyNode
from rigid_proto_ros.scene import cdr

SPIN = {"initial.angular_velocity": [0.05, 0.1, 12.0], "publish_rate": 500.0}
SCENARIOS = {"alone": SPIN, "at_rest": {"publish_rate": 500.0}, "listened_to": SPIN}
LISTENED = {"pose": PoseStamped, "twist": TwistStamped, "odom": Odometry}

published: Counter[str] = Counter()
made: Counter[str] = Counter()


def count_calls(kind: type, method: str, counts: Counter[str], name) -> None:
    """Count every call of a method by what ``name(instance)`` says."""
    original = getattr(kind, method)

    def counted(self, *args, **kwargs) -> None:
        original(self, *args, **kwargs)
        counts[name(self)] += 1

    setattr(kind, method, counted)


def fly(scenario: str) -> dict:
    """Fly for a moment, and count in the next half second."""
    node = RigidBodyNode(SCENARIOS[scenario])
    node.states.pack_all(warm_up(node.live.loop.scenario.setup))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    other = rclpy.create_node("other")
    wrench = other.create_publisher(WrenchStamped, "/rigid_body/wrench", 100)
    heard = scenario == "listened_to"
    if heard:
        for topic, message_type in LISTENED.items():
            other.create_subscription(message_type, f"/rigid_body/{topic}", lambda m: None, 10, raw=True)
        own = [publisher for publisher in node.publishers if publisher.topic_name.rpartition("/")[2] in LISTENED]
        while not (wrench.get_subscription_count() and all(p.get_subscription_count() for p in own)):
            time.sleep(0.02)
    node.live.announce()
    node.live.start()

    def look() -> tuple[int, int, Counter, int]:
        """Steps, time and counts of one moment: states are published by the physics thread."""
        simulation, received = node.live.loop.simulation, node.live.loop.commands.received
        return node.live.call(lambda: (simulation.steps, simulation.time_ns, Counter(published), received["wrench"]))

    while look()[1] < 5e8:
        executor.spin_once(timeout_sec=0.05)
    made.clear()
    before = after = look()
    while after[1] - before[1] < 5e8 or (heard and after[3] - before[3] < 30):
        if heard:
            wrench.publish(cdr.wrench_stamped(0, "world", (1e-4, 0.0, 0.0), (0.0, 0.0, 0.0)))
        time.sleep(0.01)
        after = look()
    node.live.stop()
    node.destroy_node()
    other.destroy_node()
    return {
        "steps": after[0] - before[0],
        "simulated_ns": after[1] - before[1],
        "publications": {
            topic: after[2][f"/rigid_body/{topic}"] - before[2][f"/rigid_body/{topic}"] for topic in (*LISTENED, "imu")
        },
        "message_objects": dict(made),
        "wrenches": after[3] - before[3],
        "imported": [name for name in ("rerun", "trimesh", "pyarrow") if name in sys.modules],
    }


if __name__ == "__main__":
    rclpy.init()
    count_calls(Publisher, "publish", published, lambda publisher: publisher.topic_name)
    # The types that a plain node would make in its steady state.
    for message_type in (*LISTENED.values(), WrenchStamped):
        count_calls(message_type, "__init__", made, lambda message: type(message).__name__)
    print(json.dumps({scenario: fly(scenario) for scenario in SCENARIOS}))
    rclpy.try_shutdown()
