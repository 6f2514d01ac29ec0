# SPDX-License-Identifier: MIT
"""A recorded session over ROS once more: its states with their own stamps, or its commands to a node that flies."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from ..base.errors import InputError
from ..scene import cdr
from ..scene.command_codec import frame_names, in_words, of_event
from ..session.messages import PROJECTIONS
from ..session.recorded_session import RecordedSession, StampedRows, decode_event
from ..session.replay import recorded_parameters, sorted_states
from ..simulation.commands import Change, Command
from . import qos
from .script_sender import ScriptSender

WAIT_FOR_NODE_S = 10.0

WAIT_FOR_SUBSCRIBERS_S = 3.0
"""States wait this long for somebody to listen; then they go out all the same."""

SETTLED_S = 0.5
"""After the last subscriber that was found, states wait this long for others."""

NOT_SENT = ("record", "viewer")
"""Parameters of the recording node's own surroundings: sent to another, they would overwrite its recordings."""


def publish_commands(session: RecordedSession, node_name: str) -> int:
    """Reset the node and send it the session's commands, each at its time; returns the exit status, 1 if any was late.

    Raises InputError when no such node answers.
    """
    commands = session_commands(session)
    with _context():
        sender = ScriptSender(node_name, WAIT_FOR_NODE_S)
        try:
            report = sender.send(commands, reset=True)
        finally:
            sender.destroy_node()
    print(f"  {report.text}")
    return 0 if report.all_in_time else 1


def session_commands(session: RecordedSession) -> list[Command]:
    """What moved the body, at the times at which it acted and in frames that a node of any name reads; pauses and steps
    are of the clock alone.
    """
    parameters = recorded_parameters(session)
    frames = frame_names(parameters, session.node_name)
    commands = []
    for number, line in enumerate(session.lines, 1):
        time_ns, kind, content = decode_event(line, number)
        try:
            command = of_event(kind, content, frames)
        except InputError as error:
            raise InputError(f"event {number}, {error.field}", error.received, error.accepted) from None
        if command is None:
            continue
        command = replace(in_words(command), stamp_ns=time_ns)
        if isinstance(command, Change):
            command = replace(command, content={name: content[name] for name in content if name not in NOT_SENT})
        if not isinstance(command, Change) or command.content:
            commands.append(command)
    return commands


def publish_states(session: RecordedSession, speed: float) -> int:
    """Publish the recorded states on their topics, with their stamps, which go out on /clock, too; the exit status."""
    if not len(session.times):
        raise InputError("session", "the session has no states to publish")
    with _context():
        node = rclpy.create_node("replay", start_parameter_services=False, enable_rosout=False)
        try:
            _send_states(node, session, speed)
        finally:
            node.destroy_node()
    return 0


def _send_states(node: Node, session: RecordedSession, speed: float) -> None:
    types = {"pose": PoseStamped, "twist": TwistStamped, "odom": Odometry}
    # The frames' names that the session flew with.
    frames = frame_names(recorded_parameters(session), session.node_name)
    streams, senders = _streams(session), {}
    for name in streams:
        publisher = node.create_publisher(types[name], f"/{session.node_name}/{name}", qos.STATE)
        senders[name] = publisher
    clock = node.create_publisher(Clock, "/clock", qos.CLOCK)
    _wait_for_subscribers(node, [*senders.values(), clock])
    merged = sorted(
        ((t, k, name) for name, rows in streams.items() for k, t in enumerate(rows.times.tolist())),
        key=lambda message: message[0],
    )
    first_ns, begin = merged[0][0], time.monotonic()
    told_ns = -1
    for time_ns, k, name in merged:
        rest_s = begin + 1e-9 * (time_ns - first_ns) / speed - time.monotonic()
        if rest_s > 0.0:
            time.sleep(rest_s)
        if time_ns != told_ns:
            told_ns = time_ns
            clock.publish(cdr.time(time_ns))
        row = streams[name].rows[k].tolist()
        if name == "odom":
            senders[name].publish(cdr.odometry(time_ns, frames, row[:7], row[7:]))
        else:
            senders[name].publish(cdr.stamped_doubles(time_ns, frames[0], row))
    for publisher in senders.values():
        publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=10.0))


def _wait_for_subscribers(node: Node, publishers: list[Publisher]) -> None:
    """Until somebody listens and no more have come for SETTLED_S: who listens to several topics isn't found at once."""
    counts, since = [0] * len(publishers), time.monotonic()
    deadline = since + WAIT_FOR_SUBSCRIBERS_S
    while time.monotonic() < (since + SETTLED_S if any(counts) else deadline):
        rclpy.spin_once(node, timeout_sec=0.05)
        found = [publisher.get_subscription_count() for publisher in publishers]
        if found != counts:
            counts, since = found, time.monotonic()


def _streams(session: RecordedSession) -> dict[str, StampedRows]:
    """What is to be published: the numbers that a bag holds, else what the node makes of a state."""
    if session.published:
        return {name: rows for name, rows in session.published.items() if len(rows)}
    states = list(sorted_states(session))
    times = np.array([time_ns for time_ns, _ in states], dtype=np.int64)
    return {
        name: StampedRows(times, np.array([project(row.tolist()) for _, row in states]))
        for name, project in PROJECTIONS.items()
    }


@contextmanager
def _context() -> Iterator[None]:
    rclpy.init(args=[sys.argv[0]], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()
