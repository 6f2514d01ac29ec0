# SPDX-License-Identifier: MIT
"""The node's command line, parsed before rcl parses it, so that a mistake gives one line with a remedy instead of a
stack of errors; and the initialization of rclpy with the remaining arguments.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable, Iterator

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ..base.command_line import Parser, number_from
from ..base.errors import InputError
from ..parameters.declarations import PARAMETERS, PATTERNS, is_ros_parameter, parameter_named, with_mass_of_density
from ..scene.scene_file import check_record, scene_values, typed_value
from ..scene.script import MAX_TIME_S

NODE_NAME = "rigid_body"

EXAMPLES = (
    ("rigid_body_node", "simulate the bundled T-handle"),
    ("rigid_body_node --ros-args --params-file config/hammer.yaml -p viewer:=web", "a scene, with a live view"),
    ("rigid_body_node --ros-args -p mesh:=part.obj -p scale:=0.001 -r __node:=part", "a mesh in mm, as the node /part"),
)


def own_arguments(argv: list[str]) -> argparse.Namespace:
    """``until``: seconds, or None. Any other argument outside ``--ros-args ... [--]`` ends the process: --help with
    status 0, an unknown option with status 2 and the nearest known option. Raises InputError for options inside that
    rcl doesn't know or can't read; ``given_arguments`` gives better messages about parameters.
    """
    parser = Parser(
        prog="rigid_body_node",
        usage="rigid_body_node [--until S] [--ros-args [--params-file SCENE.yaml] [-p NAME:=VALUE] ...]",
        description="Simulate a rigid body as a ROS 2 node until Ctrl-C. A scene is a ROS parameter file.",
        examples=EXAMPLES,
    )
    seconds = number_from(1e-9, MAX_TIME_S)
    parser.add_argument("--until", type=seconds, metavar="S", help="end when simulated time reaches this many seconds")
    for word in argv[1 : argv.index("--ros-args")] if "--ros-args" in argv else argv[1:]:
        if ":=" in word and word.partition(":=")[0] in PARAMETERS:
            # rcl would take it as a remapping of a topic.
            raise InputError(word, f"not an option; a parameter is given by --ros-args -p {word}")
    try:
        own = remove_ros_args(argv)[1:]
    except Exception as error:  # rclpy's own error types differ between versions
        accepted = "--params-file FILE, -p NAME:=VALUE, -r FROM:=TO and other ROS 2 arguments"
        raise InputError("--ros-args", " ".join(str(error).split()), accepted) from None
    if "-h" in own or "--help" in own:
        parser.epilog = f"{_parameter_help()}\n\n{parser.epilog}"
    if own and not any(word.startswith("-") for word in own):
        raise InputError(own[0], f"not an option; a scene is given by --ros-args --params-file {own[0]}")
    return parser.parse_args(own)


def begin_ros(argv: list[str]) -> None:
    """Initialize rclpy without its signal handlers, because rclpy must still work while everything else is closed after
    a signal. Raises InputError for arguments that rclpy refuses.
    """
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy's own error types differ between versions
        raise InputError("ROS arguments", " ".join(str(error).split())) from None


def _parameter_help() -> str:
    """The parameters as --help lists them."""
    lines = ["parameters (-p NAME:=VALUE, or in a scene):"]
    for parameter in (*PARAMETERS.values(), *PATTERNS.values()):
        default = "" if parameter.default is None else f" (default {parameter.default!r})"
        unit = f" [{parameter.unit}]" if parameter.unit else ""
        text = f"{parameter.description.rstrip('.')}{unit}{default}"
        lines.append(f"  {parameter.name}")
        lines += textwrap.wrap(text, 100, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)


def given_arguments(argv: list[str], node_name: str, warn: Callable[[str], None]) -> dict[str, object]:
    """The parameters of this node from files and ``-p name:=value`` in ``argv``; later values override earlier ones.
    Raises InputError.

    A parameter file may record only below the working folder. rcl reads the same arguments, but if a later value has
    another type than an earlier one, rcl keeps the earlier one. An unknown name is an error that gives the nearest
    known name; in a ``/**`` section, which other nodes share, it is a warning.
    """
    given: dict[str, object] = {}
    recorded: object = ""
    for option, text in _ros_options(argv):
        if option == "--params-file":
            in_file = scene_values(text, warn, node_name)
            recorded = in_file.get("record", recorded)
            given.update(in_file)
        elif option in ("-p", "--param"):
            assigned = _assignment(text, node_name)
            recorded = "" if "record" in assigned else recorded
            given.update(with_mass_of_density(assigned))
    check_record(recorded)
    return given


def _ros_options(argv: list[str]) -> Iterator[tuple[str, str]]:
    """Options with a value between ``--ros-args`` and ``--``."""
    inside = False
    arguments = iter(argv)
    for argument in arguments:
        if argument in ("--ros-args", "--"):
            inside = argument == "--ros-args"
        elif inside and argument in ("-p", "--param", "--params-file", "-r", "--remap"):
            value = next(arguments, None)
            if value is None:
                raise InputError(argument, "needs a value")
            yield argument, value


def _assignment(text: str, node_name: str) -> dict[str, object]:
    left, assigned, value = text.partition(":=")
    if not assigned or not left:
        raise InputError("-p", text, "name:=value")
    node, colon, name = left.rpartition(":")
    if not colon:
        name = left
    elif node.lstrip("/") not in (node_name.lstrip("/"), node_name.rpartition("/")[2], "**"):
        return {}
    if is_ros_parameter(name):
        return {}
    parameter = parameter_named(name)
    if not value.strip():
        raise InputError(f"-p {name}", value, parameter.accepted)
    return {name: typed_value(value, f"-p {name}")}


def remapped_node_name(argv: list[str], name: str = NODE_NAME) -> str:
    """The node's name, prefixed by its namespace if any, after ``-r __node:=name`` and ``-r __ns:=/namespace``. As in
    rcl, the first such rule applies, and a rule that starts with a node's name applies to that node only.
    """
    new: dict[str, str] = {}
    for option, text in _ros_options(argv):
        left, _, right = text.partition(":=")
        node, _, rule = left.rpartition(":")
        if option in ("-r", "--remap") and node in ("", name) and rule in ("__node", "__name", "__ns"):
            new.setdefault("namespace" if rule == "__ns" else "name", right)
    namespace, name = new.get("namespace", "").strip("/"), new.get("name", name)
    return f"{namespace}/{name}" if namespace else name
