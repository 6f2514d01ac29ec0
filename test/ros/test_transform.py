# SPDX-License-Identifier: MIT
"""What robot people expect beside pose and twist: /tf."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rigid_proto_ros.live.pacing import Stamps
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.ros.publishers import StatePublisher
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun


def test_the_transform_is_the_pose(monkeypatch):
    """tf2_msgs isn't in the wheels: its one message stands in, and a node that only makes publishers."""
    published = []

    def publisher(message_type, topic, *_, **__):
        sent = published.append if topic == "/tf" else lambda message: None
        return SimpleNamespace(publish=sent, get_subscription_count=lambda: 1)

    messages = SimpleNamespace(TFMessage=lambda transforms: SimpleNamespace(transforms=transforms))
    monkeypatch.setitem(sys.modules, "tf2_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    node = SimpleNamespace(create_publisher=publisher)
    states, run = StatePublisher(node, ("world", "body"), Stamps()), OfflineRun(make_scenario({}))
    states.configure(Parameters(publish_tf=True))
    state = State(3_000_000_007, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9, 0, 0, 0, 0, 0, 0]))
    run.simulation.state = state
    states.pack_all(run)
    assert not published
    assert states.find_subscribers()
    states.publish(run)
    states.configure(Parameters())
    states.find_subscribers()
    states.publish(run)
    ((transform,),) = (message.transforms for message in published)
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (3, 7)
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "body")
    t, r = transform.transform.translation, transform.transform.rotation
    assert [t.x, t.y, t.z, r.x, r.y, r.z, r.w] == state.row[:7].tolist()
