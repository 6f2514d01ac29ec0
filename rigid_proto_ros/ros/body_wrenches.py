# SPDX-License-Identifier: MIT
"""Typed wrenches (rigid_proto_interfaces/BodyWrench), where that package is installed: what ``axes@point`` and its
options say in the ``frame_id`` of a WrenchStamped, each in a field of its own.
"""

from __future__ import annotations

import importlib.util
from typing import Any

from ..base.errors import InputError
from ..base.rotation import Vector


def body_wrench_type() -> type | None:
    """The message's type, or None where its package isn't installed. Raises InputError for one that can't be loaded."""
    if importlib.util.find_spec("rigid_proto_interfaces") is None:
        return None
    try:
        from rclpy.type_support import check_for_type_support
        from rigid_proto_interfaces.msg import BodyWrench

        check_for_type_support(BodyWrench)
    except Exception as error:  # whatever a half-built package raises
        reason = f"{type(error).__name__}: {error}"
        raise InputError("rigid_proto_interfaces", reason, "a whole build (`make interfaces`), or none") from None
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
