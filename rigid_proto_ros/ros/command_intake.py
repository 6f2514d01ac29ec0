# SPDX-License-Identifier: MIT
"""From the command topics to the simulation: taken by the physics thread in each tick, read, checked, counted.

The subscriptions belong to the node but no executor serves them: a message that the physics thread takes from the
middleware's queue itself costs a third of one that an executor hands to a callback.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

from geometry_msgs.msg import InertiaStamped, PointStamped, WrenchStamped
from rclpy.node import Node
from std_msgs.msg import String

from ..base.errors import CommandRefused
from ..messages import cdr
from ..motion.frames import Frame, parse_frame
from ..scene.command_codec import core_command
from ..scene.scenario import check_inertia, nanoseconds
from ..simulation.commands import WrenchCommand
from . import qos
from .message_bytes import read_command, read_message, read_wrench_stamped
from .polled_subscription import TakenByHand
from .scheduling import LONG_TEXT, Beside, Scheduled
from .sequence_gaps import SequenceGaps
from .stamps import effective_time

TOPICS = ("wrench", "poke", "string", "inertia", "schedule")
"""What received messages are counted by."""

QUIET_NS = 4_000_000
"""How often topics are looked at that carried nothing lately [ns of wall time]."""

PUBLISHERS_NS = 250_000_000
"""How often it is noted who publishes on a topic that carries nothing [ns of wall time]."""

MOST_FRAMES = 1000
"""Frames of wrenches that are kept as read."""

LIVELY_NS = 5_000_000_000
"""A topic is looked at in every tick for this long after a message [ns of wall time]."""


class CommandIntake:
    """apply_changes(changes, mesh at hand) gives the Setup with parameters changed, as scheduled ``set`` entries need it.

    received counts every message taken by topic, refused ones included, ``late`` and ``wall_stamp`` stamps that mean now;
    refusals are the simulation's.
    """

    def __init__(
        self,
        node: Node,
        frames: tuple[str, str],
        apply_changes: Callable,
        apply_inertia: Callable,
    ) -> None:
        self.received: Counter[str] = Counter()
        self.late = 0
        self.wall_stamp = 0
        self._frames = frames
        self._apply_changes = apply_changes
        self._apply_inertia = apply_inertia
        self.queue_full = 0
        self.sequence_gaps = 0
        self._next_quiet_look_ns = 0
        self._next_publishers_look_ns = 0
        self._read_frames: dict[str, Frame] = {}
        self._beside = Beside()
        self._logger = node.get_logger()
        group = TakenByHand()

        def subscribe(message_type, topic):
            return node.create_subscription(
                message_type,
                f"~/{topic}",
                lambda message: None,
                qos.own(qos.COMMAND),
                callback_group=group,
                raw=True,
                qos_overriding_options=qos.OVERRIDABLE,
            )

        self._sources = (
            ("wrench", subscribe(WrenchStamped, "wrench"), WrenchStamped, self._wrench),
            ("poke", subscribe(WrenchStamped, "poke"), WrenchStamped, self._poke),
            ("string", subscribe(PointStamped, "string/target"), PointStamped, self._string_target),
            ("string", subscribe(PointStamped, "string/attach"), PointStamped, self._string_attach),
            ("inertia", subscribe(InertiaStamped, "inertia/set"), InertiaStamped, self._inertia),
            ("schedule", subscribe(String, "schedule"), String, self._schedule),
        )
        self._lively_until_ns = [0] * len(self._sources)
        self._depths = [subscription.qos_profile.depth for _, subscription, _, _ in self._sources]
        self._gaps = [SequenceGaps(subscription) for _, subscription, _, _ in self._sources]

    def take(self, simulation, scenario, wall_ns: int, catch_up: Callable[[], None], whole: bool = False) -> bool:
        """Submit everything that has arrived; what is refused is counted and the observer told, and the rest goes on. Returns whether
        something has arrived within the last LIVELY_NS.

        catch_up() is called before the first message of a tick, so that now is the tick's own time. Topics that carried something lately are looked at in every tick, quiet ones every QUIET_NS, or now if ``whole``.
        """
        caught_up = False
        for message in self._beside.finished():
            if not caught_up:
                caught_up = True
                catch_up()
            self.received["schedule"] += self._take_scheduled(message, simulation, scenario)
        look_at_quiet = whole or wall_ns >= self._next_quiet_look_ns
        if look_at_quiet:
            self._next_quiet_look_ns = wall_ns + QUIET_NS
        look_at_publishers = look_at_quiet and wall_ns >= self._next_publishers_look_ns
        if look_at_publishers:
            self._next_publishers_look_ns = wall_ns + PUBLISHERS_NS
        for source, (topic, subscription, message_type, read) in enumerate(self._sources):
            if not look_at_quiet and wall_ns > self._lively_until_ns[source]:
                continue
            gaps = self._gaps[source]
            with subscription.handle:
                # Bounded, so that a flood can't hold up the motion for ever.
                for count in range(qos.COMMAND_DEPTH):
                    taken = subscription.handle.take_message(message_type, True)
                    if taken is None:
                        if (look_at_publishers or (count and look_at_quiet)) and gaps.emptied():
                            self.queue_full += 1
                        break
                    if count == self._depths[source] - 1:
                        self.queue_full += 1
                    if not caught_up:
                        caught_up = True
                        catch_up()
                    self._lively_until_ns[source] = wall_ns + LIVELY_NS
                    self.sequence_gaps += gaps.before(taken[1].get("publication_sequence_number"))
                    counted = 1
                    try:
                        entries = read(taken[0], simulation, scenario)
                        counted = 1 if entries is None else entries
                    except CommandRefused as refusal:
                        simulation.refuse(refusal)
                    # Last: a message that counts as received counts as late or refused too, if it is.
                    self.received[topic] += counted
        return wall_ns < max(self._lively_until_ns)

    def _wrench(self, data, simulation, scenario) -> None:
        self._submit_wrench(True, data, simulation, scenario)

    def _poke(self, data, simulation, scenario) -> None:
        self._submit_wrench(False, data, simulation, scenario)

    def _submit_wrench(self, held: bool, data: bytes, simulation, scenario) -> None:
        stamp_ns, frame_id, force, torque = read_wrench_stamped(data)
        frame = self._read_frames.get(frame_id)
        if frame is None:
            frame = parse_frame(frame_id, simulation.setup.contacts, *self._frames)
            # Contacts and frames' names are set at start only, so what was read once stays so.
            if len(self._read_frames) >= MOST_FRAMES:
                self._read_frames.clear()
            self._read_frames[frame_id] = frame
        message = cdr.wrench_stamped(stamp_ns, frame_id, force, torque)
        command = WrenchCommand(held, frame, force, torque, stamp_ns, frame_id, message)
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _string_target(self, data: bytes, simulation, scenario) -> None:
        self._string("string/target", data, simulation, scenario)

    def _string_attach(self, data: bytes, simulation, scenario) -> None:
        self._string("string/attach", data, simulation, scenario)

    def _string(self, topic: str, data: bytes, simulation, scenario) -> None:
        sent = read_command(topic, data, PointStamped)
        command = core_command(sent, sent.t_ns, (), None, self._frames)
        simulation.submit(command, self._when(sent.t_ns, simulation, scenario))

    def _inertia(self, data: bytes, simulation, scenario) -> None:
        sent = read_command("inertia/set", data, InertiaStamped)
        command = core_command(sent, sent.t_ns, (), None, self._frames, self._apply_inertia, bytes(data))
        check_inertia(scenario, command.content)
        stamp_ns = sent.t_ns
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _schedule(self, data, simulation, scenario) -> int:
        message = Scheduled(bytes(data), read_message(data, String).data)
        quick = self._beside.is_empty and len(message.text) <= LONG_TEXT
        if quick:
            message.read(scenario)
            quick = not message.is_slow
        if quick:
            message.judge(scenario, self._apply_changes)
            return self._take_scheduled(message, simulation, scenario)

        def work() -> None:
            if not message.commands:
                message.read(scenario)
            message.judge(scenario, self._apply_changes)

        self._beside.give(message, work)
        return 0

    def _take_scheduled(self, message: Scheduled, simulation, scenario) -> int:
        """Submit all of a message's entries, or refuse them all; returns how many there are."""
        try:
            if message.refusal is not None:
                raise message.refusal
            times = [self._effective(entry.t_ns, simulation, scenario) for entry in message.entries]
        except CommandRefused as refusal:
            simulation.refuse(refusal, message.count)
            return message.count
        for counter in ("late", "wall_stamp"):
            entries = {e.number for e, (_, counted) in zip(message.entries, times, strict=True) if counted == counter}
            self._count_stamps(counter, len(entries))
        for entry, (when_ns, _) in zip(message.entries, times, strict=True):
            simulation.submit(entry.command, when_ns, entry.listed, entry.judged)
        return message.count

    def _when(self, stamp_ns: int, simulation, scenario) -> int:
        when_ns, counter = self._effective(stamp_ns, simulation, scenario)
        self._count_stamps(counter, 1)
        return when_ns

    def _effective(self, stamp_ns: int, simulation, scenario) -> tuple[int, str]:
        horizon_ns = nanoseconds(scenario.parameters.schedule_horizon)
        return effective_time(stamp_ns, simulation.time_ns, time.time_ns(), horizon_ns)

    def _count_stamps(self, counter: str, count: int) -> None:
        if counter == "late":
            self.late += count
        elif counter == "wall_stamp" and count:
            first, self.wall_stamp = self.wall_stamp == 0, self.wall_stamp + count
            if first:
                self._logger.warning(
                    "a command is stamped with the system's clock: it acts now, and so do later ones; stamps of commands are simulated time"
                )
