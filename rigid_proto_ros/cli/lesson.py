# SPDX-License-Identifier: MIT
"""``rigid_proto lesson``: a lesson as one file that opens from disk in a browser."""

from __future__ import annotations

import argparse
import sys

from ..base.command_line import number_from
from ..base.errors import InputError, is_missing
from ..base.files import check_whole_file, whole_file

FPS = 30.0
"""Pictures a second, as they are played."""

EXAMPLES = (("rigid_proto lesson t_handle --html out/t_handle.html", "for a class: open it in a browser"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("name", metavar="NAME", help="a lesson: the name of a bundled scene")
    parser.add_argument("--html", metavar="FILE.html", required=True, help="the file to write")
    parser.add_argument(
        "--duration",
        type=number_from(0.1, 600.0),
        metavar="S",
        help="simulated seconds (default 10, or as many as the lesson needs; for a body that falls, until it is as "
        "high as at first)",
    )


def run(args: argparse.Namespace) -> int:
    """Simulate the lesson's scene, with its script if it has one, and write the file."""
    try:
        from ..workbench.lesson_file import lesson_html
        from ..workbench.lessons import COURSES
        from ..workbench.room import fall_s
    except ImportError:
        raise InputError("--html", is_missing("viser", "workbench")) from None
    from ..base.bundled import example_path
    from ..export.flight_record import FlightRecord, frames, source_of_scene
    from ..scene.lessons import lesson
    from ..scene.scenario import read_scene
    from ..scene.scenario_run import OfflineRun
    from ..scene.script import read_script
    from ..simulation.commands import nanoseconds

    if not args.html.lower().endswith((".html", ".htm")):
        raise InputError("--html", args.html, "a file that ends in .html")
    shown = lesson(args.name)
    check_whole_file("--html", args.html)
    script = read_script(example_path(shown.script)) if shown.script else []
    last_ns = max((command.stamp_ns for command in script), default=0)
    scenario = read_scene(args.name, None, lambda text: print(f"rigid_proto lesson: {text}", file=sys.stderr))
    setup = scenario.setup
    falls = setup.gravity.any() and not setup.scene.string_attached
    duration_ns = max(nanoseconds(fall_s(setup) if falls else shown.duration_s), last_ns + nanoseconds(1.0))
    if args.duration is not None:
        duration_ns = nanoseconds(args.duration)
    record = FlightRecord()
    OfflineRun(scenario, script, record).advance(duration_ns)
    made, _ = frames(record, source_of_scene(scenario, script), FPS / COURSES[shown.name].speed)
    with whole_file("--html", args.html) as path:
        path.write_text(lesson_html(shown, made), encoding="utf-8")
    print(f"{args.html}: {duration_ns / 1e9:g} s of {args.name}; open it in a browser")
    return 0
