# SPDX-License-Identifier: MIT
"""Poke scripts: a YAML list of timed commands, expanded to the very messages that go over the topics.

``poke_client`` sends them and ``simulate`` applies them, from one expansion, so that both give one motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import yaml

from . import cdr
from .core.commands import Change, ClearWrench, Command, WrenchCommand
from .core.errors import InputError
from .core.frames import CONTACT_NAME, FIXED_POINTS, parse_frame, point_text
from .scenario import nanoseconds
from .scene_file import MAX_BYTES

MAX_TIME_S = 1e9
MAX_ENTRIES = 1_000_000
"""Commands a script may expand to: beyond it a mistyped duration is likelier than a wish."""

_FORCES = ("force", "push", "impulse")
_POKE_KEYS = {"t", "at", *_FORCES, "torque", "angular_impulse", "axes", "duration"}
_WRENCH_KEYS = {"at", "force", "push", "torque", "axes", "duration"}


@dataclass(frozen=True)
class ScriptCommand:
    """One command of an expanded script. t_ns: when it acts, from the script's start.

    kind ``wrench`` or ``poke``: frame_id, force (3,), torque (3,). kind ``set``: changes. kind ``clear_wrench``: nothing.
    """

    t_ns: int
    kind: str
    frame_id: str = ""
    force: tuple = (0.0, 0.0, 0.0)
    torque: tuple = (0.0, 0.0, 0.0)
    changes: dict | None = None

    def message(self, stamp_ns: int) -> bytes:
        """The message as it goes over its topic."""
        if self.kind in ("wrench", "poke"):
            return cdr.wrench_stamped(stamp_ns, self.frame_id, self.force, self.torque)
        return cdr.string(self.schedule_text(stamp_ns))

    def schedule_text(self, stamp_ns: int) -> str:
        """A ``set`` or ``clear_wrench`` entry for the schedule topic, with an absolute time."""
        entry: dict = {"t": stamp_ns / 1e9}
        entry.update({"set": self.changes} if self.kind == "set" else {"service": self.kind})
        return yaml.safe_dump(entry, default_flow_style=True, width=math.inf).strip()


def read_script(path: str | Path, wrench_timeout: float = 1.5) -> list[ScriptCommand]:
    """The commands of a script file in order of time; raises InputError naming file, entry and what is accepted.

    wrench_timeout [s]: held wrenches are repeated every half of it.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(str(path), f"{path.stat().st_size} bytes", f"a script of at most {MAX_BYTES} bytes")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(str(path), error.strerror, "a readable poke script") from None
    except UnicodeDecodeError:
        raise InputError(str(path), "bytes that aren't UTF-8", "a YAML file") from None
    return parse_script(text, str(path), wrench_timeout)


def parse_script(text: str, name: str = "script", wrench_timeout: float = 1.5) -> list[ScriptCommand]:
    """As ``read_script``, from text."""
    try:
        entries = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{name}, line {mark.line + 1}" if mark else name
        raise InputError(where, getattr(error, "problem", None) or "text", "valid YAML") from None
    if entries is None:
        entries = []
    if not isinstance(entries, list):
        raise InputError(name, type(entries).__name__, "a list of entries such as - {t: 0.5, force: [0, 0, 1]}")
    commands: list[ScriptCommand] = []
    for number, entry in enumerate(entries, 1):
        commands += _expand(entry, f"{name}, entry {number}", wrench_timeout)
        if len(commands) > MAX_ENTRIES:
            raise InputError(f"{name}, entry {number}", f"over {MAX_ENTRIES} commands", f"at most {MAX_ENTRIES}")
    return sorted(commands, key=lambda command: command.t_ns)


def _expand(entry, where: str, wrench_timeout: float) -> list[ScriptCommand]:
    if not isinstance(entry, dict):
        raise InputError(where, entry, "a mapping such as {t: 0.5, force: [0, 0, 1]}")
    if "t" not in entry:
        raise InputError(f"{where}, t", None, "the time in seconds")
    t_ns = nanoseconds(_number(entry["t"], f"{where}, t", 0.0, MAX_TIME_S))
    if "wrench" in entry:
        _check_keys(entry, {"t", "wrench"}, where)
        return _expand_wrench(entry["wrench"], t_ns, f"{where}, wrench", wrench_timeout)
    if "set" in entry:
        _check_keys(entry, {"t", "set"}, where)
        if not isinstance(entry["set"], dict) or not entry["set"]:
            raise InputError(f"{where}, set", entry["set"], "{parameter: value, ...}")
        return [ScriptCommand(t_ns, "set", changes={str(k): v for k, v in entry["set"].items()})]
    if "service" in entry:
        _check_keys(entry, {"t", "service"}, where)
        if entry["service"] != "clear_wrench":
            raise InputError(f"{where}, service", entry["service"], "clear_wrench")
        return [ScriptCommand(t_ns, "clear_wrench")]
    _check_keys(entry, _POKE_KEYS, where)
    return [_poke(entry, t_ns, where)]


def _poke(entry: dict, t_ns: int, where: str) -> ScriptCommand:
    impulsive = "impulse" in entry or "angular_impulse" in entry
    lasting = "force" in entry or "push" in entry or "torque" in entry
    if impulsive and (lasting or "duration" in entry):
        raise InputError(where, sorted(entry), "impulses alone, or force, push and torque with a duration")
    option = ";impulse" if impulsive else ""
    if "duration" in entry:
        option = f";duration={_number(entry['duration'], f'{where}, duration', 1e-9, MAX_TIME_S)!r}"
    frame, force, torque = _wrench_fields(entry, where)
    return ScriptCommand(t_ns, "poke", _checked_frame(frame + option, where), force, torque)


def _expand_wrench(entry, t_ns: int, where: str, wrench_timeout: float) -> list[ScriptCommand]:
    if not isinstance(entry, dict):
        raise InputError(where, entry, "{at, force or push, torque, axes, duration}")
    _check_keys(entry, _WRENCH_KEYS, where)
    frame, force, torque = _wrench_fields(entry, where)
    first = ScriptCommand(t_ns, "wrench", _checked_frame(frame, where), force, torque)
    if "duration" not in entry:
        return [first]
    duration_ns = nanoseconds(_number(entry["duration"], f"{where}, duration", 1e-9, MAX_TIME_S))
    repeats = [first]
    if wrench_timeout > 0.0:
        every_ns = max(1, nanoseconds(wrench_timeout / 2.0))
        if duration_ns // every_ns > MAX_ENTRIES:
            raise InputError(f"{where}, duration", duration_ns * 1e-9, f"at most {MAX_ENTRIES} repeats")
        times = range(t_ns + every_ns, t_ns + duration_ns, every_ns)
        repeats += [ScriptCommand(t, "wrench", first.frame_id, force, torque) for t in times]
    # The last message holds no axes to misread: no wrench at all.
    return [*repeats, ScriptCommand(t_ns + duration_ns, "wrench", "world@com")]


def _wrench_fields(entry: dict, where: str) -> tuple[str, tuple, tuple]:
    given = [key for key in _FORCES if key in entry]
    if len(given) > 1:
        raise InputError(where, given, "one of force, push, impulse")
    if not given and "torque" not in entry and "angular_impulse" not in entry:
        raise InputError(where, sorted(entry), "force, push, impulse, torque or angular_impulse")
    axes = entry.get("axes", "world")
    if axes not in ("world", "body"):
        raise InputError(f"{where}, axes", axes, "world, body")
    zero = (0.0, 0.0, 0.0)
    torque_key = "angular_impulse" if "angular_impulse" in entry else "torque"
    torque = _vector(entry[torque_key], f"{where}, {torque_key}") if torque_key in entry else zero
    force = zero
    if "push" in entry:
        if "axes" in entry or torque_key in entry:
            raise InputError(where, sorted(entry), "push without axes and torque: it acts along the inward normal")
        axes, force = "normal", (_number(entry["push"], f"{where}, push"), 0.0, 0.0)
    elif given:
        force = _vector(entry[given[0]], f"{where}, {given[0]}")
    return f"{axes}@{_at(entry.get('at', 'com'), where)}", force, torque


def _at(at, where: str) -> str:
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


def _checked_frame(frame: str, where: str) -> str:
    """The frame, readable by the node's own grammar; contact names are checked by the node that has them."""
    axes_point = frame.split(";")[0]
    contact = {axes_point.split("@")[1]} if CONTACT_NAME.match(axes_point.split("@")[1]) else set()
    try:
        parse_frame(frame, contact)
    except InputError as error:
        raise InputError(where, error.received, error.accepted) from None
    return frame


def _check_keys(entry: dict, known: set, where: str) -> None:
    unknown = [str(key) for key in entry if key not in known]
    if unknown:
        raise InputError(where, ", ".join(unknown), f"the keys {', '.join(sorted(known))}")


def _number(value, field: str, lower: float = -1e100, upper: float = 1e100) -> float:
    if isinstance(value, str):
        # YAML reads 1e-3 without a point as text.
        try:
            value = float(value)
        except ValueError:
            pass
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not lower <= value <= upper:
        raise InputError(field, value, f"a number from {lower:g} to {upper:g}")
    return float(value)


def _vector(value, field: str) -> tuple[float, float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(field, value, "three numbers [x, y, z]")
    return tuple(_number(v, field) for v in value)


def core_command(command: ScriptCommand, stamp_ns: int, contacts, apply_changes, frames=("world", "body")) -> Command:
    """The core's command for a script's; apply_changes(changes) gives the Setup with parameters changed."""
    message = command.message(stamp_ns)
    if command.kind == "set":
        return Change(command.changes, lambda: apply_changes(command.changes), message)
    if command.kind == "clear_wrench":
        return ClearWrench(message)
    frame = parse_frame(command.frame_id, contacts, *frames)
    held = command.kind == "wrench"
    return WrenchCommand(held, frame, command.force, command.torque, stamp_ns, command.frame_id, message)
