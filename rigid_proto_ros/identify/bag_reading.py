# SPDX-License-Identifier: MIT
"""Anybody's bags as measured flights: which topics count, their messages as series, a wrench's as loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.rotation import vector
from ..messages.measured_messages import MEASURED_TYPES, Stamped, read_measured
from ..motion.frames import parse_frame
from ..motion.loads import Load
from ..session.bag import read_bag
from ..session.mcap_reading import BagContent
from . import measurements as ms
from .session_reading import load_history

WRENCH_TIMEOUT_NS = 1_500_000_000
"""A wrench holds until the next message, and at most as long as the node's own default."""
EARTH = (0.0, 0.0, -9.81)

TRANSFORMS = ("geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage")
POSES = ("geometry_msgs/msg/PoseStamped", *TRANSFORMS)
KINDS = {
    "pose": POSES,
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
class _Topic:
    """name and the frame that stands behind it, or empty; messages in the order of their stamps."""

    name: str
    frame: str
    message_type: str
    messages: list[Stamped]

    @property
    def times_ns(self) -> np.ndarray:
        return np.array([message.stamp_ns for message in self.messages], np.int64)

    def numbers(self, first: int, last: int) -> np.ndarray:
        return np.array([message.numbers[first:last] for message in self.messages], float).reshape(-1, last - first)


def bag_flight(path: Path, choice: Choice) -> ms.MeasuredFlight:
    """What was measured in a bag; raises InputError naming the topic and what is wrong with it."""
    content = read_bag(path, lambda _: True)
    chosen = {kind: _read(content, *found) for kind, found in _chosen(content, choice.topics, str(path)).items()}
    if not set(chosen) & {"pose", "odom", "imu", "twist"}:
        known = ", ".join(f"{t} ({k})" for t, k in sorted(content.types.items())[:6]) or "nothing"
        raise InputError("session", f"{path} has neither poses nor rates; it has {known}")
    _check_clocks(chosen, choice)
    begin = min(int(topic.times_ns[0]) for topic in chosen.values() if topic.messages)
    window = (begin + round(choice.first_s * 1e9), begin + round(min(choice.last_s, 1e9) * 1e9))
    series = [one for kind, topic in chosen.items() if kind != "wrench" for one in _series(kind, topic, chosen)]
    series = [_within(one, window) for one in series]
    series = [one for one in series if len(one.times_ns)]
    if not series:
        raise InputError("--from", choice.first_s, f"a window with samples of {path} in it")
    loads = _load_history(chosen["wrench"], chosen, choice) if "wrench" in chosen else ms.no_loads()
    given = choice.gravity is not None
    where = "from --gravity" if given else "assumed, as no --gravity was given"
    return ms.MeasuredFlight(str(path), tuple(series), loads, choice.gravity or EARTH, gravity_from=where)


def _chosen(content: BagContent, given: dict[str, str], path: str) -> dict[str, tuple[str, str]]:
    """(topic, frame) by option: those given, else the only one of its types."""
    found = {kind: _split(text, content, kind) for kind, text in given.items()}
    if found:
        return found
    for kind, types in KINDS.items():
        topics = sorted(topic for topic, its_type in content.types.items() if its_type in types)
        topics = [topic for topic in topics if content.messages.get(topic)]
        if len(topics) > 1:
            raise InputError(
                "session", f"{path} has several {kind} topics, {', '.join(topics)}; say which with --{kind}"
            )
        if topics:
            found[kind] = (topics[0], "")
    return found


def _split(text: str, content: BagContent, kind: str) -> tuple[str, str]:
    topic, _, frame = text.partition("@")
    if topic not in content.types:
        fitting = sorted(t for t, its_type in content.types.items() if its_type in KINDS[kind])
        raise InputError(
            f"--{kind}", topic, f"a topic of the bag: {', '.join(fitting) or 'it has none of such a type'}"
        )
    if content.types[topic] not in KINDS[kind]:
        raise InputError(f"--{kind}", f"{topic}, a {content.types[topic]}", " or ".join(KINDS[kind]))
    return topic, frame


def _read(content: BagContent, topic: str, frame: str) -> _Topic:
    message_type = content.types[topic]
    assert message_type in MEASURED_TYPES
    messages: list[Stamped] = []
    for log_time, data in content.messages.get(topic, []):
        for message in read_measured(message_type, data, topic):
            if message.stamp_ns == 0:
                message = Stamped(log_time, message.frame_id, message.child_frame_id, message.numbers)
            messages.append(message)
    if message_type in TRANSFORMS:
        messages, frame = _one_transform(messages, topic, frame), ""
    elif frame and message_type not in KINDS["twist"] + KINDS["wrench"]:
        raise InputError(topic, f"{topic}@{frame}", f"{topic} alone, as a {message_type} has no choice of frames")
    messages.sort(key=lambda message: message.stamp_ns)
    # Of messages with one stamp the first counts: a repeated one says nothing new.
    kept = [m for k, m in enumerate(messages) if k == 0 or m.stamp_ns != messages[k - 1].stamp_ns]
    if not kept:
        raise InputError(topic, "no messages in the bag")
    for message in kept:
        if not np.isfinite(message.numbers).all():
            at = 1e-9 * (message.stamp_ns - kept[0].stamp_ns)
            raise InputError(topic, f"the message {at:.6g} s after the first has a number that isn't finite")
    return _Topic(topic, frame, message_type, kept)


def _one_transform(messages: list[Stamped], topic: str, child: str) -> list[Stamped]:
    children = sorted({message.child_frame_id for message in messages})
    if not child and len(children) > 1:
        raise InputError("--pose", topic, f"{topic}@CHILD with the frame of the body, one of {', '.join(children)}")
    if child and child not in children:
        raise InputError("--pose", f"{topic}@{child}", f"one of the frames {', '.join(children)}")
    found = [message for message in messages if message.child_frame_id == (child or "".join(children[:1]))]
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
    times, name = topic.times_ns, topic.name
    if kind in ("pose", "odom"):
        found = [
            ms.Series(name, ms.POSITION, times, topic.numbers(0, 3)),
            ms.Series(name, ms.ATTITUDE, times, _units(topic.numbers(3, 7), topic)),
        ]
        if kind == "odom":
            found.append(ms.Series(name, ms.VELOCITY, times, topic.numbers(7, 10), in_body=True))
            found.append(ms.Series(name, ms.RATE, times, topic.numbers(10, 13), in_body=True))
        return found
    if kind == "twist":
        in_body = _is_in_body(topic, chosen)
        return [
            ms.Series(name, ms.VELOCITY, times, topic.numbers(0, 3), in_body=in_body),
            ms.Series(name, ms.RATE, times, topic.numbers(3, 6), in_body=in_body),
        ]
    _, rate, acceleration = topic.messages[0].numbers[10:13]
    found = []
    if rate:
        found.append(ms.Series(name, ms.RATE, times, topic.numbers(4, 7), in_body=True, is_imu=True))
    if acceleration:
        found.append(ms.Series(name, ms.ACCELERATION, times, topic.numbers(7, 10), in_body=True, is_imu=True))
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


def _within(series: ms.Series, window: tuple[int, int]) -> ms.Series:
    inside = slice(*np.searchsorted(series.times_ns, (window[0], window[1] + 1)))
    return ms.Series(
        series.topic, series.kind, series.times_ns[inside], series.values[inside], series.in_body, series.is_imu
    )


def _check_clocks(chosen: dict[str, _Topic], choice: Choice) -> None:
    spans = {t.name: (int(t.times_ns[0]), int(t.times_ns[-1])) for k, t in chosen.items() if k != "wrench"}
    wrench = chosen.get("wrench")
    if wrench is not None:
        begin, end = (int(wrench.times_ns[k]) for k in (0, -1))
        spans[wrench.name] = (begin, end + WRENCH_TIMEOUT_NS)
    first, *others = spans.items()
    for name, (begin, end) in others:
        shift = round(1e9 * (choice.offsets.get(name, 0.0) - choice.offsets.get(first[0], 0.0)))
        if begin + shift > first[1][1] or end + shift < first[1][0]:
            apart = 1e-9 * (begin + shift - first[1][0])
            raise InputError(
                "clocks",
                f"{name} begins {apart:.6g} s after {first[0]} and they have no time in common; give --offset {name}=S",
            )


def _load_history(topic: _Topic, chosen: dict[str, _Topic], choice: Choice) -> ms.LoadHistory:
    """A wrench's messages, each held until the next; axes alone mean the origin of the tracked frame."""
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
    where = {"com": None, "origin": (0.0, 0.0, 0.0)}.get(frame.point[0], frame.point[-1])
    rows = []
    times = (topic.times_ns + round(1e9 * choice.offsets.get(topic.name, 0.0))).tolist()
    for number, message in enumerate(topic.messages):
        if not any(message.numbers):
            continue
        until = times[number + 1] if number + 1 < len(times) else times[number] + WRENCH_TIMEOUT_NS
        force, torque = vector(message.numbers[:3]), vector(message.numbers[3:])
        until = min(until, times[number] + WRENCH_TIMEOUT_NS)
        rows.append((times[number], until, Load(frame.axes, where, force, torque).row))
    return load_history(rows)


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
