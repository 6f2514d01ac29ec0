# SPDX-License-Identifier: MIT
"""Commands in their four forms, and the ways between them: what a script says, what a topic carries, what the
simulation takes, and what the event log keeps.

    entry of a script  <->  ScriptCommand  <->  message on a topic
                                 |  ^
                   core_command  v  |  of_event
                              core command  ->  content of an event line

``ScriptCommand`` is the command as plain data. An entry can stand for several commands (scene/script.py expands it);
each command is one entry again, but for what no entry can say (``entry_of``).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby

from ..base.errors import CommandRefused, InputError
from ..base.rotation import vector
from ..messages import cdr
from ..motion.frames import CONTACT_NAME, RESERVED_WORDS, parse_frame
from ..simulation.commands import (
    Change,
    ClearWrench,
    Command,
    MoveString,
    Rank,
    ReleaseString,
    SetState,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)
from ..simulation.setup import Setup
from .parameters import ZERO, Parameters, Vector
from .yaml_text import flow

Changing = Callable[[Mapping], Setup]
"""Gives the setup that a change of parameters, or of the inertia, leads to, from the content of its event."""

MESH_FRAME = "body/mesh"
"""Frame of a point in mesh coordinates, where the body frame's own name isn't known."""

MARKS = ("reset", "pause", "step", "timeout", "clock")
"""Events that stand in the log and don't act on the body."""

KINDS = (
    *("wrench", "poke", "string_target", "string_attach", "string_release"),
    *("thrusters", "state", "inertia", "set", "clear_wrench", *MARKS),
)
"""Kinds of events."""

TOPICS = {
    "wrench": "wrench",
    "poke": "poke",
    "string_target": "string/target",
    "string_attach": "string/attach",
    "inertia": "inertia/set",
}
"""Which topic below the node's name carries a kind; all others are scheduled."""

MAX_SCHEDULED = 5000
"""Commands that a message on the schedule topic may stand for."""

_WORDS = ("world", "body")
"""Names of the world's and the body's frame that every node reads."""


@dataclass(frozen=True)
class ScriptCommand:
    """One command as plain data. t_ns: when it acts, from the script's start. entry: which entry of the script it comes
    from, counted from 1.

    kind ``wrench`` or ``poke``: frame_id, force (3,), torque (3,). ``string_target``, ``string_attach``: frame_id and
    point (3,), or the name of a contact to attach to. ``inertia``: frame_id, inertia (10,): mass, com, ixx ixy ixz iyy
    iyz izz. ``thrusters``: forces. ``state``: state, by name. ``set``: changes. The others:
    nothing.
    """

    t_ns: int
    kind: str
    frame_id: str = ""
    force: Vector = ZERO
    torque: Vector = ZERO
    changes: Mapping[str, object] = field(default_factory=dict)
    point: Vector = ZERO
    contact: str = ""
    inertia: tuple[float, ...] = ()
    forces: tuple[float, ...] = ()
    state: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    entry: int = field(default=0, compare=False)

    @property
    def topic(self) -> str:
        """The topic that carries it, below the node's name."""
        return TOPICS.get(self.kind, "schedule")

    def message(self, stamp_ns: int) -> bytes:
        """The message as it goes over its topic."""
        if self.kind in ("wrench", "poke"):
            return cdr.wrench_stamped(stamp_ns, self.frame_id, self.force, self.torque)
        if self.kind in ("string_target", "string_attach"):
            return cdr.stamped_doubles(stamp_ns, self.frame_id, self.point)
        if self.kind == "inertia":
            return cdr.stamped_doubles(stamp_ns, self.frame_id, self.inertia)
        return cdr.string(flow(_timed(stamp_ns, entry_of(self)), quoted=True))


# Data <-> message


def of_message(topic: str, data: bytes) -> ScriptCommand:
    """The command of a message on a topic other than ``schedule``, its stamp as ``t_ns``; raises ValueError for bytes
    that are no such message, CommandRefused for a stamp that is none.
    """
    kind = next(kind for kind, its_topic in TOPICS.items() if its_topic == topic)
    count = {"wrench": 6, "poke": 6, "inertia": 10}.get(kind, 3)
    seconds, nanoseconds, frame_id, numbers = cdr.read_stamped_doubles(data, count)
    t_ns = whole_stamp(seconds, nanoseconds)
    if count == 6:
        return ScriptCommand(t_ns, kind, frame_id, vector(numbers[:3]), vector(numbers[3:]))
    if kind == "inertia":
        return ScriptCommand(t_ns, kind, frame_id, inertia=numbers)
    return ScriptCommand(t_ns, kind, frame_id, point=vector(numbers))


def whole_stamp(seconds: int, nanoseconds: int) -> int:
    """A stamp [ns]; raises CommandRefused (``stamp``) unless the nanoseconds are less than a second."""
    if nanoseconds >= 1_000_000_000:
        raise CommandRefused("stamp", "header.stamp", f"{nanoseconds} nanosec", "nanosec below 1000000000")
    return seconds * 1_000_000_000 + nanoseconds


# Data <-> event line


def of_event(time_ns: int, kind: str, content: Mapping) -> ScriptCommand:
    """The command of an event that acted at ``time_ns``, in the words of its sender; raises InputError for content that
    is none of its kind. What a mark says moves nothing: it has no command.
    """
    try:
        if kind in ("wrench", "poke"):
            force, torque = vector(content["force"]), vector(content["torque"])
            return ScriptCommand(time_ns, kind, _text(content["frame_id"]), force, torque)
        if kind in ("string_target", "string_attach"):
            return ScriptCommand(time_ns, kind, _text(content["frame_id"]), point=vector(content["point"]))
        if kind == "inertia":
            numbers = _numbers((content["mass"], *_numbers(content["com"], 3), *_numbers(content["tensor"], 6)), 10)
            return ScriptCommand(time_ns, kind, _text(content["frame_id"]), inertia=numbers)
        if kind == "thrusters":
            return ScriptCommand(time_ns, kind, forces=tuple(map(float, content["forces"])))
        if kind == "state":
            values = {_text(name): tuple(map(float, numbers)) for name, numbers in content.items()}
            return ScriptCommand(time_ns, kind, state=values)
        if kind == "set":
            return ScriptCommand(time_ns, kind, changes={_text(name): value for name, value in content.items()})
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(kind, str(content)[:80], "the content of a recorded event") from None
    if kind in ("clear_wrench", "string_release"):
        return ScriptCommand(time_ns, kind)
    raise InputError("kind", kind, ", ".join(KINDS))


def _numbers(values: Iterable, count: int) -> tuple[float, ...]:
    numbers = tuple(float(value) for value in values)
    if len(numbers) != count:
        raise ValueError
    return numbers


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


# Data -> the simulation's command


def frame_names(parameters: Parameters, node_name: str) -> tuple[str, str]:
    """What the node of this name calls the world's frame and the body's."""
    world, body = parameters.world_frame, parameters.body_frame
    if parameters.frames == "rep105":
        return "odom" if world == "world" else world, body or "base_link"
    return world, body or node_name.rpartition("/")[2] or "rigid_body"


def core_command(
    command: ScriptCommand,
    stamp_ns: int,
    contacts: Collection[str],
    change: Changing | None,
    frames: tuple[str, str] = _WORDS,
    inertia: Changing | None = None,
) -> Command:
    """The simulation's command; raises CommandRefused.

    change(changes) gives the Setup with parameters changed when a ``set`` acts, inertia(content) that of an inertia
    message; None where such a command can't come. frames: ``frame_names``.
    """
    kind, frame_id = command.kind, command.frame_id
    if kind == "string_target":
        return string_target(stamp_ns, frame_id, command.point, frames[0])
    if kind == "string_attach":
        return string_attach(stamp_ns, frame_id, command.point, *frames)
    if kind in ("wrench", "poke"):
        frame = parse_frame(frame_id, contacts, *frames)
        return WrenchCommand(kind == "wrench", frame, command.force, command.torque, stamp_ns, frame_id)
    if kind == "inertia":
        mass, *com_and_tensor = command.inertia
        content = {
            "stamp_ns": stamp_ns,
            "frame_id": frame_id,
            "relative": _mass_axes(frame_id, frames) == "body",
            "mass": mass,
            "com": com_and_tensor[:3],
            "tensor": com_and_tensor[3:],
        }
        return Change(content, _applying(inertia, content), kind, Rank.INERTIA)
    if kind == "set":
        changes = dict(command.changes)
        return Change(changes, _applying(change, changes))
    if kind == "thrusters":
        return ThrusterCommand(command.forces)
    if kind == "state":
        return SetState(command.state)
    return ClearWrench() if kind == "clear_wrench" else ReleaseString()


def _applying(change: Changing | None, content: dict) -> Callable[[], Setup]:
    if change is None:
        raise ValueError("a change of parameters where none can come")
    return functools.partial(change, content)


def string_target(stamp_ns: int, frame_id: str, point: Vector, world: str = "world") -> MoveString:
    """The simulation's command for a message of the string's target topic; raises CommandRefused."""
    if frame_id not in ("", "world", world):
        raise CommandRefused("frame", "frame_id", frame_id[:80], f"{world}: the target is a point of the world")
    return MoveString(point, stamp_ns, frame_id)


def string_attach(stamp_ns: int, frame_id: str, point: Vector, world: str = "world", body: str = "body") -> TieString:
    """The simulation's command for a message of the string's attach topic; raises CommandRefused."""
    axes = _knot_axes(frame_id, (world, body))
    return TieString(axes, point, stamp_ns, frame_id)


def _knot_axes(frame_id: str, frames: tuple[str, str]) -> str:
    world, body = frames
    axes = {"": "world", "world": "world", world: "world", "body": "body", body: "body"}
    axes |= {MESH_FRAME: "mesh", f"{body}/mesh": "mesh"}
    if frame_id not in axes:
        accepted = f"{world}, {body} (metres from the COM) or {body}/mesh (mesh coordinates)"
        raise CommandRefused("frame", "frame_id", frame_id[:80], accepted)
    return axes[frame_id]


def _mass_axes(frame_id: str, frames: tuple[str, str]) -> str:
    body = frames[1]
    axes = {"body": "body", body: "body", "": "mesh", MESH_FRAME: "mesh", f"{body}/mesh": "mesh"}
    if frame_id not in axes:
        raise CommandRefused("frame", "frame_id", frame_id[:80], f"{body}/mesh, or {body} (from the present COM)")
    return axes[frame_id]


def command_of_event(
    kind: str,
    content: Mapping,
    contacts: Collection[str],
    frames: tuple[str, str],
    change: Changing | None = None,
    inertia: Changing | None = None,
) -> Command | None:
    """The simulation's command that an event of the log tells of, as the node with these ``frame_names`` read it.

    None for what moves nothing (MARKS), and for changes where ``change`` is None: whoever asks then hears of those
    otherwise. Raises InputError for content that is none of its kind, CommandRefused for what such a node would refuse.
    """
    if kind in MARKS or (change is None and kind in ("set", "inertia")):
        return None
    command = of_event(0, kind, content)
    stamp_ns = content.get("stamp_ns", 0)
    if type(stamp_ns) is not int:
        raise InputError("stamp_ns", stamp_ns, "nanoseconds")
    return core_command(command, stamp_ns, contacts, change, frames, inertia)


def in_words(command: ScriptCommand, contacts: Collection[str], frames: tuple[str, str]) -> ScriptCommand:
    """The command with ``world`` and ``body`` for the names of this node's frames, so that a node of any
    name reads it.
    """
    if command.kind in ("wrench", "poke"):
        return replace(command, frame_id=parse_frame(command.frame_id, contacts, *frames).text)
    if command.kind == "string_target":
        return replace(command, frame_id="world")
    if command.kind == "string_attach":
        axes = _knot_axes(command.frame_id, frames)
        return replace(command, frame_id=MESH_FRAME if axes == "mesh" else axes)
    if command.kind == "inertia":
        return replace(command, frame_id="body" if _mass_axes(command.frame_id, frames) == "body" else MESH_FRAME)
    return command


# Data -> entry of a script


def entry_of(command: ScriptCommand, frames: tuple[str, str] = _WORDS) -> dict:
    """The command as an entry of a script, without its time.

    Raises InputError for what no entry can say: an impulse along a normal, an inertia message, a knot in other than
    mesh coordinates.
    """
    kind = command.kind
    if kind == "set":
        return {"set": command.changes}
    if kind == "thrusters":
        return {kind: list(command.forces)}
    if kind == "state":
        return {kind: {name: list(numbers) for name, numbers in command.state.items()}}
    if kind == "clear_wrench":
        return {"service": kind}
    if kind == "string_release":
        return {"string": "release"}
    if kind == "string_target":
        return {"string": {"target": list(command.point)}}
    if kind == "string_attach" and _knot_axes(command.frame_id, frames) == "mesh":
        return {"string": {"attach": command.contact or list(command.point)}}
    if kind == "wrench":
        return {"wrench": _load_entry(command, frames)}
    if kind == "poke":
        return _load_entry(command, frames)
    raise InputError("script", f"{kind} in {command.frame_id!r}", "a command that a script entry can express")


def _load_entry(command: ScriptCommand, frames: tuple[str, str]) -> dict:
    # What can be the name of a contact is one: the node that has it decides.
    place = command.frame_id.partition(";")[0].rpartition("@")[2]
    known = {*RESERVED_WORDS, *frames}
    contacts = [place] if CONTACT_NAME.match(place) and place not in known else []
    frame = parse_frame(command.frame_id, contacts, *frames)
    entry: dict = {"at": _at(frame.point)}
    force, torque = [float(f) for f in command.force], [float(x) for x in command.torque]
    if frame.axes == "normal":
        if frame.impulse or any(force[1:]) or any(torque):
            raise InputError("script", command.frame_id, "a command that a script entry can express")
        entry["push"] = force[0]
    else:
        words = ("impulse", "angular_impulse") if frame.impulse else ("force", "torque")
        entry |= {word: numbers for word, numbers in zip(words, (force, torque), strict=True) if any(numbers)}
        if len(entry) == 1:
            entry[words[0]] = force
        if frame.axes == "body":
            entry["axes"] = "body"
    if frame.duration_s is not None:
        entry["duration"] = frame.duration_s
    if frame.slot:
        entry["slot"] = frame.slot
    return entry


def _at(point: tuple) -> object:
    word, *values = point
    if word in ("com", "origin"):
        return word
    if word == "contact":
        return values[0]
    if word == "vertex":
        return {"vertex": values[0]}
    if word == "point":
        return {"point": list(values[0])}
    return {"ray": {"origin": list(values[0]), "direction": list(values[1])}}


def _timed(time_ns: int, entry: dict) -> dict:
    return {"t": time_ns / 1e9, **entry}


# Data -> messages to a node


@dataclass(frozen=True)
class Outgoing:
    """A message to send: the topic below the node's name, its bytes, the commands in it and when they act [ns]."""

    topic: str
    data: bytes
    commands: tuple[ScriptCommand, ...]
    time_ns: int


def outgoing(script: list[ScriptCommand], start_ns: int = 0, offset_ns: int = 0) -> Iterator[Outgoing]:
    """The messages of a script in order of time: commands of one instant go as one list, so that they act in its order.

    What no entry can say goes after them by a message of its own, and so does all that follows it at that instant.
    offset_ns: how far the stamps of messages are ahead of simulated time, in which entries are.
    """
    for t_ns, group in groupby(script, key=lambda command: command.t_ns):
        commands, time_ns = list(group), start_ns + t_ns
        entries = []
        for command in commands if len(commands) > 1 else ():
            try:
                entries.append(_timed(time_ns, entry_of(command)))
            except InputError:
                break
        if len(entries) > MAX_SCHEDULED:
            accepted = f"at most {MAX_SCHEDULED}, all in one message"
            raise InputError("script", f"{len(entries)} commands at {time_ns / 1e9:.9g} s", accepted)
        if entries:
            text = flow(entries, quoted=True)
            yield Outgoing("schedule", cdr.string(text), tuple(commands[: len(entries)]), time_ns)
        for command in commands[len(entries) :]:
            yield Outgoing(command.topic, _stamped(command, time_ns, offset_ns), (command,), time_ns)


def _stamped(command: ScriptCommand, time_ns: int, offset_ns: int) -> bytes:
    return command.message(time_ns if command.topic == "schedule" else time_ns + offset_ns)
