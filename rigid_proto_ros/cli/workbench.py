# SPDX-License-Identifier: MIT
"""``rigid_proto workbench``: a body and its interactive page in one process, until Ctrl-C."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import threading
from pathlib import Path

from ..base.errors import InputError, is_missing

EXAMPLES = (
    ("rigid_proto workbench hammer", "a bundled scene"),
    ("rigid_proto workbench --mesh part.obj", "your own mesh"),
    ("rigid_proto workbench hammer --html out/hammer.html", "a page that needs nothing but a browser, as one file"),
    (
        "rigid_proto workbench --script msg_examples/flip_and_poke.yaml --html out/poked.html",
        "the same, and it plays a poke script",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("scene", metavar="SCENE.yaml", nargs="?", help="scene file or bundled name (default t_handle)")
    parser.add_argument(
        "--html",
        metavar="FILE",
        help="write a page in which the scene, or a mesh given in its place, flies without a server",
    )
    parser.add_argument("--script", metavar="SCRIPT.yaml", help="with --html: a poke script that the page plays")
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh")
    parser.add_argument(
        "--port", type=int, metavar="PORT", help="port of the page (default 8080, or the next free one)"
    )
    parser.add_argument("--host", metavar="ADDRESS", help="address to serve the page on (default: this machine only)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C, or write a file."""
    if args.script and not args.html:
        raise InputError("--script", args.script, "with --html; poke_client plays scripts to a running body")
    return _write(args) if args.html else _serve(args)


def _serve(args: argparse.Namespace) -> int:
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


def _write(args: argparse.Namespace) -> int:
    from ..page.file import values_of_mesh, write_page
    from ..scene.scene_file import scene_file, scene_values
    from ..scene.script import read_script

    scene, mesh = args.scene, args.mesh
    if scene and not mesh and not scene.endswith((".yaml", ".yml")) and Path(scene).is_file():
        scene, mesh = None, scene
    script = read_script(args.script) if args.script else []
    values = scene_values(scene_file(scene or "t_handle")) if scene or script and not mesh else None
    if mesh and values is not None:
        values["mesh"] = mesh
    elif mesh:
        values, note = values_of_mesh(mesh)
        if note:
            print(f"rigid_proto workbench: {mesh}: {note}", file=sys.stderr)
    write_page(args.html, values, script)
    print(f"wrote {args.html}: open it in a browser")
    return 0
