# SPDX-License-Identifier: MIT
"""Received messages read from their bytes, without message objects; anything unusual goes through rclpy's own reader."""

from __future__ import annotations

import struct

from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message

_STAMP_AND_LENGTH = struct.Struct("<iII")
_SIX_DOUBLES = struct.Struct("<6d")
_LITTLE_ENDIAN_CDR = b"\x00\x01"


def read_wrench_stamped(data: bytes) -> tuple[int, str, tuple, tuple]:
    """stamp [ns], frame_id, force, torque of a serialized geometry_msgs/WrenchStamped.

    Raises UnicodeDecodeError for a frame_id that isn't UTF-8.
    """
    if data[:2] == _LITTLE_ENDIAN_CDR and len(data) >= 16:
        seconds, nanoseconds, length = _STAMP_AND_LENGTH.unpack_from(data, 4)
        end = 16 + length
        doubles_at = 4 + (end - 4 + 7) // 8 * 8
        if length and doubles_at + 48 <= len(data):
            values = _SIX_DOUBLES.unpack_from(data, doubles_at)
            frame_id = data[16 : end - 1].decode()
            return seconds * 1_000_000_000 + nanoseconds, frame_id, values[:3], values[3:]
    message = deserialize_message(data, WrenchStamped)
    stamp, wrench = message.header.stamp, message.wrench
    return (
        stamp.sec * 1_000_000_000 + stamp.nanosec,
        message.header.frame_id,
        (wrench.force.x, wrench.force.y, wrench.force.z),
        (wrench.torque.x, wrench.torque.y, wrench.torque.z),
    )
