# SPDX-License-Identifier: MIT
"""Typed wrenches (rigid_proto_interfaces/BodyWrench), where that package is installed: what ``axes@point`` and its
options say in the ``frame_id`` of a WrenchStamped, each in a field of its own.
"""

from __future__ import annotations

from typing import Any

from ..base.rotation import Vector


def body_wrench_type() -> type | None:
    """The message's type, or None where its package isn't installed."""
    try:
        from rigid_proto_interfaces.msg import BodyWrench
    except ImportError:
        return None
    return BodyWrench


def frame_of(message: Any) -> str:
    """The frame of a BodyWrench as the ``frame_id`` of a WrenchStamped says it."""
    axes = message.header.frame_id
    place = f"{axes or 'world'}@{message.point}" if message.point else axes
    duration = f";duration={message.duration!r}" if message.duration else ""
    impulse = ";impulse" if message.impulse else ""
    slot = f";slot={message.slot}" if message.slot else ""
    return f"{place}{duration}{impulse}{slot}"


def wrench_of(message: Any) -> tuple[Vector, Vector]:
    """Force and torque of a BodyWrench."""
    force, torque = message.wrench.force, message.wrench.torque
    return (force.x, force.y, force.z), (torque.x, torque.y, torque.z)
