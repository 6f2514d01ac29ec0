# SPDX-License-Identifier: MIT
"""The page's side of ROS: what it publishes and calls, and what it hears while a page is open.

Services and latched topics come on the executor's thread and are handed to ``deliver``. States and event lines aren't
given to the executor: the page takes them itself, all that have come since the last look, as the node takes its
commands.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..messages import cdr
from ..messages.session_messages import simulated_time
from ..ros import qos
from ..ros.command_queue import ManualCallbackGroup
from ..ros.parameter_server import ros_parameter
from ..scene.parameters import parameter_named

Answered = Callable[[bool, str], None]
"""Told whether a call succeeded, and its message."""

ZERO = (0.0, 0.0, 0.0)

_TRIGGERS = ("reset", "step", "clear_wrench", "string/release")

LAST_ANSWER_S = 1.0
"""[s] That a node may take to answer the last call before the link closes; a running one takes milliseconds."""


@dataclass(frozen=True)
class Received:
    """states: (time_ns, pose and twist) pairs in order, each (13,): position, attitude xyzw, velocity of the COM,
    angular velocity, all in world axes. events: lines of the event log in order.
    """

    states: list[tuple[int, np.ndarray]] = field(default_factory=list)
    events: list[str] = field(default_factory=list)


class SimulatedTimes:
    """Simulated time of the stamps of a node that may follow a /clock: its events and reports say how far its stamps
    are ahead.
    """

    def __init__(self) -> None:
        self._offsets: tuple[tuple[int, int], ...] = ()
        self.reports = 0

    @property
    def offset_ns(self) -> int:
        """How far stamps are ahead of simulated time now."""
        return self._offsets[-1][1] if self._offsets else 0

    def heard(self, line: str) -> None:
        """A line of ``~/events``."""
        if '"clock"' not in line:
            return
        try:
            event = json.loads(line)
            if event["kind"] == "clock":
                self._add(int(event["time_ns"]), int(event["content"]["offset_ns"]))
        except (ValueError, KeyError, TypeError):
            pass  # whoever takes the line up says that it isn't one of the log

    def reported(self, values: Mapping[str, str]) -> None:
        """A report of /diagnostics: all that a page hears that opens after the event. An old report changes nothing."""
        offset_ns = int(values.get("stamp_offset_ns", 0))
        self.reports += 1
        if all(offset_ns != known for _, known in self._offsets or ((0, 0),)):
            self._add(0, offset_ns)

    def _add(self, begin_ns: int, offset_ns: int) -> None:
        self._offsets = (*self._offsets[-1:], (begin_ns, offset_ns))

    def of(self, stamp_ns: int) -> int:
        """The simulated time [ns]."""
        return simulated_time(stamp_ns, self._offsets)


class RosLink:
    """A client of the node ``target``. deliver(function, *arguments) runs a function on the page's thread.

    on_scene(text) and on_diagnostics(values) are called through it while the link is open. times: of the node's stamps.
    """

    def __init__(
        self,
        target: str,
        deliver: Callable[..., object],
        on_scene: Callable[[str], None],
        on_diagnostics: Callable[[dict[str, str]], None],
    ) -> None:
        self.target = full_name(target)
        self._deliver = deliver
        self._on_scene = on_scene
        self._on_diagnostics = on_diagnostics
        self.node = Node("workbench", start_parameter_services=False, enable_rosout=False)
        publisher = self.node.create_publisher
        self._publishers = {
            "wrench": publisher(WrenchStamped, f"{self.target}/wrench", qos.COMMAND),
            "poke": publisher(WrenchStamped, f"{self.target}/poke", qos.COMMAND),
            "string/target": publisher(PointStamped, f"{self.target}/string/target", qos.COMMAND),
            "string/attach": publisher(PointStamped, f"{self.target}/string/attach", qos.COMMAND),
            "schedule": publisher(String, f"{self.target}/schedule", qos.COMMAND),
        }
        self._services = {name: self.node.create_client(Trigger, f"{self.target}/{name}") for name in _TRIGGERS}
        self._services["pause"] = self.node.create_client(SetBool, f"{self.target}/pause")
        self._set = self.node.create_client(SetParametersAtomically, f"{self.target}/set_parameters_atomically")
        self._by_hand = ManualCallbackGroup()
        self._taken: dict[str, Subscription] = {}
        self._served: list[Subscription] = []
        self._poses: dict[int, PoseStamped] = {}
        self.times = SimulatedTimes()
        self._last_call: Future | None = None
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def wait_for_node(self, patience_s: float, given_up: Callable[[], bool] = lambda: False) -> None:
        """Wait until the node is there, or ``given_up``. Raises InputError, with the names of those that are, when it
        doesn't come.
        """
        deadline = time.monotonic() + patience_s
        while not self._set.service_is_ready() and not given_up():
            if time.monotonic() > deadline:
                found = ", ".join(flying_nodes(self.node.get_topic_names_and_types())) or "none is running"
                raise InputError(
                    "--node", self.target, f"a node that answers within {patience_s:g} s, with its namespace ({found})"
                )
            time.sleep(0.02)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass

    def close(self) -> None:
        """Leave ROS, once the last call is answered: a request that nobody waits for may never leave."""
        deadline = time.monotonic() + LAST_ANSWER_S
        while self._last_call is not None and not self._last_call.done() and time.monotonic() < deadline:
            time.sleep(0.01)
        self._executor.shutdown(timeout_sec=0.5)
        self._thread.join(timeout=0.5)
        self.node.destroy_node()
        rclpy.try_shutdown()

    # Hearing

    def listen(self) -> None:
        """Subscribe to all that the page shows."""
        self._executor.create_task(self._subscribe)

    def stop_listening(self) -> None:
        """Drop every subscription: the node has then as many subscribers as before a page opened."""
        self._executor.create_task(self._unsubscribe)

    def _subscribe(self) -> None:
        if self._taken:
            return

        def subscribe(
            message_type: type,
            name: str,
            callback: Callable[[Any], None],
            profile: QoSProfile | int,
            group: CallbackGroup | None = None,
        ) -> Subscription:
            return self.node.create_subscription(message_type, name, callback, profile, callback_group=group)

        def by_hand(message_type: type, topic: str, profile: QoSProfile) -> Subscription:
            return subscribe(message_type, f"{self.target}/{topic}", lambda _: None, profile, self._by_hand)

        self._served = [
            subscribe(String, f"{self.target}/scene", self._scene, qos.LATCHED),
            subscribe(DiagnosticArray, "/diagnostics", self._diagnostics, 10),
        ]
        self._taken = {
            "events": by_hand(String, "events", qos.EVENT),
            "pose": by_hand(PoseStamped, "pose", qos.STATE),
            "twist": by_hand(TwistStamped, "twist", qos.STATE),
        }

    def _unsubscribe(self) -> None:
        subscriptions = [*self._served, *self._taken.values()]
        self._served, self._taken = [], {}
        self._poses.clear()
        for subscription in subscriptions:
            self.node.destroy_subscription(subscription)

    def _scene(self, message: String) -> None:
        self._deliver(self._on_scene, message.data)

    def _diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self.target}: simulation":
                values = {v.key: v.value for v in status.values}
                self.times.reported(values)
                self._deliver(self._on_diagnostics, values)

    def take(self) -> Received:
        """All states and event lines since the last call."""
        taken = self._taken
        if not taken:
            return Received()
        events = [message.data for message in _drain(taken["events"], String)]
        for line in events:
            self.times.heard(line)
        for pose in _drain(taken["pose"], PoseStamped):
            self._poses[_stamp_ns(pose)] = pose
        states = []
        for twist in _drain(taken["twist"], TwistStamped):
            stamp_ns = _stamp_ns(twist)
            pose = self._poses.get(stamp_ns)
            if pose is not None:
                states.append((self.times.of(stamp_ns), _row(pose, twist)))
        while len(self._poses) > 2 * qos.STATE.depth:
            del self._poses[next(iter(self._poses))]
        return Received(states, events)

    # Saying

    def wrench(self, topic: str, frame_id: str, force: Sequence[float] = ZERO, torque: Sequence[float] = ZERO) -> None:
        """Publish on ``poke`` or ``wrench``: it acts as soon as the node takes it."""
        self._publishers[topic].publish(cdr.wrench_stamped(0, frame_id, force, torque))

    def point(self, topic: str, frame_id: str, point: Iterable[float]) -> None:
        """Publish on ``string/target`` or ``string/attach``."""
        self._publishers[topic].publish(cdr.stamped_doubles(0, frame_id, tuple(float(x) for x in point)))

    def schedule(self, entry: str) -> None:
        """Publish one entry of a script."""
        self._publishers["schedule"].publish(cdr.string(entry))

    def send(self, topic: str, data: bytes) -> None:
        """Publish a message as its bytes."""
        self._publishers[topic].publish(data)

    def call(self, service: str, data: bool | None = None, done: Answered | None = None) -> None:
        """Call one of the node's services; done(success, message) comes on the page's thread."""
        client = self._services[service]
        if not client.service_is_ready():
            self._answer(done, False, f"{client.srv_name} doesn't answer: is the node running?")
            return
        request = Trigger.Request() if data is None else SetBool.Request(data=data)
        self._last_call = client.call_async(request)
        self._last_call.add_done_callback(
            lambda future: self._answer(done, future.result().success, future.result().message)
        )

    def set_parameters(self, changes: dict[str, object], done: Answered | None = None) -> None:
        """Set parameters all at once, or none; done(success, reason) comes on the page's thread."""
        try:
            parameters = [ros_parameter(parameter_named(n), parameter_named(n).convert(v)) for n, v in changes.items()]
        except InputError as error:
            self._answer(done, False, str(error))
            return
        if not self._set.service_is_ready():
            self._answer(done, False, f"{self._set.srv_name} doesn't answer: is the node running?")
            return
        request = SetParametersAtomically.Request(parameters=[p.to_parameter_msg() for p in parameters])
        self._set.call_async(request).add_done_callback(
            lambda future: self._answer(done, future.result().result.successful, future.result().result.reason)
        )

    def _answer(self, done: Answered | None, success: bool, message: str) -> None:
        if done is not None:
            self._deliver(done, success, message)


def full_name(node: str) -> str:
    """A node's name with its namespace and a leading slash. Raises InputError for what no node can be called."""
    name = f"/{node.removeprefix('/')}"
    try:
        validate_full_topic_name(name)
    except InvalidTopicNameException:
        raise InputError("--node", node, "letters, digits and _, and slashes between them, as in /lab/body") from None
    return name


def flying_nodes(topics: Iterable[tuple[str, Sequence[str]]]) -> list[str]:
    """Full names of the nodes that fly a body, by the topics (name, types) that they have."""
    names = {name for name, _ in topics}
    own = ("poke", "string/target", "inertia")
    bases = (name.removesuffix("/pose") for name in names if name.endswith("/pose"))
    return sorted(base for base in bases if all(f"{base}/{topic}" in names for topic in own))


def _drain(subscription: Subscription, message_type: type) -> list[Any]:
    messages: list[Any] = []
    with subscription.handle:
        while True:
            taken = subscription.handle.take_message(message_type, False)
            if taken is None:
                return messages
            messages.append(taken[0])


def _stamp_ns(message: PoseStamped | TwistStamped) -> int:
    stamp = message.header.stamp
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


def _row(pose: PoseStamped, twist: TwistStamped) -> np.ndarray:
    p, q = pose.pose.position, pose.pose.orientation
    v, w = twist.twist.linear, twist.twist.angular
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z])
