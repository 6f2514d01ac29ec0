# SPDX-License-Identifier: MIT
"""What the numbered examples need of ros2cli, which isn't among PyPI's wheels: topic pub, service call, param set.

Its clock goes ten times as fast, as that of the node which they talk to.
"""

import sys
import time

import rclpy
import yaml
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from std_srvs.srv import Trigger

MESSAGES = {f"geometry_msgs/msg/{kind.__name__}": kind for kind in (PointStamped, WrenchStamped)}


def fill(message: object, values: dict) -> None:
    """Set a message's fields from a mapping, refusing names and types that don't fit."""
    for name, value in values.items():
        field = getattr(message, name)
        if isinstance(value, dict):
            fill(field, value)
        else:
            setattr(message, name, type(field)(value))


def publish(node, options: list[str], topic: str, kind: str, text: str) -> None:
    """``--once``, ``--times N`` (1 Hz) or ``--rate R --times N``, after a subscription has matched."""
    given = dict(zip(options[0::2], options[1::2], strict=False)) if options != ["--once"] else {}
    message = MESSAGES[kind]()
    fill(message, yaml.safe_load(text))
    # As deep as the messages are many: at ten times the rate a node that gets no core for 0.1 s would lose some.
    publisher = node.create_publisher(MESSAGES[kind], topic, 1000)
    while not publisher.get_subscription_count():
        time.sleep(0.02)
    for k in range(int(given.get("--times", 1))):
        if k:
            time.sleep(0.1 / float(given.get("--rate", 1.0)))
        publisher.publish(message)
    assert publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=60.0))


def main(verb: str, noun: str, *rest: str) -> None:
    """Run one command."""
    rclpy.init()
    node = rclpy.create_node("ros2_stand_in", start_parameter_services=False)
    if (verb, noun) == ("topic", "pub"):
        publish(node, list(rest[:-3]), *rest[-3:])
    elif (verb, noun) == ("service", "call"):
        client = node.create_client(Trigger, rest[0])
        client.wait_for_service()
        rclpy.spin_until_future_complete(node, future := client.call_async(Trigger.Request()))
        assert future.result().success, future.result().message
    elif (verb, noun) == ("param", "set"):
        client = AsyncParameterClient(node, rest[0])
        client.wait_for_services()
        values = [Parameter(rest[1], value=yaml.safe_load(rest[2]))]
        rclpy.spin_until_future_complete(node, future := client.set_parameters(values))
        assert future.result().results[0].successful, future.result().results[0].reason
    else:
        raise SystemExit(f"{verb} {noun} is not among what the examples use")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
