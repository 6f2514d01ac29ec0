# SPDX-License-Identifier: MIT
"""Diagnostics of one body, once a second: counters, energies, and new problems since the last report."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from ..base.errors import InputError
from ..live.command_receiver import TOPICS
from ..live.live_simulation import LiveSimulation
from .commands import TOPICS as COMMAND_TOPICS
from .commands import CommandSubscriber

WARNING_S = 10.0
"""Shortest period of the log's warning that real time is given up [s]."""

REPORT_S = 1.0
"""Period of reports on /diagnostics [s]."""

UNREAD_S = 5.0
"""Period without subscribers [s], for the warnings in the log; a wake-up of rclpy's executor costs 2 ms."""

REFUSAL_REASONS = (
    *("frame", "nonfinite", "magnitude", "stamp", "ray_miss"),
    *("tensor", "integrator", "schedule", "thrusters", "state"),
)

WARNED_OF = {
    "refused_total": "{} refused",
    "messages_lost": "{} lost in transit",
    "queue_full": "messages may have been lost: a queue of commands was full",
    "overruns": "{} published late",
    "real_time_lost_s": "{:.2g} s behind real time",
    "clock_jumps": "/clock jumped {} times",
}
"""Counters whose growth raises a report to WARN, and the text for the increase."""


class Diagnostics:
    """Diagnostics of one node; a report's level depends on new problems since the previous report."""

    def __init__(self, node: Node, live: LiveSimulation, subscriber: CommandSubscriber) -> None:
        self._node = node
        self._live = live
        self._subscriber = subscriber
        matched = PublisherEventCallbacks(matched=self._on_matched)
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10, event_callbacks=matched)
        self._before = live.call(self._values)
        self._of_this_name = 1
        self._command_types = {
            node.resolve_topic_name(f"~/{topic}"): f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
            for topic, kind in COMMAND_TOPICS.items()
        }
        self._other_types: set[tuple[str, str]] = set()
        # A steady clock, because the node's clock stops when /clock does.
        self._timer = node.create_timer(UNREAD_S, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_matched(self, status: Any) -> None:
        """A subscriber has come or gone: adapt the period; the first report to the first subscriber covers
        one second.
        """
        period_ns = int((REPORT_S if status.current_count else UNREAD_S) * 1e9)
        if period_ns != self._timer.timer_period_ns:
            self._timer.timer_period_ns = period_ns
            self._timer.reset()
            with suppress(InputError):  # the simulation has ended
                self._before = self._live.call(self._values)

    def _values(self) -> dict[str, Any]:
        """Counters and values by their keys; called on the physics thread, so that they are consistent."""
        loop = self._live.loop
        commands, simulation = loop.commands, loop.simulation
        momentum, received, refused = simulation.angular_momentum, commands.received, simulation.refused
        return {
            "sim_time_ns": simulation.time_ns,
            "stamp_offset_ns": loop.stamps.offset_ns,
            "publish_rate": loop.scenario.parameters.publish_rate,
            "overruns": loop.pace.overruns,
            "real_time_lost_s": loop.pace.real_time_lost_s,
            **{f"{topic}_received": received.get(topic, 0) for topic in TOPICS},
            "commands_received": sum(received.values()),
            "refused_total": sum(refused.values()),
            **{f"refused_{reason}": refused.get(reason, 0) for reason in REFUSAL_REASONS},
            "late": commands.late,
            "wall_stamp": commands.wall_stamp,
            "messages_lost": self._subscriber.messages_lost,
            "queue_full": self._subscriber.queue_full,
            "clock_jumps": loop.pace.jumps,
            "resets": loop.resets,
            "kinetic_energy": simulation.kinetic_energy,
            "potential_energy": simulation.potential_energy,
            "angular_momentum_norm": float((momentum * momentum).sum()) ** 0.5,
            "angular_momentum_drift": simulation.angular_momentum_drift,
            "integrator": simulation.setup.integrator.name,
            "accuracy_floor": simulation.accuracy_floor,
            "state": "paused" if loop.paused else "sleeping" if simulation.at_rest else "flying",
            "recording": loop.scenario.parameters.record,
            "warning": simulation.failure or self._live.recording_trouble or simulation.too_coarse,
        }

    def _warn_of_namesakes(self) -> None:
        """Warn if another node has the same name: clients can't distinguish the two nodes' topics."""
        node = self._node
        count = node.get_node_names_and_namespaces().count((node.get_name(), node.get_namespace()))
        if count > self._of_this_name:
            node.get_logger().warning(
                f"another node is called {node.get_fully_qualified_name()}, or one was killed within the last 20 s: "
                "both take the same commands and publish to the same topics; -r __node:=NAME gives one another name"
            )
        self._of_this_name = max(count, 1)

    def _warn_of_other_types(self) -> None:
        """Warn of a publisher of another type on a command topic, which the middleware doesn't report."""
        for topic, types in self._node.get_topic_names_and_types():
            wanted = self._command_types.get(topic)
            for other in types:
                if wanted in (None, other) or (topic, other) in self._other_types:
                    continue
                self._other_types.add((topic, other))
                self._node.get_logger().warning(
                    f"a publisher on {topic} has the type {other}, not {wanted}: none of its messages will be received"
                )

    def _report(self) -> None:
        """Publish the diagnostics, and log when simulated time falls behind real time."""
        self._warn_of_namesakes()
        self._warn_of_other_types()
        # Read before the values, so that they include everything done before the stamp.
        stamp = self._node.get_clock().now().to_msg()
        try:
            before, values = self._before, self._live.call(self._values)
        except InputError:
            return  # the simulation has ended or is busy
        self._before = values
        if (lost_s := values["real_time_lost_s"] - before["real_time_lost_s"]) > 0.0:
            self._node.get_logger().warning(
                f"machine too slow: {lost_s:.2g} s of real time given up; simulated time is behind the wall clock",
                throttle_duration_sec=WARNING_S,
            )
        if self._publisher.get_subscription_count() == 0:
            return
        warnings = [text.format(grown) for key, text in WARNED_OF.items() if (grown := values[key] - before[key]) > 0]
        warnings += filter(None, [values["warning"]])
        status = DiagnosticStatus(
            name=f"{self._node.get_fully_qualified_name()}: simulation", hardware_id="simulated rigid body"
        )
        status.level = DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK
        status.message = "; ".join(warnings) or values["state"]
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp
        self._publisher.publish(message)
