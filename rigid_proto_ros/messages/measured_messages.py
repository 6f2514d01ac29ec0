# SPDX-License-Identifier: MIT
"""Messages that anybody's sensors and controllers send, from their bytes: poses, transforms, twists,
odometry, IMUs, wrenches.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..base.errors import InputError

_LITTLE_ENDIAN = (
    b"\x00\x01",
    b"\x00\x07",
)  # plain CDR of XCDR1 and XCDR2; these messages have the same layout in both but for 8-byte alignment
_XCDR2 = b"\x00\x07"


@dataclass(frozen=True)
class Stamped:
    """One message. stamp_ns as its header says; frame_id and child_frame_id; numbers: the type's own, in its order.

    Of an Imu: attitude xyzw (4), angular velocity (3), acceleration (3), and of each whether it is given (3).
    """

    stamp_ns: int
    frame_id: str
    child_frame_id: str
    numbers: tuple[float, ...]


class _Reader:
    """Walks through little-endian CDR; raises struct.error or ValueError beyond its end."""

    def __init__(self, data: bytes) -> None:
        if data[:2] not in _LITTLE_ENDIAN:
            raise ValueError("not little-endian CDR")
        self._data, self._at = data, 4
        self._widest = 4 if data[:2] == _XCDR2 else 8

    def count(self) -> int:
        """An unsigned 32-bit number."""
        self._align(4)
        (value,) = struct.unpack_from("<I", self._data, self._at)
        self._at += 4
        return int(value)

    def text(self) -> str:
        """A string."""
        length = self.count()
        if length < 1 or self._at + length > len(self._data):
            raise ValueError("a string beyond the end")
        found = self._data[self._at : self._at + length - 1].decode()
        self._at += length
        return found

    def doubles(self, count: int) -> tuple[float, ...]:
        """Doubles side by side."""
        self._align(self._widest)
        found = struct.unpack_from(f"<{count}d", self._data, self._at)
        self._at += 8 * count
        return found

    def header(self) -> tuple[int, str]:
        """Stamp [ns] and frame."""
        self._align(4)
        seconds, nanoseconds = struct.unpack_from("<iI", self._data, self._at)
        self._at += 8
        return seconds * 1_000_000_000 + nanoseconds, self.text()

    def _align(self, to: int) -> None:
        self._at += -(self._at - 4) % to


def _plain(count: int) -> Callable[[_Reader], Iterator[Stamped]]:
    def read(reader: _Reader) -> Iterator[Stamped]:
        stamp_ns, frame = reader.header()
        yield Stamped(stamp_ns, frame, "", reader.doubles(count))

    return read


def _transform(reader: _Reader) -> Iterator[Stamped]:
    stamp_ns, frame = reader.header()
    child = reader.text()
    yield Stamped(stamp_ns, frame, child, reader.doubles(7))


def _transforms(reader: _Reader) -> Iterator[Stamped]:
    for _ in range(reader.count()):
        yield from _transform(reader)


def _odometry(reader: _Reader) -> Iterator[Stamped]:
    stamp_ns, frame = reader.header()
    child = reader.text()
    numbers = reader.doubles(7 + 36 + 6)
    yield Stamped(stamp_ns, frame, child, numbers[:7] + numbers[43:])


def _imu(reader: _Reader) -> Iterator[Stamped]:
    stamp_ns, frame = reader.header()
    numbers = reader.doubles(37)
    # A covariance that begins with -1 says that its quantity isn't measured (sensor_msgs/msg/Imu).
    given = tuple(float(numbers[k] != -1.0) for k in (4, 16, 28))
    yield Stamped(stamp_ns, frame, frame, numbers[0:4] + numbers[13:16] + numbers[25:28] + given)


_READERS: dict[str, Callable[[_Reader], Iterator[Stamped]]] = {
    "geometry_msgs/msg/PoseStamped": _plain(7),
    "geometry_msgs/msg/TwistStamped": _plain(6),
    "geometry_msgs/msg/WrenchStamped": _plain(6),
    "geometry_msgs/msg/TransformStamped": _transform,
    "tf2_msgs/msg/TFMessage": _transforms,
    "nav_msgs/msg/Odometry": _odometry,
    "sensor_msgs/msg/Imu": _imu,
}

MEASURED_TYPES = tuple(_READERS)
"""Message types that can be read."""


def read_measured(message_type: str, data: bytes, topic: str) -> list[Stamped]:
    """What a message of one of ``MEASURED_TYPES`` holds: one, but any number in a TFMessage; raises InputError."""
    try:
        return list(_READERS[message_type](_Reader(data)))
    except (struct.error, ValueError):
        raise InputError(topic, f"a message can't be decoded as {message_type} in little-endian CDR") from None
