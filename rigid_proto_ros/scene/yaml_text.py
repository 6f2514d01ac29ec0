# SPDX-License-Identifier: MIT
"""YAML as people write it and as rcl types it: read from files of bounded size, without aliases, of which a few grow to
gigabytes or never end, and written with all digits of a double.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import yaml

from ..base.errors import InputError
from ..base.files import read_bounded

MAX_BYTES = 16 << 20
"""Larger than any scene or script; a mesh given by mistake stops here instead of in the YAML reader."""

_TRUE = {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
_FALSE = {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
_INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|\d+)\Z", re.ASCII)
_DOUBLE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)
_SPECIAL = re.compile(r"[+-]?\.?(inf|infinity|nan)\Z", re.IGNORECASE)
_HEX_DOUBLE = re.compile(r"[+-]?0[xX][0-9a-fA-F]*\.?[0-9a-fA-F]*([pP][+-]?\d+)?\Z")
_WORD = re.compile(r"(?!null\Z)[a-z_]{3,}\Z")
"""Text that stands in YAML without quotes, unless it reads as true or false."""


_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""libyaml's, ten times as fast, where it is installed."""
MAX_DEPTH = 100
"""Of lists and mappings in each other: libyaml's reader ends the process in deeper ones."""


def _check_nodes(text: str, plain: bool) -> None:
    """Raise MarkedYAMLError for an alias, which rcl doesn't read either, and where only ``plain`` values are read for
    anchors and tags, too.
    """
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        problem = ""
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_DEPTH:
            problem = f"more than {MAX_DEPTH} lists and mappings in each other"
        elif isinstance(event, yaml.AliasEvent):
            problem = f"the alias *{event.anchor}"
        elif plain and isinstance(event, yaml.NodeEvent):
            anchor, tag = event.anchor, getattr(event, "tag", None)
            problem = f"the anchor &{anchor}" if anchor else f"the tag {tag}" if tag else ""
        if problem:
            mark: Any = event.start_mark
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def read_text(path: Path, kind: str) -> str:
    """The text of a file; raises InputError, which says that ``kind`` ("a YAML file") is accepted."""
    data = read_bounded(path, MAX_BYTES, str(path), kind)
    try:
        return data.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise InputError(str(path), "the file isn't UTF-8 text") from None


def compose_yaml(text: str, name: str) -> yaml.Node | None:
    """The YAML tree of a text, with its lines; raises InputError, where ``name`` stands."""
    try:
        _check_nodes(text, plain=False)
        return yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise _unreadable(error, name, "valid YAML without aliases") from None


def load_json(text: str) -> Any:
    """What a text says that is JSON, which is read a hundred times as fast as YAML; None for any other."""
    try:
        return json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        return None


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)


def load_plain_yaml(text: str, name: str) -> Any:
    """What a text says as values, lists and mappings; raises InputError with ``name`` and the line for
    anything else.
    """
    if (said := load_json(text)) is not None:
        return said
    try:
        _check_nodes(text, plain=True)
        return yaml.load(text, Loader=_LOADER)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise _unreadable(error, name, "plain YAML") from None


def _unreadable(error: Exception, name: str, accepted: str) -> InputError:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or (str(error).splitlines() or ["text"])[0]
    return InputError(f"{name}, line {mark.line + 1}" if mark else name, problem, accepted)


def dump_yaml(value: object) -> str:
    """Values, lists and mappings as people would write them: the innermost on one line."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=None, width=120)


def scalar(text: str) -> bool | int | float | str:
    """A plain YAML scalar as rcl types it."""
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    if _INTEGER.match(text):
        digits = text.lstrip("+-")
        base = 16 if digits[:2] in ("0x", "0X") else 8 if digits[0] == "0" and len(digits) > 1 else 10
        try:
            value = int(digits, base) * (-1 if text[0] == "-" else 1)
        except ValueError:  # 09 is no octal number; strtod then reads it as 9.0
            return float(text)
        return value if -(1 << 63) <= value < 1 << 63 else float(value)
    if _DOUBLE.match(text):
        value = float(text)
        return text if math.isinf(value) else value  # out of a double's range: rcl keeps the text
    if _SPECIAL.match(text):
        return float(text.replace(".", ""))
    if _HEX_DOUBLE.match(text):
        try:
            return float.fromhex(text)
        except ValueError:
            return text
    return text


def yaml_value(value: object) -> str:
    """A parameter's value as it stands in a YAML file, with all its digits."""
    # JSON is YAML; repr keeps all digits, and a double keeps its point so that it is read back as one.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return yaml_double(value)
    if isinstance(value, list):
        return "[" + ", ".join(yaml_double(v) for v in value) + "]"
    return json.dumps(value)


def yaml_double(value: float) -> str:
    """A double as YAML 1.1 and rcl read it back as one."""
    text = repr(value)
    return text if any(c in text for c in ".n") else text.replace("e", ".0e")


def flow(value: object, quoted: bool = False) -> str:
    """Plain data as YAML on one line; doubles keep all their digits. quoted: as JSON, which is YAML too
    and is read faster.
    """
    if isinstance(value, Mapping):
        pairs = ((json.dumps(key) if quoted else key, flow(item, quoted)) for key, item in value.items())
        return "{" + ", ".join(f"{key}: {item}" for key, item in pairs) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(flow(item, quoted) for item in value) + "]"
    if isinstance(value, str) and not quoted and _WORD.match(value) and isinstance(scalar(value), str):
        return value
    return yaml_double(value) if isinstance(value, float) else yaml_value(value)
