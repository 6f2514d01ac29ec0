# SPDX-License-Identifier: MIT
"""Commands (simulation/commands.py) decoded from messages on topics and from events of the log.

Both have the same content: the event of a message holds what the message says. Scripts have their own syntax
(script.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base.errors import CommandRefused, InputError
from ..base.vectors import vector
from ..motion.frames import RESERVED_WORDS, body_names, parse_frame
from ..parameters.declarations import Parameters
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
from .script import MESH_FRAME

MARKS = ("reset", "pause", "step", "timeout", "clock", "jump")
"""Kinds of events that are not commands."""

_WRENCH: dict[str, int | slice] = {"force": slice(0, 3), "torque": slice(3, 6)}
_POINT: dict[str, int | slice] = {"point": slice(0, 3)}
_INERTIA: dict[str, int | slice] = {"mass": 0, "com": slice(1, 4), "tensor": slice(4, 10)}

_MESSAGES = {
    "wrench": ("wrench", 6, _WRENCH),
    "poke": ("poke", 6, _WRENCH),
    "string/target": ("string_target", 3, _POINT),
    "string/attach": ("string_attach", 3, _POINT),
    "inertia/set": ("inertia", 10, _INERTIA),
}
"""By topic below the node's name: the kind of event that a message makes, its number of doubles, and their indices by
field of the event's content. The tensor is ixx ixy ixz iyy iyz izz.
"""

EVENT_KINDS = (
    *(kind for kind, *_ in _MESSAGES.values()),
    *("thrusters", "state", "set", "clear_wrench", "string_release"),
)
"""Kinds of events that are commands."""

Names = tuple[str, str]
"""Names of the world frame and the body frame."""

WORDS: Names = ("world", "body")
"""Names that every node accepts."""


def frame_names(parameters: Parameters, node_name: str) -> Names:
    """Names of the world frame and the body frame for a node of this name. Raises InputError for a name that has
    another meaning in a ``frame_id``: commands would act in other axes or at another point than they say.
    """
    world = parameters.world_frame
    body = parameters.body_frame or node_name.strip("/") or "rigid_body"
    short = body_names(body)[-1]
    for field, name, own, other in (("body_frame", short, "body", world), ("world_frame", world, "world", body)):
        if name == other or (name != own and name in RESERVED_WORDS):
            words = ", ".join(sorted(RESERVED_WORDS - {own}))
            raise InputError(field, name, f"a name that isn't the other frame's, and none of {words}")
    return world, body


def of_message(topic: str, data: bytes, names: Names = WORDS) -> Command:
    """Decode a message of a topic other than ``schedule``, sent to a node with these frame names.

    Raises ValueError for bytes that are no such message, CommandRefused for content that is not a command.
    """
    kind, count, fields = _MESSAGES[topic]
    seconds, nanoseconds, frame_id, numbers = cdr.read_stamped_doubles(data, count)
    if nanoseconds >= 1_000_000_000:
        raise CommandRefused("stamp", "header.stamp", f"{nanoseconds} nanosec", "nanosec below 1000000000")
    content = {"stamp_ns": seconds * 1_000_000_000 + nanoseconds, "frame_id": frame_id}
    return _command(kind, content | {name: numbers[place] for name, place in fields.items()}, names)


def of_event(kind: str, content: Mapping[str, Any], names: Names = WORDS) -> Command | None:
    """Decode an event of the log of a node with these frame names. Returns None for MARKS.

    Raises InputError for content that doesn't fit the kind, CommandRefused for content that such a node would refuse.
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


def _command(kind: str, content: Mapping[str, Any], names: Names) -> Command:
    """Make the command of a kind. Raises CommandRefused, and Python's exceptions for content that doesn't fit the
    kind.
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
    in_world, in_body = dict.fromkeys(("world", world), "world"), dict.fromkeys(body_names(body), "body")
    in_mesh = dict.fromkeys((MESH_FRAME, *(f"{name}/mesh" for name in body_names(body))), "mesh")
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
