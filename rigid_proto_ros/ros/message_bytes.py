# SPDX-License-Identifier: MIT
"""Received messages read from their bytes, without message objects; anything unusual goes through rclpy's own reader."""

from __future__ import annotations

from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message

from ..base.errors import CommandRefused
from ..messages import cdr
from ..scene.command_codec import ScriptCommand, of_message, whole_stamp


def read_wrench_stamped(data: bytes) -> tuple[int, str, tuple, tuple]:
    """stamp [ns], frame_id, force, torque of a serialized geometry_msgs/WrenchStamped.

    Raises CommandRefused for bytes that are no such message, or whose frame_id isn't UTF-8.
    """
    try:
        seconds, nanoseconds, frame_id, values = cdr.read_stamped_doubles(data, 6)
    except ValueError:
        seconds, nanoseconds, frame_id, values = cdr.read_stamped_doubles(_little_endian(data, WrenchStamped), 6)
    return whole_stamp(seconds, nanoseconds), frame_id, values[:3], values[3:]


def read_command(topic: str, data: bytes, message_type) -> ScriptCommand:
    """The command of a message on a topic other than ``schedule``; raises CommandRefused for bytes that are none of its type."""
    try:
        return of_message(topic, data)
    except CommandRefused:
        raise
    except ValueError:
        return of_message(topic, _little_endian(data, message_type))


def _little_endian(data: bytes, message_type) -> bytes:
    """A message's bytes as little-endian CDR, however its sender has packed them."""
    return serialize_message(read_message(data, message_type))


def read_message(data: bytes, message_type):
    """A message from its bytes; raises CommandRefused for bytes that are none of its type."""
    try:
        return deserialize_message(data, message_type)
    except Exception:  # rclpy's own error types differ between versions and middlewares
        accepted = f"a serialized {message_type.__name__}"
        raise CommandRefused("frame", "message", f"{len(data)} bytes that are none", accepted) from None
