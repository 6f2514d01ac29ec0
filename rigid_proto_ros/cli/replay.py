# SPDX-License-Identifier: MIT
"""``rigid_proto replay``: say what a recorded session holds, and check it by computing it anew."""

from __future__ import annotations

import argparse
import sys


def add_parser(subparsers) -> None:
    """Declare the command's arguments."""
    parser = subparsers.add_parser("replay", help="show what a recorded session holds; check it")
    parser.add_argument("session", metavar="SESSION", help="an .rrd recording")
    parser.add_argument("--verify", action="store_true", help="compute it anew; exit 1 at the first difference")
    parser.add_argument("--record", metavar="FILE.rrd", help="write the computed-anew session to a recording")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print what the session holds; with ``--verify`` compare it with a new computation."""
    from ..rerun_view.reader import read_session

    session = read_session(args.session)
    times = session.times
    span = f"{times.min() / 1e9:.9g} s to {times.max() / 1e9:.9g} s" if len(times) else "no time"
    print(f"{args.session}: {len(times)} states, {span}; {len(session.events)} commands and services")
    if not session.complete:
        print(f"  not finished: {session.readable_bytes} of {session.file_bytes} bytes are whole")
    for time_ns, line in session.refusals:
        print(f"  refused at {time_ns / 1e9:.9g} s: {line}")
    if args.record:
        _record(session, args.record)
    print(f"  open it with: rerun {args.record or args.session}")
    if not args.verify:
        return 0
    from ..replay import verify

    difference = verify(session, _progress)
    if difference is None:
        print("  verified: every command and state is the same to the bit")
        return 0
    print(f"rigid_proto replay: {args.session}: {difference}", file=sys.stderr)
    return 1


def _progress(done: float) -> None:
    if sys.stderr.isatty():
        print(f"\r{100 * done:3.0f} % verified", end="\r", file=sys.stderr, flush=True)


def _record(session, path: str) -> None:
    from ..offline import tell_start
    from ..replay import Resimulation, session_scenario
    from ..rerun_view import RerunObserver

    scenario = session_scenario(session)
    observer = RerunObserver(record=path)
    try:
        tell_start(observer, scenario)
        again = Resimulation(scenario, [line for _, line in session.events], observer)
        again.simulation.announce()
        for time_ns in sorted(session.times.tolist()):
            observer.state(time_ns, again.advance(time_ns))
    finally:
        observer.close()
