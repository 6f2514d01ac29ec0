# SPDX-License-Identifier: MIT
"""Pose, twist, odometry, IMU, /clock and /tf: packed bytes, and nothing packed for a topic that nobody listens to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from ..base.rotation import rotate
from ..live.pacing import Stamps
from ..motion.state import State
from ..scene import cdr
from ..scene.parameters import Parameters
from ..scene.sensor_noise import (
    ACCELEROMETER,
    ANGULAR_VELOCITY,
    GYROSCOPE,
    LINEAR_VELOCITY,
    ORIENTATION,
    POSITION,
    SensorNoise,
    sensor_noise,
)
from . import qos

Topics = list[tuple[Publisher, Callable[[int, list[float]], Any]]]
"""A publisher, and how its message is made from time and state."""


class StatePublisher:
    """Publishes states of one body. Use ``configure`` for what parameters switch on and off.

    specific_force() gives what an accelerometer at the chosen contact shows at the present state.
    """

    def __init__(
        self,
        node: Node,
        world_frame: str,
        body_frame: str,
        specific_force: Callable[[], np.ndarray],
        stamps: Stamps,
    ) -> None:
        self._node = node
        self._stamps = stamps
        self._specific_force = specific_force
        self._frames = world_frame, body_frame

        def publisher(message_type: type, topic: str) -> Publisher:
            return node.create_publisher(
                message_type, f"~/{topic}", qos.own(qos.STATE), qos_overriding_options=qos.OVERRIDABLE
            )

        self._pose = publisher(PoseStamped, "pose")
        self._twist = publisher(TwistStamped, "twist")
        self._odom = publisher(Odometry, "odom")
        self._imu = publisher(Imu, "imu")
        self._imu_frame = body_frame
        self._clock: Publisher | None = None
        self._tf: Publisher | None = None
        self._made_clock: Publisher | None = None
        self._made_tf: Publisher | None = None
        self._tf_message: Any = None
        self._wanted: Topics = []
        self._noise: SensorNoise | None = None

    def configure(self, parameters: Parameters) -> None:
        """Switch /clock, /tf and noise on and off, and put the IMU where it is mounted; on the executor's thread."""
        # The frames of contacts have the body's axes.
        contact = parameters.imu_contact
        self._imu_frame = f"{self._frames[1]}/{contact}" if contact else self._frames[1]
        self._noise = sensor_noise(parameters)
        # Once made they are kept, silent: the physics thread may be publishing at the moment that they are switched
        # off.
        if parameters.publish_clock and self._made_clock is None:
            self._made_clock = self._node.create_publisher(Clock, "/clock", qos.CLOCK)
        if parameters.publish_tf and self._made_tf is None:
            self._made_tf = self._tf_publisher()
        self._clock = self._made_clock if parameters.publish_clock else None
        self._tf = self._made_tf if parameters.publish_tf else None

    def _tf_publisher(self) -> Publisher | None:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            self._node.get_logger().warning("publish_tf: tf2_msgs isn't installed (ros-jazzy-tf2-msgs); no /tf")
            return None
        self._tf_message = TFMessage
        return self._node.create_publisher(TFMessage, "/tf", qos.TF)

    def find_subscribers(self) -> bool:
        """Note which topics have subscribers, for ``publish``; whether any has."""
        self._wanted = [(p, message) for p, message in self._topics() if p.get_subscription_count()]
        return bool(self._wanted)

    def publish(self, state: State) -> None:
        """Publish one state on every topic that had a subscriber when that was last noted."""
        if not self._wanted:
            return
        row = state.row.tolist()
        for publisher, message in self._wanted:
            publisher.publish(message(state.time_ns, row))

    def pack_all(self, state: State) -> None:
        """Make every message once and publish none, so that what they need is compiled."""
        for _, message in self._topics():
            message(state.time_ns, state.row.tolist())

    def _stamp_ns(self, time_ns: int) -> int:
        return time_ns + self._stamps.offset_ns

    def _with_noise(self, topic: str, time_ns: int, row: list[float]) -> list[float]:
        """The state (13,) with its noise."""
        return row if self._noise is None else self._noise.measured(topic, time_ns, row)

    def _topics(self) -> Topics:
        topics: Topics = [(self._pose, self._pose_message), (self._twist, self._twist_message)]
        topics += [(self._odom, self._odom_message), (self._imu, self._imu_message)]
        if self._clock is not None:
            topics.insert(0, (self._clock, lambda time_ns, _: cdr.time(time_ns)))
        if self._tf is not None:
            topics.append((self._tf, self._transform))
        return topics

    def _pose_message(self, time_ns: int, row: list[float]) -> bytes:
        row = self._with_noise("pose", time_ns, row)
        return cdr.stamped_doubles(self._stamp_ns(time_ns), self._frames[0], row[:7])

    def _twist_message(self, time_ns: int, row: list[float]) -> bytes:
        row = self._with_noise("twist", time_ns, row)
        twist = (*row[7:10], *rotate(*row[3:7], *row[10:13]))
        return cdr.stamped_doubles(self._stamp_ns(time_ns), self._frames[0], twist)

    def _odom_message(self, time_ns: int, row: list[float]) -> bytes:
        # An Odometry's twist is in the child frame: body axes.
        row = self._with_noise("odom", time_ns, row)
        twist = (*rotate(-row[3], -row[4], -row[5], row[6], *row[7:10]), *row[10:13])
        covariances = (
            self._covariance(POSITION, ORIENTATION, time_ns),
            self._covariance(LINEAR_VELOCITY, ANGULAR_VELOCITY, time_ns),
        )
        return cdr.odometry(self._stamp_ns(time_ns), self._frames, row[:7], twist, covariances)

    def _covariance(self, linear: int, angular: int, time_ns: int) -> Sequence[float]:
        """Of a pose or twist (36,), from the variances of two sensors."""
        if self._noise is None:
            return cdr.NO_COVARIANCE
        variances = [self._noise.variance(sensor, time_ns) for sensor in (linear, angular)]
        return np.diag(np.repeat(variances, 3)).ravel().tolist()

    def _imu_message(self, time_ns: int, row: list[float]) -> Imu:
        """Attitude, angular velocity and specific force, both in body axes, at the contact that was chosen."""
        message = Imu()
        message.header.stamp.sec, message.header.stamp.nanosec = self._stamps.of(time_ns)
        message.header.frame_id = self._imu_frame
        o, rate, felt = message.orientation, message.angular_velocity, message.linear_acceleration
        o.x, o.y, o.z, o.w = self._with_noise("pose", time_ns, row)[3:7]
        noise, turns, force = self._noise, row[10:13], self._specific_force().tolist()
        if noise is not None:
            turns, force = noise.imu(time_ns, turns, force)
            message.orientation_covariance = _isotropic(noise.variance(ORIENTATION, time_ns))
            message.angular_velocity_covariance = _isotropic(noise.variance(GYROSCOPE, time_ns))
            message.linear_acceleration_covariance = _isotropic(noise.variance(ACCELEROMETER, time_ns))
        rate.x, rate.y, rate.z = turns
        felt.x, felt.y, felt.z = force
        return message

    def _transform(self, time_ns: int, row: list[float]) -> Any:
        transform = TransformStamped()
        transform.header.stamp.sec, transform.header.stamp.nanosec = self._stamps.of(time_ns)
        transform.header.frame_id, transform.child_frame_id = self._frames
        t, r = transform.transform.translation, transform.transform.rotation
        # Where the body is drawn: without noise.
        t.x, t.y, t.z, r.x, r.y, r.z, r.w = row[:7]
        return self._tf_message(transforms=[transform])


def _isotropic(variance: float) -> list[float]:
    """A covariance (9,) alike in all directions."""
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
