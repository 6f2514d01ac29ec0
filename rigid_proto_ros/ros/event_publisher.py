# SPDX-License-Identifier: MIT
"""What happened to the body, as messages: inertia, scene and the frames fixed to it (latched), applied commands and the
event log.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

from geometry_msgs.msg import InertiaStamped, TransformStamped, WrenchStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from ..base.vectors import Vector
from ..live.pacing import Stamps
from ..scene import cdr
from ..session.messages import applied_bytes
from ..simulation.observer import Applied, BodyChanged, BodySnapshot, Event, Logged, Observer, Refused, SceneChanged
from . import qos

WARNING_S = 1.0
"""Between two warnings of one reason, wall time."""


class EventPublisher(Observer):
    """An observer that publishes on the physics thread what happens, which is rare. stamps: set before the first."""

    takes = frozenset({SceneChanged, BodyChanged, Applied, Refused, Logged})

    def __init__(
        self,
        node: Node,
        body_frame: str,
        contacts: Mapping[str, Vector],
    ) -> None:
        def publisher(message_type: type, topic: str, profile: QoSProfile) -> Publisher:
            return node.create_publisher(
                message_type, f"~/{topic}", qos.own(profile), qos_overriding_options=qos.OVERRIDABLE
            )

        self._logger = node.get_logger()
        self.stamps = Stamps()
        self._frames_on_body = FramesOnBody(node, body_frame, contacts)
        self._body_frame = body_frame
        self._mesh_frame = f"{body_frame}/mesh"
        self._inertia = publisher(InertiaStamped, "inertia", qos.LATCHED)
        self._scene = publisher(String, "scene", qos.LATCHED)
        self._applied = publisher(WrenchStamped, "applied", qos.EVENT)
        self._events = publisher(String, "events", qos.EVENT)
        self._warned: dict[str, float] = {}

    def wants(self, kind: type) -> bool:
        """Lines of the event log only while somebody listens to their topic."""
        return self._events.get_subscription_count() > 0 if kind is Logged else kind in self.takes

    def on(self, event: Event) -> None:
        """Publish it, or warn of it."""
        match event:
            case Logged(_, line):
                if self.wants(Logged):
                    self._events.publish(cdr.string(line))
            case SceneChanged(_, scene):
                # All parameters, and the mesh's hash in a comment, as a parameter file.
                self._scene.publish(cdr.string(scene))
            case BodyChanged():
                self._publish_inertia(event)
            case Applied():
                self._publish_applied(event)
            case Refused(_, reason, message):
                self._warn(reason, message)

    def _publish_inertia(self, event: BodyChanged) -> None:
        """Latched: COM in scaled mesh coordinates, tensor about it in mesh axes."""
        time_ns, body = event
        message = InertiaStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = self.stamps.of(time_ns)
        message.header.frame_id = self._mesh_frame
        inertia, I = message.inertia, body.inertia
        inertia.m = body.mass
        inertia.com.x, inertia.com.y, inertia.com.z = body.center_of_mass.tolist()
        inertia.ixx, inertia.ixy, inertia.ixz = float(I[0, 0]), float(I[0, 1]), float(I[0, 2])
        inertia.iyy, inertia.iyz, inertia.izz = float(I[1, 1]), float(I[1, 2]), float(I[2, 2])
        self._inertia.publish(message)
        self._frames_on_body.publish(self.stamps.of(time_ns), body)

    def _publish_applied(self, event: Applied) -> None:
        """A wrench or poke as it took effect: about the COM in the body's frame, which TF knows. What its sender said
        of point, axes, slot and duration stands in its event.
        """
        if self._applied.get_subscription_count():
            stamp_ns = event.time_ns + self.stamps.offset_ns
            self._applied.publish(applied_bytes(stamp_ns, self._body_frame, event.load, event.body, event.attitude))

    def _warn(self, reason: str, message: str) -> None:
        """For what is refused when it comes and for what turns out impossible when it is to act.

        At most one a second for each reason: a flood of one kind doesn't hide what else goes wrong.
        """
        now = time.monotonic()
        if now >= self._warned.get(reason, -math.inf) + WARNING_S:
            self._warned[reason] = now
            self._logger.warning(f"refused: {message}")


class FramesOnBody:
    """contacts: in mesh coordinates, by name."""

    def __init__(self, node: Node, body_frame: str, contacts: Mapping[str, Vector]) -> None:
        self._body_frame = body_frame
        self._contacts = contacts
        self._publisher: Any = None
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            return
        self._message_type = TFMessage
        self._publisher = node.create_publisher(TFMessage, "/tf_static", qos.own(qos.LATCHED))

    def publish(self, stamp: tuple[int, int], body: BodySnapshot) -> None:
        """Mesh and contacts lie like this about the COM from now on; stamp: seconds and nanoseconds."""
        if self._publisher is None:
            return
        origins = {"mesh": (-body.center_of_mass).tolist()}
        for name, point in self._contacts.items():
            origins[name] = (body.scale * point - body.center_of_mass).tolist()
        transforms = []
        for name, origin in origins.items():
            transform = TransformStamped()
            transform.header.stamp.sec, transform.header.stamp.nanosec = stamp
            transform.header.frame_id, transform.child_frame_id = self._body_frame, f"{self._body_frame}/{name}"
            translation = transform.transform.translation
            translation.x, translation.y, translation.z = (x + 0.0 for x in origin)
            transforms.append(transform)
        self._publisher.publish(self._message_type(transforms=transforms))
