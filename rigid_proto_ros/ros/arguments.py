# SPDX-License-Identifier: MIT
"""ROS arguments checked before rcl reads them, so that a slip ends in one line with a remedy and not in a stack of errors."""

from __future__ import annotations

from collections.abc import Callable

from ..core.errors import InputError
from ..parameters import is_ros_parameter, parameter_named
from ..scene_file import compose_text, read_scene_file, scalar


def check_arguments(argv: list[str], node_name: str, warn: Callable[[str], None]) -> None:
    """Check parameter files and ``-p name:=value`` in ``argv``; raises InputError.

    A name that is no parameter is an error with the nearest known one; in a ``/**`` section, which other nodes share, a
    warning.
    """
    for option, value in _ros_options(argv):
        if option == "--params-file":
            scene = read_scene_file(value, node_name)
            for name, given in scene.values.items():
                if is_ros_parameter(name):
                    continue
                try:
                    parameter_named(name)
                except InputError as error:
                    if name not in scene.wildcard:
                        raise InputError(f"{value}, {name}", given, error.accepted) from None
                    warn(f"{value}: {name} under /** is not a parameter of this node; ignored")
        else:
            _check_assignment(value, node_name)


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


def _check_assignment(text: str, node_name: str) -> None:
    left, assigned, value = text.partition(":=")
    if not assigned or not left:
        raise InputError("-p", text, "name:=value")
    node, colon, name = left.rpartition(":")
    if not colon:
        name = left
    elif node.lstrip("/") not in (node_name, "**"):
        return
    if is_ros_parameter(name):
        return
    parameter = parameter_named(name)
    tree = compose_text(value, f"-p {name}")
    if tree is None:
        raise InputError(f"-p {name}", value, parameter.accepted)
    if isinstance(tree.value, list):
        types = {type(scalar(item.value)) for item in tree.value if isinstance(item.value, str)}
        if len(types) > 1:
            raise InputError(
                f"-p {name}", value, "a list of one type: write whole numbers with a point too, as in [0.0, 0.0, -9.81]"
            )
