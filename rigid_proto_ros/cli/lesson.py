# SPDX-License-Identifier: MIT
"""``rigid_proto lesson``: write the page as one file that opens in a lesson or with a given mesh in flight."""

from __future__ import annotations

import argparse
import sys

from ..base.errors import InputError

EXAMPLES = (
    ("rigid_proto lesson t_handle --html out/t_handle.html", "for a class: open it in a browser"),
    ("rigid_proto lesson part.obj --html out/part.html", "your own mesh, without a question"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("name", metavar="NAME", help="a lesson: the name of a bundled scene; or a mesh file")
    parser.add_argument("--html", metavar="FILE.html", required=True, help="the file to write")


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from ..page.file import values_of_mesh, write_page
    from ..scene.lessons import lesson
    from ..scene.scene_file import is_mesh

    if not args.html.lower().endswith((".html", ".htm")):
        raise InputError("--html", args.html, "a file that ends in .html")
    if is_mesh(args.name):
        values, note = values_of_mesh(args.name)
        if note:
            print(f"rigid_proto lesson: {args.name}: {note}", file=sys.stderr)
        write_page(args.html, values)
    else:
        write_page(args.html, begins=f"lesson={lesson(args.name).name}")
    print(f"wrote {args.html}: open it in a browser")
    return 0
