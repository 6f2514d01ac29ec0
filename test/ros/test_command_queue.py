# SPDX-License-Identifier: MIT
"""What the node uses of rclpy beyond its public interface: an upgrade that breaks it is named here, in a line."""

from __future__ import annotations

import inspect
import time

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.subscription import Subscription
from ros_process import READY_S

from rigid_proto_ros.ros.command_queue import ManualCallbackGroup, RequestQueue

SAYS = "this release of rclpy differs from 7.1.6 in what rigid_proto_ros uses beyond the public interface: "


def parameters(function) -> list[str]:
    return list(inspect.signature(function).parameters)


def test_an_executor_asks_the_callback_group_of_a_subscription_before_it_serves_it():
    for method in ("can_execute", "beginning_execution", "ending_execution"):
        assert parameters(getattr(CallbackGroup, method)) == ["self", "entity"], f"{SAYS}CallbackGroup.{method}"


def test_messages_can_be_taken_from_a_subscription_without_an_executor(ros_domain_id):
    from std_msgs.msg import String

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = rclpy.create_node("taken", context=context)
    try:
        subscription: Subscription = node.create_subscription(String, "~/text", lambda message: None, 10, raw=True)
        publisher = node.create_publisher(String, "~/text", 10)
        while not (publisher.get_subscription_count() and subscription.get_publisher_count()):
            time.sleep(0.001)
        publisher.publish(String(data="hello"))
        with subscription.handle:
            while (taken := subscription.handle.take_message(String, True)) is None:
                time.sleep(0.001)
        assert bytes(taken[0]).endswith(b"hello\0"), f"{SAYS}Subscription.handle.take_message"
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def test_requests_can_be_taken_from_a_service_without_an_executor(ros_domain_id):
    from std_srvs.srv import Trigger

    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    node = rclpy.create_node("asked", context=context)
    try:
        queue = RequestQueue(node, Trigger, "do", ManualCallbackGroup())
        assert queue.take() is None
        client = node.create_client(Trigger, "~/do")
        while not client.service_is_ready():
            time.sleep(0.001)
        future = client.call_async(Trigger.Request())
        while (request := queue.take()) is None:
            time.sleep(0.001)
        assert isinstance(request[0], Trigger.Request), f"{SAYS}Service.handle.service_take_request"
        queue.answer(request, Trigger.Response(success=True, message="done"))
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        executor.spin_until_future_complete(future, READY_S)
        assert future.result().message == "done", f"{SAYS}Service.send_response"
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)
