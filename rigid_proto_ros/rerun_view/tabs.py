# SPDX-License-Identifier: MIT
"""Finding a view of a running viewer by its name, and bringing it to the front of its tabs."""

from __future__ import annotations

from typing import Any

from ..base.errors import InputError


def bring_to_front(client: Any, name: str) -> str | None:
    """The id of the view of this name, in front now; None for a name of a whole tab, such as ``Lesson``.

    Case doesn't matter; of views with equal names that of the tab in front comes first. Raises InputError with the
    names there are.
    """
    blueprint = client.get_blueprint(of="recording").blueprint
    views = {f"view/{view.view_id}": view.name for view in client.get_state().views}
    found = _walk(blueprint, f"container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}", views, ())
    path = next((path for path, called in found if called.lower() == name.strip().lower()), None)
    if path is None:
        raise InputError("--view", name, "one of " + ", ".join(sorted({called for _, called in found})))
    for parent, child in zip(path[:-1], path[1:], strict=True):
        container = blueprint["/" + parent]["ContainerBlueprint"]
        if container["container_kind"] == "Tabs":
            container["active_tab"] = child
    client.set_blueprint(blueprint, of="recording")
    return path[-1].removeprefix("view/") if path[-1] in views else None


def _walk(
    blueprint: dict, node: str, views: dict[str, str], above: tuple[str, ...]
) -> list[tuple[tuple[str, ...], str]]:
    """(path from the root, name) of everything that has a name at or below ``node``, what is in front first."""
    path = (*above, node)
    if node in views:
        return [(path, views[node])]
    container = blueprint.get("/" + node, {}).get("ContainerBlueprint", {})
    found = [(path, container["display_name"])] if "display_name" in container else []
    contents = container.get("contents", [])
    for child in sorted(contents, key=lambda child: child != container.get("active_tab")):
        found += _walk(blueprint, child, views, path)
    return found
