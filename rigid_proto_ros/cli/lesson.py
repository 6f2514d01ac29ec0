# SPDX-License-Identifier: MIT
"""``rigid_proto lesson``: the page as one file that opens in a lesson."""

from __future__ import annotations

import argparse

from ..base.errors import InputError

EXAMPLES = (("rigid_proto lesson t_handle --html out/t_handle.html", "for a class: open it in a browser"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("name", metavar="NAME", help="a lesson: the name of a bundled scene")
    parser.add_argument("--html", metavar="FILE.html", required=True, help="the file to write")


def run(args: argparse.Namespace) -> int:
    """Write the file."""
    from ..page.file import write_page
    from ..scene.lessons import lesson

    if not args.html.lower().endswith((".html", ".htm")):
        raise InputError("--html", args.html, "a file that ends in .html")
    write_page(args.html, begins=f"lesson={lesson(args.name).name}")
    print(f"wrote {args.html}: open it in a browser")
    return 0
