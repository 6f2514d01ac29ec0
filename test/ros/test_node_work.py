# SPDX-License-Identifier: MIT
"""What a scene doesn't need isn't done: counted, not timed."""

from __future__ import annotations

import time
from collections import Counter

import pytest

pytest.importorskip("rclpy")

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher

from rigid_proto_ros.ros.node import RigidBodyNode
from rigid_proto_ros.scene import cdr

SPIN = {"initial.angular_velocity": [0.05, 0.1, 12.0], "publish_rate": 500.0}
LISTENED = {"pose": PoseStamped, "twist": TwistStamped, "odom": Odometry}


@pytest.fixture
def counts(ros_environment, monkeypatch):
    """How often each topic is published, and messages of which types are made: those of a plain node's steady state."""
    published: Counter[str] = Counter()
    made: Counter[str] = Counter()

    def count_calls(kind: type, method: str, counts: Counter[str], name) -> None:
        """Count every call of a method by what ``name(instance)`` says."""
        original = getattr(kind, method)

        def counted(self, *args, **kwargs) -> None:
            original(self, *args, **kwargs)
            counts[name(self)] += 1

        monkeypatch.setattr(kind, method, counted)

    count_calls(Publisher, "publish", published, lambda publisher: publisher.topic_name)
    for message_type in (*LISTENED.values(), WrenchStamped):
        count_calls(message_type, "__init__", made, lambda message: type(message).__name__)
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    rclpy.init()
    yield published, made
    rclpy.try_shutdown()


def fly(values: dict, counts: tuple[Counter, Counter], heard: bool = False) -> dict:
    """Fly for a moment, and count in the next half second. heard: by a subscriber who sends wrenches meanwhile."""
    published, made = counts
    node = RigidBodyNode(values)
    node.states.pack_all(node.live.loop)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    other = rclpy.create_node("other")
    wrench = other.create_publisher(WrenchStamped, "/rigid_body/wrench", 100)
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
    }


def test_without_subscribers_nothing_is_published_and_the_body_still_flies(counts):
    work = fly(SPIN, counts)
    assert set(work["publications"].values()) == {0}
    assert work["simulated_ns"] > 0.4e9
    # A free body crosses the time between two looks in one exact step: none is taken per publication period of 2 ms.
    assert work["steps"] <= 1
    assert work["message_objects"] == {}


def test_a_body_at_rest_takes_no_step(counts):
    work = fly({"publish_rate": 500.0}, counts)
    assert work["steps"] == 0
    assert work["simulated_ns"] > 0.4e9
    assert set(work["publications"].values()) == {0}


def test_the_steady_state_makes_no_message_objects(counts):
    work = fly(SPIN, counts, heard=True)
    published = work["publications"]
    # Odometry is subscribed too, the IMU is not.
    for topic in ("pose", "twist", "odom"):
        # One a period of 2 ms; the ends of the counted time cut one off.
        assert published[topic] == pytest.approx(work["simulated_ns"] / 2e6, abs=2), published
    assert published["imu"] == 0
    assert work["wrenches"] >= 30
    assert work["message_objects"] == {}
