# SPDX-License-Identifier: MIT
"""``rigid_proto snapshot``: a picture of a recorded flight, without a display."""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
from pathlib import Path

from ..base.command_line import Progress
from ..base.errors import InputError, is_missing

EXAMPLES = (("rigid_proto snapshot out/flight.rrd --at 4 -o out/flight.png", "what the viewer shows at 4 s"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Write a .png of a recording as the viewer shows it at one simulated time. This needs no display, but a Vulkan "
        "driver; the package mesa-vulkan-drivers has one that needs no GPU."
    )
    parser.add_argument("session", metavar="SESSION", help="an .rrd or .mcap recording, or a bag of one body")
    parser.add_argument("--at", metavar="T", type=float, required=True, help="simulated time [s]")
    parser.add_argument("-o", "--output", metavar="X.png", required=True, help="the picture to write")
    parser.add_argument("--size", metavar="WxH", default="1600x900", help="pixels of the picture (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Write the picture; raises InputError for a request that is refused."""
    from ..rerun_view.session_files import is_bag

    # Pillow comes with Rerun.
    for module, package in (("rerun", "rerun-sdk"), ("PIL", "pillow")):
        if importlib.util.find_spec(module) is None:
            raise InputError("snapshot", is_missing(package, "rerun"))
    size = _pixels(args.size, 200)
    if not is_bag(Path(args.session)):
        _draw(args, args.session, size)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        _draw(args, _drawn(args, Path(folder)), size)
    return 0


def _draw(args: argparse.Namespace, recording: str | Path, size: tuple[int, int]) -> None:
    from ..rerun_view.snapshot import take_picture

    with Progress("drawing") as progress:
        take_picture(recording, args.at, args.output, size, progress.fraction)
    print(f"wrote {args.output}")


def _drawn(args: argparse.Namespace, folder: Path) -> Path:
    """The last run of a bag, converted to a recording for the viewer."""
    from ..rerun_view.session_files import read_runs, record
    from ..rerun_view.snapshot import check_picture, check_time

    session = read_runs(args.session)[-1]
    # What is refused is refused before the long work.
    check_time(session, args.at)
    check_picture(args.output)
    path = folder / "session.rrd"
    with Progress("reading the bag") as progress:
        record([session], path, progress=progress.fraction)
    return path


def _pixels(text: str, smallest: int) -> tuple[int, int]:
    """Width and height of --size; raises InputError."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (smallest <= width <= 8000 and smallest <= height <= 8000):
        raise InputError("--size", text, f"WIDTHxHEIGHT in pixels, each {smallest} to 8000")
    return width, height
