# SPDX-License-Identifier: MIT
"""A ROS client in a process of its own, told what to do in lines of JSON: {"do": name, ...} in, {"done": result} out.

Messages and requests go in and out as nested dicts and lists, in the fields of their types.
"""

import json
import os
import sys
import threading
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped, PointStamped, PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

WAIT_S = 180.0
"""Longer than a first start with all kernels to compile on a loaded machine."""

TYPES = {
    t.__name__: t
    for t in (
        *(
            DiagnosticArray,
            InertiaStamped,
            PointStamped,
            PoseStamped,
            TwistStamped,
            WrenchStamped,
            Odometry,
            Clock,
            Imu,
        ),
        *(
            Float64MultiArray,
            String,
            SetBool,
            Trigger,
            DescribeParameters,
            GetParameters,
            ListParameters,
            SetParameters,
        ),
        SetParametersAtomically,
    )
}


def plain(value):
    """A message as dicts, lists and numbers."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (bytes, bytearray)):
        return int.from_bytes(value, "little")
    if hasattr(value, "tolist"):
        return value.tolist()
    return [plain(v) for v in value] if isinstance(value, (list, tuple)) else value


def stamp_ns(message) -> int:
    """The header's stamp [ns]."""
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def filled(message, content: dict):
    """A message with these fields set."""
    for name, value in content.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def profile(depth=5000, latched=False, best_effort=False) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class Client:
    """What can be done; each method is a ``do``."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("tester", start_parameter_services=False, enable_rosout=False)
        self.received: dict[str, list] = {}
        self.subscriptions: dict = {}
        self.publishers = {}
        self.clients = {}
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        threading.Thread(target=self.executor.spin, daemon=True).start()

    def listen(self, topic, type, wait=True, **qos):
        """Collect what comes on a topic, in order; again, and a new subscription takes the place of the one before."""
        messages = self.received.setdefault(topic, [])
        if topic in self.subscriptions:
            self.node.destroy_subscription(self.subscriptions[topic])
        subscription = self.subscriptions[topic] = self.node.create_subscription(
            TYPES[type], topic, messages.append, profile(**qos)
        )
        if wait:
            _until(lambda: subscription.get_publisher_count(), f"a publisher of {topic}")

    def heard(self, topic, last=0, stamp=None, after=None):
        """What has come on a topic; only the ``last`` ones, those with this stamp [ns] or one after it, if that is given."""
        messages = list(self.received[topic])
        if stamp is not None:
            messages = [m for m in messages if stamp_ns(m) == stamp]
        if after is not None:
            messages = [m for m in messages if stamp_ns(m) > after]
        return [plain(m) for m in (messages[-last:] if last else messages)]

    def forget(self, topics):
        """Drop what has come on some topics."""
        for topic in topics:
            self.received[topic].clear()

    def stamps(self, topic):
        """Stamps of what has come on a topic [ns]."""
        return [stamp_ns(m) for m in list(self.received[topic])]

    def heard_count(self, topic):
        """How many messages have come on a topic."""
        return len(self.received[topic])

    def advertise(self, topic, type, wait=True, **qos):
        """A publisher, matched with the node's subscription; ``topic#2`` is another one of the same topic."""
        publisher = self.node.create_publisher(TYPES[type], topic.partition("#")[0], profile(**qos))
        self.publishers[topic] = (publisher, TYPES[type])
        if wait:
            _until(lambda: publisher.get_subscription_count(), f"a subscription of {topic}")

    def publish(self, topic, messages, rate=0.0):
        """Messages in order; rate per second, 0 as fast as it goes."""
        publisher, message_type = self.publishers[topic]
        start = time.monotonic()
        for k, content in enumerate(messages):
            if rate:
                time.sleep(max(0.0, start + k / rate - time.monotonic()))
            publisher.publish(filled(message_type(), content))

    def repeat(self, topics, content, count, rate=0.0):
        """One message ``count`` times by each of these publishers, in turn; rate per second, 0 as fast as it goes."""
        publishers = [self.publishers[topic][0] for topic in topics]
        message = serialize_message(filled(self.publishers[topics[0]][1](), content))
        start = time.monotonic()
        for k in range(count):
            if rate and k % 10 == 0:
                time.sleep(max(0.0, start + k / rate - time.monotonic()))
            for publisher in publishers:
                publisher.publish(message)

    def publish_bytes(self, topic, messages):
        """Serialized messages, in hex, as they are."""
        publisher, _ = self.publishers[topic]
        for text in messages:
            publisher.publish(bytes.fromhex(text))

    def acknowledged(self, topic):
        """Wait until all that was published has been received by everybody."""
        assert self.publishers[topic][0].wait_for_all_acked(rclpy.duration.Duration(seconds=WAIT_S))

    def call(self, service, type, request=None, timeout=WAIT_S):
        """A service's answer."""
        if service not in self.clients:
            self.clients[service] = self.node.create_client(TYPES[type], service)
            _until(self.clients[service].service_is_ready, f"the service {service}")
        future = self.clients[service].call_async(filled(TYPES[type].Request(), request or {}))
        _until(future.done, f"an answer of {service}", timeout)
        return plain(future.result())

    def lockstep_by_wrench(self, node, count, forces):
        """``count`` times: publish a wrench and wait for a twist of a later time. Returns the stamps of the twists [ns] and
        the seconds that it took.
        """
        publisher, _ = self.publishers[f"{node}/wrench"]
        message = WrenchStamped()
        twists = self.received[f"{node}/twist"]
        stamps, began = [stamp_ns(twists[-1])], time.monotonic()
        for k in range(count):
            message.wrench.force.x = forces[k % len(forces)]
            publisher.publish(message)
            # While paused the present state comes again ten times a second.
            _until(lambda: stamp_ns(twists[-1]) > stamps[-1], "a later twist", pause=0.0)
            stamps.append(stamp_ns(twists[-1]))
        return {"stamps": stamps, "seconds": time.monotonic() - began}

    def lockstep(self, node, count, push):
        """``count`` times: publish an impulse that means now, call step, and wait for the twist of its end, after which the
        next goes out. Returns the stamps of the twists [ns] and the answers.
        """
        publisher, _ = self.publishers[f"{node}/poke"]
        message = WrenchStamped()
        message.header.frame_id = "world;impulse"
        message.wrench.force.x = push
        service = self.node.create_client(Trigger, f"{node}/step")
        _until(service.service_is_ready, f"the service {node}/step")
        twists = self.received[f"{node}/twist"]
        stamps, answers = [stamp_ns(twists[-1])], []
        for _ in range(count):
            publisher.publish(message)
            future = service.call_async(Trigger.Request())
            _until(future.done, "an answer of step")
            answers.append(future.result().message)
            # While paused the present state comes again ten times a second.
            _until(lambda: stamp_ns(twists[-1]) > stamps[-1], "a later twist", pause=0.0)
            stamps.append(stamp_ns(twists[-1]))
        return {"stamps": stamps, "answers": answers}

    def set_parameters(self, node, values, atomically=False):
        """[[name, value]] through the standard services; [[successful, reason]]."""
        kind = "SetParametersAtomically" if atomically else "SetParameters"
        service = f"{node}/set_parameters{'_atomically' if atomically else ''}"
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values]
        answer = self.call(service, kind, {"parameters": messages})
        results = [answer["result"]] if atomically else answer["results"]
        return [[r["successful"], r["reason"]] for r in results]

    def get_parameters(self, node, names):
        """Values by name through the standard service."""
        service = f"{node}/get_parameters"
        self.call(service, "GetParameters", {"names": []})
        future = self.clients[service].call_async(GetParameters.Request(names=names))
        _until(future.done, f"an answer of {service}")
        return {n: plain(parameter_value_to_python(v)) for n, v in zip(names, future.result().values, strict=True)}

    def endpoints(self, topic):
        """QoS of the topic's publishers and subscriptions: [side, node, reliability, durability]."""
        found = []
        for side, infos in (
            ("pub", self.node.get_publishers_info_by_topic(topic)),
            ("sub", self.node.get_subscriptions_info_by_topic(topic)),
        ):
            for info in infos:
                q = info.qos_profile
                name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                found.append([side, name, q.reliability.name, q.durability.name])
        return found


def _until(condition, what, timeout=WAIT_S, pause=0.002):
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(f"no {what} within {timeout} s")
        time.sleep(pause)


def main() -> None:
    # Answers get stdout for themselves: the middleware writes its errors there, too, and they now go to stderr.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    client = Client()
    for line in sys.stdin:
        job = json.loads(line)
        try:
            answer = {"done": getattr(client, job.pop("do"))(**job)}
        except Exception as error:  # told to the test, which fails with it
            answer = {"failed": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)
    # The executor's thread still sits in the middleware: the orderly way out races with it. But a publisher that goes
    # without a word is believed to be there for 20 s more.
    for publisher, _ in client.publishers.values():
        client.node.destroy_publisher(publisher)
    os._exit(0)


if __name__ == "__main__":
    main()
