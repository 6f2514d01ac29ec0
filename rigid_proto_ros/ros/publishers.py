# SPDX-License-Identifier: MIT
"""The node's publishers: states as packed bytes, on topics with subscribers; and events: inertia and scene (latched),
applied commands and the event log.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from geometry_msgs.msg import InertiaStamped, PoseStamped, TransformStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from visualization_msgs.msg import Marker

from ..live.pacing import Stamps
from ..parameters.declarations import Parameters
from ..scene import cdr
from ..scene.scenario_run import ScenarioRun
from ..scene.sensor_noise import ImuNoise, imu_noise
from ..session.messages import PROJECTIONS, applied_bytes, inertia_bytes
from ..simulation.observer import Applied, BodyChanged, Event, Logged, Observer, Refused, SceneChanged
from ..simulation.setup import Setup
from . import qos
from .marker import BodyMarker

WARNING_S = 1.0
"""Shortest period between two warnings of the same reason [s of wall time]."""

IDENTITY = (0.0, 0.0, 0.0, 1.0)

Topics = list[tuple[Publisher, Callable[[ScenarioRun, int, list[float]], Any]]]
"""Publishers, each with the function that makes its message from run, time and state; None: no message now."""


def _publisher(
    node: Node,
    message_type: type,
    topic: str,
    profile: QoSProfile,
    events: PublisherEventCallbacks | None = None,
) -> Publisher:
    return node.create_publisher(
        message_type,
        f"~/{topic}",
        qos.own(profile),
        event_callbacks=events,
        qos_overriding_options=qos.OVERRIDABLE,
    )


class StatePublisher:
    """Publishes pose, twist, odometry, IMU, marker, /clock, /tf and /tf_static of one body; ``configure`` switches
    those that depend on parameters.

    frames: names of the world and body frames. on_matched() is called on the executor's thread when a subscriber comes
    or goes.
    """

    def __init__(
        self, node: Node, frames: tuple[str, str], stamps: Stamps, on_matched: Callable[[], None] = lambda: None
    ) -> None:
        self._node = node
        self._events = PublisherEventCallbacks(matched=lambda _: on_matched())
        self._stamps = stamps
        self._frames = frames
        self._topics: Topics = [
            (self._publisher(PoseStamped, "pose"), partial(self._in_world, PROJECTIONS["pose"])),
            (self._publisher(TwistStamped, "twist"), partial(self._in_world, PROJECTIONS["twist"])),
            (self._publisher(Odometry, "odom"), self._odometry),
            (self._publisher(Imu, "imu"), self._imu_message),
            (self._publisher(Marker, "marker"), BodyMarker(frames, stamps).message),
        ]
        self._clock: Publisher | None = None
        self._tf: Publisher | None = None
        self._framed: Setup | None = None
        self._sought_tf = False
        self._tf_message: Any = None
        self._silent: tuple[Publisher | None, ...] = ()
        self._wanted: Topics = []
        self._imu_of: Parameters | None = None
        self._imu_frame = ""
        self._noise: ImuNoise | None = None

    def _publisher(self, message_type: type, topic: str) -> Publisher:
        return _publisher(self._node, message_type, topic, qos.STATE, self._events)

    def configure(self, parameters: Parameters) -> None:
        """Switch /clock and /tf on and off; on the executor's thread."""
        if parameters.publish_clock and self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", qos.CLOCK, event_callbacks=self._events)
            self._topics = [(self._clock, lambda _, time_ns, __: cdr.time(time_ns)), *self._topics]
        if parameters.publish_tf and not self._sought_tf:
            self._sought_tf = True
            self._begin_tf()
        # Publishers are never destroyed: the physics thread may be using them while they are switched off.
        self._silent = tuple(
            publisher
            for publisher, on in ((self._clock, parameters.publish_clock), (self._tf, parameters.publish_tf))
            if not on
        )

    def _begin_tf(self) -> None:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            self._node.get_logger().warning("publish_tf: tf2_msgs isn't installed (ros-jazzy-tf2-msgs); no /tf")
            return
        self._tf_message = TFMessage
        self._tf = self._node.create_publisher(TFMessage, "/tf", qos.TF, event_callbacks=self._events)
        self._tf_static = self._node.create_publisher(TFMessage, "/tf_static", qos.own(qos.LATCHED))
        self._topics = [*self._topics, (self._tf, self._transform)]

    def find_subscribers(self) -> bool:
        """Find the topics with subscribers, for ``publish``; returns whether there are any."""
        self._wanted = [
            (publisher, message)
            for publisher, message in self._topics
            if publisher not in self._silent and publisher.get_subscription_count()
        ]
        return bool(self._wanted)

    def publish(self, run: ScenarioRun) -> None:
        """Publish the present state on every topic that ``find_subscribers`` has found."""
        if self._wanted:
            state = run.simulation.state
            row = state.row.tolist()
            for publisher, make in self._wanted:
                if (message := make(run, state.time_ns, row)) is not None:
                    publisher.publish(message)

    def pack_all(self, run: ScenarioRun) -> None:
        """Make every message once without publishing it, so that their modules are loaded before the start."""
        state = run.simulation.state
        for _, message in self._topics:
            message(run, state.time_ns, state.row.tolist())

    def _in_world(
        self, project: Callable[[list[float]], list[float]], _: ScenarioRun, time_ns: int, row: list[float]
    ) -> bytes:
        return cdr.stamped_doubles(time_ns + self._stamps.offset_ns, self._frames[0], project(row))

    def _odometry(self, _: ScenarioRun, time_ns: int, row: list[float]) -> bytes:
        # An Odometry's twist is in the child frame: body axes.
        return cdr.odometry(time_ns + self._stamps.offset_ns, self._frames, PROJECTIONS["odom"](row))

    def _imu_message(self, run: ScenarioRun, time_ns: int, row: list[float]) -> Imu:
        """Attitude, and angular velocity and specific force in body axes, at the contact ``imu_contact``."""
        parameters = run.scenario.parameters
        contact = parameters.imu_contact
        if parameters is not self._imu_of:
            self._imu_of, self._noise = parameters, imu_noise(parameters)
            self._imu_frame = f"{self._frames[1]}/{contact}" if contact else self._frames[1]
        message = Imu()
        message.header.stamp.sec, message.header.stamp.nanosec = self._stamps.of(time_ns)
        message.header.frame_id = self._imu_frame
        o, rate, felt = message.orientation, message.angular_velocity, message.linear_acceleration
        o.x, o.y, o.z, o.w = row[3:7]
        setup = run.simulation.setup
        point = setup.body.point(setup.contacts[contact]).tolist() if contact else (0.0, 0.0, 0.0)
        noise, turns, force = self._noise, row[10:13], run.simulation.specific_force(point).tolist()
        if noise is not None:
            turns, force = noise.measured(time_ns + self._stamps.offset_ns, turns, force)
            covariances = (message.angular_velocity_covariance, message.linear_acceleration_covariance)
            for covariance, sigma in zip(covariances, noise.sigma.tolist(), strict=True):
                covariance[[0, 4, 8]] = sigma * sigma
        rate.x, rate.y, rate.z = turns
        felt.x, felt.y, felt.z = force
        return message

    def _transform(self, run: ScenarioRun, time_ns: int, row: list[float]) -> Any:
        setup = run.simulation.setup
        if setup is not self._framed:
            # Frames that messages name, relative to the centre of mass in body axes; published again for a new setup.
            self._framed, body = setup, setup.body
            places = {"mesh": -body.center_of_mass, **{n: body.point(p) for n, p in setup.contacts.items()}}
            fixed = [
                self._stamped_transform(time_ns, (self._frames[1], f"{self._frames[1]}/{name}"), [*place, *IDENTITY])
                for name, place in places.items()
            ]
            self._tf_static.publish(self._tf_message(transforms=fixed))
        return self._tf_message(transforms=[self._stamped_transform(time_ns, self._frames, row)])

    def _stamped_transform(self, time_ns: int, frames: tuple[str, str], row: Sequence[float]) -> TransformStamped:
        transform = TransformStamped()
        transform.header.stamp.sec, transform.header.stamp.nanosec = self._stamps.of(time_ns)
        transform.header.frame_id, transform.child_frame_id = frames
        t, r = transform.transform.translation, transform.transform.rotation
        t.x, t.y, t.z, r.x, r.y, r.z, r.w = map(float, row[:7])
        return transform


class EventPublisher(Observer):
    """Publishes events on the physics thread; they are rare."""

    takes = frozenset({SceneChanged, BodyChanged, Applied, Refused, Logged})

    def __init__(self, node: Node, body_frame: str, stamps: Stamps) -> None:
        self._logger = node.get_logger()
        self._stamps = stamps
        self._body_frame = body_frame
        self._inertia = _publisher(node, InertiaStamped, "inertia", qos.LATCHED)
        self._scene = _publisher(node, String, "scene", qos.LATCHED)
        self._applied = _publisher(node, WrenchStamped, "applied", qos.EVENT)
        self._events = _publisher(node, String, "events", qos.EVENT)
        self._warned: dict[str, float] = {}

    def wants(self, kind: type) -> bool:
        """Whether an event is needed; lines of the event log only while their topic has subscribers."""
        return self._events.get_subscription_count() > 0 if kind is Logged else kind in self.takes

    def on(self, event: Event) -> None:
        """Publish the event; of a refusal, log a warning."""
        match event:
            case Logged(_, line):
                if self.wants(Logged):
                    self._events.publish(cdr.string(line))
            case SceneChanged(_, scene):
                # All parameters, and the mesh's hash in a comment, as a parameter file.
                self._scene.publish(cdr.string(scene))
            case BodyChanged(time_ns, setup):
                stamp_ns = time_ns + self._stamps.offset_ns
                self._inertia.publish(inertia_bytes(stamp_ns, self._body_frame, setup.body))
            case Applied(time_ns) if self._applied.get_subscription_count():
                # About the COM in the body frame, which TF has. The event log has the command's own point, axes, slot
                # and duration.
                stamp_ns = time_ns + self._stamps.offset_ns
                self._applied.publish(applied_bytes(stamp_ns, self._body_frame, event.load, event.body, event.attitude))
            case Refused(_, reason, message):
                self._warn(reason, message)

    def _warn(self, reason: str, message: str) -> None:
        """Warn of commands refused on arrival or when they take effect.

        At most one warning per second and reason, so that a flood of one kind doesn't hide other problems.
        """
        now = time.monotonic()
        if now >= self._warned.get(reason, -math.inf) + WARNING_S:
            self._warned[reason] = now
            self._logger.warning(f"refused: {message}")
