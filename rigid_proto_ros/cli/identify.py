# SPDX-License-Identifier: MIT
"""``rigid_proto identify``: estimate mass properties from recorded motion, and say which of them the motion
determines.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError, is_missing
from ..mass.properties import MassProperties

if TYPE_CHECKING:
    from ..identify.bag_reading import Choice
    from ..identify.measurements import MeasuredFlight
    from ..scene.scenario import Scenario

EXAMPLES = (
    ("rigid_proto identify out/flight.mcap", "mass properties from a recording, and which of them it identifies"),
    ("rigid_proto identify throws/*.mcap --mass 1.2 --urdf", "several throws of a weighed body, as a URDF <inertial>"),
    (
        "rigid_proto identify rov.mcap --pose /odom --wrench /thrusters@base_link --fit mass,com,inertia,damping",
        "a bag of another robot",
    ),
)
SENSORS = {"pose": "[@CHILD]", "imu": "", "wrench": "[@FRAME]"}
"""Options that choose among several topics of a bag, and what may follow the topic's name."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "sessions", nargs="+", metavar="SESSION", help="recordings of this package (.mcap), or bags of ROS 2 or 1"
    )
    parser.add_argument("--mass", type=float, metavar="M", help="the mass [kg], if it is known")
    for sensor, frame in SENSORS.items():
        parser.add_argument(f"--{sensor}", metavar=f"TOPIC{frame}", help=f"the {sensor} topic of a bag")
    parser.add_argument(
        "--gravity", type=float, nargs=3, metavar=("X", "Y", "Z"), help="[m/s²] (default: the scene's, or 0 0 -9.81)"
    )
    parser.add_argument(
        "--from", type=float, default=0.0, dest="first", metavar="S", help="use samples from this time on [s]"
    )
    parser.add_argument(
        "--to", type=float, default=math.inf, dest="last", metavar="S", help="use samples up to this time [s]"
    )
    parser.add_argument(
        "--fit",
        default="mass,com,inertia",
        metavar="LIST",
        help="what to estimate: mass,com,inertia (default), damping, gravity, offset, gyro_bias, accel_bias, imu_place",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--urdf", action="store_true", help="print a URDF <inertial>")


def run(args: argparse.Namespace) -> int:
    """Read the recordings, estimate the mass properties and print them."""
    try:
        from ..identify.identification import Known, as_json, as_text, as_urdf, identify
    except ImportError as error:
        package = str(error.name).partition(".")[0]
        raise InputError("identify", is_missing(package, "identify")) from None
    choice = _choice(args)
    flights, scenes = _flights(args.sessions, choice)
    known = Known(args.mass)
    if scenes:
        setup = scenes[0].setup
        body = MassProperties(setup.body.mass, setup.body.center_of_mass, setup.body.inertia)
        known = replace(known, body=body, length=setup.length)
    found = identify(flights, [word.strip() for word in args.fit.split(",") if word.strip()], known)
    if args.json:
        print(json.dumps(as_json(found)))
    elif args.urdf:
        print(as_urdf(found), end="")
    else:
        print("\n".join(as_text(found)))
    return 0


def _choice(args: argparse.Namespace) -> Choice:
    from ..identify.bag_reading import Choice

    if args.mass is not None and not (0.0 < args.mass < math.inf):
        raise InputError("--mass", args.mass, "a finite number above 0")
    if not (0.0 <= args.first < args.last):
        raise InputError("--from", args.first, f"0 or more, and less than --to ({args.last:g})")
    if args.gravity is not None and not all(map(math.isfinite, args.gravity)):
        raise InputError("--gravity", args.gravity, "three finite numbers [m/s²]")
    if args.json and args.urdf:
        raise InputError("--urdf", "can't be combined with --json")
    topics = {sensor: getattr(args, sensor) for sensor in SENSORS if getattr(args, sensor)}
    gravity = None if args.gravity is None else tuple(args.gravity)
    return Choice(topics, args.first, args.last, gravity)


def _flights(names: list[str], choice: Choice) -> tuple[list[MeasuredFlight], list[Scenario]]:
    """All flights of the sessions, and the scenarios of those recorded by this package."""
    from ..identify.bag_reading import bag_flight
    from ..identify.session_reading import session_flight
    from ..session.bag import check_session, read_runs

    flights, scenes = [], []
    for name in names:
        path = Path(name)
        check_session(path)
        runs = []
        if not choice.topics and path.suffix != ".bag" and _has_scene(path):
            runs = [run for run in read_runs(path) if run.scene]
        if not runs:
            flights.append(bag_flight(path, choice))
        for number, run in enumerate(runs, 1):
            title = name if len(runs) == 1 else f"{name}, run {number}"
            flight, scenario = session_flight(run, title, choice.first_s, choice.last_s)
            if choice.gravity is not None:
                flight = replace(flight, gravity=choice.gravity, gravity_from="from --gravity")
            flights.append(flight)
            scenes.append(scenario)
    return flights, scenes


def _has_scene(path: Path) -> bool:
    """Whether a bag contains a scene, as recordings of this package do."""
    from ..session.bag import has_scene

    return path.suffix != ".db3" and not (path.is_dir() and any(path.glob("*.db3"))) and has_scene(path)
