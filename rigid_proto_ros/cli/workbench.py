# SPDX-License-Identifier: MIT
"""``rigid_proto workbench``: node and interactive page in one command, until Ctrl-C; what ``make workbench`` runs."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time

from ..core.errors import InputError


def add_parser(subparsers) -> None:
    """Declare the command's arguments."""
    parser = subparsers.add_parser("workbench", help="node and interactive page, until Ctrl-C")
    parser.add_argument("scene", nargs="?", metavar="SCENE.yaml", help="scene file or bundled name (t_handle)")
    parser.add_argument("--mesh", metavar="PATH", help="fly this mesh")
    parser.add_argument("--node", metavar="NAME", help="show the node of this name, which runs already")
    parser.add_argument("--port", type=int, metavar="PORT", help="of the page (8080, or the next free one)")
    parser.add_argument("--host", metavar="ADDRESS", help="that the page is served on (this machine only)")
    parser.add_argument("--no-browser", action="store_true", help="only say the address")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Start what is needed and stay."""
    if importlib.util.find_spec("viser") is None:
        raise InputError("workbench", "no viser", "its package: pip install 'viser>=1.1,<1.2' (extra [workbench])")
    if args.node and (args.scene or args.mesh):
        raise InputError("--node", args.node, "a running node, or a scene to start one with, not both")
    from ..offline import read_scene, scene_file
    from ..parameters import PARAMETERS
    from ..rerun_view.ports import LOOPBACK, choose_port
    from .processes import Processes, own_executable

    port = choose_port("--port", args.port, PARAMETERS["workbench_port"].default)
    node_arguments: list[str] = []
    if not args.node:
        overrides = {"mesh": args.mesh} if args.mesh else {}
        scene = args.scene or "t_handle"
        read_scene(scene, overrides)  # what is wrong with it is said before anything starts
        node_arguments = ["--ros-args", "--params-file", str(scene_file(scene))]
        node_arguments += ["-p", f"mesh:={args.mesh}"] if args.mesh else []
    with Processes() as processes:
        running = []
        if not args.node:
            running.append(processes.start([*own_executable("rigid_body_node"), *node_arguments]))
        host = args.host or LOOPBACK
        page_arguments = ["--port", str(port), "--host", host, "--node", args.node or "/rigid_body"]
        page_arguments += [] if args.no_browser else ["--open"]
        page = processes.start([*own_executable("workbench"), *page_arguments])
        running.append(page)
        while all(process.poll() is None for process in running):
            time.sleep(0.2)
        ended = next(process for process in running if process.poll() is not None)
        name = "the page" if ended is page else "rigid_body_node"
        print(f"rigid_proto workbench: {name} ended with status {ended.returncode}", file=sys.stderr)
        return ended.returncode or 1
