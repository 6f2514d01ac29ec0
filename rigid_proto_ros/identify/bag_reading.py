# SPDX-License-Identifier: MIT
"""Any bag as a measured flight, read with rosbags: topics are chosen, and their messages become series and loads. A
wrench is a command that holds until the next one, or a sample of a load that changed in between.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError, is_missing
from ..base.vectors import BoolArray, FloatArray, IntArray, vector
from ..motion.frames import parse_frame
from ..motion.loads import Load
from . import measurements as ms

EARTH = (0.0, 0.0, -9.81)

KINDS = ("pose", "imu", "wrench")
"""Options that name a topic."""
TRANSFORMS = ("geometry_msgs/msg/TransformStamped", "tf2_msgs/msg/TFMessage")

WRENCH_TIMEOUT_NS = 1_500_000_000
"""Longest time for which a wrench holds without a further message: the node's own default."""
STEADY = 0.5
"""Gaps between messages belong to one rate if they differ from the usual gap by less than this fraction."""
FEWEST_SAMPLED = 20
"""Least number of messages of a sampled wrench."""
LEAST_JUMP, MOST_CHANGES = 0.03, 16
"""A jump of a sampled load counts above this fraction of the largest force or torque; and the largest number of such
jumps.
"""


@dataclass(frozen=True)
class Choice:
    """The part of a bag that is used. topics: by option, as given, ``TOPIC`` or ``TOPIC@frame``."""

    topics: dict[str, str] = field(default_factory=dict)
    first_s: float = 0.0
    last_s: float = np.inf
    gravity: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class _Topic:
    """Messages of one topic. frame: the one given with the name, or empty. times_ns (n,): ascending, from the headers.
    numbers (n, k): position and attitude, rate and acceleration (NaN if an IMU doesn't measure them), or force and
    torque. parent, child: frames of the first message.
    """

    name: str
    frame: str
    times_ns: IntArray
    numbers: FloatArray
    parent: str
    child: str


def bag_flight(path: Path, choice: Choice) -> ms.MeasuredFlight:
    """Read the measurements in a bag. Raises InputError, which names the topic and what is wrong with it."""
    chosen = _chosen_topics(path, choice)
    _check_clocks(chosen)
    begin = min(int(topic.times_ns[0]) for topic in chosen.values())
    first, last = (begin + round(min(edge_s, 1e9) * 1e9) for edge_s in (choice.first_s, choice.last_s))
    series = [one for kind in ("pose", "imu") if kind in chosen for one in _series(kind, chosen[kind])]
    series = [part for part in (one.within(first, last) for one in series) if len(part.times_ns)]
    if not series:
        raise InputError("--from", choice.first_s, f"a window with samples of {path} in it")
    loads = ms.load_history()
    if "wrench" in chosen:
        wrench = chosen["wrench"]
        loads = wrench_history(wrench.name, wrench.times_ns, wrench.numbers, *_wrench_frame(wrench, chosen["pose"]))
    where = "assumed, as no --gravity was given" if choice.gravity is None else "from --gravity"
    return ms.MeasuredFlight(str(path), tuple(series), loads, choice.gravity or EARTH, gravity_from=where)


def _chosen_topics(path: Path, choice: Choice) -> dict[str, _Topic]:
    """Topics by option."""
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
            found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
            for connection, logged_ns, data in bag.messages([one for one in bag.connections if one.topic in names]):
                message: Any = bag.deserialize(data, connection.msgtype)
                parts = message.transforms if connection.msgtype == TRANSFORMS[1] else [message]
                found[connection.topic] += [(logged_ns, part) for part in parts]
        # Inside the try, since a type that the bag itself defines may lack a field that is read.
        return {kind: _topic(found[name], name, types[name], frame) for kind, (name, frame) in chosen.items()}
    except InputError:
        raise
    except Exception as error:  # the library raises any exception for truncated or damaged files
        accepted = f"a bag that rosbags can read ({error}); ros2 bag reindex repairs a bag whose recorder was killed"
        raise InputError("session", str(path), accepted) from None


def _chosen(types: dict[str, str], given: dict[str, str], path: str) -> dict[str, tuple[str, str]]:
    """Topic and frame by option: the topic given, or the only one of a suitable type."""
    found = {}
    for kind in KINDS:
        topics = sorted(topic for topic, its_type in types.items() if _READ.get(its_type, ("",))[0] == kind)
        if kind in given:
            topic, _, frame = given[kind].partition("@")
            if topic not in topics:
                accepted = f"a topic of the bag: {', '.join(topics) or 'it has no topic of such a type'}"
                raise InputError(f"--{kind}", topic, accepted)
            found[kind] = (topic, frame)
        elif len(topics) > 1:
            several = f"{path} has several {kind} topics, {', '.join(topics)}"
            raise InputError("session", f"{several}; say which with --{kind}")
        elif topics:
            found[kind] = (topics[0], "")
    if "pose" not in found:
        known = ", ".join(f"{t} ({k})" for t, k in sorted(types.items())[:6]) or "nothing"
        raise InputError("session", f"{path} has no poses, transforms or odometry; it has {known}")
    return found


def _components(one: Any, other: Any) -> tuple[float, ...]:
    """Components of two vectors, or of a position and an orientation xyzw."""
    numbers = (one.x, one.y, one.z, other.x, other.y, other.z)
    return (*numbers, other.w) if hasattr(other, "w") else numbers


def _imu(m: Any) -> tuple[float, ...]:
    """Angular velocity and acceleration; NaN for one whose covariance begins with -1, which isn't measured
    (sensor_msgs/msg/Imu).
    """
    numbers = _components(m.angular_velocity, m.linear_acceleration)
    has_rate, has_felt = m.angular_velocity_covariance[0] != -1.0, m.linear_acceleration_covariance[0] != -1.0
    none = (np.nan, np.nan, np.nan)
    return (numbers[:3] if has_rate else none) + (numbers[3:] if has_felt else none)


_READ: dict[str, tuple[str, Callable[[Any], tuple[float, ...]]]] = {
    "geometry_msgs/msg/PoseStamped": ("pose", lambda m: _components(m.pose.position, m.pose.orientation)),
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        "pose",
        lambda m: _components(m.pose.pose.position, m.pose.pose.orientation),
    ),
    "nav_msgs/msg/Odometry": ("pose", lambda m: _components(m.pose.pose.position, m.pose.pose.orientation)),
    **dict.fromkeys(TRANSFORMS, ("pose", lambda m: _components(m.transform.translation, m.transform.rotation))),
    "geometry_msgs/msg/WrenchStamped": ("wrench", lambda m: _components(m.wrench.force, m.wrench.torque)),
    "sensor_msgs/msg/Imu": ("imu", _imu),
}
"""By message type: the option that takes it, and the function that extracts its numbers."""


def _topic(messages: list[tuple[int, Any]], name: str, message_type: str, frame: str) -> _Topic:
    kind, numbers_of = _READ[message_type]
    if message_type in TRANSFORMS:
        messages, frame = _one_transform(messages, name, frame), ""
    elif frame and kind != "wrench":
        raise InputError(name, f"{name}@{frame}", f"{name} alone, since a {message_type} has no choice of frames")
    stamps = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for _, m in messages]
    if not any(stamps):  # stamps weren't set; a single zero may be the start of simulated time
        stamps = [logged for logged, _ in messages]
    # Of messages with equal stamps the first counts; the others are repetitions.
    times, first = np.unique(np.array(stamps, np.int64), return_index=True)
    numbers = np.array([numbers_of(message) for _, message in messages])[first]
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if len(bad) and kind != "imu":
        at = 1e-9 * (times[bad[0]] - times[0])
        raise InputError(name, f"the message {at:.6g} s after the first has a number that isn't finite")
    head = messages[0][1]
    return _Topic(name, frame, times, numbers, head.header.frame_id, getattr(head, "child_frame_id", ""))


def _one_transform(messages: list[tuple[int, Any]], topic: str, child: str) -> list[tuple[int, Any]]:
    children = sorted({message.child_frame_id for _, message in messages})
    if child not in children and (child or len(children) > 1):
        raise InputError("--pose", f"{topic}@{child}", f"{topic}@CHILD, CHILD one of {', '.join(children)}")
    found = [(logged, message) for logged, message in messages if message.child_frame_id == (child or children[0])]
    parents = {message.header.frame_id for _, message in found}
    if len(parents) > 1:
        raise InputError(topic, f"{child or children[0]} has several parents, {', '.join(sorted(parents))}")
    return found


def _series(kind: str, topic: _Topic) -> list[ms.Series]:
    times, numbers = topic.times_ns, topic.numbers
    if kind == "pose":
        sizes = np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
        if np.any(np.abs(sizes - 1.0) > 0.1):
            worst = float(sizes[np.argmax(np.abs(sizes - 1.0))][0])
            raise InputError(topic.name, f"an orientation of length {worst:.3g}, where a unit quaternion should be")
        attitudes = numbers[:, 3:] / sizes
        position = ms.Series(topic.name, ms.POSITION, times, numbers[:, :3])
        return [position, ms.Series(topic.name, ms.ATTITUDE, times, attitudes)]
    rate = ms.Series(topic.name, ms.RATE, times, numbers[:, :3])
    found = [rate, ms.Series(topic.name, ms.ACCELERATION, times, numbers[:, 3:])]
    given = [one for one in found if not np.isnan(one.values).all()]
    for one in given:
        if not np.isfinite(one.values).all():
            raise InputError(topic.name, f"an {one.kind} that isn't finite")
    return given


def _check_clocks(chosen: dict[str, _Topic]) -> None:
    pose = chosen["pose"]
    for kind, topic in chosen.items():
        held = WRENCH_TIMEOUT_NS if kind == "wrench" else 0
        if topic.times_ns[0] > pose.times_ns[-1] or topic.times_ns[-1] + held < pose.times_ns[0]:
            apart = 1e-9 * (topic.times_ns[0] - pose.times_ns[0])
            accepted = "stamps of one clock, or of clocks that differ by at most 0.05 s (--fit offset)"
            received = f"{topic.name} begins {apart:.6g} s after {pose.name}, so their times do not overlap"
            raise InputError("clocks", received, accepted)


def _wrench_frame(topic: _Topic, pose: _Topic) -> tuple[str, tuple[float, float, float] | None]:
    """Axes of a wrench, and its point in the tracked frame; None for the centre of mass."""
    worlds, bodies = {"world", pose.parent} - {""}, {"body", pose.child} - {""}
    text = topic.frame or topic.parent
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


def wrench_history(
    topic: str, times: IntArray, numbers: FloatArray, axes: str, where: tuple[float, float, float] | None
) -> ms.LoadHistory:
    """Loads of wrench messages. times (m,): ascending [ns]. numbers (m, 6): forces and torques. axes: as in ``Load``.
    where: point in the tracked frame; None for the centre of mass.
    """
    acts: BoolArray = np.any(numbers != 0.0, axis=1)
    same = np.append(False, np.all(numbers[1:] == numbers[:-1], axis=1))
    begins, sds_s = _begin_times(times, acts)
    ends = np.minimum(np.append(begins[1:], times[-1] + WRENCH_TIMEOUT_NS), times + WRENCH_TIMEOUT_NS)
    rows: list[tuple[int, int, FloatArray]] = []
    before, which = np.full(len(times), -1), np.full(len(times), -1)
    for k in range(len(times)):
        before[k] = which[k - 1] if k and ends[k - 1] == begins[k] else -1
        if not acts[k]:
            continue
        if same[k] and before[k] >= 0:
            rows[-1] = (rows[-1][0], int(ends[k]), rows[-1][2])
        else:
            load = Load(axes, where, vector(numbers[k, :3]), vector(numbers[k, 3:]))
            rows.append((int(begins[k]), int(ends[k]), load.row))
        which[k] = len(rows) - 1
    sds_s *= _sharpness(numbers)
    counted = np.sort(np.argsort(-sds_s)[:MOST_CHANGES])
    counted = counted[sds_s[counted] > 0.0]
    changes = ms.SampledChanges(before[counted], which[counted], sds_s[counted])
    return replace(ms.load_history(rows), topic=topic, changes=changes)


def _sharpness(numbers: FloatArray) -> FloatArray:
    """Fraction (m,) of each change of the loads (m, 6) that is a jump. A steady change is known between samples."""
    forces, torques = numbers[:, :3], numbers[:, 3:]
    parts = [part / max(float(np.linalg.norm(part, axis=1).max()), 1e-300) for part in (forces, torques)]
    steps = np.diff(np.hstack(parts), axis=0, prepend=np.hstack(parts)[:1])
    around = 0.5 * (np.vstack([steps[1:], steps[-1:]]) + np.vstack([steps[:1], steps[:-1]]))
    sizes, sharp = np.linalg.norm(steps, axis=1), np.linalg.norm(steps - around, axis=1)
    return np.where((sizes > 0.0) & (sharp > LEAST_JUMP), np.minimum(sharp / np.maximum(sizes, 1e-300), 1.0), 0.0)


def _begin_times(times_ns: IntArray, acts: BoolArray) -> tuple[IntArray, FloatArray]:
    """Times (m,) [ns] at which the loads of messages at times_ns (m,) begin, and their standard deviations (m,) [s].

    A command acts from its stamp on. A wrench that is sent at a steady rate, even while it is zero, is a sampled load:
    it changed at some time since the previous message, on average midway.
    """
    gaps = np.diff(times_ns)
    if len(times_ns) < FEWEST_SAMPLED or not np.any(~acts[:-1] & acts[1:]):
        return times_ns, np.zeros(len(times_ns))
    usual = float(np.median(gaps))
    steady = np.append(False, np.abs(gaps - usual) < STEADY * usual)
    if steady.mean() < 0.5:
        return times_ns, np.zeros(len(times_ns))
    waited = np.where(steady, np.append(0, gaps), 0)
    return times_ns - waited // 2, 1e-9 * waited / np.sqrt(12.0)
