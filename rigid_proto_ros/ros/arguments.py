# SPDX-License-Identifier: MIT
"""ROS arguments checked before rcl reads them, so that a slip ends in one line with a remedy and not in a stack of errors."""

from __future__ import annotations

from collections.abc import Callable

from ..core.errors import InputError
from ..parameters import is_ros_parameter, parameter_named
from ..scene_file import read_scene_file, typed_value


def given_arguments(argv: list[str], node_name: str, warn: Callable[[str], None]) -> dict[str, object]:
    """The parameters that files and ``-p name:=value`` in ``argv`` give this node, later ones winning; raises InputError.

    rcl reads the same; but where a later value has another type than an earlier one it keeps the earlier one. A name that is no
    parameter is an error with the nearest known one; in a ``/**`` section, which other nodes share, a warning.
    """
    given: dict[str, object] = {}
    for option, text in _ros_options(argv):
        if option == "--params-file":
            scene = read_scene_file(text, node_name)
            for name, value in scene.values.items():
                if is_ros_parameter(name):
                    continue
                try:
                    parameter_named(name)
                except InputError as error:
                    if name not in scene.wildcard:
                        raise InputError(f"{text}, {name}", value, error.accepted) from None
                    warn(f"{text}: {name} under /** is not a parameter of this node; ignored")
                    continue
                given[name] = value
        else:
            assigned = _assignment(text, node_name)
            # As in flight: a density that is set wins over a mass that was there.
            given.update({"mass": 0.0, **assigned} if "density" in assigned else assigned)
    return given


def _ros_options(argv: list[str]) -> list[tuple[str, str]]:
    """Options with a value between ``--ros-args`` and ``--``."""
    found, inside = [], False
    arguments = iter(argv)
    for argument in arguments:
        if argument == "--ros-args":
            inside = True
        elif argument == "--":
            inside = False
        elif inside and argument in ("-p", "--param", "--params-file"):
            value = next(arguments, None)
            if value is None:
                raise InputError(argument, "nothing", "a value behind it")
            found.append(("--params-file" if argument == "--params-file" else "-p", value))
    return found


def _assignment(text: str, node_name: str) -> dict[str, object]:
    left, assigned, value = text.partition(":=")
    if not assigned or not left:
        raise InputError("-p", text, "name:=value")
    node, colon, name = left.rpartition(":")
    if not colon:
        name = left
    elif node.lstrip("/") not in (node_name, "**"):
        return {}
    if is_ros_parameter(name):
        return {}
    parameter = parameter_named(name)
    if not value.strip():
        raise InputError(f"-p {name}", value, parameter.accepted)
    return {name: typed_value(value, f"-p {name}")}
