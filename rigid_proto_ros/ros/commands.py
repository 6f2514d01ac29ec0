# SPDX-License-Identifier: MIT
"""The command topics and ``~/step``: the physics thread takes their messages (arrivals.py), converts and submits them.

The middleware counts messages that a publisher had to drop before they were fetched, and reports the count by an event
callback. Messages dropped by this subscriber's full queue are not counted anywhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from typing import Any

from geometry_msgs.msg import InertiaStamped, PointStamped, WrenchStamped
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ..base.errors import CommandRefused, InputError
from ..live.command_receiver import CommandReceiver
from ..live.simulation_loop import SimulationLoop
from ..scene import cdr
from ..scene.command_codec import Names, of_message
from ..simulation.commands import Command, MoveString, ThrusterCommand, WrenchCommand
from . import qos
from .arrivals import Arrivals

QUIET_NS = 4_000_000
"""Polling period of the topics while no messages arrive [ns of wall time]."""

ACTIVE_NS = 5_000_000_000
"""How long after a message the topics are polled in every tick [ns of wall time]."""

TOPICS = {
    "wrench": WrenchStamped,
    "poke": WrenchStamped,
    "string/target": PointStamped,
    "string/attach": PointStamped,
    "inertia/set": InertiaStamped,
    "schedule": String,
    "thrusters": Float64MultiArray,
}


class CommandQueue:
    """The messages of one topic in the node's private namespace, as bytes.

    queue_full: how often the queue was found full, after which an unknown number of messages may be lost.
    messages_lost: number of messages dropped by publishers, as reported by the middleware. contended: the topic has
    several publishers, and no warning was logged yet.
    """

    def __init__(self, node: Node, topic: str, arrivals: Arrivals) -> None:
        self.topic = topic
        self.queue_full = 0
        self.messages_lost = 0
        self.contended = False
        self._logger = node.get_logger()
        events = SubscriptionEventCallbacks(
            message_lost=self._on_lost,
            incompatible_qos=self._on_incompatible,
            matched=self._on_matched,
        )
        self._messages = arrivals.subscribe(TOPICS[topic], topic, qos.COMMAND, events)
        self._topic_name = node.resolve_topic_name(f"~/{topic}")

    def take(self) -> Iterator[bytes]:
        """Yield the messages that have arrived."""
        for count, data in enumerate(self._messages.take()):
            if count == self._messages.depth - 1:
                self.queue_full += 1
            yield data

    def note_sender(self, command: Command) -> None:
        """Warn, once per new publisher, if a command replaces one that another publisher may hold."""
        held = isinstance(command, WrenchCommand) and command.held and not command.frame.slot
        if self.contended and (held or isinstance(command, MoveString | ThrusterCommand)):
            self.contended = False
            slots = "; with ;slot=<name> in their frames they don't" if held else ""
            self._logger.warning(f"several publishers on {self._topic_name} replace each other's commands{slots}")

    def _on_matched(self, status: Any) -> None:
        if status.current_count < 2:
            self.contended = False
        elif status.current_count_change > 0:
            self.contended = True

    def _on_lost(self, status: Any) -> None:
        self.messages_lost = status.total_count

    def _on_incompatible(self, status: Any) -> None:
        policy = qos_policy_name_from_kind(status.last_policy_kind)
        self._logger.warning(
            f"a publisher on {self._topic_name} offers incompatible QoS (last policy: {policy}): "
            "none of its messages will be received; commands have to be reliable"
        )


class CommandSubscriber:
    """The command subscriptions of one node. frames: names of its world and body frames."""

    def __init__(self, node: Node, arrivals: Arrivals, frames: Names, has_thrusters: bool) -> None:
        self._frames = frames
        self._next_quiet_ns = self._active_until_ns = 0
        self._queues = [
            CommandQueue(node, topic, arrivals) for topic in TOPICS if has_thrusters or topic != "thrusters"
        ]

    @property
    def queue_full(self) -> int:
        """Number of times that a queue was found full."""
        return sum(queue.queue_full for queue in self._queues)

    @property
    def messages_lost(self) -> int:
        """Number of lost messages, as reported by the middleware."""
        return sum(queue.messages_lost for queue in self._queues)

    def take(self, commands: CommandReceiver, wall_ns: int, at_once: bool) -> bool:
        """Take all messages that have arrived, convert them, and submit their commands. A refused command is counted,
        observers are notified, and the others are still taken. In lockstep, stop after a command that a step must
        follow. Returns whether a message has arrived within the last ACTIVE_NS. Quiet topics are polled every QUIET_NS,
        or now if ``at_once``.
        """
        if at_once or wall_ns >= self._next_quiet_ns or wall_ns < self._active_until_ns:
            self._next_quiet_ns = wall_ns + QUIET_NS
            for queue in self._queues:
                for data in queue.take():
                    self._active_until_ns = wall_ns + ACTIVE_NS
                    with suppress(CommandRefused):  # already counted, and sent to the observer
                        if queue.topic == "schedule":
                            commands.receive_schedule(partial(read_text, data))
                        else:
                            convert = partial(self._read, queue, data)
                            commands.receive(queue.topic.partition("/")[0], convert)
                    if commands.step_requested:
                        return True
        return wall_ns < self._active_until_ns

    def _read(self, queue: CommandQueue, data: bytes) -> Command:
        command = read_command(queue.topic, data, self._frames)
        if queue.contended:
            queue.note_sender(command)
        return command


def read_command(topic: str, data: bytes, frames: Names) -> Command:
    """The command of a message on a topic other than ``schedule``; raises CommandRefused."""
    try:
        if topic == "thrusters":
            return ThrusterCommand(tuple(deserialize_message(data, Float64MultiArray).data))
        # Decodes the bytes without a message object, which is faster.
        return of_message(topic, data, frames)
    except CommandRefused:
        raise
    except Exception:  # rclpy's own error types differ between versions and middlewares
        raise _undecodable(topic, data) from None


def read_text(data: bytes) -> str:
    """The text of a message on ``schedule``; raises CommandRefused."""
    try:
        return cdr.read_string(data)
    except ValueError:
        raise _undecodable("schedule", data) from None


def _undecodable(topic: str, data: bytes) -> CommandRefused:
    accepted = f"a {TOPICS[topic].__name__} as little-endian CDR"
    return CommandRefused("frame", "message", f"{len(data)} bytes that can't be decoded", accepted)


class StepService:
    """The service ``~/step`` of one node. A controller in lockstep waits for every answer, and an executor, which
    rebuilds its wait set each time, would cost several times as much as the step itself.
    """

    def __init__(self, arrivals: Arrivals) -> None:
        self._requests = arrivals.serve(Trigger, "step")
        self._under_way: tuple[Any, Iterator[None]] | None = None

    def serve(self, loop: SimulationLoop) -> None:
        """Serve the requests in order, each within the tick's time budget, and answer those that are complete."""
        while True:
            if self._under_way is None:
                request = self._requests.take()
                if request is None:
                    return
                self._under_way = request, loop.steps()
            request, steps = self._under_way
            answer = Trigger.Response(success=True)
            try:
                next(steps)
                return
            except StopIteration:
                time_s, received = loop.simulation.time_ns / 1e9, loop.commands.received.total()
                answer.message = f"simulated time is {time_s:.9g} s; {received} commands received"
            except InputError as error:
                answer = Trigger.Response(success=False, message=str(error))
            self._under_way = None
            self._requests.answer(request, answer)
