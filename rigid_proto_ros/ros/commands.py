# SPDX-License-Identifier: MIT
"""The command topics: taken by the physics thread (arrivals.py), converted, and submitted; and ``~/step``, taken
likewise.

Lost messages are counted by the middleware, which tells the executor of them in the public way: those that a sender had
to drop before they were fetched. What this side's own queue drops when it is full nobody counts.
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
"""How often topics are read while nothing comes [ns of wall time]."""

ACTIVE_NS = 5_000_000_000
"""They are read in every tick for this long after a message [ns of wall time]."""

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
    """The messages of one topic below the node's name, as bytes.

    queue_full: how often the queue was found full, so that messages may have been dropped here, nobody knows how many.
    messages_lost: how many the middleware has said that their senders dropped. contended: several publishers are there,
    and nobody was told yet.
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
        """What has arrived, message by message."""
        for count, data in enumerate(self._messages.take()):
            if count == self._messages.depth - 1:
                self.queue_full += 1
            yield data

    def note_sender(self, command: Command) -> None:
        """Warn, once for each publisher that comes, where a command replaces what another publisher may hold."""
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
    """The subscriptions of one node. frames: what it calls the world's and the body's frame."""

    def __init__(self, node: Node, arrivals: Arrivals, frames: Names, has_thrusters: bool) -> None:
        self._frames = frames
        self._next_quiet_ns = self._active_until_ns = 0
        self._queues = [
            CommandQueue(node, topic, arrivals) for topic in TOPICS if has_thrusters or topic != "thrusters"
        ]

    @property
    def queue_full(self) -> int:
        """How often a queue was found full."""
        return sum(queue.queue_full for queue in self._queues)

    @property
    def messages_lost(self) -> int:
        """How many messages the middleware has said to be lost."""
        return sum(queue.messages_lost for queue in self._queues)

    def take(self, commands: CommandReceiver, wall_ns: int, at_once: bool) -> bool:
        """Take every message that has arrived, convert it, and submit its command; what is refused is counted and
        notified of, and the rest goes on; in lockstep only up to one that is followed by a step. Returns whether
        something has arrived within the last ACTIVE_NS. Quiet topics are read every QUIET_NS, or now if ``at_once``.
        """
        if at_once or wall_ns >= self._next_quiet_ns or wall_ns < self._active_until_ns:
            self._next_quiet_ns = wall_ns + QUIET_NS
            for queue in self._queues:
                for data in queue.take():
                    self._active_until_ns = wall_ns + ACTIVE_NS
                    with suppress(CommandRefused):  # counted, and the observer was told
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
        # From its bytes, without a message object.
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
    """``~/step`` of one node. A controller in lockstep waits for every answer, and an executor, which gathers all that
    it waits for anew each time, costs several times what the step itself does.
    """

    def __init__(self, arrivals: Arrivals) -> None:
        self._requests = arrivals.serve(Trigger, "step")
        self._under_way: tuple[Any, Iterator[None]] | None = None

    def serve(self, loop: SimulationLoop) -> None:
        """Take what is asked for, one request after another, each for as long as a tick has time, and answer."""
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
