# SPDX-License-Identifier: MIT
"""Commands (simulation/commands.py) read from messages and event lines, written as messages and entries of a script.

    entry of a script  <->  command  <->  message on a topic
                              |  ^
                     content  v  |  of_event
                           event line

scene/script.py reads entries: one can stand for several commands; each command is one entry again, but for what no
entry can say (``entry_of``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

from ..base.errors import CommandRefused, InputError
from ..base.vectors import vector
from ..motion.frames import parse_frame
from ..simulation.commands import (
    Change,
    ClearWrench,
    Command,
    MoveString,
    ReleaseString,
    SetState,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)
from . import cdr
from .parameters import Parameters
from .yaml_text import flow

MESH_FRAME = "body/mesh"
"""Frame of a point in mesh coordinates, where the body frame's own name isn't known."""

MARKS = ("reset", "pause", "step", "timeout", "clock")
"""Events that stand in the log and don't act on the body."""

TOPICS = {
    "wrench": "wrench",
    "poke": "poke",
    "string_target": "string/target",
    "string_attach": "string/attach",
    "inertia": "inertia/set",
}
"""Which topic below the node's name carries a kind; all others are scheduled."""

_KINDS = {topic: kind for kind, topic in TOPICS.items()}

MAX_SCHEDULED = 5000
"""Commands that a message on the schedule topic may stand for."""

Names = tuple[str, str]
"""What the world's and the body's frame are called."""

WORDS: Names = ("world", "body")
"""Names that every node reads."""


def frame_names(parameters: Parameters, node_name: str) -> Names:
    """What the node of this name calls the world's frame and the body's."""
    world, body = parameters.world_frame, parameters.body_frame
    return world, body or node_name.rpartition("/")[2] or "rigid_body"


EVENT_KINDS = (
    *("wrench", "poke", "string_target", "string_attach", "inertia", "thrusters", "state"),
    *("set", "clear_wrench", "string_release"),
)
"""Events that a command is behind."""

_FIELDS: dict[str, dict[str, int | slice]] = {
    "wrench": {"force": slice(0, 3), "torque": slice(3, 6)},
    "poke": {"force": slice(0, 3), "torque": slice(3, 6)},
    "string_target": {"point": slice(0, 3)},
    "string_attach": {"point": slice(0, 3)},
    "inertia": {"mass": 0, "com": slice(1, 4), "tensor": slice(4, 10)},
}
"""Where the doubles of a message stand in the content of its event: ixx ixy ixz iyy iyz izz is the tensor."""


def of_message(topic: str, data: bytes, names: Names = WORDS) -> Command:
    """The command of a message on a topic other than ``schedule``, to a node that calls its frames so.

    Raises ValueError for bytes that are no such message, CommandRefused for what no command says.
    """
    kind = _KINDS[topic]
    fields = _FIELDS[kind]
    count = {"wrench": 6, "poke": 6, "inertia": 10}.get(kind, 3)
    seconds, nanoseconds, frame_id, numbers = cdr.read_stamped_doubles(data, count)
    if nanoseconds >= 1_000_000_000:
        raise CommandRefused("stamp", "header.stamp", f"{nanoseconds} nanosec", "nanosec below 1000000000")
    content = {"stamp_ns": seconds * 1_000_000_000 + nanoseconds, "frame_id": frame_id}
    return _command(kind, content | {name: numbers[place] for name, place in fields.items()}, names)


def of_event(kind: str, content: Mapping, names: Names = WORDS) -> Command | None:
    """The command that an event of the log tells of, as the node with these frames read it; None for MARKS, which don't
    affect the motion.

    Raises InputError for content that is none of its kind, CommandRefused for what such a node would refuse.
    """
    if kind in MARKS:
        return None
    if kind not in EVENT_KINDS:
        raise InputError("kind", kind, ", ".join([*EVENT_KINDS, *MARKS]))
    try:
        return _command(kind, content, names)
    except CommandRefused:
        raise
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(kind, str(content)[:80], "the content of a recorded event") from None


def _command(kind: str, content: Mapping, names: Names) -> Command:
    """The command of an event's content, which a message becomes before it is read; raises CommandRefused, and what
    Python raises for content that is none.
    """
    match kind:
        case "set":
            return Change(dict(content))
        case "clear_wrench":
            return ClearWrench()
        case "string_release":
            return ReleaseString()
        case "thrusters":
            return ThrusterCommand(tuple(map(float, content["forces"])))
        case "state":
            return SetState({name: tuple(map(float, values)) for name, values in content.items()})
    stamp_ns, frame_id, (world, body) = content.get("stamp_ns", 0), content["frame_id"], names
    if type(stamp_ns) is not int or not isinstance(frame_id, str):
        raise TypeError
    if kind in ("wrench", "poke"):
        frame = parse_frame(frame_id, world, body)
        force, torque = vector(content["force"]), vector(content["torque"])
        return WrenchCommand(kind == "wrench", frame, force, torque, frame_id, stamp_ns=stamp_ns)
    in_world, in_body = dict.fromkeys(("world", world), "world"), dict.fromkeys(("body", body), "body")
    in_mesh = dict.fromkeys((MESH_FRAME, f"{body}/mesh"), "mesh")
    if kind == "string_target":
        _axes(frame_id, {"": "world", **in_world}, f"{world}: the target is a point of the world")
        return MoveString(vector(content["point"]), frame_id, stamp_ns=stamp_ns)
    if kind == "string_attach":
        accepted = f"{world}, {body} (metres from the COM) or {body}/mesh (mesh coordinates)"
        axes = _axes(frame_id, {"": "world", **in_world, **in_body, **in_mesh}, accepted)
        return TieString(axes, vector(content["point"]), frame_id, stamp_ns=stamp_ns)
    axes = _axes(frame_id, {"": "mesh", **in_body, **in_mesh}, f"{body}/mesh, or {body} (from the present COM)")
    tensor = list(map(float, content["tensor"]))
    if len(tensor) != 6:
        raise ValueError
    whole = {
        "stamp_ns": stamp_ns,
        "frame_id": frame_id,
        "relative": axes == "body",
        "mass": float(content["mass"]),
        "com": list(vector(content["com"])),
        "tensor": tensor,
    }
    return Change(whole, kind="inertia", stamp_ns=stamp_ns)


def _axes(frame_id: str, known: Mapping[str, str], accepted: str) -> str:
    if frame_id not in known:
        raise CommandRefused("frame", "frame_id", frame_id[:80], accepted)
    return known[frame_id]


# Written


def in_words(command: Command) -> Command:
    """The command in frames ``world`` and ``body``, so that a node of any name reads it."""
    if isinstance(command, WrenchCommand):
        return replace(command, sent=None)
    if isinstance(command, MoveString):
        return replace(command, frame_id="world")
    if isinstance(command, TieString):
        return replace(command, frame_id=MESH_FRAME if command.axes == "mesh" else command.axes)
    if isinstance(command, Change) and command.kind == "inertia":
        frame_id = "body" if command.content["relative"] else MESH_FRAME
        return replace(command, content={**command.content, "frame_id": frame_id})
    return command


def message(command: Command, stamp_ns: int) -> bytes:
    """The message as it goes over its topic."""
    if isinstance(command, WrenchCommand):
        return cdr.wrench_stamped(stamp_ns, command.frame_id, command.force, command.torque)
    if isinstance(command, MoveString | TieString):
        return cdr.stamped_doubles(stamp_ns, command.frame_id, command.point)
    if isinstance(command, Change) and command.kind == "inertia":
        content = command.content
        numbers = (content["mass"], *content["com"], *content["tensor"])
        return cdr.stamped_doubles(stamp_ns, content["frame_id"], numbers)
    return cdr.string(flow({"t": stamp_ns / 1e9, **entry_of(command)}, quoted=True))


def entry_of(command: Command) -> dict:
    """The command as an entry of a script, without its time.

    Raises InputError for what no entry can say: an impulse along a normal, an inertia message, a knot in other than
    mesh coordinates.
    """
    match command:
        case WrenchCommand():
            entry = _load_entry(command)
            return {"wrench": entry} if command.held else entry
        case MoveString():
            return {"string": {"target": list(command.point)}}
        case TieString(axes="mesh"):
            return {"string": {"attach": command.contact or list(command.point)}}
        case ReleaseString():
            return {"string": "release"}
        case ThrusterCommand():
            return {"thrusters": list(command.forces)}
        case SetState():
            return {"state": command.content}
        case Change(kind="set"):
            return {"set": dict(command.content)}
        case ClearWrench():
            return {"service": "clear_wrench"}
    raise _no_entry(command)


def _no_entry(command: Command) -> InputError:
    frame_id = command.content.get("frame_id")
    return InputError("script", f"{command.kind} in {frame_id!r}", "a command that a script entry can express")


def _load_entry(command: WrenchCommand) -> dict:
    frame = command.frame
    entry: dict = {"at": _at(frame.point)}
    force, torque = list(map(float, command.force)), list(map(float, command.torque))
    if frame.axes == "normal":
        if frame.impulse or any(force[1:]) or any(torque):
            raise _no_entry(command)
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


# Messages to a node


@dataclass(frozen=True)
class Outgoing:
    """A message to send: the topic below the node's name, its bytes, the commands in it and when they act [ns]."""

    topic: str
    data: bytes
    commands: tuple[Command, ...]
    time_ns: int


def outgoing(script: list[Command], start_ns: int = 0, offset_ns: int = 0) -> Iterator[Outgoing]:
    """The messages of a script in order of time: commands of one instant go as one list, so that they act in its order.

    What no entry can say goes after them by a message of its own, and so does all that follows it at that instant.
    offset_ns: how far the stamps of messages are ahead of simulated time, in which entries are.
    """
    for t_ns, group in groupby(script, key=lambda command: command.stamp_ns):
        commands, time_ns = list(group), start_ns + t_ns
        entries = []
        for command in commands if len(commands) > 1 else ():
            try:
                entries.append({"t": time_ns / 1e9, **entry_of(command)})
            except InputError:
                break
        if len(entries) > MAX_SCHEDULED:
            accepted = f"at most {MAX_SCHEDULED}, all in one message"
            raise InputError("script", f"{len(entries)} commands at {time_ns / 1e9:.9g} s", accepted)
        if entries:
            text = flow(entries, quoted=True)
            yield Outgoing("schedule", cdr.string(text), tuple(commands[: len(entries)]), time_ns)
        for command in commands[len(entries) :]:
            topic = TOPICS.get(command.kind, "schedule")
            stamp_ns = time_ns if topic == "schedule" else time_ns + offset_ns
            yield Outgoing(topic, message(command, stamp_ns), (command,), time_ns)
