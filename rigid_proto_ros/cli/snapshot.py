# SPDX-License-Identifier: MIT
"""``rigid_proto snapshot``: a picture of a recorded flight, without a display."""

from __future__ import annotations

import argparse

from ..core.errors import InputError


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add the ``snapshot`` command."""
    parser = subparsers.add_parser(
        "snapshot",
        help="a picture of a recording at one time, without a display",
        description="Write a .png of a recording as the viewer shows it at one simulated time. Needs no display, but a "
        "Vulkan driver; mesa-vulkan-drivers will do.",
    )
    parser.add_argument("session", metavar="SESSION", help="an .rrd recording")
    parser.add_argument("--at", metavar="T", type=float, required=True, help="simulated time [s]")
    parser.add_argument("-o", "--output", metavar="X.png", required=True, help="the picture to write")
    parser.add_argument(
        "--view",
        metavar="NAME",
        default="",
        help="a tab of the layout (Lesson, Debugging, Plain), or one of its views alone, such as Flight",
    )
    parser.add_argument("--size", metavar="WxH", default="1600x900", help="pixels of the whole layout (%(default)s)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Take the picture; InputError says what was wrong with the request."""
    from ..rerun_view.snapshot import take_picture

    take_picture(args.session, args.at, args.output, args.view, _size(args.size))
    return 0


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (200 <= width <= 8000 and 200 <= height <= 8000):
        raise InputError("--size", text, "WIDTHxHEIGHT in pixels, each 200 to 8000")
    return width, height
