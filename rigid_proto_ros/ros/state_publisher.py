# SPDX-License-Identifier: MIT
"""Pose, twist, odometry, IMU, /clock and /tf: packed bytes, and nothing packed for a topic that nobody listens to."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from .. import cdr
from ..core.rotation import rotate
from ..core.state import State
from . import qos


class StatePublisher:
    """Publishes states of one body. Use ``configure`` for what parameters switch on and off.

    specific_force() gives what an accelerometer at the chosen contact shows at the present state.
    """

    def __init__(self, node: Node, world_frame: str, body_frame: str, specific_force: Callable[[], np.ndarray]) -> None:
        self._node = node
        self._specific_force = specific_force
        self._frames = world_frame, body_frame

        def publisher(message_type, topic):
            return node.create_publisher(message_type, f"~/{topic}", qos.STATE, qos_overriding_options=qos.OVERRIDABLE)

        self._pose = publisher(PoseStamped, "pose"), cdr.StampedTemplate(world_frame, 7)
        self._twist = publisher(TwistStamped, "twist"), cdr.StampedTemplate(world_frame, 6)
        self._odom = (
            publisher(Odometry, "odom"),
            cdr.StampedTemplate(world_frame, cdr.ODOMETRY_DOUBLES, child_frame_id=body_frame),
        )
        self._imu = publisher(Imu, "imu")
        self._clock = None
        self._tf = None

    def configure(self, values: Mapping[str, object]) -> None:
        """Create or drop the publishers of /clock and /tf; runs on the executor's thread."""
        if values["publish_clock"] and self._clock is None:
            self._clock = self._node.create_publisher(Clock, "/clock", qos.CLOCK)
        elif not values["publish_clock"] and self._clock is not None:
            clock, self._clock = self._clock, None
            self._node.destroy_publisher(clock)
        if values["publish_tf"] and self._tf is None:
            self._tf = self._tf_publisher()
        elif not values["publish_tf"] and self._tf is not None:
            tf, self._tf = self._tf, None
            self._node.destroy_publisher(tf)

    def _tf_publisher(self):
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            self._node.get_logger().warning("publish_tf: tf2_msgs isn't installed (ros-jazzy-tf2-msgs); no /tf")
            return None
        return self._node.create_publisher(TFMessage, "/tf", qos.TF)

    def publish(self, state: State) -> None:
        """Publish one state on every topic that has a subscriber."""
        time_ns, row = state.time_ns, state.row.tolist()
        q, v, w = row[3:7], row[7:10], row[10:13]
        clock = self._clock
        if clock is not None and clock.get_subscription_count():
            clock.publish(cdr.time(time_ns))
        publisher, template = self._pose
        if publisher.get_subscription_count():
            publisher.publish(bytes(template.pack(time_ns, row[:7])))
        publisher, template = self._twist
        if publisher.get_subscription_count():
            publisher.publish(bytes(template.pack(time_ns, [*v, *rotate(*q, *w)])))
        publisher, template = self._odom
        if publisher.get_subscription_count():
            # An Odometry's twist is in the child frame: body axes.
            template.pack(time_ns, row[:7])
            v_body = rotate(-q[0], -q[1], -q[2], q[3], *v)
            publisher.publish(bytes(template.pack(time_ns, [*v_body, *w], at=cdr.ODOMETRY_TWIST_AT)))
        if self._imu.get_subscription_count():
            self._imu.publish(self._imu_message(time_ns, q, w))
        tf = self._tf
        if tf is not None and tf.get_subscription_count():
            tf.publish(self._transform(tf.msg_type, time_ns, row))

    def _imu_message(self, time_ns: int, q: list[float], w: list[float]) -> Imu:
        """Attitude, angular velocity and exact specific force, both in body axes, at the contact that was chosen."""
        message = Imu()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        message.header.frame_id = self._frames[1]
        o, rate, felt = message.orientation, message.angular_velocity, message.linear_acceleration
        o.x, o.y, o.z, o.w = q
        rate.x, rate.y, rate.z = w
        felt.x, felt.y, felt.z = self._specific_force().tolist()
        return message

    def _transform(self, message_type, time_ns: int, row: list[float]):
        transform = TransformStamped()
        transform.header.stamp.sec, transform.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        transform.header.frame_id, transform.child_frame_id = self._frames
        t, r = transform.transform.translation, transform.transform.rotation
        t.x, t.y, t.z, r.x, r.y, r.z, r.w = row[:7]
        return message_type(transforms=[transform])
