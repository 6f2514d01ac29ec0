# SPDX-License-Identifier: MIT
"""What /diagnostics says of one body, once a second."""

from __future__ import annotations

import threading
import time
import traceback

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ..live.diagnostics import COUNTED, increase, report, warnings_since
from ..live.live_simulation import LiveSimulation

WARNING_S = 10.0
"""How often the log says that real time is given up."""

REPORT_S = 1.0
"""Time between two reports on /diagnostics."""


class Diagnostics:
    """Of one node; the level of a report follows from what went wrong since the one before."""

    def __init__(self, node: Node, live: LiveSimulation) -> None:
        self._node = node
        self._live = live
        self._other_publishers = 0
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._before: dict[str, object] = {}
        self._reported_s = time.monotonic()

    def report(self) -> None:
        """Publish how it stands, and log what is new and wrong."""
        # Before the values are read: what was done before the stamp is in them.
        stamp = self._node.get_clock().now().to_msg()
        values = report(self._live)
        values["warning"] = values["warning"] or self._namesake()
        warnings = warnings_since(self._before, values)
        self._warn_of_lost_time(increase("real_time_lost_s", self._before, values))
        self._before = {key: value for key, value in values.items() if key in COUNTED or key.startswith("refused_")}
        if self._publisher.get_subscription_count() == 0:
            return
        warnings += [str(values["warning"])] if values["warning"] else []
        status = DiagnosticStatus(
            name=f"{self._node.get_fully_qualified_name()}: simulation", hardware_id="simulated rigid body"
        )
        status.level = DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK
        status.message = "; ".join(warnings) or values["state"]
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp
        self._publisher.publish(message)

    def _warn_of_lost_time(self, lost_s: float) -> None:
        """In the log, at most once in WARNING_S: the share of the time since the last report that was given up."""
        before_s, self._reported_s = self._reported_s, time.monotonic()
        if lost_s > 0.0:
            share = min(1.0, lost_s / (self._reported_s - before_s))
            self._node.get_logger().warning(
                f"too much to do here: {share:.0%} of real time given up; simulated time falls behind the wall clock",
                throttle_duration_sec=WARNING_S,
            )

    def _namesake(self) -> str:
        """A warning when somebody else publishes the same states; logged when it begins."""
        before, self._other_publishers = self._other_publishers, self._node.count_publishers("~/pose") - 1
        if self._other_publishers <= 0:
            return ""
        warning = (
            f"another node publishes {self._node.get_fully_qualified_name()}/pose: "
            "nodes of the same name receive each other's commands"
        )
        if before <= 0:
            self._node.get_logger().warning(warning)
        return warning


class Reports(threading.Thread):
    """Lets the node report once a second. An executor would go through every entity of the node for it, and its timers
    stand still with /clock.
    """

    def __init__(self, diagnostics: Diagnostics) -> None:
        super().__init__(name="reports", daemon=True)
        self._diagnostics = diagnostics
        self._no_more = threading.Event()

    def run(self) -> None:
        """On the thread."""
        while not self._no_more.wait(REPORT_S):
            try:
                self._diagnostics.report()
            except Exception:
                # A fault of ours in one report must not end the others.
                traceback.print_exc()

    def stop(self) -> None:
        """End: nobody reports of a node that is being destroyed."""
        self._no_more.set()
        self.join(REPORT_S)
