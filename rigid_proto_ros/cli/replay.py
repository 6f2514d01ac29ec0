# SPDX-License-Identifier: MIT
"""``rigid_proto replay``: show, verify, repair, convert, branch or publish a recorded session."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.command_line import Progress, number_from
from ..base.errors import InputError, printable
from ..base.files import check_whole_file, check_writable, is_same_file, whole_file
from .exports import add_exports, asked, check_exports, write_exports

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..scene.scenario import Scenario
    from ..session.check import Difference
    from ..session.recorded_session import RecordedSession

EXAMPLES = (
    ("rigid_proto replay out/flight.mcap --verify", "repeat the simulation, and compare every state bit for bit"),
    ("rigid_proto replay out/flight.mcap --record out/seen.rrd", "draw it for Rerun"),
    (
        "rigid_proto replay out/flight.mcap --at 4 --as-scene out/branch.yaml",
        "the scene at 4 s, to continue with changes",
    ),
    ("rigid_proto replay out/flight.mcap --as-scene out/take.yaml", "all of it as a scene and a poke script"),
    ("rigid_proto replay out/flight.mcap --publish states --speed 20", "publish its states over ROS, 20 times as fast"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "session", metavar="SESSION", help="an .mcap recording, or a bag of ros2 bag record (file or folder)"
    )
    parser.add_argument("--scene", metavar="FILE", help="the scene, for a bag without one")
    parser.add_argument(
        "--node",
        metavar="NAME",
        default="",
        help="the node that gets the commands, or the body in a bag with several bodies",
    )
    parser.add_argument(
        "--verify", action="store_true", help="repeat the simulation and compare; exit 1 at the first difference"
    )
    parser.add_argument(
        "--record", metavar="FILE", help="draw the session into an .rrd (for Rerun), or write it anew as .mcap"
    )
    parser.add_argument(
        "--repair", metavar="FILE", help="write a readable file with the complete part of a damaged session"
    )
    parser.add_argument("--at", type=number_from(0.0, 1e9), metavar="T", help="simulated time [s], for --as-scene")
    parser.add_argument(
        "--as-scene",
        metavar="FILE.yaml",
        help="write the session as a scene and a poke script, FILE_script.yaml; with --at, a scene that starts at that "
        "time, and a script of the loads that act then",
    )
    parser.add_argument("--publish", choices=("states", "commands"), help="publish the session over ROS")
    parser.add_argument(
        "--speed", type=number_from(1e-6, 1e6), metavar="X", help="speed factor of --publish states (default 1)"
    )
    add_exports(parser)


def run(args: argparse.Namespace) -> int:
    """Print a summary of the session and carry out the options."""
    if args.at is not None and args.as_scene is None:
        raise InputError("--at", "needs --as-scene FILE.yaml")
    if args.speed is not None and args.publish != "states":
        raise InputError("--speed", "needs --publish states; a running node has real_time_factor")
    for file in _recorded(args.record or ""):
        _check_place("--record", file, args.session, check_writable)
    _check_place("--as-scene", args.as_scene, args.session, check_whole_file)
    check_exports(args)
    from ..session.bag import read_runs, repair

    if args.repair:
        repair(Path(args.session), Path(args.repair))
    runs = read_runs(args.session, "" if args.publish == "commands" else args.node)
    given = _given_scene(args.scene, runs[-1])
    for number, session in enumerate(runs, 1):
        _print_session(args.session if len(runs) == 1 else f"{args.session}, run {number} of {len(runs)}", session)
    if args.record:
        from ..rerun_view.recorders import record

        with Progress(f"recording {args.record}") as progress:
            record(runs, args.record, given, progress.fraction)
    if asked(args):
        _export(runs, args, given)
    if args.as_scene:
        _save_scene(runs[-1], args, given)
    status = _verify(runs, args) if args.verify else 0
    if status == 0 and args.publish:
        status = _publish(runs[-1], args)
    return status


def _check_place(option: str, file: str | None, session: str, check: Callable[[str, str], None]) -> None:
    """Check before long work that a file can be written and that it isn't the session."""
    if file and is_same_file(file, session):
        raise InputError(option, file, "another file than the session")
    if file:
        check(option, file)


def _recorded(names: str) -> list[str]:
    from ..rerun_view.recorders import recording_names

    return recording_names(names)


def _print_session(name: str, session: RecordedSession) -> None:
    states = session.states
    span = f"{states.first_ns / 1e9:.9g} s to {states.end_ns / 1e9:.9g} s" if states.count else "no time"
    print(f"{name}: {states.count} states, {span}; {len(session.events)} commands and services")
    if not session.complete:
        print("  truncated: read up to where it was cut")
    if session.missing:
        print(printable(f"  without {', '.join(session.missing)}"))
    if session.accuracy_floor:
        print(printable(f"  the accuracy asked for is not held throughout: {session.accuracy_floor}"))


def _verify(runs: list[RecordedSession], args: argparse.Namespace) -> int:
    from ..session.check import NotVerifiableError, verify

    verified = 0
    for number, session in enumerate(runs, 1):
        which = f"run {number}: " if len(runs) > 1 else ""
        try:
            with Progress("verifying") as progress:
                difference = verify(session, progress.fraction)
        except NotVerifiableError as error:
            # The part before the first reset can't be checked; the parts after it can.
            if number == len(runs) and not verified:
                raise
            print(f"  {which}not checked: {error.received}")
            continue
        if difference is not None:
            print(printable(f"rigid_proto replay: {args.session}: {which}{difference}"), file=sys.stderr)
            if not difference.tampered:
                _print_difference(difference, session)
            return 1
        verified += 1
    print("  verified: every command and state is reproduced bit for bit")
    return 0


def _export(runs: list[RecordedSession], args: argparse.Namespace, given: Scenario | None) -> None:
    from ..export.flight_record import FlightRecord, source_of_session
    from ..session.recorded_session import play

    session, record = runs[-1], FlightRecord()
    with Progress("reading the motion") as progress:
        play(session, record, given, progress.fraction)
    if len(runs) > 1:
        print(f"  exported is run {len(runs)}, the last")
    write_exports(args, record, source_of_session(session, given), lambda text: print(f"  {text}"))


def _print_difference(difference: Difference, session: RecordedSession) -> None:
    """Print the last command before a difference, and how the environments of recording and replay differ."""
    from ..session.check import made_with_table

    if difference.command:
        print(printable(f"  before it acted {difference.command}"), file=sys.stderr)
    table = made_with_table(session)
    if not table:
        print("  the recording doesn't say what it was made with", file=sys.stderr)
    for name, was, here in table:
        if was != here:
            print(printable(f"  {name} differs: {was} recorded, {here} here"), file=sys.stderr)


def _given_scene(path: str | None, session: RecordedSession) -> Scenario | None:
    """The scene in a file that is given for a session without a scene; None without a file. Raises InputError if the
    session has its own scene.
    """
    if not path:
        return None
    if not session.missing:
        raise InputError("--scene", path, "no scene: the session has its own")
    from ..scene.scenario import read_scene

    return read_scene(path, None, lambda text: print(f"rigid_proto: {text}", file=sys.stderr))


def _save_scene(session: RecordedSession, args: argparse.Namespace, given: Scenario | None) -> None:
    from ..session.as_script import branch_at, recorded_branch, script_of_session
    from ..simulation.commands import nanoseconds

    if session.missing and (given is None or args.at is None):
        accepted = "one that has them" + (", or its scene by --scene FILE" if args.at is not None else "")
        raise InputError("--as-scene", f"a recording without {', '.join(session.missing)}", accepted)
    if args.at is None:
        saved, what = script_of_session(session), "scene and script"
    elif given is None:
        saved, what = branch_at(session, nanoseconds(args.at)), f"scene at {args.at:g} s"
    else:
        saved, state_ns = recorded_branch(session, given, nanoseconds(args.at))
        what = f"scene at {args.at:g} s"
        print(f"  the state is that recorded at {state_ns / 1e9:.9g} s; what acts then isn't recorded")
    scene = Path(args.as_scene)
    script = scene.with_name(f"{scene.stem}_script.yaml")
    for file, text in ((scene, saved.scene), (script, saved.script)):
        with whole_file("--as-scene", file) as path:
            path.write_text(text, encoding="utf-8")
    words = ["rigid_proto", "simulate", str(scene), "--script", str(script)]
    print(f"  {what}: {shlex.join(words)}")


def _publish(session: RecordedSession, args: argparse.Namespace) -> int:
    from .executables import check_rclpy

    check_rclpy("--publish")
    from ..ros import replay_publisher

    if args.publish == "states":
        return replay_publisher.publish_states(session, args.speed or 1.0)
    return replay_publisher.publish_commands(session, args.node or f"/{session.node_name}")
