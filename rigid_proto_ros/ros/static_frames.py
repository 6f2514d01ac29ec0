# SPDX-License-Identifier: MIT
"""Frames fixed to body or world, as /tf_static tells them (where tf2_msgs is installed).

The node's own go out: the mesh's and one a contact, all at the body. Those of others come in, so that a wrench may be
given in any frame that a chain of them fixes to the body or to the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

from ..base.errors import CommandRefused
from ..base.rotation import Vector, rotate, vector
from ..motion.body import Body
from ..motion.frames import Frame, parse_frame
from ..simulation.observer import BodySnapshot
from . import qos
from .pacing import Stamps

MOST_LINKS = 100
"""Of a chain of frames; longer ones go in a circle."""


class Wrench(NamedTuple):
    """A wrench in a frame that needs no transform: the frame, its text, force [N] and torque [N m] (3,)."""

    frame: Frame
    frame_id: str
    force: Vector
    torque: Vector


class _Transform(NamedTuple):
    """From a frame to its parent: attitude xyzw and origin [m]."""

    parent: str
    attitude: tuple[float, float, float, float]
    origin: Vector

    def turned(self, values: Vector) -> Vector:
        """A vector (3,) of the frame in the parent's axes."""
        return rotate(*self.attitude, *values)

    def moved(self, point: Vector) -> Vector:
        """A point (3,) of the frame in the parent's coordinates."""
        x, y, z = self.turned(point)
        a, b, c = self.origin
        return x + a, y + b, z + c


class StaticFrames:
    """frames: what the node calls world and body. contacts: in mesh coordinates, by name."""

    def __init__(self, node: Node, frames: tuple[str, str], contacts: Mapping[str, Vector], stamps: Stamps) -> None:
        self._world, self._body = frames
        self._contacts = contacts
        self._stamps = stamps
        self._links: dict[str, _Transform] = {}
        self._publisher: Any = None
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            return
        self._message_type = TFMessage
        self._publisher = node.create_publisher(TFMessage, "/tf_static", qos.own(qos.LATCHED))
        node.create_subscription(TFMessage, "/tf_static", self._heard, qos.own(qos.TF_STATIC))

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        """Mesh and contacts lie otherwise about the COM from now on."""
        if self._publisher is None:
            return
        origins = {"mesh": (-body.center_of_mass).tolist()}
        for name, point in self._contacts.items():
            origins[name] = (body.scale * point - body.center_of_mass).tolist()
        transforms = []
        for name, origin in origins.items():
            transform = TransformStamped()
            transform.header.stamp.sec, transform.header.stamp.nanosec = self._stamps.of(time_ns)
            transform.header.frame_id, transform.child_frame_id = self._body, f"{self._body}/{name}"
            translation = transform.transform.translation
            translation.x, translation.y, translation.z = (x + 0.0 for x in origin)
            transforms.append(transform)
        self._publisher.publish(self._message_type(transforms=transforms))

    def _heard(self, message: Any) -> None:
        for link in message.transforms:
            q, t = link.transform.rotation, link.transform.translation
            # Assigned whole: the physics thread reads it.
            self._links[link.child_frame_id] = _Transform(link.header.frame_id, (q.x, q.y, q.z, q.w), (t.x, t.y, t.z))

    @property
    def known(self) -> bool:
        """Whether any frame has been heard of."""
        return bool(self._links)

    def read(self, frame_id: str, body: Body, force: Vector, torque: Vector) -> Wrench:
        """A wrench of this frame, which is none of the node's own words, in body or world axes.

        One of a frame fixed to the body acts at that frame's origin; one fixed to the world gives axes alone, as
        ``world`` does, and the wrench acts at the COM. Raises CommandRefused for a frame that is fixed to neither.
        """
        place, semicolon, options = frame_id.partition(";")
        name, point = place, (0.0, 0.0, 0.0)
        for _ in range(MOST_LINKS):
            if name in (self._world, self._body):
                break
            if name not in self._links:
                accepted = f"axes@point, or a frame that /tf_static fixes to {self._body} or {self._world}"
                raise CommandRefused("frame", "frame_id", frame_id, accepted)
            link = self._links[name]
            name, point, force, torque = link.parent, link.moved(point), link.turned(force), link.turned(torque)
        else:
            raise CommandRefused("frame", "frame_id", frame_id, f"at most {MOST_LINKS} frames in a chain")
        at = "world@com"
        if name == self._body:
            x, y, z = vector(body.mesh_point(point))
            at = f"body@point/{x!r},{y!r},{z!r}"
        text = f"{at}{semicolon}{options}"
        return Wrench(parse_frame(text), text, force, torque)
