# SPDX-License-Identifier: MIT
"""Publication of a recorded session over ROS: its states with their stamps, or its commands to a running node."""

from __future__ import annotations

import time

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from ..base.errors import InputError
from ..scene import cdr
from ..scene.command_codec import frame_names
from ..scene.script import parse_script
from ..session.as_script import script_of_session
from ..session.recorded_session import RecordedSession, recorded_parameters
from . import qos
from .script_sender import ros_context, send_script

WAIT_FOR_NODE_S = 10.0

WAIT_FOR_SUBSCRIBERS_S = 3.0
"""Longest wait for a first subscriber [s]; then states are published anyway."""

SETTLED_S = 0.5
"""How long publication waits for further subscribers after the last one [s]."""


def publish_commands(session: RecordedSession, node_name: str) -> int:
    """Reset the node and send it the session's commands as a script. Returns the exit status: 1 if a command was late,
    refused or dropped. Raises InputError if no such node answers, and for a session without a complete run.
    """
    commands = parse_script(script_of_session(session).script)
    with ros_context():
        report = send_script(commands, node_name, WAIT_FOR_NODE_S, reset=True)
    print(f"  {report.text}")
    return 0 if report.all_in_time else 1


def publish_states(session: RecordedSession, speed: float) -> int:
    """Publish the recorded states on their topics with their stamps, and the stamps on /clock; returns the
    exit status.
    """
    if not session.states.topics:
        raise InputError("session", "the session has no states to publish")
    with ros_context():
        node = rclpy.create_node("replay", start_parameter_services=False, enable_rosout=False)
        try:
            _send_states(node, session, speed)
        finally:
            node.destroy_node()
    return 0


def _send_states(node: Node, session: RecordedSession, speed: float) -> None:
    types = {"pose": PoseStamped, "twist": TwistStamped, "odom": Odometry}
    # The session's own frame names.
    frames = frame_names(recorded_parameters(session), session.node_name)
    topics = session.states.topics
    senders = {name: node.create_publisher(types[name], f"/{session.node_name}/{name}", qos.STATE) for name in topics}
    clock = node.create_publisher(Clock, "/clock", qos.CLOCK)
    _wait_for_subscribers(node, [*senders.values(), clock])
    first_ns, begin, clock_ns = session.states.first_ns, time.monotonic(), -1
    for time_ns, name, row in session.states:
        time.sleep(max(0.0, begin + 1e-9 * (time_ns - first_ns) / speed - time.monotonic()))
        if time_ns != clock_ns:
            clock_ns = time_ns
            clock.publish(cdr.time(time_ns))
        if name == "odom":
            senders[name].publish(cdr.odometry(time_ns, frames, row))
        else:
            senders[name].publish(cdr.stamped_doubles(time_ns, frames[0], row))
    for publisher in senders.values():
        publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=10.0))


def _wait_for_subscribers(node: Node, publishers: list[Publisher]) -> None:
    """Wait for a first subscriber, and until no more come for SETTLED_S, because a client of several topics isn't
    discovered at once.
    """
    counts, since = [0] * len(publishers), time.monotonic()
    deadline = since + WAIT_FOR_SUBSCRIBERS_S
    while time.monotonic() < (since + SETTLED_S if any(counts) else deadline):
        rclpy.spin_once(node, timeout_sec=0.05)
        found = [publisher.get_subscription_count() for publisher in publishers]
        if found != counts:
            counts, since = found, time.monotonic()
