# SPDX-License-Identifier: MIT
"""Scene files: ROS parameter files, read without ROS and typed as rcl types them.

A scene is the file that starts the node with ``--params-file``. A plain scalar is a bool, an integer (also 0x10 and
010), a double (also 1e-3, .inf, nan) or otherwise text. A quoted scalar is text. All items of a list have one type, as
in rcl.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from ..base.bundled import body_names, scene_names, scene_path
from ..base.errors import InputError, MeshError, did_you_mean, printable
from ..base.yaml_text import compose_yaml, key_of, read_text, refused, typed
from ..mesh.assembly import other_formats
from ..mesh.locate import resolve_mesh
from ..mesh.parts import YAML, tells_parts
from ..mesh.reading import FORMATS
from ..parameters.declarations import is_ros_parameter, parameter_named

GONE = re.compile(
    r"(imu_noise\..*|pose_noise\..*|noise\.(gyroscope|accelerometer|position|orientation|(linear|angular)_velocity)"
    r"|noise\.state|noise_seed|step_until|step_periods|frames|initial\.flight)\Z"
)
"""Parameters of earlier versions."""

GONE_DEFAULTS = {"step_periods": 1, "frames": "own"}
"""Their defaults, if not empty or 0."""


def scene_file(name: str) -> Path:
    """Path of a scene given by path or bundled name. Raises InputError, which lists the bundled scenes."""
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


def is_mesh(name: str) -> bool:
    """Whether a scene's name is that of a mesh: a file in a supported format or of parts, by path or package:// URI, or
    a bundled body that has no scene of the same name.
    """
    suffix = Path(name).suffix.lower().lstrip(".")
    if suffix in YAML and Path(name).is_file():
        with suppress(InputError):  # reported by the reader of scenes
            return tells_parts(read_text(Path(name), "a YAML file"))
    if suffix in YAML or not (name.startswith("package://") or Path(name).is_file()):
        return name in body_names() and name not in scene_names()
    return suffix in FORMATS or suffix in other_formats()


def named_values(name: str, warn: Callable[[str], None] = print) -> dict[str, object]:
    """The parameters of a scene, or of a body alone, by path or bundled name. Unknown names as in ``scene_values``."""
    return {"mesh": name} if is_mesh(name) else scene_values(scene_file(name), warn)


@dataclass
class SceneFile:
    """values: the node's parameters by name. wildcard: names that only ``/**`` sections have. has_section: whether any
    section is for the node. unused: the sections that are not.
    """

    values: dict[str, object] = field(default_factory=dict)
    wildcard: set[str] = field(default_factory=set)
    has_section: bool = False
    unused: list[str] = field(default_factory=list)


def read_scene_file(path: str | Path, node_name: str = "rigid_body") -> SceneFile:
    """Read the sections for this node, whose name includes its namespace; later sections override earlier ones. Raises
    InputError, which names file, line and remedy.
    """
    return read_scene_text(read_text(Path(path), "a YAML file"), str(path), node_name)


def read_scene_text(text: str, name: str = "scene", node_name: str = "rigid_body") -> SceneFile:
    """Read a scene from text, as ``read_scene_file`` does. name: for error messages."""
    scene = SceneFile()
    root = compose_yaml(text, name)
    if root is None:
        return scene
    full_name = f"/{node_name.lstrip('/')}"
    named: set[str] = set()
    for section, parameters in _sections(name, root, ""):
        values: dict[str, object] = {}
        lines: dict[str, int] = {}
        for parameter, line, value in _values(name, parameters, ""):
            if parameter in values:
                twice = f"{parameter} twice, here and in line {lines[parameter]}"
                raise InputError(f"{name}, line {line}", twice, "each parameter of a section once")
            values[parameter], lines[parameter] = value, line
        if not _section_form(section).match(full_name):
            scene.unused.append(section)
            continue
        scene.has_section = True
        scene.values.update(values)
        if section != "/**":
            named |= values.keys()
    for parameter in [parameter for parameter in scene.values if GONE.match(parameter)]:
        value = scene.values.pop(parameter)
        # A recorded scene holds all parameters of its version, so those without effect are skipped.
        if any(value) if isinstance(value, list) else value not in (0, "", GONE_DEFAULTS.get(parameter)):
            raise InputError(f"{name}, {parameter}", "a parameter of an earlier version that no longer exists")
    scene.wildcard = scene.values.keys() - named
    return scene


def scene_values(
    path: str | Path, warn: Callable[[str], None] = print, node_name: str = "rigid_body"
) -> dict[str, object]:
    """The parameters that a scene file gives to a node; unknown names as in ``read_scene``. A relative path of a mesh
    is searched from the current folder, then from the scene's folder.
    """
    scene = read_scene_file(path, node_name)
    if not scene.has_section:
        there = ", ".join(scene.unused[:5]) or "none"
        none = f"there is no section for /{node_name.lstrip('/')} (it has {there})"
        warn(printable(f"{path}: {none}; /** is for every node"))
    values: dict[str, object] = {}
    for parameter, value in scene.values.items():
        if is_ros_parameter(parameter):
            continue
        try:
            parameter_named(parameter)
        except InputError as error:
            if parameter not in scene.wildcard:
                raise InputError(f"{path}, {parameter}", error.received, error.accepted) from None
            warn(printable(f"{path}: {parameter} under /** is not a parameter of this node; ignored"))
            continue
        values[parameter] = value
    if isinstance(mesh := values.get("mesh"), str):
        values["mesh"] = mesh_found_from(mesh, Path(path).parent)
    return values


def check_record(names: object) -> None:
    """Check that a scene records only below the working folder, since a stranger may have written it. Raises InputError
    for any other path in its parameter ``record``.
    """
    for name in str(names or "").split(","):
        if not Path(name.strip()).resolve().is_relative_to(Path.cwd()):
            accepted = "a file below the working folder, as a scene names it; the command line names any other one"
            raise InputError("record", name.strip(), accepted)


def mesh_found_from(mesh: str, folder: Path) -> str:
    """The name by which a mesh is found: as the scene file in ``folder`` gives it, or else relative to that folder."""
    for name in (mesh, str(folder / mesh)):
        with suppress(MeshError):
            resolve_mesh(name)
            return name
    return mesh


def _sections(path: str, tree: yaml.Node, namespace: str) -> Iterator[tuple[str, yaml.Node]]:
    """Pairs of a node's name, with the namespaces around it, and the content of its ros__parameters."""
    if not isinstance(tree, yaml.MappingNode):
        raise refused(tree, path, "a mapping such as rigid_body: {ros__parameters: {...}}")
    for key, content in tree.value:
        name = key_of(key, path)
        if name == "ros__parameters" and namespace:
            yield namespace, content
        elif namespace and not isinstance(content, yaml.MappingNode):
            raise refused(key, path, "ros__parameters: under the node's name")
        else:
            yield from _sections(path, content, f"{namespace}/{name.strip('/')}")


def _section_form(name: str) -> re.Pattern[str]:
    """Pattern of the full node names that a section is for: ``*`` stands for one part of a name, ``**`` for any number
    of parts.
    """
    parts = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return re.compile("".join(parts.get(part, f"/{re.escape(part)}") for part in name.split("/")[1:]) + r"\Z")


def typed_value(text: str, name: str) -> object:
    """A value, typed as rcl types it on a command line. Raises InputError for what rcl refuses."""
    node = compose_yaml(text, name)
    if isinstance(node, yaml.SequenceNode):
        return _sequence(name, node)
    if not isinstance(node, yaml.ScalarNode):
        raise InputError(name, text, "a plain value or a list")
    return typed(node)


def _values(path: str, node: yaml.Node, prefix: str) -> Iterator[tuple[str, int, object]]:
    """Name, line and value of each parameter in a mapping; the names of an inner mapping are prefixed with its own."""
    if not isinstance(node, yaml.MappingNode):
        raise refused(node, path, "name: value lines under ros__parameters")
    for key, value in node.value:
        name, line = f"{prefix}{key_of(key, path)}", key.start_mark.line + 1
        if isinstance(value, yaml.MappingNode):
            yield from _values(path, value, f"{name}.")
        elif isinstance(value, yaml.SequenceNode):
            yield name, line, _sequence(path, value)
        elif not value.style and value.value == "":
            raise refused(key, path, f"a value behind {name}:")
        else:
            yield name, line, typed(value)


def _sequence(path: str, node: yaml.SequenceNode) -> list[object]:
    items: list[object] = []
    for item in node.value:
        if isinstance(item, yaml.MappingNode):
            raise refused(item, path, "a list of plain values")
        # rcl flattens nested lists.
        items.extend(_sequence(path, item) if isinstance(item, yaml.SequenceNode) else [typed(item)])
    if len({type(item) for item in items}) > 1:
        raise refused(node, path, "a list of one type: write whole numbers with a point too, as in [0.0, 0.0, -9.81]")
    return items
