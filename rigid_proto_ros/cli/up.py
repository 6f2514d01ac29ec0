# SPDX-License-Identifier: MIT
"""``rigid_proto up``: the node with a live view, until Ctrl-C; ``make up`` runs it."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys

from ..base.errors import InputError, is_missing

EXAMPLES = (
    ("rigid_proto up", "the T-handle, with a live view"),
    ("rigid_proto up hammer --viewer web", "another scene, shown in the browser"),
    ("rigid_proto up hammer --viewer workbench", "with the interactive page alone"),
    ("rigid_proto up part.obj", "your own mesh"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scene", nargs="?", default="t_handle", help="scene file, mesh or bundled name")
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh")
    parser.add_argument(
        "--viewer",
        choices=("auto", "web", "native", "workbench", "none"),
        default="auto",
        help="the live view: Rerun in the browser (web) or in a window (native), or the interactive page (workbench); "
        "auto: native if there is a display, otherwise web, and the page beside it",
    )
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        help="address to serve the page on, 0.0.0.0 for the network (default: this machine only)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the node in this process, so that signals reach it directly."""
    from ..scene.scenario import read_scene
    from ..scene.scene_file import is_mesh, scene_file
    from .executables import as_typed, check_rclpy, text_parameter

    check_rclpy("rigid_body_node")
    overrides = text_parameter("mesh", args.mesh) if args.mesh else []
    alone = is_mesh(args.scene)
    body = text_parameter("mesh", args.scene) if alone else ["--params-file", str(scene_file(args.scene))]
    scenario = read_scene(args.scene, {"mesh": args.mesh} if args.mesh else {})
    viewer = args.viewer
    if viewer == "auto":
        display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        viewer = ("native" if display else "web") + (",workbench" if _has_page() else "")
    # Visible, but not out of sight: 2 cm/s in the 0.05 s of a poke.
    force = f"{0.35 * scenario.setup.body.mass:.1g}"
    at = "com" if args.mesh else next(iter(scenario.setup.contacts), "com")
    client = as_typed("poke_client")
    print(f"Try in another terminal: {client} poke --at {at} --force {force} 0 0   (Ctrl-C ends the node)")
    sys.stdout.flush()
    from ..ros.main import main

    ros_arguments = ["--ros-args", *body, "-p", f"viewer:={viewer}", *overrides]
    if args.host:
        ros_arguments += text_parameter("workbench_host", args.host)
    return main(["rigid_body_node", *ros_arguments], as_job=True)


def _has_page() -> bool:
    """Whether the page can be served; prints the reason if not."""
    from ..page.bundle import built_page

    try:
        if importlib.util.find_spec("websockets") is None:
            raise InputError("page", is_missing("websockets", "workbench"))
        built_page()
    except InputError as error:
        print(f"rigid_proto up: without the interactive page: {error}", file=sys.stderr)
        return False
    return True
