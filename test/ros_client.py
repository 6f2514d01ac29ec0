# SPDX-License-Identifier: MIT
"""A ROS client in the test's own process, with a context, node and thread of its own. Messages go in and come out as nested
dicts and lists, in the fields of their types.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped, PointStamped, PoseStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from ros_process import READY_S
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

COMMANDS = {
    "wrench": WrenchStamped,
    "poke": WrenchStamped,
    "string/target": PointStamped,
    "string/attach": PointStamped,
    "inertia/set": InertiaStamped,
    "schedule": String,
    "thrusters": Float64MultiArray,
}
STATES = {"pose": PoseStamped, "twist": TwistStamped}
LATCHED = {"inertia": InertiaStamped, "scene": String}
TOPICS = {
    **COMMANDS,
    **STATES,
    **LATCHED,
    "odom": Odometry,
    "imu": Imu,
    "applied": WrenchStamped,
    "events": String,
    "/diagnostics": DiagnosticArray,
    "/clock": Clock,
}
"""Types by the topics' names."""


def plain(value: Any) -> Any:
    """A message as dicts, lists and numbers."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (bytes, bytearray)):
        return int.from_bytes(value, "little")
    if hasattr(value, "tolist"):
        return value.tolist()
    return [plain(v) for v in value] if isinstance(value, (list, tuple)) else value


def filled(message: Any, content: dict) -> Any:
    """A message with these fields set; a whole number is one where a double is expected."""
    for name, value in content.items():
        field = getattr(message, name)
        if isinstance(value, dict):
            filled(field, value)
        else:
            setattr(message, name, float(value) if isinstance(field, float) else value)
    return message


def stamp_ns(message: Any) -> int:
    """The header's stamp [ns], of a message or of its dict."""
    if not isinstance(message, dict):
        return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    stamp = message["header"]["stamp"]
    return stamp["sec"] * 1_000_000_000 + stamp["nanosec"]


class _Taken(MutuallyExclusiveCallbackGroup):
    """Of subscriptions whose messages are taken from time to time, all that have come: the executor would wake for each of
    them, which costs ten times as much as to take it.
    """

    def can_execute(self, entity: Any) -> bool:
        return False


class RosClient:
    """Short ways to talk to one node. Topics and services are names of that node's own, or begin with a slash. in_order: of
    several topics, too, messages are heard as they come, with those of other subscriptions of ``own``.
    """

    def __init__(self, environment: dict[str, str], node: str = "/rigid_body", in_order: bool = False) -> None:
        self.environment, self.node = environment, node
        self._context = rclpy.Context()
        domain, no_handlers = int(environment["ROS_DOMAIN_ID"]), SignalHandlerOptions.NO
        rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=no_handlers)
        self.own = rclpy.create_node(
            "tester", context=self._context, start_parameter_services=False, enable_rosout=False
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.own)
        self._group = None if in_order else _Taken()
        self._received: dict[str, list] = {}
        self._subscriptions: dict[str, Any] = {}
        self._taking = threading.Lock()
        self._ended = threading.Event()
        work = [self._spin] if in_order else [self._spin, self._take]
        self._threads = [threading.Thread(target=run, name="client", daemon=True) for run in work]
        for thread in self._threads:
            thread.start()
        self._publishers: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}

    def _spin(self) -> None:
        while not self._ended.is_set():
            self._executor.spin_once(timeout_sec=0.2)

    def _take(self) -> None:
        while not self._ended.wait(0.01):
            with self._taking:
                for subscription in self._subscriptions.values():
                    with subscription.handle:
                        # No more at a time: a topic that is never empty must not keep the others waiting.
                        for _ in range(100):
                            if (taken := subscription.handle.take_message(subscription.msg_type, False)) is None:
                                break
                            subscription.callback(taken[0])

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        self._ended.set()
        self._executor.wake()
        for thread in self._threads:
            thread.join()
        self._executor.shutdown()
        self.own.destroy_node()
        self._context.try_shutdown()

    def name(self, topic: str) -> str:
        return topic if topic.startswith("/") else f"{self.node}/{topic}"

    def until(self, condition: Callable[[], Any], what: str, pause_s: float = 0.02) -> Any:
        """Wait for a condition; returns its value."""
        deadline = time.monotonic() + READY_S
        while not (found := condition()):
            assert all(thread.is_alive() for thread in self._threads), "this client has ended by an error"
            assert time.monotonic() < deadline, f"no {what} within {READY_S} s"
            time.sleep(pause_s)
        return found

    # Hearing

    def meet(self) -> None:
        """Hear the node's states and reports from now on, and be ready to command it."""
        self.listen(*STATES, "/diagnostics")
        self.advertise(*(topic for topic in COMMANDS if topic != "thrusters"))

    def listen(self, *topics: str, wait: bool = True, best_effort: bool = False) -> None:
        """Collect what comes, in order; again, and a new subscription takes the place of the one before."""
        for topic in topics:
            name = self.name(topic)
            messages = self._received.setdefault(name, [])
            profile = _profile(latched=topic in LATCHED, best_effort=best_effort)
            subscription = self.own.create_subscription(
                TOPICS[topic], name, messages.append, profile, callback_group=self._group
            )
            with self._taking:
                if name in self._subscriptions:
                    self.own.destroy_subscription(self._subscriptions[name])
                self._subscriptions[name] = subscription
            if wait:
                self.until(subscription.get_publisher_count, f"publisher of {name}")

    def heard(self, topic: str, last: int = 0, stamp: int | None = None, after: int | None = None) -> list[dict]:
        """What has come; only the ``last`` ones, those with this stamp [ns] or one after it, if that is given."""
        messages = list(self._received[self.name(topic)])
        if stamp is not None:
            messages = [m for m in messages if stamp_ns(m) == stamp]
        if after is not None:
            messages = [m for m in messages if stamp_ns(m) > after]
        return [plain(m) for m in (messages[-last:] if last else messages)]

    def heard_count(self, topic: str) -> int:
        return len(self._received[self.name(topic)])

    def forget(self, *topics: str) -> None:
        """Drop what was heard."""
        for topic in topics:
            self._received[self.name(topic)].clear()

    def events(self, kind: str = "") -> list[dict]:
        """Lines of the event log that were heard, of one kind or all."""
        found = [json.loads(message["data"]) for message in self.heard("events")]
        return [event for event in found if kind in ("", event["kind"])]

    def newest_ns(self, topic: str) -> int:
        """The newest message's stamp [ns], -1 without one."""
        messages = self._received[self.name(topic)]
        return stamp_ns(messages[-1]) if messages else -1

    def now_ns(self) -> int:
        """The stamp of the newest pose, once there is one."""
        self.until(lambda: self.newest_ns("pose") >= 0, "state")
        return self.newest_ns("pose")

    def fly_until(self, time_ns: int) -> None:
        """Wait until the newest states heard have reached ``time_ns``."""
        self.until(lambda: all(self.newest_ns(topic) >= time_ns for topic in STATES), f"states at {time_ns} ns")

    def all_diagnostics(self, last: int = 0, after: int | None = None) -> list[dict]:
        """Reports of the node so far, among the ``last`` or those made after a time of the system's clock [ns].

        Each as keys and values, with ``level``, ``message``, ``name`` and ``stamp_ns``.
        """
        reports = []
        for message in self.heard("/diagnostics", last=last, after=after):
            for status in message["status"]:
                if status["name"] == f"{self.node}: simulation":
                    values = {entry["key"]: entry["value"] for entry in status["values"]}
                    said = {k: status[k] for k in ("level", "message", "name")}
                    reports.append({**values, **said, "stamp_ns": stamp_ns(message)})
        return reports

    def diagnostics(self) -> dict:
        """A report of what is so after this call began: it is stamped before its values are read."""
        asked_ns = time.time_ns()
        return self.until(lambda: self.all_diagnostics(after=asked_ns), "diagnostics")[0]

    def until_received(self, count: int, topic: str = "commands") -> dict:
        """The first report that has received so many commands since the counters were read."""

        def covered():
            reports = self.all_diagnostics(last=5)
            return reports and int(reports[-1][f"{topic}_received"]) >= count and reports[-1]

        return self.until(covered, f"{count} {topic} received")

    # Commanding

    def advertise(self, *topics: str, wait: bool = True, depth: int = 5000, best_effort: bool = False) -> None:
        """Publishers, matched with the node's subscriptions; ``topic#2`` is another one of the same topic."""
        for topic in topics:
            own = topic.partition("#")[0]
            message_type = TOPICS.get(own, WrenchStamped)
            publisher = self.own.create_publisher(
                message_type, self.name(own), _profile(depth, best_effort=best_effort)
            )
            self._publishers[topic] = publisher
            if wait:
                self.until(publisher.get_subscription_count, f"subscription of {topic}")

    def publish(self, topic: str, *messages: dict | bytes, rate: float = 0.0) -> None:
        """Messages in order, as dicts or serialized; rate per second, 0 as fast as it goes."""
        publisher = self._publishers[topic]
        start = time.monotonic()
        for k, content in enumerate(messages):
            if rate:
                time.sleep(max(0.0, start + k / rate - time.monotonic()))
            publisher.publish(content if isinstance(content, bytes) else filled(publisher.msg_type(), content))

    def repeat(self, topics: list[str], content: dict, count: int, rate: float = 0.0) -> None:
        """One message ``count`` times by each of these publishers, in turn; rate per second, 0 as fast as it goes."""
        publishers = [self._publishers[topic] for topic in topics]
        message = serialize_message(filled(publishers[0].msg_type(), content))
        start = time.monotonic()
        for k in range(count):
            if rate and k % 10 == 0:
                time.sleep(max(0.0, start + k / rate - time.monotonic()))
            for publisher in publishers:
                publisher.publish(message)

    def acknowledged(self, *topics: str) -> None:
        """Wait until all that was published has been received by everybody."""
        for topic in topics:
            assert self._publishers[topic].wait_for_all_acked(Duration(seconds=READY_S))

    def schedule(self, *entries: str) -> None:
        self.publish("schedule", *({"data": entry} for entry in entries))

    def call(self, service: str, service_type: Any, pause_s: float = 0.002, **request: Any) -> Any:
        """A service's answer."""
        name = self.name(service)
        if name not in self._clients:
            self._clients[name] = self.own.create_client(service_type, name)
            self.until(self._clients[name].service_is_ready, f"service {name}")
        future = self._clients[name].call_async(service_type.Request(**request))
        self.until(future.done, f"answer of {name}", pause_s)
        return future.result()

    def trigger(self, service: str) -> dict:
        return plain(self.call(service, Trigger))

    def pause(self, paused: bool) -> dict:
        return plain(self.call("pause", SetBool, data=paused))

    def reset(self) -> None:
        """Time 0, and states heard that were published since; some must have been heard before."""
        self.fly_until(1)
        reached_ns = self.now_ns()
        assert self.trigger("reset")["success"]
        self.until(lambda: all(self.newest_ns(topic) < reached_ns for topic in STATES), "states since the reset")

    def set(self, atomically: bool = False, **values) -> list:
        """Parameters by name, double underscores for dots; [[successful, reason]]."""
        return self.set_named({n.replace("__", "."): v for n, v in values.items()}, atomically)

    def set_named(self, values: dict, atomically: bool = False) -> list:
        messages = [Parameter(name, value=_alike(value)).to_parameter_msg() for name, value in values.items()]
        if atomically:
            results = [self.call("set_parameters_atomically", SetParametersAtomically, parameters=messages).result]
        else:
            results = self.call("set_parameters", SetParameters, parameters=messages).results
        return [[r.successful, r.reason] for r in results]

    def get(self, *names: str) -> dict:
        values = self.call("get_parameters", GetParameters, names=list(names)).values
        return {n: plain(parameter_value_to_python(v)) for n, v in zip(names, values, strict=True)}

    def names(self) -> list[str]:
        """All parameters of the node."""
        return list(self.call("list_parameters", ListParameters).result.names)


def _profile(depth: int = 5000, latched: bool = False, best_effort: bool = False) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _alike(value: Any) -> Any:
    """A list of whole numbers and doubles as one of doubles: rclpy takes no mixed ones."""
    mixed = isinstance(value, (list, tuple)) and {type(x) for x in value} == {int, float}
    return [float(x) for x in value] if mixed else value
