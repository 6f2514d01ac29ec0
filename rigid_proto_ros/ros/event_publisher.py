# SPDX-License-Identifier: MIT
"""What happened to the body, as messages: inertia and scene (latched), applied commands, the event log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from geometry_msgs.msg import InertiaStamped, WrenchStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from ..messages import cdr
from ..motion.body import Body
from ..motion.loads import Load
from ..simulation.commands import WrenchCommand
from ..simulation.observer import BodySnapshot, Observer
from . import qos
from .robot_description import RobotDescription
from .static_frames import StaticFrames

WARNING_S = 1.0
"""Between two warnings of one reason, wall time."""


class EventPublisher(Observer):
    """An observer that publishes; its methods run on the physics thread, and are rare."""

    def __init__(self, node: Node, body_frame: str, mesh_path: Callable[[], str], static_frames: StaticFrames) -> None:
        def publisher(message_type: type, topic: str, profile: QoSProfile) -> Publisher:
            return node.create_publisher(
                message_type, f"~/{topic}", qos.own(profile), qos_overriding_options=qos.OVERRIDABLE
            )

        self._logger = node.get_logger()
        self._static_frames = static_frames
        self._mesh_frame = f"{body_frame}/mesh"
        self._inertia = publisher(InertiaStamped, "inertia", qos.LATCHED)
        self._scene = publisher(String, "scene", qos.LATCHED)
        self._description = RobotDescription(node, body_frame, mesh_path)
        self._applied = publisher(WrenchStamped, "applied", qos.EVENT)
        self._events = publisher(String, "events", qos.EVENT)
        self._warned: dict[str, float] = {}

    def scene_changed(self, time_ns: int, scene: str) -> None:  # noqa: ARG002 (an observer is told)
        """All parameters, and the mesh's hash in a comment, as a parameter file."""
        self._scene.publish(cdr.string(scene))

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        """The latched inertia: COM in scaled mesh coordinates, tensor about it in mesh axes."""
        message = InertiaStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        message.header.frame_id = self._mesh_frame
        inertia, I = message.inertia, body.inertia
        inertia.m = body.mass
        inertia.com.x, inertia.com.y, inertia.com.z = body.center_of_mass.tolist()
        inertia.ixx, inertia.ixy, inertia.ixz = float(I[0, 0]), float(I[0, 1]), float(I[0, 2])
        inertia.iyy, inertia.iyz, inertia.izz = float(I[1, 1]), float(I[1, 2]), float(I[2, 2])
        self._inertia.publish(message)
        self._description.body_changed(body)
        self._static_frames.body_changed(time_ns, body)

    def applied(self, time_ns: int, command: WrenchCommand, load: Load, body: Body) -> None:
        """A wrench or poke as it took effect: its point settled on the body, its axes world or body."""
        if self._applied.get_subscription_count():
            force = load.force if load.axes == "world" else load.own_force(body).tolist()
            frame_id = load.frame_id + command.frame.options
            self._applied.publish(cdr.wrench_stamped(time_ns, frame_id, force, load.torque))

    def refused(self, time_ns: int, reason: str, message: str) -> None:  # noqa: ARG002
        """A warning, for what is refused when it comes and for what turns out impossible when it is to act.

        At most one a second for each reason: a flood of one kind doesn't hide what else goes wrong.
        """
        now = time.monotonic()
        if now >= self._warned.get(reason, -math.inf) + WARNING_S:
            self._warned[reason] = now
            self._logger.warning(f"refused: {message}")

    def event(self, time_ns: int, line: str) -> None:  # noqa: ARG002
        """A line of the event log."""
        if self.wants_events():
            self._events.publish(cdr.string(line))

    def wants_events(self) -> bool:
        """Somebody listens to the topic."""
        return self._events.get_subscription_count() > 0
