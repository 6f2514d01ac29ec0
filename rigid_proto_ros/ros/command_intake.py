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

from .. import cdr
from ..core.commands import Change, Rank, WrenchCommand
from ..core.errors import CommandRefused, InputError
from ..core.frames import Frame, parse_frame
from ..plain_yaml import load_plain_yaml
from ..poke_script import (
    MAX_SCHEDULE_LENGTH,
    MESH_FRAME,
    ScriptCommand,
    core_command,
    expand_script,
    string_attach,
    string_target,
)
from ..scenario import check_inertia, nanoseconds
from . import qos
from .message_bytes import read_message, read_wrench_stamped, whole_stamp
from .sequence_gaps import SequenceGaps
from .stamps import effective_time
from .taken_by_hand import TakenByHand

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

MAX_BRACKETS = 100
"""Lists and mappings opened in one: the YAML reader takes seconds over thousands, and the body would wait for it."""


class CommandIntake:
    """apply_changes(changes) gives the Setup with parameters changed, as scheduled ``set`` entries need it.

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

    def take(self, simulation, scenario, wall_ns: int, catch_up: Callable[[], None]) -> bool:
        """Submit everything that has arrived; what is refused is counted and the observer told, and the rest goes on. Returns whether
        something has arrived within the last LIVELY_NS.

        catch_up() is called before the first message of a tick, so that now is the tick's own time. Topics that carried something lately are looked at in every tick, quiet ones every QUIET_NS.
        """
        caught_up = False
        look_at_quiet = wall_ns >= self._next_quiet_look_ns
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
                    try:
                        read(taken[0], simulation, scenario)
                    except CommandRefused as refusal:
                        simulation.refuse(refusal)
                    # Last: a message that counts as received counts as late or refused too, if it is.
                    self.received[topic] += 1
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
        stamp_ns, frame_id, point = _read_point_stamped(data)
        command = string_target(stamp_ns, frame_id, point, self._frames[0])
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _string_attach(self, data: bytes, simulation, scenario) -> None:
        stamp_ns, frame_id, point = _read_point_stamped(data)
        command = string_attach(stamp_ns, frame_id, point, *self._frames)
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _inertia(self, data: bytes, simulation, scenario) -> None:
        message = read_message(data, InertiaStamped)
        stamp, given = message.header.stamp, message.inertia
        stamp_ns, frame_id = whole_stamp(stamp.sec, stamp.nanosec), message.header.frame_id
        body = self._frames[1]
        if frame_id not in ("", "body", body, MESH_FRAME, f"{body}/mesh"):
            raise CommandRefused("frame", "frame_id", frame_id[:80], f"{body}/mesh, or {body} (from the present COM)")
        content = {
            "stamp_ns": stamp_ns,
            "frame_id": frame_id,
            "relative": frame_id in ("body", body),
            "mass": given.m,
            "com": [given.com.x, given.com.y, given.com.z],
            "tensor": [given.ixx, given.ixy, given.ixz, given.iyy, given.iyz, given.izz],
        }
        check_inertia(scenario, content)
        command = Change(content, lambda: self._apply_inertia(content), bytes(data), "inertia", Rank.INERTIA)
        simulation.submit(command, self._when(stamp_ns, simulation, scenario))

    def _schedule(self, data, simulation, scenario) -> None:
        text = read_message(data, String).data
        if len(text) > MAX_SCHEDULE_LENGTH:
            raise CommandRefused("schedule", "schedule", f"{len(text)} characters", f"at most {MAX_SCHEDULE_LENGTH}")
        if text.count("[") + text.count("{") > MAX_BRACKETS:
            raise CommandRefused("schedule", "schedule", text[:80], f"at most {MAX_BRACKETS} opening brackets")
        try:
            command = _scheduled(text)
            if command.kind == "set":
                scenario.with_changes(command.changes)
        except CommandRefused:
            raise
        except InputError as error:
            raise CommandRefused("schedule", error.field, error.received, error.accepted) from None
        stamp_ns = command.t_ns
        core = core_command(command, stamp_ns, simulation.setup.contacts, self._apply_changes)
        simulation.submit(core, self._when(stamp_ns, simulation, scenario))

    def _when(self, stamp_ns: int, simulation, scenario) -> int:
        horizon_ns = nanoseconds(scenario.values["schedule_horizon"])
        when_ns, counter = effective_time(stamp_ns, simulation.time_ns, time.time_ns(), horizon_ns)
        if counter == "late":
            self.late += 1
        elif counter == "wall_stamp":
            self.wall_stamp += 1
            if self.wall_stamp == 1:
                self._logger.warning(
                    "a command is stamped by the system's clock: it acts now, as others like it will; stamps are simulated time"
                )
        return when_ns


def _scheduled(text: str) -> ScriptCommand:
    """The one command of an entry on the schedule topic; raises InputError."""
    entry = load_plain_yaml(text, "schedule")
    # At most one, so that a repeat or a long wrench isn't written out first: the body waits for this.
    commands = expand_script([entry], "schedule", max_commands=1) if isinstance(entry, dict) else []
    if len(commands) != 1 or commands[0].topic != "schedule":
        accepted = "one entry {t, set}, {t, string: release} or {t, service: clear_wrench}"
        raise InputError("schedule", text[:80], accepted)
    return commands[0]


def _read_point_stamped(data: bytes) -> tuple[int, str, tuple[float, float, float]]:
    message = read_message(data, PointStamped)
    stamp, point = message.header.stamp, message.point
    return whole_stamp(stamp.sec, stamp.nanosec), message.header.frame_id, (point.x, point.y, point.z)
