# SPDX-License-Identifier: MIT
"""What /diagnostics says of the simulation, once a second."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from .troubles import COUNTED, troubles

REFUSAL_REASONS = ("frame", "nonfinite", "magnitude", "stamp", "ray_miss", "tensor", "integrator", "schedule")


class Diagnostics:
    """values() gives the keys and values; the level follows from what went wrong since the last report."""

    def __init__(self, node: Node, values) -> None:
        self._node = node
        self._values = values
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._before: dict[str, object] = {}
        # By the steady clock: reports must go on while /clock stands still.
        self._timer = node.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _report(self) -> None:
        # Before the values are read: what was done before the stamp is in them.
        stamp = self._node.get_clock().now().to_msg()
        values = self._values()
        said, self._before = troubles(self._before, values), {key: values[key] for key in values if _counts(key)}
        if self._publisher.get_subscription_count() == 0:
            return
        said += [values["warning"]] if values["warning"] else []
        status = DiagnosticStatus(
            name=f"{self._node.get_fully_qualified_name()}: simulation", hardware_id="simulated rigid body"
        )
        status.level = DiagnosticStatus.WARN if said else DiagnosticStatus.OK
        status.message = "; ".join(said) or values["state"]
        status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp
        self._publisher.publish(message)


def _counts(key: str) -> bool:
    return key in COUNTED or key.startswith("refused_")
