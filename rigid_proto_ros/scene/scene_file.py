# SPDX-License-Identifier: MIT
"""Scene files: ROS parameter files, read without ROS and typed as rcl types them.

A scene is the same file that starts the node with ``--params-file``. Plain scalars are a bool, an integer (also 0x10
and 010), a double (also 1e-3, .inf, nan) or else text; quoted ones are text; a list must hold one type, as rcl wants
it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from ..base.bundled import scene_names, scene_path
from ..base.errors import InputError, did_you_mean
from .yaml_text import compose_yaml, read_text, scalar

KINDS: dict[type[yaml.Node], str] = {yaml.SequenceNode: "list", yaml.MappingNode: "mapping"}
"""What a value is that is no single one, in a refusal."""


GONE = re.compile(
    r"(imu_noise\..*|pose_noise\..*|noise\.(gyroscope|accelerometer|position|orientation|(linear|angular)_velocity)"
    r"|noise_seed|step_until|step_periods|frames|initial\.flight)\Z"
)
"""Parameters of earlier versions."""

GONE_DEFAULTS = {"step_periods": 1, "frames": "own"}
"""Of those among them whose default isn't empty or 0."""


def scene_file(name: str) -> Path:
    """The file of a scene given by path or bundled name; raises InputError naming the bundled ones."""
    path = Path(name)
    if not path.is_file() and "/" not in name and name.removesuffix(".yaml") in scene_names():
        return scene_path(name.removesuffix(".yaml"))
    if not path.exists():
        hint = did_you_mean(Path(name).stem, scene_names())
        known = f"the bundled scenes are {', '.join(scene_names())}"
        raise InputError(
            "scene", f"there is no file and no bundled scene {name!r}; {' '.join(filter(None, [hint, known]))}"
        )
    return path


@dataclass
class SceneFile:
    """values: parameters by name for the node; wildcard: names that only ``/**`` sections gave. has_section: whether
    any section is for the node; unused: the sections that aren't.
    """

    values: dict[str, object] = field(default_factory=dict)
    wildcard: set[str] = field(default_factory=set)
    has_section: bool = False
    unused: list[str] = field(default_factory=list)

    def warning(self, path: str | Path, node_name: str) -> str:
        """What to say of a file that has sections, and none for this node; else empty."""
        if self.has_section or not self.unused:
            return ""
        names = ", ".join(self.unused[:5])
        return f"{path}: no section is for /{node_name.lstrip('/')} (it has {names}); /** is for every node"


def read_scene_file(path: str | Path, node_name: str = "rigid_body") -> SceneFile:
    """Read the sections for this node, given with its namespace, later ones winning; raises InputError naming file,
    line and remedy.
    """
    return _read_sections(compose_yaml(read_text(Path(path), "a YAML file"), str(path)), str(path), node_name)


def read_scene_text(text: str, name: str = "scene", node_name: str = "rigid_body") -> SceneFile:
    """As ``read_scene_file``, from text; ``name`` stands in errors."""
    return _read_sections(compose_yaml(text, name), name, node_name)


def _read_sections(root: yaml.Node | None, path: str, node_name: str) -> SceneFile:
    scene = SceneFile()
    if root is None:
        return scene
    if not isinstance(root, yaml.MappingNode):
        raise _refused(path, root, "a mapping such as rigid_body: {ros__parameters: {...}}")
    full_name = f"/{node_name.lstrip('/')}"
    named: set[str] = set()
    for name, parameters in _sections(path, root, ""):
        values: dict[str, object] = {}
        _collect(path, parameters, "", values)
        # A section without a namespace is for a node of that name in any.
        if name != f"/{full_name.rpartition('/')[2]}" and not _section_form(name).match(full_name):
            scene.unused.append(name)
            continue
        scene.has_section = True
        scene.values.update(values)
        if name != "/**":
            named |= values.keys()
    for name in [name for name in scene.values if GONE.match(name)]:
        value = scene.values.pop(name)
        # A recorded scene holds all parameters of its version: what had no effect is left out.
        if any(value) if isinstance(value, list) else value not in (0, "", GONE_DEFAULTS.get(name)):
            raise InputError(f"{path}, {name}", "a parameter of an earlier version; this one has no such parameter")
    scene.wildcard = scene.values.keys() - named
    return scene


def _sections(path: str, tree: yaml.MappingNode, namespace: str) -> Iterator[tuple[str, yaml.Node]]:
    """The nodes' names, with the namespaces that they are nested in, and what stands under their ros__parameters."""
    for key, section in tree.value:
        name = f"{namespace}/{_name(path, key).strip('/')}"
        if not isinstance(section, yaml.MappingNode):
            raise _refused(path, section, "a section such as rigid_body: {ros__parameters: {...}}")
        for inner, content in section.value:
            if _name(path, inner) == "ros__parameters":
                yield name, content
            elif not isinstance(content, yaml.MappingNode):
                raise _refused(path, inner, "ros__parameters: under the node's name")
        nested = [pair for pair in section.value if _name(path, pair[0]) != "ros__parameters"]
        if nested:
            yield from _sections(path, yaml.MappingNode(section.tag, nested, section.start_mark), name)


def _section_form(name: str) -> re.Pattern[str]:
    """Which full names of nodes a section is for: ``*`` stands for one part of a name, ``**`` for any
    number of them.
    """
    parts = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return re.compile("".join(parts.get(part, f"/{re.escape(part)}") for part in name.split("/")[1:]) + r"\Z")


def typed_value(text: str, name: str) -> object:
    """A value as rcl types it on a command line; raises InputError for what rcl refuses."""
    node = compose_yaml(text, name)
    if isinstance(node, yaml.SequenceNode):
        return _sequence(name, node)
    if not isinstance(node, yaml.ScalarNode):
        raise InputError(name, text, "a plain value or a list")
    return _typed(node)


def _collect(path: str, node: yaml.Node, prefix: str, values: dict[str, object]) -> None:
    if not isinstance(node, yaml.MappingNode):
        raise _refused(path, node, "name: value lines under ros__parameters")
    for key, value in node.value:
        name = f"{prefix}{_name(path, key)}"
        if isinstance(value, yaml.MappingNode):
            _collect(path, value, f"{name}.", values)
        elif isinstance(value, yaml.SequenceNode):
            values[name] = _sequence(path, value)
        elif not value.style and value.value == "":
            raise _refused(path, key, f"a value behind {name}:")
        else:
            values[name] = _typed(value)


def _name(path: str, key: yaml.Node) -> str:
    if not isinstance(key, yaml.ScalarNode):
        raise _refused(path, key, "a name")
    return key.value


def _typed(node: yaml.ScalarNode) -> bool | int | float | str:
    return node.value if node.style else scalar(node.value)


def _sequence(path: str, node: yaml.SequenceNode) -> list:
    items: list[object] = []
    for item in node.value:
        if isinstance(item, yaml.MappingNode):
            raise _refused(path, item, "a list of plain values")
        # rcl reads nested lists as one long list.
        items.extend(_sequence(path, item) if isinstance(item, yaml.SequenceNode) else [_typed(item)])
    if len({type(item) for item in items}) > 1:
        raise _refused(path, node, "a list of one type: write whole numbers with a point too, as in [0.0, 0.0, -9.81]")
    return items


def _refused(path: str, node: yaml.Node, accepted: str) -> InputError:
    received = node.value if isinstance(node, yaml.ScalarNode) else f"a {KINDS[type(node)]}"
    if isinstance(node, yaml.SequenceNode) and all(isinstance(item, yaml.ScalarNode) for item in node.value):
        received = "[" + ", ".join(str(item.value) for item in node.value) + "]"
    # A value from the command line has no lines to count.
    where = path if str(path).startswith("-") else f"{path}, line {node.start_mark.line + 1}"
    return InputError(str(where), received, accepted)
