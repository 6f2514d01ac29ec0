# SPDX-License-Identifier: MIT
"""Sends a script to a node as lists of schedule entries, ahead of time and no faster than the node confirms them, and
reports how many were late or refused.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.utilities import try_shutdown
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_msgs.msg import String
from std_srvs.srv import SetBool

from ..base.errors import InputError
from ..scene.script import RESET, schedules
from ..simulation.commands import Command, nanoseconds
from . import qos
from .arguments import begin_ros

MAX_UNCONFIRMED = 500
"""Largest number of commands sent that the node hasn't reported as received; far below the capacity of its queues."""

SEND_AHEAD_NS = 60 * 1_000_000_000
"""How far ahead of simulated time commands are sent while it runs [ns], so that a client that is ended leaves few
behind. While time is held at 0, all commands within the node's schedule_horizon are sent.
"""

KEEP_HELD_S = 0.25
"""Period of the message that keeps time held at 0 [s]; the node holds it for 1 s after each list."""

STALLED_S = 15.0
"""Timeout of a report or confirmation [s], after which the node is considered gone."""

STANDSTILL_S = 5.0
"""If simulated time hasn't advanced for this long [s] by the reports, one a second, another client has paused it, or it
follows a clock that has stopped.
"""


@dataclass(frozen=True)
class Report:
    """Outcome of sending a script. sent: commands by kind. late, refused: increase of the node's counters up to
    ``reached_ns``; reasons: refused commands by reason. last_ns: time at which the last command acts. was_reset:
    whether another client has reset the node meanwhile, or it was restarted.
    """

    sent: dict[str, int]
    late: int
    refused: int
    reasons: dict[str, int]
    last_ns: int
    reached_ns: int
    was_reset: bool

    @property
    def all_in_time(self) -> bool:
        """Whether none was late, refused or dropped."""
        return self.late == 0 and self.refused == 0 and not self.was_reset

    @property
    def text(self) -> str:
        """One line for the terminal."""
        parts = ", ".join(f"{count} {kind}" for kind, count in self.sent.items()) or "nothing"
        why = ", ".join(f"{count} {reason}" for reason, count in self.reasons.items())
        refused = f"{self.refused} refused{f' ({why})' if why else ''}"
        text = f"sent {parts}; {self.late} late, {refused}; the last acts at {self.last_ns / 1e9:.6g} s"
        if self.was_reset:
            text += ", but the node was reset or restarted meanwhile: commands that hadn't acted were dropped"
        elif self.sent and self.reached_ns <= self.last_ns:
            text += f", but simulated time has stopped at {self.reached_ns / 1e9:.6g} s"
        return text


@contextmanager
def ros_context(*arguments: str) -> Iterator[None]:
    """Context of an initialized rclpy; raises InputError for arguments that it refuses."""
    begin_ros([sys.argv[0], *arguments])
    try:
        yield
    finally:
        try_shutdown()


def send_script(
    script: list[Command], node_name: str, timeout_s: float, reset: bool = False, lead_s: float = 0.2
) -> Report:
    """Send a script's commands to the node and wait until all have acted; call within a ``ros_context``."""
    sender = ScriptSender(node_name, timeout_s)
    try:
        return sender.send(script, reset, lead_s)
    finally:
        sender.destroy_node()


class ScriptSender(Node):
    """A client of the node ``node_name``. Raises InputError if the node doesn't answer within timeout_s; 0:
    no limit.
    """

    def __init__(self, node_name: str, timeout_s: float) -> None:
        self.target = node_name if node_name.startswith("/") else f"/{node_name}"
        try:
            validate_full_topic_name(self.target)
        except NameValidationException:
            raise InputError("--node", node_name, "a node's name, such as /rigid_body or /lab/rigid_body") from None
        super().__init__("poke_client", start_parameter_services=False, enable_rosout=False)
        self._counters: dict[str, str] = {}
        self._reported_s = 0.0
        self._restarted = False
        self._sent, self._sent_s = 0, 0.0
        self._schedule = self.create_publisher(String, f"{self.target}/schedule", qos.COMMAND)
        self._get_parameters = self.create_client(GetParameters, f"{self.target}/get_parameters")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._wait_for_node(timeout_s)

    def send(self, script: list[Command], reset: bool, lead_s: float) -> Report:
        """Send all commands, each for its simulated time, and wait until all have acted. With ``reset``, simulated time
        starts at 0 when all commands within the horizon have arrived, even if it was paused.
        """
        before = dict(self._counters)
        self._received_before = int(before["commands_received"])
        self._resets = int(before.get("resets", 0)) + reset
        start_ns = 0 if reset else self._present_ns() + nanoseconds(lead_s)
        horizon_ns = nanoseconds(float(self._parameter("schedule_horizon") or 0.0))
        lists = list(schedules(script, start_ns))
        held = sum(time_ns <= horizon_ns for time_ns, _ in lists) if reset else 0
        if reset:
            # In a list of its own, because a refused command makes its whole list refused.
            self._publish([RESET], held > 0)
        paused, number = reset and before.get("state") == "paused", 0
        for place, (time_ns, entries) in enumerate(lists):
            if place < held:
                self._make_room(len(entries), holding=True)
            else:
                if place == held and reset:
                    self._make_room(MAX_UNCONFIRMED)
                    paused = paused and self._resume()
                self._make_room(len(entries))
                while time_ns > self._reached_ns() + min(horizon_ns, SEND_AHEAD_NS) and not self._was_reset():
                    self._listen()
            if self._was_reset():
                break
            self._publish(entries, place + 1 < held)
            number += len(entries)
        self._make_room(MAX_UNCONFIRMED)
        if paused:
            self._resume()
        last_ns = start_ns + (script[-1].stamp_ns if script else 0)
        if script:
            self._wait_until_acted(last_ns)
        if self._restarted:
            before = dict.fromkeys(before, "0")
        # All values are from one report, so the counters include everything up to its time.
        grown = {key: int(self._counters[key]) - int(before[key]) for key in before if key.startswith("refused_")}
        refused = grown.pop("refused_total")
        reasons = {key.removeprefix("refused_"): count for key, count in grown.items() if count}
        late = int(self._counters["late"]) - int(before["late"])
        sent = Counter(command.kind for command in script[:number])
        return Report(sent, late, refused, reasons, last_ns, self._reached_ns(), self._was_reset())

    def _publish(self, entries: list[dict[str, Any]], more: bool = False) -> None:
        """Send a list. more: the node holds time at 0 until the next list."""
        if more:
            entries = [{"more": True, **entries[0]}, *entries[1:]]
        self._schedule.publish(String(data=json.dumps(entries)))
        self._sent += len(entries)
        self._sent_s = time.monotonic()

    def _resume(self) -> bool:
        """Resume a paused node; returns False, since it is no longer paused."""
        client = self.create_client(SetBool, f"{self.target}/pause")
        self._spin_until(client.service_is_ready, f"the service {client.srv_name}")
        answer = self._answer(client, SetBool.Request(data=False))
        if not answer.success:
            raise InputError(client.srv_name, answer.message, "success")
        return False

    def _make_room(self, count: int, holding: bool = False) -> None:
        """Wait until ``count`` more commands would leave at most MAX_UNCONFIRMED unconfirmed. holding: the node holds
        time at 0 meanwhile.
        """

        def has_room() -> bool:
            if holding and time.monotonic() > self._sent_s + KEEP_HELD_S:
                self._publish([{}], more=True)
            return self._was_reset() or self._sent + min(count, MAX_UNCONFIRMED) - self._confirmed() <= MAX_UNCONFIRMED

        self._spin_until(has_room, f"{self.target} to confirm {self._sent} commands")

    def _was_reset(self) -> bool:
        """Whether another client has reset the node since ``send`` began, or it was restarted."""
        return self._restarted or int(self._counters.get("resets", 0)) > self._resets

    def _parameter(self, name: str) -> Any:
        """The node's value of a parameter, or None if it has no such parameter."""
        answer = self._answer(self._get_parameters, GetParameters.Request(names=[name]))
        return parameter_value_to_python(answer.values[0]) if answer.values else None

    def _wait_for_node(self, timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        while not (
            self._counters and self._schedule.get_subscription_count() and self._get_parameters.service_is_ready()
        ):
            if timeout_s and time.monotonic() > deadline:
                raise InputError("--node", self.target, f"a running rigid_body node within {timeout_s:g} s")
            rclpy.spin_once(self, timeout_sec=0.1)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"{self.target}: simulation":
                before, self._counters = self._counters, {v.key: v.value for v in status.values}
                received = [int(counters.get("commands_received", 0)) for counters in (before, self._counters)]
                self._restarted |= received[1] < received[0]
                self._reported_s = time.monotonic()

    def _present_ns(self) -> int:
        """Simulated time now, from the next state or, if states are rare or stamped by a /clock, from the
        next report.
        """
        stamps: list[int] = []

        def on_pose(message: PoseStamped) -> None:
            stamp = message.header.stamp
            stamps.append(stamp.sec * 1_000_000_000 + stamp.nanosec)

        follows_clock, asked_s = self._parameter("use_sim_time"), time.monotonic()
        subscription = self.create_subscription(PoseStamped, f"{self.target}/pose", on_pose, 1)
        self._spin_until(
            lambda: self._reported_s > asked_s or (stamps and not follows_clock),
            f"a state or a report of {self.target}",
        )
        self.destroy_subscription(subscription)
        return self._reached_ns() if self._reported_s > asked_s else stamps[0]

    def _confirmed(self) -> int:
        return int(self._counters["commands_received"]) - self._received_before

    def _wait_until_acted(self, last_ns: int) -> None:
        """Wait for a report from after the last command, because a ray hits or misses the body only when it acts. Give
        up if simulated time doesn't advance for STANDSTILL_S.
        """
        reached_ns, since_s = -1, 0.0
        while self._reached_ns() <= last_ns and not self._was_reset():
            if self._reached_ns() != reached_ns:
                reached_ns, since_s = self._reached_ns(), self._reported_s
            elif self._reported_s > since_s + STANDSTILL_S:
                return
            self._listen()

    def _listen(self) -> None:
        """Wait briefly for the next report; raises InputError if there was none for STALLED_S."""
        rclpy.spin_once(self, timeout_sec=0.1)
        if time.monotonic() > self._reported_s + STALLED_S:
            raise InputError("--node", self.target, f"a report within {STALLED_S:g} s")

    def _reached_ns(self) -> int:
        """Simulated time of the last report [ns]."""
        return int(self._counters["sim_time_ns"])

    def _answer(self, client: Client, request: Any) -> Any:
        future = client.call_async(request)
        self._spin_until(future.done, f"an answer of {client.srv_name}")
        return future.result()

    def _spin_until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + STALLED_S
        while not condition():
            if time.monotonic() > deadline:
                raise InputError("--node", self.target, f"{what} within {STALLED_S:g} s")
            rclpy.spin_once(self, timeout_sec=0.05)
