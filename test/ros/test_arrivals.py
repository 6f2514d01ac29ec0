# SPDX-License-Identifier: MIT
"""Where rclpy lacks what is private, commands and steps come by ordinary callbacks, and the node says so."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from command_rig import wrench_message
from conftest import held_domain
from ros_client import RosClient, stamp_ns
from ros_process import start_node
from std_srvs.srv import Trigger

pytest.importorskip("rclpy")

import rclpy

from rigid_proto_ros.ros import arrivals

MS = 10**6


def test_by_callbacks_every_command_acts_and_every_step_is_answered(ros_environment, tmp_path):
    with held_domain() as domain:
        environment = {**ros_environment, "ROS_DOMAIN_ID": str(domain)}
        values = {"start_paused": True, "lockstep": True}
        node = start_node(environment, tmp_path / "node", values, name="plain_callbacks_node")
        client = RosClient(environment)
        try:
            node.wait_for("is simulating")
            assert "commands come by callbacks, which costs time: this rclpy has been changed for a test" in node.errors
            client.listen("twist", "events")
            client.advertise("wrench", "poke")
            for k in range(20):
                client.publish("wrench", wrench_message(0, "world", (1e-3, 0.0, 0.0)))
                client.until(lambda k=k: client.newest_ns("twist") == (k + 1) * 10 * MS, "the step")
            client.publish("poke", *(wrench_message(0, "world;impulse", (1e-3, 0.0, 0.0)) for _ in range(50)))
            client.until(lambda: len(client.events("poke")) == 50, "pokes")
            answer = client.call("step", Trigger)
            assert answer.success and answer.message == "simulated time is 0.21 s; 70 commands received"
            client.until(lambda: client.newest_ns("twist") == 210 * MS, "the step")
            assert stamp_ns(client.heard("twist", last=1)[0]) == 210 * MS
        finally:
            client.close()
            assert node.end() == 0, node.errors


@pytest.mark.parametrize(
    ("lacking", "reason"),
    [
        ({"Subscription": object}, "no take_message"),
        ({"Service": object}, "no service_take_request"),
        ({"WaitSet": lambda *_: None}, "other wait sets (AttributeError"),
    ],
)
def test_what_is_lacking_is_found_at_the_start(lacking, reason, ros_environment, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    rclpy.init()
    node = rclpy.create_node("lacking")
    assert arrivals.why_not_direct(node) == ""
    there = {name: getattr(arrivals.rclpy_implementation, name) for name in ("Subscription", "Service", "WaitSet")}
    monkeypatch.setattr(arrivals, "rclpy_implementation", SimpleNamespace(**{**there, **lacking}))
    assert arrivals.why_not_direct(node).startswith(reason)
    node.destroy_node()
    rclpy.try_shutdown()
