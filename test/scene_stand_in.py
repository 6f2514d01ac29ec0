# SPDX-License-Identifier: MIT
"""A stand-in for viser's scene: its ``add_*`` methods make plain objects that hold what they were given."""

from __future__ import annotations

from types import SimpleNamespace


class SceneStandIn:
    """nodes: what was added, by name."""

    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}

    def __getattr__(self, method: str):
        if not method.startswith("add_"):
            raise AttributeError(method)

        def add(name: str, *arguments, **properties) -> SimpleNamespace:
            properties = {"visible": True, "position": (0.0, 0.0, 0.0), **properties}
            if method == "add_line_segments":
                properties["points"] = arguments[0]
            if method == "add_label":
                properties["text"] = arguments[0]
            node = SimpleNamespace(kind=method, arguments=arguments, **properties)
            node.remove = lambda: self.nodes.pop(name)
            self.nodes[name] = node
            return node

        return add
