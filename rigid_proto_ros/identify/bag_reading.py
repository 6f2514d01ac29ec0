# SPDX-License-Identifier: MIT
"""Anybody's bags as measured flights, read by rosbags: which topics count, their messages as series, a wrench's as
loads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError, is_missing
from ..motion.frames import parse_frame
from . import measurements as ms
from .wrench_messages import WRENCH_TIMEOUT_NS, wrench_history

EARTH = (0.0, 0.0, -9.81)

TRANSFORMS = ("geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage")
KINDS = {
    "pose": ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped", *TRANSFORMS),
    "twist": ("geometry_msgs/msg/TwistStamped",),
    "odom": ("nav_msgs/msg/Odometry",),
    "imu": ("sensor_msgs/msg/Imu",),
    "wrench": ("geometry_msgs/msg/WrenchStamped",),
}
"""Options, and the types of message that each takes."""


@dataclass(frozen=True)
class Choice:
    """What of a bag counts. topics: by option, as given, ``TOPIC`` or ``TOPIC@frame``. offsets [s] by
    topic: given ones.
    """

    topics: dict[str, str] = field(default_factory=dict)
    offsets: dict[str, float] = field(default_factory=dict)
    first_s: float = 0.0
    last_s: float = np.inf
    gravity: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class _Message:
    """stamp_ns as its header says. numbers: the type's own, in its order; of an Imu its rate and its acceleration, NaN
    where they aren't given.
    """

    stamp_ns: int
    frame_id: str
    child_frame_id: str
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class _Topic:
    """name and the frame that stands behind it, or empty; messages in the order of their stamps."""

    name: str
    frame: str
    messages: list[_Message]

    @property
    def times_ns(self) -> np.ndarray:
        return np.array([message.stamp_ns for message in self.messages], np.int64)

    def numbers(self, first: int, last: int) -> np.ndarray:
        return np.array([message.numbers[first:last] for message in self.messages], float).reshape(-1, last - first)


def bag_flight(path: Path, choice: Choice) -> ms.MeasuredFlight:
    """What was measured in a bag; raises InputError naming the topic and what is wrong with it."""
    chosen = _chosen_topics(path, choice)
    _check_clocks(chosen, choice)
    begin = min(int(topic.times_ns[0]) for topic in chosen.values())
    window = (begin + round(choice.first_s * 1e9), begin + round(min(choice.last_s, 1e9) * 1e9))
    series = [one for kind, topic in chosen.items() if kind != "wrench" for one in _series(kind, topic, chosen)]
    series = [part for part in (one.within(*window) for one in series) if len(part.times_ns)]
    if not series:
        raise InputError("--from", choice.first_s, f"a window with samples of {path} in it")
    loads = ms.no_loads()
    if "wrench" in chosen:
        wrench = chosen["wrench"]
        loads = wrench_history(wrench.name, wrench.times_ns, wrench.numbers(0, 6), *_wrench_frame(wrench, chosen))
    where = "assumed, as no --gravity was given" if choice.gravity is None else "from --gravity"
    return ms.MeasuredFlight(str(path), tuple(series), loads, choice.gravity or EARTH, gravity_from=where)


def _chosen_topics(path: Path, choice: Choice) -> dict[str, _Topic]:
    """By option."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError("session", str(path), is_missing("rosbags", "identify")) from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as bag:
            types = {one.topic: one.msgtype for one in bag.connections if one.msgcount}
            chosen = _chosen(types, choice.topics, str(path))
            names = {topic for topic, _ in chosen.values()}
            found: dict[str, list[_Message]] = {name: [] for name in names}
            connections = [one for one in bag.connections if one.topic in names]
            for connection, logged_ns, data in bag.messages(connections):
                message = bag.deserialize(data, connection.msgtype)
                found[connection.topic] += _messages(connection.msgtype, message, logged_ns)
    except InputError:
        raise
    except Exception as error:  # the library lets through whatever cut or damaged bytes lead to
        accepted = f"a bag that rosbags can read ({error}); ros2 bag reindex mends one whose recorder was killed"
        raise InputError("session", str(path), accepted) from None
    return {kind: _topic(found[name], name, types[name], frame) for kind, (name, frame) in chosen.items()}


def _chosen(types: dict[str, str], given: dict[str, str], path: str) -> dict[str, tuple[str, str]]:
    """(topic, frame) by option: those given, else the only one of its types."""
    found = {}
    for kind, text in given.items():
        topic, _, frame = text.partition("@")
        fitting = ", ".join(sorted(name for name, its_type in types.items() if its_type in KINDS[kind]))
        if topic not in types:
            raise InputError(f"--{kind}", topic, f"a topic of the bag: {fitting or 'it has none of such a type'}")
        if types[topic] not in KINDS[kind]:
            raise InputError(f"--{kind}", f"{topic}, a {types[topic]}", " or ".join(KINDS[kind]))
        found[kind] = (topic, frame)
    for kind, accepted in KINDS.items() if not given else ():
        topics = sorted(topic for topic, its_type in types.items() if its_type in accepted)
        if len(topics) > 1:
            several = f"{path} has several {kind} topics, {', '.join(topics)}"
            raise InputError("session", f"{several}; say which with --{kind}")
        if topics:
            found[kind] = (topics[0], "")
    if not {"pose", "odom"} & set(found):
        known = ", ".join(f"{t} ({k})" for t, k in sorted(types.items())[:6]) or "nothing"
        raise InputError("session", f"{path} has no poses, transforms or odometry; it has {known}")
    return found


def _messages(message_type: str, message: Any, logged_ns: int) -> list[_Message]:
    """What a message of one of KINDS holds: one, but any number in a TFMessage."""
    if message_type == "tf2_msgs/msg/TFMessage":
        return [one for part in message.transforms for one in _messages(TRANSFORMS[0], part, logged_ns)]
    header = message.header
    stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
    child = getattr(message, "child_frame_id", "")
    return [_Message(stamp_ns or logged_ns, header.frame_id, child, _NUMBERS[message_type](message))]


def _pair(one: Any, other: Any) -> tuple[float, ...]:
    """Of two vectors, or of a position and an orientation xyzw."""
    numbers = (one.x, one.y, one.z, other.x, other.y, other.z)
    return (*numbers, other.w) if hasattr(other, "w") else numbers


def _pose(pose: Any) -> tuple[float, ...]:
    return _pair(pose.position, pose.orientation)


def _imu(m: Any) -> tuple[float, ...]:
    """A covariance that begins with -1 says that its quantity isn't measured (sensor_msgs/msg/Imu)."""
    numbers = _pair(m.angular_velocity, m.linear_acceleration)
    has_rate, has_felt = m.angular_velocity_covariance[0] != -1.0, m.linear_acceleration_covariance[0] != -1.0
    none = (np.nan, np.nan, np.nan)
    return (numbers[:3] if has_rate else none) + (numbers[3:] if has_felt else none)


_NUMBERS: dict[str, Callable[[Any], tuple[float, ...]]] = {
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda m: _pair(m.transform.translation, m.transform.rotation),
    "geometry_msgs/msg/TwistStamped": lambda m: _pair(m.twist.linear, m.twist.angular),
    "geometry_msgs/msg/WrenchStamped": lambda m: _pair(m.wrench.force, m.wrench.torque),
    "nav_msgs/msg/Odometry": lambda m: (*_pose(m.pose.pose), *_pair(m.twist.twist.linear, m.twist.twist.angular)),
    "sensor_msgs/msg/Imu": _imu,
}


def _topic(messages: list[_Message], name: str, message_type: str, frame: str) -> _Topic:
    if message_type in TRANSFORMS:
        messages, frame = _one_transform(messages, name, frame), ""
    elif frame and message_type not in KINDS["twist"] + KINDS["wrench"]:
        raise InputError(name, f"{name}@{frame}", f"{name} alone, as a {message_type} has no choice of frames")
    messages = sorted(messages, key=lambda message: message.stamp_ns)
    # Of messages with one stamp the first counts: a repeated one says nothing new.
    kept = [m for k, m in enumerate(messages) if k == 0 or m.stamp_ns != messages[k - 1].stamp_ns]
    for message in kept:
        if not np.isfinite(message.numbers).all() and message_type not in KINDS["imu"]:
            at = 1e-9 * (message.stamp_ns - kept[0].stamp_ns)
            raise InputError(name, f"the message {at:.6g} s after the first has a number that isn't finite")
    return _Topic(name, frame, kept)


def _one_transform(messages: list[_Message], topic: str, child: str) -> list[_Message]:
    children = sorted({message.child_frame_id for message in messages})
    if not child and len(children) > 1:
        raise InputError("--pose", topic, f"{topic}@CHILD with the frame of the body, one of {', '.join(children)}")
    if child and child not in children:
        raise InputError("--pose", f"{topic}@{child}", f"one of the frames {', '.join(children)}")
    found = [message for message in messages if message.child_frame_id == (child or children[0])]
    parents = {message.frame_id for message in found}
    if len(parents) > 1:
        raise InputError(topic, f"{child or children[0]} has several parents, {', '.join(sorted(parents))}")
    return found


def _frames(chosen: dict[str, _Topic]) -> tuple[set[str], set[str]]:
    """Names of the world's frame and of the tracked one, as far as the topics say."""
    worlds, bodies = {"world"}, {"body"}
    for kind in ("pose", "odom"):
        if kind in chosen:
            message = chosen[kind].messages[0]
            worlds.add(message.frame_id)
            bodies.add(message.child_frame_id)
    return worlds - {""}, bodies - {""}


def _series(kind: str, topic: _Topic, chosen: dict[str, _Topic]) -> list[ms.Series]:
    def series(quantity: str, first: int, last: int, in_body: bool = False) -> ms.Series:
        return ms.Series(topic.name, quantity, topic.times_ns, topic.numbers(first, last), in_body, kind == "imu")

    if kind == "imu":
        found = [series(ms.RATE, 0, 3, in_body=True), series(ms.ACCELERATION, 3, 6, in_body=True)]
        given = [one for one in found if not np.isnan(one.values).all()]
        for one in given:
            if not np.isfinite(one.values).all():
                raise InputError(topic.name, f"an {one.kind} that isn't finite")
        return given
    if kind == "twist":
        in_body = _is_in_body(topic, chosen)
        return [series(ms.VELOCITY, 0, 3, in_body), series(ms.RATE, 3, 6, in_body)]
    attitude = series(ms.ATTITUDE, 3, 7)
    found = [series(ms.POSITION, 0, 3), replace(attitude, values=_units(attitude.values, topic))]
    if kind == "odom":
        found += [series(ms.VELOCITY, 7, 10, in_body=True), series(ms.RATE, 10, 13, in_body=True)]
    return found


def _is_in_body(topic: _Topic, chosen: dict[str, _Topic]) -> bool:
    worlds, bodies = _frames(chosen)
    frame = topic.frame or topic.messages[0].frame_id
    if frame in worlds:
        return False
    if frame in bodies:
        return True
    known = ", ".join(sorted(worlds | bodies))
    raise InputError(
        "--twist", f"{topic.name} in frame {frame!r}", f"{topic.name}@world or {topic.name}@body, or one of {known}"
    )


def _units(q: np.ndarray, topic: _Topic) -> np.ndarray:
    size = np.linalg.norm(q, axis=1, keepdims=True)
    if np.any(np.abs(size - 1.0) > 0.1):
        worst = float(size[np.argmax(np.abs(size - 1.0))][0])
        raise InputError(topic.name, f"an orientation of length {worst:.3g}, where a unit quaternion should be")
    return q / size


def _check_clocks(chosen: dict[str, _Topic], choice: Choice) -> None:
    held = {kind: WRENCH_TIMEOUT_NS if kind == "wrench" else 0 for kind in chosen}
    spans = {t.name: (int(t.times_ns[0]), int(t.times_ns[-1]) + held[kind]) for kind, t in chosen.items()}
    first, *others = spans.items()
    for name, (begin, end) in others:
        shift = round(1e9 * (choice.offsets.get(name, 0.0) - choice.offsets.get(first[0], 0.0)))
        if begin + shift > first[1][1] or end + shift < first[1][0]:
            apart = 1e-9 * (begin + shift - first[1][0])
            raise InputError(
                "clocks",
                f"{name} begins {apart:.6g} s after {first[0]} and they have no time in common; give --offset {name}=S",
            )


def _wrench_frame(topic: _Topic, chosen: dict[str, _Topic]) -> tuple[str, tuple[float, float, float] | None]:
    """Axes of a wrench, and where it acts in the tracked frame, None for the centre of mass."""
    worlds, bodies = _frames(chosen)
    text = topic.frame or topic.messages[0].frame_id
    axes, at, point = text.partition("@")
    axes = "world" if axes in worlds else "body" if axes in bodies else axes
    try:
        frame = parse_frame(f"{axes}@{point if at else 'origin'}")
    except CommandRefused:
        known = ", ".join(sorted(worlds | bodies))
        accepted = (
            f"{topic.name}@AXES or {topic.name}@AXES@POINT, axes one of {known}, point com, origin or point/x,y,z"
        )
        raise InputError("--wrench", f"{topic.name} in frame {text!r}", accepted) from None
    if frame.axes == "normal" or frame.point[0] not in ("com", "origin", "point") or frame.options:
        raise InputError("--wrench", text, "axes world or body, at com, origin or point/x,y,z")
    return frame.axes, {"com": None, "origin": (0.0, 0.0, 0.0)}.get(frame.point[0], frame.point[-1])


def given_offsets(words: Sequence[str]) -> dict[str, float]:
    """``TOPIC=S`` by topic; raises InputError."""
    found = {}
    for word in words:
        topic, equals, text = word.rpartition("=")
        try:
            found[topic] = float(text)
        except ValueError:
            equals = ""
        if not equals or not topic or not abs(found[topic]) < 1e9:
            raise InputError("--offset", word, "TOPIC=S with a number of seconds, added to the topic's stamps")
    return found
