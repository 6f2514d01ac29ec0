# SPDX-License-Identifier: MIT
"""The body as a URDF on a latched topic, for viewers that draw robot descriptions: made for subscribers alone."""

from __future__ import annotations

from collections.abc import Callable
from xml.sax.saxutils import quoteattr

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import String

from ..mass.export import urdf_inertial
from ..mass.properties import MassProperties
from ..simulation.observer import BodySnapshot
from . import qos


class RobotDescription:
    """``~/robot_description``: whoever subscribes gets the present body, and every later one while subscribed.

    The physics thread only notes the body; text is made and published on the executor's thread. mesh_path() gives the
    file of the body's mesh, "" without one.
    """

    def __init__(self, node: Node, body_frame: str, mesh_path: Callable[[], str]) -> None:
        self._node = node
        self._body_frame = body_frame
        self._mesh_path = mesh_path
        self._present: tuple[BodySnapshot, str] | None = None
        self._published: tuple[BodySnapshot, str] | None = None
        self._publisher = self._make_publisher()
        self._changed = node.create_guard_condition(self._bring_up_to_date)

    def body_changed(self, body: BodySnapshot) -> None:
        """On the physics thread: this is the body from now on."""
        self._present = body, self._mesh_path()
        self._changed.trigger()

    def _make_publisher(self) -> Publisher:
        return self._node.create_publisher(
            String,
            "~/robot_description",
            qos.own(qos.LATCHED),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: self._bring_up_to_date()),
            qos_overriding_options=qos.OVERRIDABLE,
        )

    def _bring_up_to_date(self) -> None:
        """After a change, and whenever a subscription comes or goes."""
        present = self._present
        if present is None or present is self._published:
            return  # the middleware keeps the last one for late joiners
        if self._publisher.get_subscription_count():
            self._publisher.publish(String(data=urdf(*present, self._body_frame)))
            self._published = present
        elif self._published is not None:
            # Nobody listens, and the one kept for late joiners is out of date: a new publisher keeps none.
            self._node.destroy_publisher(self._publisher)
            self._published = None
            self._publisher = self._make_publisher()


def urdf(body: BodySnapshot, mesh_path: str, name: str) -> str:
    """The body as a URDF of one link at the COM; mesh_path "" for none."""
    inertial = urdf_inertial(MassProperties(body.mass, body.center_of_mass, body.inertia), frame="com")
    visual = ""
    if mesh_path:
        origin = " ".join(f"{-c + 0.0:.17g}" for c in body.center_of_mass)
        scale = " ".join(f"{s:.17g}" for s in body.scale)
        mesh = f'<mesh filename={quoteattr("file://" + mesh_path)} scale="{scale}"/>'
        visual = f'<visual><origin xyz="{origin}" rpy="0 0 0"/><geometry>{mesh}</geometry></visual>'
    quoted = quoteattr(name)
    return (
        f'<?xml version="1.0"?>\n<robot name={quoted}>\n<link name={quoted}>\n{inertial}{visual}\n</link>\n</robot>\n'
    )
