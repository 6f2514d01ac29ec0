# SPDX-License-Identifier: MIT
"""YAML as people type it for scripts: values, lists and mappings, and nothing that could do more than its length lets on."""

from __future__ import annotations

import yaml

from ..base.errors import InputError


class _PlainLoader(yaml.SafeLoader):
    """Without tags, whose constructors fail in ways of their own, and without aliases: a few of them grow to gigabytes."""

    def compose_node(self, parent, index):
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            raise yaml.MarkedYAMLError(problem="an anchor or alias", problem_mark=event.start_mark)
        if event.tag is not None:
            raise yaml.MarkedYAMLError(problem=f"the tag {event.tag}", problem_mark=event.start_mark)
        return super().compose_node(parent, index)


def load_plain_yaml(text: str, name: str):
    """What a text says as plain data; raises InputError with ``name`` and the line for anything else."""
    try:
        return yaml.load(text, Loader=_PlainLoader)  # noqa: S506 (it is a SafeLoader)
    except (yaml.YAMLError, RecursionError, ValueError, OverflowError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{name}, line {mark.line + 1}" if mark else name
        raise InputError(where, getattr(error, "problem", None) or "text", "plain YAML") from None
