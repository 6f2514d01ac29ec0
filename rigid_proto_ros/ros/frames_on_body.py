# SPDX-License-Identifier: MIT
"""Frames fixed to the body, as /tf_static tells them (where tf2_msgs is installed): the mesh's and one a contact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

from ..base.vectors import Vector
from ..simulation.observer import BodySnapshot
from . import qos


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
