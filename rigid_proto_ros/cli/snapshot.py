# SPDX-License-Identifier: MIT
"""``rigid_proto snapshot``: a picture of a recorded flight, without a display."""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.command_line import Progress
from ..base.errors import InputError, is_missing

if TYPE_CHECKING:
    from ..session.recorded_session import States

EXAMPLES = (("rigid_proto snapshot out/flight.mcap --at 4 -o out/flight.png", "what the viewer shows at 4 s"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Write a .png of a recording as the viewer shows it at one simulated time. This needs no display, but a Vulkan "
        "driver; the package mesa-vulkan-drivers has one that needs no GPU."
    )
    parser.add_argument("session", metavar="SESSION", help="an .mcap recording, or a bag of one body")
    parser.add_argument("--at", metavar="T", type=float, required=True, help="simulated time [s]")
    parser.add_argument("-o", "--output", metavar="X.png", required=True, help="the picture to write")
    parser.add_argument("--size", metavar="WxH", default="1600x900", help="pixels of the picture (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Write the picture. Raises InputError for a request that is refused."""
    # Rerun installs Pillow.
    for module, package in (("rerun", "rerun-sdk"), ("PIL", "pillow")):
        if importlib.util.find_spec(module) is None:
            raise InputError("snapshot", is_missing(package, "rerun"))
    from ..rerun_view.recorders import record
    from ..rerun_view.snapshot import check_picture, take_picture
    from ..session.bag import read_runs

    size = _pixels(args.size, 200)
    session = read_runs(args.session)[-1]
    # Refuse before the long work.
    _check_time(session.states, args.at)
    check_picture(args.output)
    with tempfile.TemporaryDirectory() as folder:
        view = Path(folder) / "session.rrd"
        with Progress("reading the session") as progress:
            record([session], view, progress=progress.fraction)
        with Progress("drawing") as progress:
            take_picture(view, args.at, args.output, size, progress.fraction)
    print(f"wrote {args.output}")
    return 0


def _check_time(states: States, at_s: float) -> None:
    """Raises InputError unless there are states around ``at_s``."""
    if not states.count:
        raise InputError("session", "the recording has no states")
    begin, end = 1e-9 * states.first_ns, 1e-9 * states.end_ns
    if not begin <= at_s <= end:
        raise InputError("--at", at_s, f"a time within the recording, {begin:g} to {end:g} s")


def _pixels(text: str, smallest: int) -> tuple[int, int]:
    """Width and height of --size [pixels]. Raises InputError."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (smallest <= width <= 8000 and smallest <= height <= 8000):
        raise InputError("--size", text, f"WIDTHxHEIGHT in pixels, each {smallest} to 8000")
    return width, height
