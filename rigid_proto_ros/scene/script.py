# SPDX-License-Identifier: MIT
"""Poke scripts: a YAML list of timed commands, expanded to the very messages that go over the topics.

``poke_client`` sends them and ``simulate`` applies them, from one expansion, so that both give one motion.
"""

from __future__ import annotations

import json
import random
from collections.abc import Mapping, Set
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from ..base.errors import InputError, did_you_mean
from ..motion.frames import CONTACT_NAME, FIXED_POINTS, SLOT_NAME, parse_frame, point_text
from ..simulation.commands import STATE_VALUES
from .command_codec import MAX_SCHEDULED, MESH_FRAME, ScriptCommand
from .parameters import ZERO, Vector
from .scenario import nanoseconds
from .yaml_text import load_plain_yaml, read_text

MAX_TIME_S = 1e9
MAX_ENTRIES = 1_000_000
"""Commands a script may expand to: beyond it a mistyped duration is likelier than a wish."""

MAX_SCHEDULE_LENGTH = 1_000_000
"""Characters of a message on the schedule topic: 5000 entries and some."""

MAX_YAML_LENGTH = 10_000
MAX_BRACKETS = 100
"""Of a message that isn't JSON as well: the YAML reader takes seconds over thousands of brackets, and the
body would wait.
"""

_FORCES = ("force", "push", "impulse")
_POKE_KEYS = {"at", *_FORCES, "torque", "angular_impulse", "axes", "duration", "slot"}
_TIMING_KEYS = {"t", "repeat", "every", "jitter", "seed"}
_WRENCH_KEYS = {"at", "force", "push", "torque", "axes", "duration", "slot"}
_STRING_KEYS = {"attach", "target"}
ENTRY_KEYS: Mapping[str, set[str]] = {
    "timing": _TIMING_KEYS,
    "poke": _POKE_KEYS,
    "wrench": _WRENCH_KEYS,
    "string": _STRING_KEYS | {"release"},
    "other": {"wrench", "thrusters", "state", "string", "set", "service", "script"},
}
"""The keys that a script may hold, by the kind of entry."""


def read_script(path: str | Path) -> list[ScriptCommand]:
    """The commands of a script file in order of time; raises InputError naming file, entry and what is accepted."""
    return parse_script(read_text(Path(path), "a poke script"), str(path))


def parse_script(text: str, name: str = "script") -> list[ScriptCommand]:
    """As ``read_script``, from text."""
    return expand_script(load_plain_yaml(text, name), name)


def read_schedule(text: str) -> dict | list:
    """What a message on the schedule topic says: an entry, or a list of entries. JSON, which is YAML, may be longer and
    is read faster. Raises InputError.
    """
    if len(text) > MAX_SCHEDULE_LENGTH:
        raise InputError("schedule", f"{len(text)} characters", f"at most {MAX_SCHEDULE_LENGTH}")
    try:
        entries = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        if len(text) > MAX_YAML_LENGTH:
            raise InputError(
                "schedule", f"{len(text)} characters", f"JSON, or at most {MAX_YAML_LENGTH} characters of other YAML"
            ) from None
        if text.count("[") + text.count("{") > MAX_BRACKETS:
            raise InputError("schedule", text[:80], f"at most {MAX_BRACKETS} opening brackets, or JSON") from None
        entries = load_plain_yaml(text, "schedule")
    if not entries or not isinstance(entries, (dict, list)):
        raise InputError("schedule", text[:80], "an entry such as {t: 0.5, force: [0, 0, 1]}, or a list of entries")
    return entries


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)


def expand_schedule(entries: dict | list) -> list[ScriptCommand]:
    """The commands of what ``read_schedule`` gives, in the order in which they are listed; raises InputError."""
    listed = entries if isinstance(entries, list) else [entries]
    if any(isinstance(entry, dict) and "script" in entry for entry in listed):
        raise InputError("schedule", "script", "entries alone, without a script around them")
    commands = expand_script(listed, "schedule", MAX_SCHEDULED)
    # As listed, which only matters among those that act at once because their time is past.
    return sorted(commands, key=lambda command: command.entry)


def expand_script(entries: Any, name: str = "script", max_commands: int = MAX_ENTRIES) -> list[ScriptCommand]:
    """As ``parse_script``, from what its YAML says: a list of entries, or a mapping that holds one as ``script``."""
    whole: dict = {}
    if isinstance(entries, dict) and "script" in entries:
        whole = {key: value for key, value in entries.items() if key != "script"}
        _check_keys(whole, _TIMING_KEYS - {"t"}, name)
        entries = entries["script"]
    if entries is None:
        entries = []
    if not isinstance(entries, list):
        raise InputError(name, type(entries).__name__, "a list of entries such as - {t: 0.5, force: [0, 0, 1]}")
    commands: list[ScriptCommand] = []
    offsets_ns = _offsets_ns(whole, name, max_commands)
    for number, entry in enumerate(entries, 1):
        where = f"{name}, entry {number}"
        for k, offset_ns in enumerate(offsets_ns):
            for t_ns in _times_ns(entry, where, f"{whole.get('seed', 0)}/{number}/{k}", max_commands):
                jitter_ns = _jitter_ns(whole, name, f"whole/{number}/{k}/{t_ns}")
                commands += _expand(entry, max(0, t_ns + offset_ns + jitter_ns), number, where)
            if len(commands) > max_commands:
                raise InputError(where, f"more than {max_commands} commands")
    return sorted(commands, key=lambda command: command.t_ns)


def _times_ns(entry: Any, where: str, seed: str, max_commands: int) -> list[int]:
    """When an entry acts: at t, again ``every`` seconds for ``repeat`` times in all, each moved by up to
    ±``jitter``.
    """
    if not isinstance(entry, dict):
        raise InputError(where, entry, "a mapping such as {t: 0.5, force: [0, 0, 1]}")
    if "t" not in entry:
        raise InputError(f"{where}, t", None, "the time in seconds")
    t_ns = nanoseconds(_number(entry["t"], f"{where}, t", 0.0, MAX_TIME_S))
    offsets = _offsets_ns(entry, where, max_commands)
    return [max(0, t_ns + offset + _jitter_ns(entry, where, f"{seed}/{k}")) for k, offset in enumerate(offsets)]


def _offsets_ns(timing: dict, where: str, max_commands: int) -> list[int]:
    if "repeat" not in timing and "every" not in timing:
        return [0]
    repeat = _number(timing.get("repeat", 1), f"{where}, repeat", 1, max_commands)
    if repeat != int(repeat):
        raise InputError(f"{where}, repeat", repeat, "a whole number of times")
    if repeat > 1 and "every" not in timing:
        raise InputError(f"{where}, every", None, "the seconds between repeats")
    every = _number(timing.get("every", 0.0), f"{where}, every", 0.0, MAX_TIME_S)
    return [nanoseconds(k * every) for k in range(int(repeat))]


def _jitter_ns(timing: dict, where: str, seed: str) -> int:
    """A uniform random shift, the same for the same seed wherever and whenever the script is read."""
    if "jitter" not in timing:
        return 0
    jitter = _number(timing["jitter"], f"{where}, jitter", 0.0, MAX_TIME_S)
    if jitter == 0.0:
        return 0
    own = _number(timing.get("seed", 0), f"{where}, seed", 0, 2**63)
    return nanoseconds(random.Random(f"{int(own)}/{seed}").uniform(-jitter, jitter))


def _expand(entry: dict, t_ns: int, number: int, where: str) -> list[ScriptCommand]:
    if "wrench" in entry:
        _check_keys(entry, _TIMING_KEYS | {"wrench"}, where)
        return [_held_wrench(entry["wrench"], t_ns, number, f"{where}, wrench")]
    if "thrusters" in entry:
        _check_keys(entry, _TIMING_KEYS | {"thrusters"}, where)
        forces = _forces(entry["thrusters"], f"{where}, thrusters")
        return [ScriptCommand(t_ns, "thrusters", forces=forces, entry=number)]
    if "state" in entry:
        _check_keys(entry, _TIMING_KEYS | {"state"}, where)
        return [ScriptCommand(t_ns, "state", state=_state(entry["state"], f"{where}, state"), entry=number)]
    if "string" in entry:
        _check_keys(entry, _TIMING_KEYS | {"string"}, where)
        return _expand_string(entry["string"], t_ns, number, f"{where}, string")
    if "set" in entry:
        _check_keys(entry, _TIMING_KEYS | {"set"}, where)
        if not isinstance(entry["set"], dict) or not entry["set"]:
            raise InputError(f"{where}, set", entry["set"], "{parameter: value, ...}")
        if "record" in entry["set"]:
            raise InputError(
                f"{where}, set, record",
                entry["set"]["record"],
                "parameters of the motion; ros2 param set switches record",
            )
        changes = {str(name): value for name, value in entry["set"].items()}
        return [ScriptCommand(t_ns, "set", changes=changes, entry=number)]
    if "service" in entry:
        _check_keys(entry, _TIMING_KEYS | {"service"}, where)
        if entry["service"] != "clear_wrench":
            raise InputError(f"{where}, service", entry["service"], "clear_wrench")
        return [ScriptCommand(t_ns, "clear_wrench", entry=number)]
    _check_keys(entry, _TIMING_KEYS | _POKE_KEYS, where, ENTRY_KEYS["other"] - {"script"})
    return [_poke(entry, t_ns, number, where)]


def _poke(entry: dict, t_ns: int, number: int, where: str) -> ScriptCommand:
    impulsive = "impulse" in entry or "angular_impulse" in entry
    lasting = "force" in entry or "push" in entry or "torque" in entry
    if impulsive and (lasting or "duration" in entry or "slot" in entry):
        raise InputError(where, sorted(entry), "impulses alone, or force, push and torque with a duration or slot")
    frame, force, torque = _wrench_fields(entry, where)
    frame += ";impulse" if impulsive else _duration(entry, where)
    frame = _checked_frame(frame + _slot(entry, where), where)
    return ScriptCommand(t_ns, "poke", frame, force, torque, entry=number)


def _held_wrench(entry: Any, t_ns: int, number: int, where: str) -> ScriptCommand:
    if not isinstance(entry, dict):
        raise InputError(where, entry, "{at, force or push, torque, axes, duration}")
    _check_keys(entry, _WRENCH_KEYS, where)
    frame, force, torque = _wrench_fields(entry, where)
    frame += _duration(entry, where) + _slot(entry, where)
    return ScriptCommand(t_ns, "wrench", _checked_frame(frame, where), force, torque, entry=number)


def _expand_string(entry: Any, t_ns: int, number: int, where: str) -> list[ScriptCommand]:
    if entry == "release":
        return [ScriptCommand(t_ns, "string_release", entry=number)]
    accepted = "release, or {attach: contact or [x, y, z] in mesh coordinates, target: [x, y, z] in the world}"
    if not isinstance(entry, dict) or not entry or not set(entry) <= _STRING_KEYS:
        raise InputError(where, entry, accepted)
    commands = []
    if "attach" in entry:
        attach = entry["attach"]
        if isinstance(attach, dict) and set(attach) == {"point"}:
            attach = attach["point"]
        if isinstance(attach, str) and CONTACT_NAME.match(attach):
            commands.append(ScriptCommand(t_ns, "string_attach", MESH_FRAME, contact=attach, entry=number))
        else:
            point = _vector(attach, f"{where}, attach")
            commands.append(ScriptCommand(t_ns, "string_attach", MESH_FRAME, point=point, entry=number))
    if "target" in entry:
        target = _vector(entry["target"], f"{where}, target")
        commands.append(ScriptCommand(t_ns, "string_target", "world", point=target, entry=number))
    return commands


def with_contacts(script: list[ScriptCommand], contacts: Mapping[str, Vector]) -> list[ScriptCommand]:
    """The script with the names of contacts that strings are tied to replaced by their points (mesh coordinates)."""
    resolved = []
    for command in script:
        if command.contact:
            if command.contact not in contacts:
                known = ", ".join(sorted(contacts)) or "none"
                raise InputError("string, attach", command.contact, f"a contact of the body ({known}) or [x, y, z]")
            command = replace(command, point=contacts[command.contact], contact="")
        resolved.append(command)
    return resolved


def _wrench_fields(entry: dict, where: str) -> tuple[str, Vector, Vector]:
    given = [key for key in _FORCES if key in entry]
    if len(given) > 1:
        raise InputError(where, given, "one of force, push, impulse")
    if not given and "torque" not in entry and "angular_impulse" not in entry:
        raise InputError(where, sorted(entry), "force, push, impulse, torque or angular_impulse")
    axes = entry.get("axes", "world")
    if axes not in ("world", "body"):
        raise InputError(f"{where}, axes", axes, "world, body")
    torque_key = "angular_impulse" if "angular_impulse" in entry else "torque"
    torque = _vector(entry[torque_key], f"{where}, {torque_key}") if torque_key in entry else ZERO
    force: Vector = ZERO
    if "push" in entry:
        if "axes" in entry or torque_key in entry:
            raise InputError(where, sorted(entry), "push without axes and torque: it acts along the inward normal")
        axes, force = "normal", (_number(entry["push"], f"{where}, push"), 0.0, 0.0)
    elif given:
        force = _vector(entry[given[0]], f"{where}, {given[0]}")
    return f"{axes}@{_at(entry.get('at', 'com'), where)}", force, torque


def _at(at: object, where: str) -> str:
    field = f"{where}, at"
    accepted = "com, origin, a contact's name, {vertex: i}, {point: [x, y, z]} or {ray: {origin, direction}}"
    if isinstance(at, str) and (at in FIXED_POINTS or CONTACT_NAME.match(at)):
        return at
    if isinstance(at, dict) and len(at) == 1:
        ((word, value),) = at.items()
        if word == "vertex" and isinstance(value, int) and not isinstance(value, bool) and value >= 0:
            return point_text(("vertex", value))
        if word == "point":
            return point_text(("point", _vector(value, f"{field}, point")))
        if word == "ray" and isinstance(value, dict) and set(value) == {"origin", "direction"}:
            return point_text(("ray", *(_vector(value[k], f"{field}, ray, {k}") for k in ("origin", "direction"))))
    raise InputError(field, at, accepted)


def _duration(entry: dict, where: str) -> str:
    if "duration" not in entry:
        return ""
    return f";duration={_number(entry['duration'], f'{where}, duration', 1e-9, MAX_TIME_S)!r}"


def _slot(entry: dict, where: str) -> str:
    if "slot" not in entry:
        return ""
    if not isinstance(entry["slot"], str) or not SLOT_NAME.match(entry["slot"]):
        raise InputError(f"{where}, slot", entry["slot"], "a name of [a-z][a-z0-9_]*, up to 12 characters")
    return f";slot={entry['slot']}"


def _checked_frame(frame: str, where: str) -> str:
    """The frame, readable by the node's own grammar; contact names are checked by the node that has them."""
    axes_point = frame.split(";")[0]
    contact = {axes_point.split("@")[1]} if CONTACT_NAME.match(axes_point.split("@")[1]) else set()
    try:
        parse_frame(frame, contact)
    except InputError as error:
        raise InputError(where, error.received, error.accepted) from None
    return frame


def _check_keys(entry: dict, known: set, where: str, others: Set[str] = frozenset()) -> None:
    """others: keys of other kinds of entries, one of which may be meant."""
    unknown = [str(key) for key in entry if key not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known | others)
        keys = f"the keys here are {', '.join(sorted(known))}"
        keys += f"; other entries have {', '.join(sorted(others))}" if others else ""
        raise InputError(where, f"there is no key {', '.join(unknown)}; {' '.join(filter(None, [hint, keys]))}")


def _number(value: Any, field: str, lower: float = -1e100, upper: float = 1e100) -> float:
    if type(value) is float and lower <= value <= upper:
        return value
    if isinstance(value, str):
        # YAML reads 1e-3 without a point as text.
        try:
            value = float(value)
        except ValueError:
            pass
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not lower <= value <= upper:
        raise InputError(field, value, f"a number from {lower:g} to {upper:g}")
    return float(value)


def _forces(value: Any, field: str) -> tuple[float, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(field, value, "a list of forces [N], one a thruster in the order of their names")
    return tuple(_number(force, field) for force in value)


def _state(value: Any, field: str) -> dict[str, tuple[float, ...]]:
    if not isinstance(value, dict) or not value:
        raise InputError(field, value, "any of " + ", ".join(STATE_VALUES))
    _check_keys(value, set(STATE_VALUES), field)
    state = {}
    for name, numbers in value.items():
        if not isinstance(numbers, list) or len(numbers) != STATE_VALUES[name]:
            raise InputError(f"{field}, {name}", numbers, f"{STATE_VALUES[name]} numbers")
        state[name] = tuple(_number(number, f"{field}, {name}") for number in numbers)
    return state


def _vector(value: Any, field: str) -> Vector:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(field, value, "three numbers [x, y, z]")
    x, y, z = (_number(v, field) for v in value)
    return x, y, z
