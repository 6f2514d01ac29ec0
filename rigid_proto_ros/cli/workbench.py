# SPDX-License-Identifier: MIT
"""``rigid_proto workbench``: node and interactive page in one command, until Ctrl-C; what ``make workbench`` runs."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time

from ..base.bundled import scene_names
from ..base.errors import InputError, is_missing
from .options import add_mesh, add_scene

RESTART_S = 3.0
"""[s] A page or node that is killed sooner after its start isn't started again."""

AT_FIRST = ("--open", "--anew")
"""What a page that takes a killed one's place doesn't do again."""


EXAMPLES = (
    ("rigid_proto workbench hammer", "a bundled scene"),
    ("rigid_proto workbench --mesh part.obj", "your own mesh"),
    ("rigid_proto workbench --node /rigid_body", "the page of a running node"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_scene(parser, "scene file or bundled name (default t_handle)", nargs="?")
    add_mesh(parser)
    parser.add_argument("--node", metavar="NAME", help="open the page for a running node of this name")
    parser.add_argument("--link", metavar="LINK", help="open this link, made by a button of the page")
    parser.add_argument(
        "--port", type=int, metavar="PORT", help="port of the page (default 8080, or the next free one)"
    )
    parser.add_argument("--host", metavar="ADDRESS", help="address to serve the page on (default: this machine only)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, open no browser")


def run(args: argparse.Namespace) -> int:
    """Start what is needed and stay."""
    from .processes import check_rclpy

    if importlib.util.find_spec("viser") is None:
        raise InputError("workbench", is_missing("viser", "workbench"))
    check_rclpy("workbench")
    if args.node and (args.scene or args.mesh):
        raise InputError("--node", args.node, "a running node, or a scene to start one with, not both")
    if args.link is not None:
        from ..workbench.link import decode

        decode(args.link)  # a page that isn't open yet has nobody to tell of a refusal
    from ..workbench.upload import sweep

    try:
        return _stay(args)
    finally:
        sweep()  # a page that was killed leaves its uploads


def _stay(args: argparse.Namespace) -> int:
    from ..rerun_view.ports import LOOPBACK
    from ..scene.parameters import Parameters
    from ..workbench.listening import choose_page_port
    from .processes import Processes, own_executable

    scene = args.scene or "t_handle"
    node_arguments, asked = ([], None) if args.node else _node_arguments(scene, args.mesh)
    host = args.host or LOOPBACK
    port = choose_page_port(host, asked if args.port is None else args.port, Parameters().workbench_port)
    page_arguments = ["--port", str(port), "--host", host, "--node", args.node or "/rigid_body"]
    page_arguments += ["--lesson", scene] if not args.mesh and not args.node and scene in scene_names() else []
    page_arguments += ["--link", args.link] if args.link else []
    page_arguments += [] if args.no_browser else ["--open"]
    page_arguments += ["--running"] if args.node else ["--anew"]
    page_command = [*own_executable("workbench"), *page_arguments]
    with Processes() as processes:
        node_command = [*own_executable("rigid_body_node"), *node_arguments]
        node = None if args.node else processes.start(node_command)
        page = processes.start(page_command)
        node_began = page_began = time.monotonic()
        while True:
            time.sleep(0.1)
            if node is not None and node.poll() is not None:
                if node.returncode >= 0 or time.monotonic() < node_began + RESTART_S:
                    return _ended("rigid_body_node", node.returncode)
                # The page has said that it is gone, and finds the next one by its name.
                print(
                    "rigid_proto workbench: the node was killed; a new one was started, at the start of its scene",
                    file=sys.stderr,
                )
                node, node_began = processes.start(node_command), time.monotonic()
            if page.poll() is not None:
                if page.returncode == 2:
                    return 2  # it has said what was refused
                if page.returncode >= 0 or time.monotonic() < page_began + RESTART_S:
                    return _ended("the page", page.returncode)
                # Killed: the body flies on, and the browsers find the next page by themselves.
                print("rigid_proto workbench: the page was killed; a new one was started", file=sys.stderr)
                page_command = [part for part in page_command if part not in AT_FIRST]
                page, page_began = processes.start(page_command), time.monotonic()


def _ended(name: str, status: int) -> int:
    print(f"rigid_proto workbench: {name} ended with status {status}", file=sys.stderr)
    return status if status > 0 else 1


def _node_arguments(scene: str, mesh: str | None) -> tuple[list[str], int | None]:
    """How to start the node, and the page's port where the scene asks for one; what is wrong with it is said before
    anything starts.
    """
    from ..scene.offline import read_scene
    from ..scene.parameters import Parameters
    from ..scene.scene_file import scene_file
    from .processes import text_parameter

    port = read_scene(scene, {"mesh": mesh} if mesh else {}).parameters.workbench_port
    arguments = ["--ros-args", "--params-file", str(scene_file(scene)), *(text_parameter("mesh", mesh) if mesh else [])]
    return arguments, None if port == Parameters().workbench_port else port
