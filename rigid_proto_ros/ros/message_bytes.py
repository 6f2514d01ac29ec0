# SPDX-License-Identifier: MIT
"""Received messages read from their bytes, without message objects; anything unusual goes through rclpy's own reader."""

from __future__ import annotations

import struct

from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message

from ..core.errors import CommandRefused

_STAMP_AND_LENGTH = struct.Struct("<iII")
_SIX_DOUBLES = struct.Struct("<6d")
_LITTLE_ENDIAN_CDR = b"\x00\x01"


def read_wrench_stamped(data: bytes) -> tuple[int, str, tuple, tuple]:
    """stamp [ns], frame_id, force, torque of a serialized geometry_msgs/WrenchStamped.

    Raises CommandRefused for bytes that are no such message, or whose frame_id isn't UTF-8.
    """
    if data[:2] == _LITTLE_ENDIAN_CDR and len(data) >= 16:
        seconds, nanoseconds, length = _STAMP_AND_LENGTH.unpack_from(data, 4)
        end = 16 + length
        doubles_at = 4 + (end - 4 + 7) // 8 * 8
        if length and doubles_at + 48 <= len(data):
            values = _SIX_DOUBLES.unpack_from(data, doubles_at)
            try:
                frame_id = data[16 : end - 1].decode()
            except UnicodeDecodeError:
                raise CommandRefused("frame", "frame_id", "bytes that aren't UTF-8", "text") from None
            return whole_stamp(seconds, nanoseconds), frame_id, values[:3], values[3:]
    message = read_message(data, WrenchStamped)
    stamp, wrench = message.header.stamp, message.wrench
    return (
        whole_stamp(stamp.sec, stamp.nanosec),
        message.header.frame_id,
        (wrench.force.x, wrench.force.y, wrench.force.z),
        (wrench.torque.x, wrench.torque.y, wrench.torque.z),
    )


def read_message(data: bytes, message_type):
    """A message from its bytes; raises CommandRefused for bytes that are none of its type."""
    try:
        return deserialize_message(data, message_type)
    except Exception:  # rclpy's own error types differ between versions and middlewares
        accepted = f"a serialized {message_type.__name__}"
        raise CommandRefused("frame", "message", f"{len(data)} bytes that are none", accepted) from None


def whole_stamp(seconds: int, nanoseconds: int) -> int:
    """A stamp [ns]; raises CommandRefused (``stamp``) unless the nanoseconds are less than a second."""
    if nanoseconds >= 1_000_000_000:
        raise CommandRefused("stamp", "header.stamp", f"{nanoseconds} nanosec", "nanosec below 1000000000")
    return seconds * 1_000_000_000 + nanoseconds
