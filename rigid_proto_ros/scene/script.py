# SPDX-License-Identifier: MIT
"""Poke scripts: YAML lists of timed entries, read as commands; and commands written as entries.

``poke_client`` sends a script's commands and ``simulate`` applies them. Both read scripts here, so both give the same
motion.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from ..base.errors import CommandRefused, InputError, did_you_mean
from ..base.vectors import Vector
from ..base.yaml_text import flow, load_items, load_json, load_yaml, plain, read_text
from ..motion.frames import CONTACT_NAME, FIXED_POINTS, RESERVED_WORDS, SLOT_NAME, Frame
from ..parameters.declarations import ZERO
from ..simulation.commands import (
    STATE_VALUES,
    Change,
    ClearWrench,
    Command,
    MoveString,
    ReleaseString,
    SetState,
    ThrusterCommand,
    TieString,
    WrenchCommand,
    nanoseconds,
)

Stamp = dict[str, Any]
"""stamp_ns and entry number of a command."""

RESET = {"service": "reset"}
"""First entry of a list on the schedule topic that resets the simulation; reset and list are taken together."""


class Schedule(NamedTuple):
    """A message on the schedule topic: an entry, or a list of entries without its head. sent: number of entries
    received. reset: the list starts with RESET. more: further lists of the same script follow.
    """

    entries: list[Any]
    is_list: bool
    sent: int
    reset: bool
    more: bool


MESH_FRAME = "body/mesh"
"""Frame of a point in mesh coordinates where the name of the body frame isn't known."""

MAX_TIME_S = 1e9
MAX_ENTRIES = 1_000_000
"""Largest number of commands of a script: more is likelier a mistyped duration than an intention."""

MAX_SCHEDULED = 5000
"""Largest number of commands of a message on the schedule topic."""

MAX_SCHEDULE_LENGTH = 1_000_000
"""Longest message on the schedule topic [characters]: room for 5000 entries."""

MAX_YAML_LENGTH = 10_000
"""Longest message that isn't JSON [characters]. YAML takes a hundred times as long to read and would delay the body."""

_REPEATING = {"repeat", "every", "jitter"}
_TIMING_KEYS = {"t", "seed"} | _REPEATING
_WRENCH_KEYS = {"at", "force", "push", "torque", "axes", "duration", "slot"}
_POKE_KEYS = _TIMING_KEYS | _WRENCH_KEYS | {"impulse", "angular_impulse"}
_STRING_KEYS = {"attach", "target"}

# Reading


def read_script(path: str | Path) -> list[Command]:
    """The commands of a script file in order of time. Raises InputError, which names file, entry and what is
    accepted.
    """
    return parse_script(read_text(Path(path), "a poke script"), str(path))


def parse_script(text: str, name: str = "script") -> list[Command]:
    """The commands of a script's text, as ``read_script`` gives them."""
    return expand_script(load_items(text, name), name)


def read_schedule(text: str) -> Schedule:
    """Read a message on the schedule topic: an entry, or a list of entries. The first entry of a list may be
    ``{service: reset}`` and may have ``more: true``, alone or beside its own keys. JSON, which is YAML, may be longer
    and is read faster. Raises InputError.
    """
    entries = load_json(text) if len(text) <= MAX_SCHEDULE_LENGTH else None
    if entries is None:
        if len(text) > MAX_YAML_LENGTH:
            accepted = f"{MAX_SCHEDULE_LENGTH} characters of JSON, or {MAX_YAML_LENGTH} of other YAML, at most"
            raise InputError("schedule", f"{len(text)} characters", accepted)
        entries = load_yaml(text, "schedule")
    if not entries or not isinstance(entries, (dict, list)):
        raise InputError("schedule", text[:80], "an entry such as {t: 0.5, force: [0, 0, 1]}, or a list of entries")
    if isinstance(entries, dict):
        return Schedule([entries], False, 1, False, False)
    head, count = entries[0], len(entries)
    if not isinstance(head, dict):
        return Schedule(entries, True, count, False, False)
    own = {key: value for key, value in head.items() if key != "more"}
    more, reset = plain(head.get("more", False)), plain(own) in (RESET, {"t": 0, **RESET})
    if not isinstance(more, bool):
        raise InputError("schedule, entry 1, more", more, "true or false")
    return Schedule(entries[1:] if reset or not own else [own, *entries[1:]], True, count, reset, more)


def expand_schedule(schedule: Schedule) -> list[Command]:
    """The commands of a schedule in the order of its entries. Raises InputError."""
    first = 1 + schedule.sent - len(schedule.entries)
    commands = expand_script(schedule.entries, "schedule", MAX_SCHEDULED, first)
    # The order of entries matters only among commands that act at once because their time is past.
    return sorted(commands, key=attrgetter("entry"))


def expand_script(entries: Any, name: str = "script", max_commands: int = MAX_ENTRIES, first: int = 1) -> list[Command]:
    """The commands of a script's parsed YAML, as ``parse_script`` gives them. entries: a list, an iterator or None.
    first: number of the first entry.
    """
    if entries is None:
        entries = []
    if not isinstance(entries, (list, Iterator)):
        raise InputError(name, type(entries).__name__, "a list of entries such as - {t: 0.5, force: [0, 0, 1]}")
    commands: list[Command] = []
    for number, entry in enumerate(entries, first):
        commands += expand_entry(entry, name, number, max_commands)
        if len(commands) > max_commands:
            raise InputError(f"{name}, entry {number}", f"more than {max_commands} commands")
    commands.sort(key=attrgetter("stamp_ns"))
    return commands


def expand_entry(
    entry: Any, name: str, number: int = 1, max_commands: int = MAX_ENTRIES, now_ns: int | None = None
) -> list[Command]:
    """The commands of the ``number``-th entry of a script in order of time. now_ns: the time at which an entry without
    a time acts; None if every entry must have one. Numbers and vectors may be NumPy's. Raises InputError.
    """
    key = ""
    try:
        times_ns = _times_ns(entry, number, max_commands, now_ns)
        key = next(filter(_READERS.__contains__, entry), "")
        if not key:
            _check_keys(entry, _POKE_KEYS, _READERS.keys())
            return [_load(False, entry, {"stamp_ns": t_ns, "entry": number}) for t_ns in times_ns]
        _check_keys(entry, _TIMING_KEYS | {key})
        read, content = _READERS[key], entry[key]
        return [command for t_ns in times_ns for command in read(content, {"stamp_ns": t_ns, "entry": number})]
    except CommandRefused:
        raise
    except InputError as error:
        place = ", ".join(filter(None, (f"{name}, entry {number}", key, error.field)))
        raise InputError(place, error.received, error.accepted) from None


def _times_ns(entry: Any, number: int, max_commands: int, now_ns: int | None) -> list[int]:
    """Times [ns] at which the ``number``-th entry acts: at t, or now, and again ``every`` seconds for ``repeat`` times
    in all. Each is shifted by a uniform random time within ±``jitter``, the same for the same seed wherever and
    whenever the script is read.
    """
    if not isinstance(entry, dict):
        raise InputError("", entry, "a mapping such as {t: 0.5, force: [0, 0, 1]}")
    if "t" in entry:
        t_ns = nanoseconds(_number(entry["t"], "t", 0.0, MAX_TIME_S))
    elif now_ns is None:
        raise InputError("t", None, "the time in seconds")
    else:
        t_ns = now_ns
    if entry.keys().isdisjoint(_REPEATING):
        return [t_ns]
    repeat = _number(entry.get("repeat", 1), "repeat", 1, max_commands)
    if repeat != int(repeat):
        raise InputError("repeat", repeat, "a whole number of times")
    if repeat > 1 and "every" not in entry:
        raise InputError("every", None, "the seconds between repeats")
    every = _number(entry.get("every", 0.0), "every", 0.0, MAX_TIME_S)
    times_ns = [t_ns + nanoseconds(k * every) for k in range(int(repeat))]
    if times_ns[-1] > nanoseconds(MAX_TIME_S):
        raise InputError("every", every, f"repeats that end by {MAX_TIME_S:g} s")
    jitter = _number(entry.get("jitter", 0.0), "jitter", 0.0, MAX_TIME_S)
    if jitter == 0.0:
        return times_ns
    seed = int(_number(entry.get("seed", 0), "seed", 0, 2**63))
    shifts = (random.Random(f"{seed}/0/{number}/0/{k}").uniform(-jitter, jitter) for k in range(int(repeat)))
    return sorted(max(0, time_ns + nanoseconds(shift)) for time_ns, shift in zip(times_ns, shifts, strict=True))


def _held_wrench(entry: Any, stamp: Stamp) -> list[Command]:
    if not isinstance(entry, dict):
        raise InputError("", entry, "{at, force or push, torque, axes, duration}")
    _check_keys(entry, _WRENCH_KEYS)
    return [_load(True, entry, stamp)]


def _thrusters(forces: Any, stamp: Stamp) -> list[Command]:
    forces = plain(forces)
    if not isinstance(forces, list) or not forces:
        raise InputError("", forces, "a list of forces [N], one per thruster in the order of their names")
    return [ThrusterCommand(tuple(_number(force, "") for force in forces), **stamp)]


def _state(values: Any, stamp: Stamp) -> list[Command]:
    if not isinstance(values, dict) or not values:
        raise InputError("", values, "any of " + ", ".join(STATE_VALUES))
    _check_keys(values, STATE_VALUES.keys())
    return [SetState({name: _numbers(numbers, name, STATE_VALUES[name]) for name, numbers in values.items()}, **stamp)]


def _string(entry: Any, stamp: Stamp) -> list[Command]:
    entry = plain(entry)
    if entry == "release":
        return [ReleaseString(**stamp)]
    if not isinstance(entry, dict) or not entry or not entry.keys() <= _STRING_KEYS:
        accepted = "release, or {attach: contact or [x, y, z] in mesh coordinates, target: [x, y, z] in the world}"
        raise InputError("", entry, accepted)
    commands: list[Command] = []
    if "attach" in entry:
        attach = entry["attach"]
        contact = attach if isinstance(attach, str) and CONTACT_NAME.match(attach) else ""
        point = ZERO if contact else _vector(attach, "attach")
        commands.append(TieString("mesh", point, MESH_FRAME, contact, **stamp))
    if "target" in entry:
        commands.append(MoveString(_vector(entry["target"], "target"), "world", **stamp))
    return commands


def _set(changes: Any, stamp: Stamp) -> list[Command]:
    if not isinstance(changes, dict) or not changes:
        raise InputError("", changes, "{parameter: value, ...}")
    if "record" in changes:
        accepted = "parameters of the motion; set record by ros2 param set"
        raise InputError("record", changes["record"], accepted)
    return [Change({str(name): plain(value) for name, value in changes.items()}, **stamp)]


def _service(name: Any, stamp: Stamp) -> list[Command]:
    if plain(name) != "clear_wrench":
        raise InputError("", name, "clear_wrench; reset heads a list on the topic ~/schedule")
    return [ClearWrench(**stamp)]


_READERS: Mapping[str, Callable[[Any, Stamp], list[Command]]] = {
    "wrench": _held_wrench,
    "thrusters": _thrusters,
    "state": _state,
    "string": _string,
    "set": _set,
    "service": _service,
}
"""Readers by the key that determines the kind of an entry; an entry with none of these keys is a poke."""

ENTRY_KEYS: Set[str] = _POKE_KEYS | _READERS.keys()
"""All keys of entries."""


def _load(held: bool, entry: dict[str, Any], stamp: Stamp) -> WrenchCommand:
    impulse = "impulse" in entry or "angular_impulse" in entry
    lasting = "force" in entry or "push" in entry or "torque" in entry
    duration_s = None
    if "duration" in entry:
        duration_s = _number(entry["duration"], "duration", 1e-9, MAX_TIME_S)
    if impulse and (lasting or duration_s is not None or "slot" in entry):
        raise InputError("", sorted(entry), "impulses alone, or force, push and torque with a duration or slot")
    if not (impulse or lasting):
        raise InputError("", sorted(entry), "force, push, impulse, torque or angular_impulse")
    slot = entry.get("slot", "")
    if "slot" in entry and not (isinstance(slot, str) and SLOT_NAME.match(slot)):
        raise InputError("slot", slot, "a name of [a-z][a-z0-9_]*, up to 12 characters")
    axes = plain(entry.get("axes", "world"))
    if axes not in ("world", "body"):
        raise InputError("axes", axes, "world, body")
    force_key, torque_key = ("impulse", "angular_impulse") if impulse else ("force", "torque")
    force = _vector(entry[force_key], force_key) if force_key in entry else ZERO
    torque = _vector(entry[torque_key], torque_key) if torque_key in entry else ZERO
    point = _point(entry.get("at", "com"))
    if "push" in entry:
        if "force" in entry or "axes" in entry or "torque" in entry:
            raise InputError("", sorted(entry), "push without force, axes and torque: it acts along the inward normal")
        if point == ("com",):
            raise InputError("at", "com", "a point of the surface, which has a normal, such as {vertex: 0}")
        axes, force = "normal", (_number(entry["push"], "push"), 0.0, 0.0)
    return WrenchCommand(held, Frame(axes, point, duration_s, impulse, slot), force, torque, **stamp)


def _point(at: object) -> tuple[Any, ...]:
    if isinstance(at, str) and (at in FIXED_POINTS or (CONTACT_NAME.match(at) and at not in RESERVED_WORDS)):
        return (at,) if at in FIXED_POINTS else ("contact", at)
    if isinstance(at, dict) and len(at) == 1:
        ((word, value),) = at.items()
        if word == "vertex" and type(number := plain(value)) is int and number >= 0:
            return "vertex", number
        if word == "point":
            return "point", _vector(value, "at, point")
        if word == "ray" and isinstance(value, dict) and set(value) == {"origin", "direction"}:
            origin, direction = (_vector(value[key], f"at, ray, {key}") for key in ("origin", "direction"))
            if any(direction):
                return "ray", origin, direction
            raise InputError("at", at, "a ray whose direction isn't zero")
    accepted = "com, origin, a contact's name, {vertex: i}, {point: [x, y, z]} or {ray: {origin, direction}}"
    raise InputError("at", at, accepted)


def _check_keys(entry: dict[str, Any], known: Set[str], others: Set[str] = frozenset()) -> None:
    """Raises InputError for a key that isn't known. others: keys of other kinds of entries, which may have been
    meant.
    """
    if entry.keys() <= known:
        return
    unknown = [str(key) for key in entry if key not in known]
    hint = did_you_mean(unknown[0], known | others)
    keys = f"the keys here are {', '.join(sorted(known))}"
    keys += f"; other entries have {', '.join(sorted(others))}" if others else ""
    raise InputError("", f"there is no key {', '.join(unknown)}; {' '.join(filter(None, [hint, keys]))}")


def _number(value: Any, field: str, lower: float = -1e100, upper: float = 1e100) -> float:
    if type(value) is float and lower <= value <= upper:
        return value  # the usual case, checked first: a script may have thousands
    value = plain(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not lower <= value <= upper:
        raise InputError(field, value, f"a number from {lower:g} to {upper:g}")
    return float(value)


def _vector(value: Any, field: str) -> Vector:
    if type(value) is not list:
        value = plain(value)
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(field, value, "three numbers [x, y, z]")
    x, y, z = value
    return _number(x, field), _number(y, field), _number(z, field)


def _numbers(values: Any, field: str, count: int) -> tuple[float, ...]:
    values = plain(values)
    if not isinstance(values, list) or len(values) != count:
        raise InputError(field, values, f"{count} numbers")
    return tuple(_number(value, field) for value in values)


def at_contact(command: TieString, contacts: Mapping[str, Vector]) -> TieString:
    """The command with the name of its contact replaced by the contact's point (mesh coordinates). Raises
    InputError.
    """
    if command.contact not in contacts:
        known = ", ".join(sorted(contacts)) or "none"
        raise InputError("string, attach", command.contact, f"a contact of the body ({known}) or [x, y, z]")
    return replace(command, point=contacts[command.contact], contact="")


# Writing


def entry_of(command: Command) -> dict[str, Any]:
    """The command as a script entry without its time.

    Raises InputError for a command that no entry can express: an impulse along a normal, an inertia message, a knot
    that isn't in mesh coordinates.
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


def _load_entry(command: WrenchCommand) -> dict[str, Any]:
    frame = command.frame
    match frame.point:
        case ("vertex" | "point" as word, place):
            at: object = {word: place if word == "vertex" else list(place)}
        case ("ray", origin, direction):
            at = {"ray": {"origin": list(origin), "direction": list(direction)}}
        case (*_, name):  # a contact, com or origin
            at = name
    entry: dict[str, Any] = {"at": at}
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


def script_text(entries: Iterable[Mapping[str, Any]]) -> str:
    """The text of a script file of these entries."""
    return "".join(f"- {flow(entry)}\n" for entry in entries) or "[]\n"


def schedules(script: list[Command], start_ns: int = 0) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    """The lists that send a script on the schedule topic, in order of time: the time at which the commands of each act
    [ns], and one entry per command. Commands of the same time are one list, so that they act in its order. Raises
    InputError.
    """
    for t_ns, commands in groupby(script, key=attrgetter("stamp_ns")):
        time_ns = start_ns + t_ns
        entries = [{"t": time_ns / 1e9, **entry_of(command)} for command in commands]
        if len(entries) > MAX_SCHEDULED:
            accepted = f"at most {MAX_SCHEDULED}, all in one message"
            raise InputError("script", f"{len(entries)} commands at {time_ns / 1e9:.9g} s", accepted)
        yield time_ns, entries
