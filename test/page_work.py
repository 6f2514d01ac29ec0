# SPDX-License-Identifier: MIT
"""Counts the node's publish calls before a page listens to it, meanwhile and afterwards, and prints them as JSON."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter

import rclpy
from geometry_msgs.msg import PoseStamped
from node_work import SPIN, count_publications, steps_and_time
from rclpy.executors import SingleThreadedExecutor

from rigid_proto_ros.live.warm_up import warm_up
from rigid_proto_ros.ros.diagnostics import Reports
from rigid_proto_ros.ros.node import RigidBodyNode
from rigid_proto_ros.workbench.ros_link import RosLink

COUNTED_S = 1.2
"""[s] Diagnostics come once a second."""


def main() -> None:
    """One listener to the pose from first to last; the page's link comes and goes."""
    rclpy.init()
    counts: Counter[str] = Counter()
    node = RigidBodyNode(SPIN)
    node.states.pack_all(warm_up(node.loop.scenario.setup))
    count_publications(counts)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    listener = rclpy.create_node("listener")
    listener.create_subscription(PoseStamped, "/rigid_body/pose", lambda m: None, 10, raw=True)
    node.live.start()
    spinning.start()
    reports = Reports(node.diagnostics)
    reports.start()

    def count(twist_listeners: int) -> dict:
        deadline = time.monotonic() + 20.0
        while node.count_subscribers("/rigid_body/twist") != twist_listeners and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.3)
        counts.clear()
        began = steps_and_time(node)[1]
        time.sleep(COUNTED_S)
        return {"publications": dict(counts), "simulated_ns": steps_and_time(node)[1] - began}

    found = {"before": count(0)}
    link = RosLink("/rigid_body", lambda function, *arguments: None, lambda text: None, lambda values: None)
    link.listen()
    found["open"] = count(1)
    link.stop_listening()
    found["after"] = count(0)
    node.live.stop()
    reports.stop()
    executor.shutdown(timeout_sec=1.0)
    print(json.dumps(found))
    listener.destroy_node()
    link.close()


if __name__ == "__main__":
    main()
