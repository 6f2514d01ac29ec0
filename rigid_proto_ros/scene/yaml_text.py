# SPDX-License-Identifier: MIT
"""YAML as people write it: read from files of bounded size, without aliases, of which a few grow to
gigabytes or never end.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ..base.errors import InputError
from ..base.files import read_bounded

MAX_BYTES = 16 << 20
"""Larger than any scene or script; a mesh given by mistake stops here instead of in the YAML reader."""


def _marked(problem: str, event: yaml.NodeEvent) -> yaml.MarkedYAMLError:
    mark: Any = event.start_mark
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


class _Loader(yaml.SafeLoader):
    """Without aliases, which rcl doesn't read either."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise _marked(f"the alias *{event.anchor}", event)
        self.check_node_event(event)
        return super().compose_node(parent, index)

    def check_node_event(self, event: yaml.NodeEvent) -> None:
        """Refuse what a node may not have."""


class _PlainLoader(_Loader):
    """Without tags too, whose constructors fail in ways of their own."""

    def check_node_event(self, event: yaml.NodeEvent) -> None:
        if event.anchor is not None:
            raise _marked(f"the anchor &{event.anchor}", event)
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _marked(f"the tag {tag}", event)


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
        return yaml.compose(text, Loader=_Loader)
    except (yaml.YAMLError, RecursionError) as error:
        raise _unreadable(error, name, "valid YAML without aliases") from None


def load_plain_yaml(text: str, name: str) -> Any:
    """What a text says as values, lists and mappings; raises InputError with ``name`` and the line for
    anything else.
    """
    try:
        return yaml.load(text, Loader=_PlainLoader)
    except (yaml.YAMLError, RecursionError, ValueError, OverflowError) as error:
        raise _unreadable(error, name, "plain YAML") from None


def _unreadable(error: Exception, name: str, accepted: str) -> InputError:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or (str(error).splitlines() or ["text"])[0]
    return InputError(f"{name}, line {mark.line + 1}" if mark else name, problem, accepted)


def dump_yaml(value: object) -> str:
    """Values, lists and mappings as people would write them: the innermost on one line."""
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=None, width=120)
