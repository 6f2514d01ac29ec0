# SPDX-License-Identifier: MIT
"""YAML as people write it, typed as rcl types it: read from files of bounded size, without aliases, of which a few grow
to gigabytes or never end, and written with all digits of a double.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import yaml

from .errors import InputError
from .files import read_bounded

MAX_BYTES = 16 << 20
"""Larger than any scene or script; a mesh given by mistake stops here instead of in the YAML reader."""

MAX_DEPTH = 100
"""Of lists and mappings in each other: libyaml's reader ends the process in deeper ones."""

_TRUE = {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
_FALSE = {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
_INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|\d+)\Z", re.ASCII)
_DOUBLE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)
_SPECIAL = re.compile(r"[+-]?\.?(inf|infinity|nan)\Z", re.IGNORECASE)
_WORD = re.compile(r"(?!null\Z)[a-z_]{3,}\Z")
"""Text that needs no quotes in YAML, unless it means true or false."""

_PLAIN = (float, int, str, bool, type(None))

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""libyaml's, ten times as fast, where it is installed."""


def read_text(path: Path, kind: str) -> str:
    """The text of a file; raises InputError, which says that ``kind`` ("a YAML file") is accepted."""
    data = read_bounded(path, MAX_BYTES, str(path), kind)
    try:
        return data.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise InputError(str(path), "the file isn't UTF-8 text") from None


def _events(text: str, name: str) -> Iterator[yaml.Event]:
    """The text's parts one after another, as far as they are YAML without aliases, not too deep; raises InputError, in
    which ``name`` is the name of the text.
    """
    depth = 0
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            problem = ""
            if depth > MAX_DEPTH:
                problem = f"more than {MAX_DEPTH} lists and mappings in each other"
            elif isinstance(event, yaml.AliasEvent):
                problem = f"the alias *{event.anchor}"  # rcl doesn't read them either
            if problem:
                mark: Any = event.start_mark
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=mark)
            yield event
    except yaml.YAMLError as error:
        raise _no_yaml(error, name) from None


def _no_yaml(error: yaml.YAMLError, name: str) -> InputError:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or (str(error).splitlines() or ["text"])[0]
    place = f"{name}, line {mark.line + 1}" if mark else name
    return InputError(place, problem, "valid YAML without aliases")


def compose_yaml(text: str, name: str) -> yaml.Node | None:
    """The YAML tree of a text, with line numbers; raises InputError, in which ``name`` is the name of the text."""
    for _ in _events(text, name):
        pass  # libyaml's composer ends the process where a text is too deep
    try:
        return yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        raise _no_yaml(error, name) from None


def load_json(text: str) -> Any:
    """What a text says that is JSON, which is read a hundred times as fast as YAML; None for any other."""
    try:
        return json.loads(text, parse_constant=_no_number, object_pairs_hook=_unique)
    except (ValueError, RecursionError):
        return None


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        raise ValueError(pairs)
    return values


def _no_number(text: str) -> NoReturn:
    raise ValueError(text)


def load_yaml(text: str, name: str) -> Any:
    """What a text says as values, lists and mappings; raises InputError with ``name`` and the line for what is no YAML.
    Tags are left aside.
    """
    said = load_items(text, name)
    return list(said) if isinstance(said, Iterator) else said


def load_items(text: str, name: str) -> Any:
    """The same, but of a list its items one by one: a wrong one is found before a long text is read to its end."""
    if (said := load_json(text)) is not None:
        return said
    events = _events(text, name)
    for event in events:
        if isinstance(event, yaml.SequenceStartEvent):
            return _items(events, name)
        if isinstance(event, _CONTENT):
            value = _value(event, events, name)
            _end(events, name)
            return value
    return None


_CONTENT = (yaml.ScalarEvent, yaml.CollectionStartEvent)


def _items(events: Iterator[yaml.Event], name: str) -> Iterator[Any]:
    for event in events:
        if isinstance(event, yaml.SequenceEndEvent):
            break
        yield _value(event, events, name)
    _end(events, name)


def _end(events: Iterator[yaml.Event], name: str) -> None:
    """Raises InputError for what isn't the end of the text."""
    for event in events:
        if isinstance(event, yaml.DocumentStartEvent):
            raise InputError(_place(name, event), "another document", "one document")


def _place(name: str, event: yaml.Event) -> str:
    mark: Any = event.start_mark
    return f"{name}, line {mark.line + 1}"


def _value(event: yaml.Event, events: Iterator[yaml.Event], name: str) -> Any:
    """What begins with an event and goes on with the next ones."""
    if isinstance(event, yaml.ScalarEvent):
        return typed(event)
    if isinstance(event, yaml.SequenceStartEvent):
        items = []
        while not isinstance(item := next(events), yaml.SequenceEndEvent):
            items.append(_value(item, events, name))
        return items
    values: dict[str, Any] = {}
    while not isinstance(key := next(events), yaml.MappingEndEvent):
        if not isinstance(key, yaml.ScalarEvent):
            raise InputError(_place(name, key), "a list or a mapping as a key", "a name")
        if key.value in values:
            raise InputError(_place(name, key), f"{key.value} twice in one mapping", "each key once")
        values[str(key.value)] = _value(next(events), events, name)
    return values


def key_of(key: yaml.Node, name: str) -> str:
    """A mapping's key as text; raises InputError for one that is a list or a mapping."""
    if not isinstance(key, yaml.ScalarNode):
        raise refused(key, name, "a name")
    return str(key.value)


def typed(node: yaml.ScalarNode | yaml.ScalarEvent) -> bool | int | float | str:
    """A single value as rcl types it: a quoted one is text."""
    return node.value if node.style else scalar(node.value)


def scalar(text: str) -> bool | int | float | str:
    """A plain YAML scalar as rcl types it."""
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if _INTEGER.match(text):
        digits = text.lstrip("+-")
        base = 16 if digits[:2] in ("0x", "0X") else 8 if digits[0] == "0" and len(digits) > 1 else 10
        with suppress(ValueError, OverflowError):  # 09 is no octal number; strtod then reads it as 9.0
            value = int(digits, base) * (-1 if text[0] == "-" else 1)
            return value if -(1 << 63) <= value < 1 << 63 else float(value)
    if _DOUBLE.match(text):
        value = float(text)
        return text if math.isinf(value) else value  # out of a double's range: rcl keeps the text
    return float(text.replace(".", "")) if _SPECIAL.match(text) else text


def refused(node: yaml.Node, name: str, accepted: str) -> InputError:
    """What stands there isn't ``accepted``."""
    received = node.value
    if isinstance(node, yaml.MappingNode):
        received = "a mapping"
    elif isinstance(node, yaml.SequenceNode):
        plain = all(isinstance(item, yaml.ScalarNode) for item in node.value)
        received = "[" + ", ".join(str(item.value) for item in node.value) + "]" if plain else "a list"
    # A value from the command line has no lines to count.
    return InputError(name if name.startswith("-") else f"{name}, line {node.start_mark.line + 1}", received, accepted)


def yaml_value(value: object) -> str:
    """A parameter's value as written to a YAML file, with all digits."""
    # JSON is YAML; repr keeps all digits, and a double keeps its point so that it is read back as one.
    if isinstance(value, float):
        text = repr(value)
        return text if any(c in text for c in ".n") else text.replace("e", ".0e")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(yaml_value(item) for item in value) + "]"
    return json.dumps(value)


def flow(value: object) -> str:
    """Plain data as YAML on one line; doubles keep all their digits."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(flow(item) for item in value) + "]"
    if isinstance(value, str) and _WORD.match(value) and isinstance(scalar(value), str):
        return value
    return yaml_value(value)


def plain(value: object) -> Any:
    """A value as YAML has it, from NumPy's numbers and arrays, tuples and paths, also within lists and mappings."""
    if type(value) in _PLAIN:
        return value
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (dict, Mapping)):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return os.fspath(value) if isinstance(value, os.PathLike) else value
