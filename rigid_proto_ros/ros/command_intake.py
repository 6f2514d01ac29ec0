# SPDX-License-Identifier: MIT
"""From the command topics to the simulation: taken by the physics thread in each tick, read, checked, counted."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from geometry_msgs.msg import InertiaStamped, PointStamped, WrenchStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray, String

from ..base.errors import CommandRefused
from ..base.rotation import Vector
from ..messages import cdr
from ..motion.frames import Frame, parse_frame
from ..scene.command_codec import ScriptCommand, core_command, of_message, whole_stamp
from ..scene.scenario import BodyMesh, check_inertia, nanoseconds
from ..simulation.commands import ThrusterCommand, WrenchCommand
from ..simulation.setup import Setup
from .body_wrenches import body_wrench_type, frame_of, wrench_of
from .command_queue import CommandQueue, Unserved
from .scheduling import LONG_TEXT, BackgroundThread, ScheduleMessage
from .simulation_loop import SimulationLoop
from .static_frames import StaticFrames

TOPICS = ("wrench", "thrusters", "poke", "string", "inertia", "schedule")
"""What received messages are counted by."""

QUIET_NS = 4_000_000
"""How often topics are read that carried nothing lately [ns of wall time]."""

PUBLISHERS_NS = 250_000_000
"""How often it is noted who publishes on a topic that carries nothing [ns of wall time]."""

MOST_FRAMES = 1000
"""Frames of wrenches that are kept as read."""

ACTIVE_NS = 5_000_000_000
"""A topic is read in every tick for this long after a message [ns of wall time]."""

DAY_NS = 24 * 3600 * 1_000_000_000


class CommandIntake:
    """frames: what the node calls the world's and the body's frame. apply_changes(changes, mesh at hand) gives the
    Setup with parameters changed when a scheduled ``set`` acts, apply_inertia(content) that of an inertia message.

    received counts every message taken by topic, refused ones included, ``late`` and ``wall_stamp`` stamps that mean
    now; refusals are the simulation's.
    """

    def __init__(
        self,
        node: Node,
        loop: SimulationLoop,
        frames: tuple[str, str],
        static_frames: StaticFrames,
        apply_changes: Callable[[Mapping, BodyMesh | None], Setup],
        apply_inertia: Callable[[Mapping], Setup],
    ) -> None:
        self.received: Counter[str] = Counter()
        self.late = 0
        self.wall_stamp = 0
        self._loop = loop
        self._frames = frames
        self._static_frames = static_frames
        self._apply_changes = apply_changes
        self._apply_inertia = apply_inertia
        self._next_quiet_ns = 0
        self._next_publishers_ns = 0
        self._read_frames: dict[str, Frame] = {}
        self._background = BackgroundThread()
        self._logger = node.get_logger()
        group = Unserved()
        self._sources: tuple[tuple[str, CommandQueue, Callable[[bytes], int]], ...] = (
            ("wrench", CommandQueue(node, WrenchStamped, "wrench", group), lambda data: self._wrench(data, True)),
            ("poke", CommandQueue(node, WrenchStamped, "poke", group), lambda data: self._wrench(data, False)),
            ("string", CommandQueue(node, PointStamped, "string/target", group), self._string_target),
            ("string", CommandQueue(node, PointStamped, "string/attach", group), self._string_attach),
            ("inertia", CommandQueue(node, InertiaStamped, "inertia/set", group), self._inertia),
            ("schedule", CommandQueue(node, String, "schedule", group), self._schedule),
        )
        if loop.scenario.parameters.thrusters:
            queue = CommandQueue(node, Float64MultiArray, "thrusters", group)
            self._sources = (*self._sources, ("thrusters", queue, self._thrusters))
        typed = body_wrench_type()
        if typed is not None:
            for topic, name, held in (("wrench", "body_wrench", True), ("poke", "body_poke", False)):
                read = partial(self._body_wrench, message_type=typed, held=held)
                self._sources = (*self._sources, (topic, CommandQueue(node, typed, name, group), read))
        self._active_until_ns = [0] * len(self._sources)

    @property
    def in_progress(self) -> bool:
        """Whether a message of the schedule is still worked out in the background."""
        return not self._background.is_empty

    @property
    def queue_full(self) -> int:
        """How often a queue was found full."""
        return sum(queue.queue_full for _, queue, _ in self._sources)

    @property
    def sequence_gaps(self) -> int:
        """Messages that were sent and never arrived, as far as that can be known."""
        return sum(queue.sequence_gaps for _, queue, _ in self._sources)

    def take(self, wall_ns: int, all_topics: bool = False) -> bool:
        """Submit everything that has arrived; what is refused is counted and notified of, and the rest goes on.
        Returns whether something has arrived within the last ACTIVE_NS.

        The loop catches up before the first message, so that now is the tick's own time. Topics that carried something
        lately are read in every tick, quiet ones every QUIET_NS, or now if ``all_topics``.
        """
        for number, message in enumerate(self._background.finished()):
            if number == 0:
                self._loop.catch_up()
            self.received["schedule"] += self._take_scheduled(message)
        read_quiet = all_topics or wall_ns >= self._next_quiet_ns
        if read_quiet:
            self._next_quiet_ns = wall_ns + QUIET_NS
        note_publishers = read_quiet and wall_ns >= self._next_publishers_ns
        if note_publishers:
            self._next_publishers_ns = wall_ns + PUBLISHERS_NS
        for source, (topic, queue, read) in enumerate(self._sources):
            if read_quiet or wall_ns <= self._active_until_ns[source]:
                for data in queue.take(note_publishers):
                    self._loop.catch_up()
                    self._active_until_ns[source] = wall_ns + ACTIVE_NS
                    self._read(topic, read, data)
        return wall_ns < max(self._active_until_ns)

    def _read(self, topic: str, read: Callable[[bytes], int], data: bytes) -> None:
        counted = 1
        try:
            counted = read(data)
        except CommandRefused as refusal:
            self._loop.simulation.refuse(refusal)
        # Last: a message that counts as received counts as late or refused too, if it is.
        self.received[topic] += counted

    # Each returns how many commands the message counts as

    def _wrench(self, data: bytes, held: bool) -> int:
        return self._take_wrench(held, *read_wrench_stamped(data))

    def _body_wrench(self, data: bytes, message_type: type, held: bool) -> int:
        message = read_message(data, message_type)
        stamp = message.header.stamp
        return self._take_wrench(held, whole_stamp(stamp.sec, stamp.nanosec), frame_of(message), *wrench_of(message))

    def _take_wrench(self, held: bool, stamp_ns: int, frame_id: str, force: Vector, torque: Vector) -> int:
        simulation = self._loop.simulation
        frame = self._read_frames.get(frame_id)
        if frame is None:
            try:
                frame = parse_frame(frame_id, frozenset(simulation.setup.contacts), *self._frames)
            except CommandRefused:
                if not self._static_frames.known:
                    raise
                # Logged as it is read now: a replay has no such frames.
                read = self._static_frames.read(frame_id, simulation.setup.body, force, torque)
                message = cdr.wrench_stamped(stamp_ns, read.frame_id, read.force, read.torque)
                command = WrenchCommand(held, read.frame, read.force, read.torque, stamp_ns, read.frame_id, message)
                return self._submit(command)
            # Contacts and frames' names are set at start only, so what was read once stays so.
            if len(self._read_frames) >= MOST_FRAMES:
                self._read_frames.clear()
            self._read_frames[frame_id] = frame
        message = cdr.wrench_stamped(stamp_ns, frame_id, force, torque)
        return self._submit(WrenchCommand(held, frame, force, torque, stamp_ns, frame_id, message))

    def _submit(self, command: WrenchCommand) -> int:
        self._loop.simulation.submit(command, self._when(command.stamp_ns))
        if command.held:
            self._loop.request_step()
        return 1

    def _thrusters(self, data: bytes) -> int:
        forces = tuple(read_message(data, Float64MultiArray).data)
        self._loop.simulation.submit(ThrusterCommand(forces, bytes(data)))
        self._loop.request_step()
        return 1

    def _string_target(self, data: bytes) -> int:
        return self._string("string/target", data)

    def _string_attach(self, data: bytes) -> int:
        return self._string("string/attach", data)

    def _string(self, topic: str, data: bytes) -> int:
        sent = read_command(topic, data, PointStamped)
        command = core_command(sent, sent.t_ns, (), self._no_change, self._frames)
        self._loop.simulation.submit(command, self._when(sent.t_ns))
        return 1

    def _inertia(self, data: bytes) -> int:
        sent = read_command("inertia/set", data, InertiaStamped)
        command = core_command(sent, sent.t_ns, (), self._no_change, self._frames, self._apply_inertia, bytes(data))
        check_inertia(self._loop.scenario, command.content)
        self._loop.simulation.submit(command, self._when(sent.t_ns))
        return 1

    def _no_change(self, changes: Mapping) -> Setup:
        raise TypeError(f"no set comes on this topic: {changes}")

    def _schedule(self, data: bytes) -> int:
        scenario = self._loop.scenario
        message = ScheduleMessage(bytes(data), read_message(data, String).data)
        quick = self._background.is_empty and len(message.text) <= LONG_TEXT
        if quick:
            message.read(scenario)
            quick = not message.is_slow
        if quick:
            message.check(scenario, self._apply_changes)
            return self._take_scheduled(message)

        def work() -> None:
            if not message.commands:
                message.read(scenario)
            message.check(scenario, self._apply_changes)

        self._background.give(message, work)
        return 0

    def _take_scheduled(self, message: ScheduleMessage) -> int:
        """Submit all of a message's entries, or refuse them all; returns how many there are."""
        simulation = self._loop.simulation
        try:
            if message.refusal is not None:
                raise message.refusal
            times = [self._effective(entry.t_ns, listed=True) for entry in message.entries]
        except CommandRefused as refusal:
            simulation.refuse(refusal, message.count)
            return message.count
        for counter in ("late", "wall_stamp"):
            entries = {e.number for e, (_, counted) in zip(message.entries, times, strict=True) if counted == counter}
            self._count_stamps(counter, len(entries))
        for entry, (when_ns, _) in zip(message.entries, times, strict=True):
            simulation.submit(entry.command, when_ns, entry.listed, entry.checked)
        return message.count

    def _when(self, stamp_ns: int) -> int:
        when_ns, counter = self._effective(stamp_ns)
        self._count_stamps(counter, 1)
        return when_ns

    def _effective(self, stamp_ns: int, listed: bool = False) -> tuple[int, str]:
        horizon_ns = nanoseconds(self._loop.scenario.parameters.schedule_horizon)
        offset_ns = 0 if listed else self._loop.stamps.offset_ns
        return effective_time(stamp_ns, self._loop.simulation.time_ns, time.time_ns(), horizon_ns, offset_ns)

    def _count_stamps(self, counter: str, count: int) -> None:
        if counter == "late":
            self.late += count
        elif counter == "wall_stamp" and count:
            first, self.wall_stamp = self.wall_stamp == 0, self.wall_stamp + count
            if first:
                self._logger.warning(
                    "a command is stamped with the system's clock: it acts now, and so do later ones; "
                    "stamps of commands are simulated time"
                )


def effective_time(stamp_ns: int, now_ns: int, wall_ns: int, horizon_ns: int, offset_ns: int = 0) -> tuple[int, str]:
    """Simulated time [ns] at which a command with this stamp acts, and the counter it goes to, if any.

    Zero or past means now (past: ``late``); one up to the horizon ahead acts at exactly that time; one within a day of
    the system clock comes from a tool that stamps by it: it means now (``wall_stamp``). Raises CommandRefused
    (``stamp``). offset_ns: how far stamps are ahead of simulated time.
    """
    if stamp_ns == 0:
        return now_ns, ""
    time_ns = stamp_ns - offset_ns
    if time_ns <= now_ns:
        return now_ns, "late" if time_ns < now_ns else ""
    if time_ns <= now_ns + horizon_ns:
        return time_ns, ""
    if abs(stamp_ns - wall_ns) <= DAY_NS:
        return now_ns, "wall_stamp"
    raise CommandRefused(
        "stamp",
        "header.stamp",
        f"{stamp_ns / 1e9:.9g} s",
        f"0, or time up to {horizon_ns / 1e9:g} s (schedule_horizon) after {(now_ns + offset_ns) / 1e9:.9g} s",
    )


# Messages read from their bytes, without message objects; anything unusual goes through rclpy's own reader


def read_wrench_stamped(data: bytes) -> tuple[int, str, tuple, tuple]:
    """stamp [ns], frame_id, force, torque of a serialized geometry_msgs/WrenchStamped.

    Raises CommandRefused for bytes that are no such message, or whose frame_id isn't UTF-8.
    """
    try:
        seconds, nanoseconds, frame_id, values = cdr.read_stamped_doubles(data, 6)
    except ValueError:
        seconds, nanoseconds, frame_id, values = cdr.read_stamped_doubles(_little_endian(data, WrenchStamped), 6)
    return whole_stamp(seconds, nanoseconds), frame_id, values[:3], values[3:]


def read_command(topic: str, data: bytes, message_type: type) -> ScriptCommand:
    """The command of a message on a topic other than ``schedule``; raises CommandRefused for bytes that
    are none of its type.
    """
    try:
        return of_message(topic, data)
    except CommandRefused:
        raise
    except ValueError:
        return of_message(topic, _little_endian(data, message_type))


def _little_endian(data: bytes, message_type: type) -> bytes:
    """A message's bytes as little-endian CDR, however its sender has packed them."""
    return serialize_message(read_message(data, message_type))


def read_message(data: bytes, message_type: type) -> Any:
    """A message from its bytes; raises CommandRefused for bytes that are none of its type."""
    try:
        return deserialize_message(data, message_type)
    except Exception:  # rclpy's own error types differ between versions and middlewares
        accepted = f"a serialized {message_type.__name__}"
        raise CommandRefused("frame", "message", f"{len(data)} bytes that can't be decoded", accepted) from None
