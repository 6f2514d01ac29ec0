# SPDX-License-Identifier: MIT
"""A line of the event log in words: ``poke 0.03 N at tip, 0.1 s``."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

_PLAIN = {
    "clear_wrench": "wrench and pokes end",
    "string_release": "string released",
    "timeout": "string released: its timeout",
}


def words_of(line: str) -> str:
    """A line of the event log, JSON, in words."""
    event = json.loads(line)
    kind, content = str(event["kind"]), event["content"]
    match kind:
        case "wrench" | "poke":
            return _load(kind, content)
        case "string_attach":
            return f"string tied at {_point(content['point'])} ({content['frame_id'] or 'world'})"
        case "string_target":
            return f"string's free end to {_point(content['point'])} m"
        case "set":
            return ", ".join(f"{name} = {_value(value)}" for name, value in content.items())
        case "state":
            return "state: " + ", ".join(f"{name} {_value(value)}" for name, value in content.items())
        case "thrusters":
            return f"thrusters {_point(content['forces'])} N"
        case "inertia":
            return f"inertia: {_number(content['mass'])} kg"
        case "pause":
            return "paused" if content["data"] else "resumed"
        case "jump":
            return f"/clock jumped by {content['by_ns'] / 1e9:+.9g} s"
        case _:
            return _PLAIN.get(kind, kind)


def _load(kind: str, content: dict[str, Any]) -> str:
    place, *options = content["frame_id"].split(";")
    axes, _, point = place.rpartition("@")
    is_impulse = "impulse" in options
    parts = [
        f"{_number(math.hypot(*content[name]))} {unit}{' s' if is_impulse else ''}"
        for name, unit in (("force", "N"), ("torque", "N m"))
        if any(content[name])
    ]
    said = f"{kind} {' and '.join(parts) or '0 N'} at {point if axes or point not in ('', 'world', 'body') else 'com'}"
    for option in options:
        name, _, value = option.partition("=")
        said += {"duration": f", {value} s", "slot": f", slot {value}"}.get(name, "")
    return said


def _number(value: float) -> str:
    return f"{value:.4g}"


def _point(values: Sequence[float]) -> str:
    return "(" + ", ".join(map(_number, values)) + ")"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return _point(value)
    return _number(value) if isinstance(value, float) else str(value)
