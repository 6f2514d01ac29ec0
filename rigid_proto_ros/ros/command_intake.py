# SPDX-License-Identifier: MIT
"""From the command topics to the simulation: taken by the physics thread in each tick, read, checked, counted.

The subscriptions belong to the node but no executor serves them: a message that the physics thread takes from the
middleware's queue itself costs a third of one that an executor hands to a callback.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

import yaml
from geometry_msgs.msg import WrenchStamped
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from .. import cdr
from ..core.commands import WrenchCommand
from ..core.errors import CommandRefused, InputError
from ..core.frames import parse_frame
from ..poke_script import MAX_TIME_S, core_command, parse_script
from ..scenario import nanoseconds
from . import qos
from .message_bytes import read_wrench_stamped
from .stamps import effective_time

MAX_SCHEDULE_LENGTH = 100_000
"""Characters of one schedule entry."""


class _TakenByHand(CallbackGroup):
    """A callback group whose entities no executor may serve."""

    def can_execute(self, entity) -> bool:
        return False

    def beginning_execution(self, entity) -> bool:
        return False

    def ending_execution(self, entity) -> None:
        pass


class CommandIntake:
    """apply_changes(changes) gives the Setup with parameters changed, as scheduled ``set`` entries need it.

    received counts messages by topic, ``late`` and ``wall_stamp`` stamps that mean now; refusals are the simulation's.
    """

    def __init__(self, node: Node, frames: tuple[str, str], apply_changes: Callable, on_refusal: Callable) -> None:
        self.received: Counter[str] = Counter()
        self.late = 0
        self.wall_stamp = 0
        self._frames = frames
        self._apply_changes = apply_changes
        self._on_refusal = on_refusal
        group = _TakenByHand()

        def subscribe(message_type, topic):
            return node.create_subscription(
                message_type,
                f"~/{topic}",
                lambda message: None,
                qos.COMMAND,
                callback_group=group,
                raw=True,
                qos_overriding_options=qos.OVERRIDABLE,
            )

        self._sources = (
            ("wrench", subscribe(WrenchStamped, "wrench"), WrenchStamped, self._wrench),
            ("poke", subscribe(WrenchStamped, "poke"), WrenchStamped, self._poke),
            ("schedule", subscribe(String, "schedule"), String, self._schedule),
        )

    def take(self, simulation, scenario) -> None:
        """Submit everything that has arrived; what is refused is counted and told, and the rest goes on."""
        for topic, subscription, message_type, read in self._sources:
            with subscription.handle:
                # Bounded, so that a flood can't hold up the motion for ever.
                for _ in range(qos.COMMAND_DEPTH):
                    taken = subscription.handle.take_message(message_type, True)
                    if taken is None:
                        break
                    self.received[topic] += 1
                    try:
                        read(taken[0], simulation, scenario)
                    except CommandRefused as refusal:
                        simulation.refuse(refusal)
                        self._on_refusal(refusal)

    @property
    def commands_received(self) -> int:
        """Every message taken, refused ones included."""
        return sum(self.received.values())

    def _wrench(self, data, simulation, scenario) -> None:
        self._submit_wrench(True, data, simulation, scenario)

    def _poke(self, data, simulation, scenario) -> None:
        self._submit_wrench(False, data, simulation, scenario)

    def _submit_wrench(self, held: bool, data: bytes, simulation, scenario) -> None:
        try:
            stamp_ns, frame_id, force, torque = read_wrench_stamped(data)
        except UnicodeDecodeError:
            raise CommandRefused("frame", "frame_id", "bytes that aren't UTF-8", "text") from None
        frame = parse_frame(frame_id, simulation.setup.contacts, *self._frames)
        message = cdr.wrench_stamped(stamp_ns, frame_id, force, torque)
        command = WrenchCommand(held, frame, force, torque, stamp_ns, frame_id, message)
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _schedule(self, data, simulation, scenario) -> None:
        text = deserialize_message(data, String).data
        if len(text) > MAX_SCHEDULE_LENGTH:
            raise CommandRefused("schedule", "schedule", f"{len(text)} characters", f"at most {MAX_SCHEDULE_LENGTH}")
        try:
            entry = yaml.safe_load(text)
            (command,) = parse_script(yaml.safe_dump([entry]), "schedule") if isinstance(entry, dict) else (None,)
            if command is None or command.kind not in ("set", "clear_wrench"):
                raise InputError("schedule", text[:80], "one entry {t, set} or {t, service: clear_wrench}")
            stamp_ns = nanoseconds(min(float(entry["t"]), MAX_TIME_S))
            if command.kind == "set":
                scenario.with_changes(command.changes)
        except CommandRefused:
            raise
        except InputError as error:
            raise CommandRefused("schedule", error.field, error.received, error.accepted) from None
        except (yaml.YAMLError, ValueError, TypeError, RecursionError, OverflowError):
            raise CommandRefused("schedule", "schedule", text[:80], "one entry as YAML") from None
        core = core_command(command, stamp_ns, simulation.setup.contacts, self._apply_changes)
        simulation.submit(core, self._when(stamp_ns, simulation, scenario))

    def _when(self, stamp_ns: int, simulation, scenario) -> int:
        horizon_ns = nanoseconds(scenario.values["schedule_horizon"])
        when_ns, counter = effective_time(stamp_ns, simulation.time_ns, time.time_ns(), horizon_ns)
        if counter == "late":
            self.late += 1
        elif counter == "wall_stamp":
            self.wall_stamp += 1
        return when_ns
