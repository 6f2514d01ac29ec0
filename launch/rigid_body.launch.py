# SPDX-License-Identifier: MIT
"""One rigid body: the node, and when asked for a poke script and a viewer.

ros2 launch rigid_proto_ros rigid_body.launch.py scene:=hammer script:=/path/to/pokes.yaml viewer:=web publish_rate:=500

Every parameter of the node can be given by its name.
"""

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.logging import get_logger
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = "rigid_proto_ros"

ARGUMENTS = (
    ("scene", "t_handle", "scene: the path of a parameter file, or the name of a bundled one"),
    ("params_file", "", "another parameter file, whose values count before the scene's"),
    ("mesh", "", "simulate this mesh instead of the scene's: a path, a package:// URI or a bundled name"),
    ("name", "rigid_body", "name of the node, and of the body's frame"),
    ("namespace", "", "namespace of the node"),
    ("script", "", "poke script to send: a path, or the name of a bundled one; empty sends nothing"),
    ("reset", "true", "reset first, so that the script's times are simulated time itself"),
    (
        "viewer",
        "",
        "live view: none, web or native (Rerun), workbench (the interactive page), or web,workbench; empty: the scene's",
    ),
    ("record", "", "record to this .mcap file, or show it in this .rrd (Rerun), or both with a comma"),
    ("use_sim_time", "", "true: simulated time follows /clock; empty: as the scene has it"),
    ("log_level", "info", "least severity of what the node logs: debug, info, warn, error or fatal"),
)


def generate_launch_description() -> LaunchDescription:
    """The declared arguments, and the nodes that follow from them."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, description in ARGUMENTS
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    """The body's node, and a poke client where a script is named."""
    # Only here: a launch file is listed on machines on which the package isn't on the path. Only what needs no numba: launch
    # runs with the system's Python, the node with that of its environment.
    from rigid_proto_ros.base.bundled import example_path
    from rigid_proto_ros.scene.scene_file import scene_file

    given = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    parameters = _parameters(context.launch_configurations)
    parameters |= {name: given[name] for name in ("mesh", "viewer") if given[name]}
    if given["use_sim_time"]:
        parameters["use_sim_time"] = given["use_sim_time"].lower() in ("true", "1", "yes")
    target = "/".join(["", *filter(None, [given["namespace"].strip("/"), given["name"]])])
    files = [given["scene"], *filter(None, [given["params_file"]])]
    body = Node(
        package=PACKAGE,
        executable="rigid_body_node",
        name=given["name"],
        namespace=given["namespace"],
        parameters=[
            *(p for file in files for p in _for_node(str(scene_file(file)), target)),
            *filter(None, [parameters]),
        ],
        # On its command line: a file of parameters records only below the working folder.
        ros_arguments=[
            "--log-level",
            given["log_level"],
            *(["-p", f"record:={given['record']}"] if given["record"] else []),
        ],
        output="screen",
        # A client that waits for it would wait for ever.
        on_exit=Shutdown(),
    )
    if not given["script"]:
        return [body]
    script = given["script"]
    if "/" not in script and not Path(script).is_file():
        script = str(example_path(script.removesuffix(".yaml")))
    # The first start compiles for a minute or two: the client waits for as long as it takes.
    options = ["--node", target, "--timeout", "0"]
    if given["reset"].lower() in ("true", "1", "yes"):
        options.append("--reset")
    client = Node(package=PACKAGE, executable="poke_client", arguments=[script, *options], output="screen")
    return [body, client]


def _parameters(given: Mapping[str, str]) -> dict:
    """The node's parameters among what is given by name. Another launch file that includes this one may have set other
    names, so that one which is nearly a parameter's is warned of, and others are left alone.
    """
    from rigid_proto_ros.base.errors import InputError
    from rigid_proto_ros.parameters.declarations import PARAMETERS, parameter_named
    from rigid_proto_ros.scene.scene_file import typed_value

    found = {}
    for name in sorted(given.keys() - {name for name, _, _ in ARGUMENTS}):
        try:
            declared = parameter_named(name)
        except InputError:
            for near in get_close_matches(name, PARAMETERS, n=1, cutoff=0.8):
                get_logger("rigid_body.launch").warning(f"{name}:={given[name]} is no parameter; did you mean {near}?")
            continue
        found[name] = (
            given[name]
            if declared.type == "string"
            else declared.convert(typed_value(given[name], name) if declared.type == "bool" else given[name])
        )
    return found


def _for_node(scene: str, target: str) -> list:
    """The scene as launch takes it: the file, or its values where a node of another name wouldn't find its section;
    what stands in a section for this very node counts before those.
    """
    if target == "/rigid_body":
        return [scene]
    from rigid_proto_ros.scene.scene_file import mesh_found_from, read_scene_file

    own = read_scene_file(scene, target)
    values = {**read_scene_file(scene).values, **{name: own.values[name] for name in own.values.keys() - own.wildcard}}
    if isinstance(values.get("mesh"), str):
        # Launch writes the values to a file elsewhere.
        values["mesh"] = mesh_found_from(values["mesh"], Path(scene).parent)
    return [*filter(None, [values])]
