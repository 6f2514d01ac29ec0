# SPDX-License-Identifier: MIT
"""What robot people expect beside pose and twist: an IMU at a contact, and /tf."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from command_rig import wrench_message
from ros_client import stamp_ns
from scipy.spatial.transform import Rotation

pytest.importorskip("rclpy")

from rigid_proto_ros.live.pacing import Stamps
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.ros.publishers import StatePublisher
from rigid_proto_ros.scene.parameters import Parameters
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun

SECOND = 10**9


def numbers(vector: dict) -> np.ndarray:
    return np.array([vector[k] for k in ("x", "y", "z")])


def felt(body, arm, attitude, rate, force_world) -> np.ndarray:
    """Specific force, body axes, at ``arm`` (m from the COM) of a body that falls under a force at its COM.

    Gravity accelerates body and reference alike, so it isn't felt. rate: angular velocity, body axes.
    """
    turning = np.linalg.solve(body.inertia, -np.cross(rate, body.inertia @ rate))
    at_com = Rotation.from_quat(attitude).inv().apply(force_world) / body.mass
    return at_com + np.cross(turning, arm) + np.cross(rate, np.cross(rate, arm))


def test_the_imu_feels_the_exact_specific_force_at_its_contact_and_turns_at_the_body_rate(rig):
    force = np.array([0.0, 0.02, 0.01])
    rig.set(imu_contact="left", gravity=[0.0, 0.0, -9.81], scale=[1.5, 0.8, 2.0], wrench_timeout=0.0)
    rig.listen("imu")
    rig.start_over(paused=True)
    rig.until(lambda: rig.heard("imu"), "the node to know that somebody listens")
    rig.forget("imu")
    rig.publish("wrench", wrench_message(SECOND // 2, "world@com", force))
    rig.until_received(rig.sent)
    rig.pause(False)
    for topic in ("odom", "imu"):
        rig.until(lambda topic=topic: rig.newest_ns(topic) >= SECOND * 7 // 10, f"{topic} of that time")
    body = make_scenario({**rig.scene, "scale": [1.5, 0.8, 2.0]}).setup.body
    arm = body.point(rig.scene["contacts.left"])
    odometry = {stamp_ns(m): m["twist"]["twist"] for m in rig.heard("odom")}
    measured = {stamp_ns(m): m for m in rig.heard("imu")}
    moments = [ns for ns in measured if 0 < ns <= SECOND * 7 // 10 and ns in odometry]
    assert sum(ns <= SECOND // 2 for ns in moments) > 10
    assert sum(ns > SECOND // 2 for ns in moments) > 5
    for ns in moments:
        message = measured[ns]
        assert message["header"]["frame_id"] == "rigid_body/left"
        rate, attitude = numbers(message["angular_velocity"]), list(message["orientation"].values())
        assert message["angular_velocity"] == odometry[ns]["angular"]
        expected = felt(body, arm, attitude, rate, force if ns > SECOND // 2 else np.zeros(3))
        assert np.linalg.norm(expected) > 1.0
        # Measured 2e-15.
        assert numbers(message["linear_acceleration"]) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    # At the centre of mass a body in free fall feels nothing but the force. It is mounted there from the very time on
    # at which the command acts.
    rig.trigger("clear_wrench")
    now_ns = int(rig.diagnostics()["sim_time_ns"])
    rig.forget("imu")
    moved_ns = now_ns + SECOND // 5
    rig.schedule(f"{{t: {moved_ns / SECOND!r}, set: {{imu_contact: ''}}}}")
    rig.until(lambda: rig.newest_ns("imu") > moved_ns + SECOND // 10, "the COM's")
    for message in rig.heard("imu"):
        at_com, place = message["header"]["frame_id"] == "rigid_body", stamp_ns(message)
        assert at_com == (place > moved_ns) or place == moved_ns
        if place > now_ns + SECOND // 10:
            assert (np.abs(numbers(message["linear_acceleration"])).max() == 0.0) == at_com


@pytest.fixture
def tf2_stand_in(monkeypatch):
    """tf2_msgs isn't in the wheels: its one message stands in, and a node that only makes publishers. What goes out on
    /tf.
    """
    published = []

    def publisher(message_type, topic, *_, **__):
        sent = published.append if topic == "/tf" else lambda message: None
        return SimpleNamespace(publish=sent, get_subscription_count=lambda: 1)

    messages = SimpleNamespace(TFMessage=lambda transforms: SimpleNamespace(transforms=transforms))
    monkeypatch.setitem(sys.modules, "tf2_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", messages)
    return SimpleNamespace(create_publisher=publisher), published


def test_the_transform_is_the_pose(tf2_stand_in):
    node, published = tf2_stand_in
    states = StatePublisher(node, ("world", "body"), OfflineRun(make_scenario({})), Stamps())
    states.configure(Parameters(publish_tf=True))
    state = State(3 * SECOND + 7, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.9, 0, 0, 0, 0, 0, 0]))
    states.pack_all(state)
    assert not published
    assert states.find_subscribers()
    states.publish(state)
    states.configure(Parameters())
    states.find_subscribers()
    states.publish(state)
    (transform,) = published[0].transforms
    assert len(published) == 1
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (3, 7)
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "body")
    t, r = transform.transform.translation, transform.transform.rotation
    assert [t.x, t.y, t.z, r.x, r.y, r.z, r.w] == state.row[:7].tolist()
