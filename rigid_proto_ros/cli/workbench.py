# SPDX-License-Identifier: MIT
"""``rigid_proto workbench``: a body and its interactive page in one process, until Ctrl-C."""

from __future__ import annotations

import argparse
import importlib.util
import threading

from ..base.errors import InputError, is_missing

EXAMPLES = (
    ("rigid_proto workbench hammer", "a bundled scene"),
    ("rigid_proto workbench --mesh part.obj", "your own mesh"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scene", metavar="SCENE.yaml", nargs="?", help="scene file or bundled name (default t_handle)")
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh")
    parser.add_argument(
        "--port", type=int, metavar="PORT", help="port of the page (default 8080, or the next free one)"
    )
    parser.add_argument("--host", metavar="ADDRESS", help="address to serve the page on (default: this machine only)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    if importlib.util.find_spec("viser") is None:
        raise InputError("workbench", is_missing("viser", "workbench"))
    from ..parameters.declarations import Parameters
    from ..rerun_view.ports import LOOPBACK
    from ..scene.scenario import make_scenario
    from ..scene.scene_file import check_record, scene_file, scene_values
    from ..workbench.main import serve

    scene = args.scene or "t_handle"
    values = {**scene_values(scene_file(scene)), **({"mesh": args.mesh} if args.mesh else {})}
    check_record(values.get("record"))
    port = args.port
    asked = Parameters().replaced(values).workbench_port
    if port is None and asked != Parameters().workbench_port:
        port = asked
    name = "" if args.mesh else scene
    wait = threading.Event().wait  # until a signal interrupts it
    serve(lambda: make_scenario(values), name, port, args.host or LOOPBACK, not args.no_browser, wait)
    return 0
