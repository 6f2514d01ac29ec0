# SPDX-License-Identifier: MIT
"""The command topics: taken by the physics thread at each tick, converted, and submitted."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import InertiaStamped, PointStamped, WrenchStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray, String

from ..base.errors import CommandRefused
from ..live.command_receiver import CommandReceiver
from ..scene.command_codec import Names, of_message
from ..simulation.commands import Command, ThrusterCommand
from .command_queue import CommandQueue, ManualCallbackGroup

QUIET_NS = 4_000_000
"""How often topics are read that carried nothing lately [ns of wall time]."""

ACTIVE_NS = 5_000_000_000
"""A topic is read in every tick for this long after a message [ns of wall time]."""

STAMPED = {
    "wrench": WrenchStamped,
    "poke": WrenchStamped,
    "string/target": PointStamped,
    "string/attach": PointStamped,
    "inertia/set": InertiaStamped,
}


class CommandSubscriber:
    """The subscriptions of one node. frames: what it calls the world's and the body's frame."""

    def __init__(self, node: Node, commands: CommandReceiver, frames: Names, has_thrusters: bool) -> None:
        self._commands = commands
        self._frames = frames
        self._next_quiet_ns = 0
        group = ManualCallbackGroup()
        self._sources: list[tuple[CommandQueue, Callable[[bytes], None]]] = [
            (CommandQueue(node, message_type, topic, group), partial(self._stamped, topic))
            for topic, message_type in STAMPED.items()
        ]
        self._sources.append((CommandQueue(node, String, "schedule", group), self._schedule))
        if has_thrusters:
            self._sources.append((CommandQueue(node, Float64MultiArray, "thrusters", group), self._thrusters))
        self._active_until_ns = [0] * len(self._sources)

    @property
    def queue_full(self) -> int:
        """How often a queue was found full."""
        return sum(queue.queue_full for queue, _ in self._sources)

    @property
    def messages_lost(self) -> int:
        """How many messages the middleware has said to be lost."""
        return sum(queue.messages_lost for queue, _ in self._sources)

    def take(self, wall_ns: int, all_topics: bool = False) -> bool:
        """Submit everything that has arrived; what is refused is counted and notified of, and the rest goes on.
        Returns whether something has arrived within the last ACTIVE_NS.

        Topics that carried something lately are read in every tick, quiet ones every QUIET_NS, or now if
        ``all_topics``.
        """
        read_quiet = all_topics or wall_ns >= self._next_quiet_ns
        if read_quiet:
            self._next_quiet_ns = wall_ns + QUIET_NS
        for source, (queue, submit) in enumerate(self._sources):
            if read_quiet or wall_ns <= self._active_until_ns[source]:
                for data in queue.take():
                    self._active_until_ns[source] = wall_ns + ACTIVE_NS
                    try:
                        submit(data)
                    except CommandRefused:
                        pass  # counted, and the observer was told
        return wall_ns < max(self._active_until_ns)

    def _stamped(self, topic: str, data: bytes) -> None:
        self._commands.receive(topic.partition("/")[0], lambda: read_stamped(topic, data, self._frames))

    def _thrusters(self, data: bytes) -> None:
        def read() -> Command:
            return ThrusterCommand(tuple(read_message(data, Float64MultiArray).data))

        self._commands.receive("thrusters", read)

    def _schedule(self, data: bytes) -> None:
        self._commands.receive_schedule(lambda: read_message(data, String).data)


# Messages read from their bytes, without message objects; anything unusual goes through rclpy's own reader


def read_stamped(topic: str, data: bytes, frames: Names) -> Command:
    """The command of a message on a topic of STAMPED; raises CommandRefused for bytes that are none of its type."""
    try:
        return of_message(topic, data, frames)
    except CommandRefused:
        raise
    except ValueError:
        # As little-endian CDR, however its sender has packed it.
        return of_message(topic, serialize_message(read_message(data, STAMPED[topic])), frames)


def read_message(data: bytes, message_type: type) -> Any:
    """A message from its bytes; raises CommandRefused for bytes that are none of its type."""
    try:
        return deserialize_message(data, message_type)
    except Exception:  # rclpy's own error types differ between versions and middlewares
        accepted = f"a serialized {message_type.__name__}"
        raise CommandRefused("frame", "message", f"{len(data)} bytes that can't be decoded", accepted) from None
