# SPDX-License-Identifier: MIT
"""``rigid_proto workbench``: the page on a scene or mesh, served until Ctrl-C or written as one file."""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import threading
import webbrowser
from typing import Any

from ..base.errors import InputError, is_missing

EXAMPLES = (
    ("rigid_proto workbench hammer", "a bundled scene"),
    ("rigid_proto workbench part.obj", "your own mesh"),
    ("rigid_proto workbench hammer --html out/hammer.html", "as one file, which needs nothing but a browser"),
    ("rigid_proto workbench --script msg_examples/flip_and_poke.yaml", "the page plays a poke script"),
    ("rigid_proto workbench --host 0.0.0.0", "for a class: whoever opens it has a body of their own"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "scene", metavar="SCENE", nargs="?", help="scene file, bundled name or mesh file (default: t_handle)"
    )
    parser.add_argument("--script", metavar="SCRIPT.yaml", help="a poke script that the page plays")
    parser.add_argument("--html", metavar="FILE", help="write the page as a file, and serve nothing")
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh")
    parser.add_argument(
        "--port", type=int, metavar="PORT", help="port of the page (default 8080, or the next free one)"
    )
    parser.add_argument("--host", metavar="ADDRESS", help="address to serve the page on (default: this machine only)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C, or write a file."""
    from ..page.file import page_text, write_page
    from ..scene.script import read_script

    script = read_script(args.script) if args.script else []
    values = _values(args.scene, args.mesh, bool(script))
    if args.html:
        write_page(args.html, values, script)
        print(f"wrote {args.html}: open it in a browser")
        return 0
    if importlib.util.find_spec("websockets") is None:
        raise InputError("workbench", is_missing("websockets", "workbench"))
    from ..base.ports import LOOPBACK
    from ..page.server import serve_page, show_code
    from ..parameters.declarations import Parameters

    page, default = page_text(values, script).encode(), Parameters().workbench_port
    own, others = serve_page(page, args.port, default, args.host or LOOPBACK)
    print(f"The workbench is at {own}   (Ctrl-C ends it)", flush=True)
    if others:
        print(f"Others open {others}: each has a body of their own, and nothing of this machine", flush=True)
        show_code(others)
    if not args.no_browser and _has_display():
        webbrowser.open(own)
    threading.Event().wait()  # until a signal interrupts it
    return 0


def _values(scene: str | None, mesh: str | None, has_script: bool) -> dict[str, Any] | None:
    """The parameters with which the page starts; None for its default."""
    from ..page.file import values_of_mesh
    from ..scene.scene_file import is_mesh, scene_file, scene_values

    if scene and not mesh and is_mesh(scene):
        scene, mesh = None, scene
    if has_script and not (scene or mesh):
        scene = "t_handle"
    values = scene_values(scene_file(scene)) if scene else None
    if mesh and values is not None:
        values["mesh"] = mesh
    elif mesh:
        values, note = values_of_mesh(mesh)
        if note:
            print(f"rigid_proto workbench: {mesh}: {note}", file=sys.stderr)
    return values


def _has_display() -> bool:
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
