# SPDX-License-Identifier: MIT
"""What /diagnostics says of one body, once a second."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from .command_intake import TOPICS, CommandIntake
from .diagnostic_warnings import COUNTED, increase, warnings_since
from .simulation_loop import SimulationLoop
from .watchers import Watchers

REFUSAL_REASONS = ("frame", "nonfinite", "magnitude", "stamp", "ray_miss", "tensor", "integrator", "schedule")

WARNING_S = 10.0
"""How often the log says that real time is given up."""

REPORT_S = 1.0
"""Time between two reports on /diagnostics."""


class Diagnostics:
    """Of one node; the level of a report follows from what went wrong since the one before."""

    def __init__(self, node: Node, loop: SimulationLoop, intake: CommandIntake, watchers: Watchers) -> None:
        self._node = node
        self._loop = loop
        self._intake = intake
        self._watchers = watchers
        self._other_publishers = 0
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._before: dict[str, object] = {}
        self._reported_s = time.monotonic()

    def report(self) -> None:
        """Publish how it stands, and log what is new and wrong."""
        # Before the values are read: what was done before the stamp is in them.
        stamp = self._node.get_clock().now().to_msg()
        values = self._values()
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

    def _values(self) -> dict[str, object]:
        loop, intake = self._loop, self._intake
        simulation, timekeeping = loop.simulation, loop.timekeeping
        # First: whatever happened up to then is counted in what follows.
        time_ns = simulation.time_ns
        momentum = simulation.angular_momentum
        # Counted last by the physics thread, so read first: who finds a message received finds its refusal too.
        received = dict(intake.received)
        refused = dict(simulation.refused)
        return {
            "sim_time_ns": time_ns,
            "stamp_offset_ns": loop.stamps.offset_ns,
            "publish_rate": loop.scenario.parameters.publish_rate,
            "overruns": timekeeping.overruns,
            "real_time_lost_s": timekeeping.real_time_lost_s,
            **{f"{topic}_received": received.get(topic, 0) for topic in TOPICS},
            "commands_received": sum(received.values()),
            "refused_total": sum(refused.values()),
            **{f"refused_{reason}": refused.get(reason, 0) for reason in REFUSAL_REASONS},
            "late": intake.late,
            "wall_stamp": intake.wall_stamp,
            "sequence_gaps": intake.sequence_gaps,
            "queue_full": intake.queue_full,
            "kinetic_energy": simulation.kinetic_energy,
            "potential_energy": simulation.potential_energy,
            "angular_momentum_norm": float((momentum * momentum).sum()) ** 0.5,
            "angular_momentum_drift": simulation.angular_momentum_drift,
            "integrator": simulation.setup.integrator.name,
            "integrator_choice": simulation.choice,
            "accuracy_floor": simulation.accuracy_floor,
            "steps": simulation.steps,
            "force_evaluations": simulation.force_evaluations,
            "state": "paused" if timekeeping.paused else "sleeping" if simulation.at_rest else "flying",
            "recording": loop.scenario.parameters.record,
            "warning": (
                simulation.failure
                or self._watchers.recording_error
                or self._namesake()
                or simulation.too_coarse
                or simulation.too_slow
            ),
        }

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
    """Lets several nodes of one process report once a second, all together. An executor would go through every entity
    of every node for each of them, and its timers stand still with /clock.
    """

    def __init__(self, diagnostics: Sequence[Diagnostics]) -> None:
        super().__init__(name="reports", daemon=True)
        self._diagnostics = diagnostics
        self._no_more = threading.Event()

    def run(self) -> None:
        """On the thread."""
        while not self._no_more.wait(REPORT_S):
            for diagnostics in self._diagnostics:
                try:
                    diagnostics.report()
                except Exception:
                    # A fault of ours in one report must not end those of the other nodes.
                    traceback.print_exc()

    def stop(self) -> None:
        """End: nobody reports of a node that is being destroyed."""
        self._no_more.set()
        self.join(REPORT_S)
