# SPDX-License-Identifier: MIT
"""``rigid_proto identify``: mass properties from recorded motion, and first what of them it identifies."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError, is_missing

if TYPE_CHECKING:
    from ..identify.bag_reading import Choice
    from ..identify.comparison import Candidate
    from ..identify.identification import Known
    from ..identify.measurements import MeasuredFlight
    from ..identify.report import Identification
    from ..mass.from_mesh import MeshBody
    from ..rerun_view.identification_picture import DrawnTensor, TrackedFlight
    from ..scene.scenario import Scenario

EXAMPLES = (
    ("rigid_proto identify out/flight.mcap", "what recorded motion identifies of the body, and what it doesn't"),
    ("rigid_proto identify throws/*.mcap --mass 1.2 --urdf", "several throws of a weighed body, as a URDF <inertial>"),
    ("rigid_proto identify throw.mcap --mesh hammer", "is it solid, a shell, or as its bounding box says?"),
    (
        "rigid_proto identify rov.mcap --odom /odom --wrench /thrusters@base_link --fit mass,com,inertia,damping",
        "a bag of another robot",
    ),
)
SENSORS = ("pose", "twist", "odom", "imu", "wrench")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "sessions", nargs="+", metavar="SESSION", help="recordings made here (.rrd, .mcap), or any bags of ROS 2 or 1"
    )
    parser.add_argument("--mass", type=float, metavar="M", help="the mass [kg], where it is known")
    parser.add_argument(
        "--mesh",
        metavar="PART",
        help="the body's mesh, in axes of the tracked frame: its models are compared with the motion",
    )
    parser.add_argument("--density", type=float, metavar="D", help="with --mesh: the mass is that of the solid [kg/m³]")
    parser.add_argument(
        "--against", metavar="ROBOT.urdf", help="compare its inertials with the motion (SDF and MJCF too)"
    )
    for sensor in SENSORS:
        frame = "[@FRAME]" if sensor in ("twist", "wrench") else "[@CHILD]" if sensor == "pose" else ""
        parser.add_argument(f"--{sensor}", metavar=f"TOPIC{frame}", help=f"the {sensor} topic of a bag")
    parser.add_argument(
        "--gravity", type=float, nargs=3, metavar=("X", "Y", "Z"), help="[m/s²] (default: the scene's, or 0 0 -9.81)"
    )
    parser.add_argument(
        "--offset", action="append", default=[], metavar="TOPIC=S", help="seconds to add to a topic's stamps"
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
    parser.add_argument("--robust", action="store_true", help="give outliers less weight")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--urdf", action="store_true", help="print a URDF <inertial>")
    parser.add_argument(
        "--record",
        metavar="FILE.rrd",
        help="for Rerun: measured tracks, fitted motions, residuals and tensors",
    )


def run(args: argparse.Namespace) -> int:
    """Read, estimate, and print it."""
    try:
        from ..identify.identification import identify
        from ..identify.report import as_json, as_text, as_urdf
    except ImportError as error:
        package = str(error.name).partition(".")[0]
        raise InputError("identify", is_missing(package, "identify")) from None
    choice = _choice(args)
    flights, scenes = _flights(args.sessions, choice)
    known, candidates = _known(args, choice, scenes)
    fit = [word.strip() for word in args.fit.split(",") if word.strip()]
    found = identify(flights, fit, known, candidates, args.robust)
    if args.record is not None:
        _record(args.record, found, scenes, candidates, _mesh_body(args.mesh) if args.mesh is not None else None)
    if args.json:
        print(json.dumps(as_json(found)))
    elif args.urdf:
        print(as_urdf(found), end="")
    else:
        print("\n".join(as_text(found)))
    return 0


def _choice(args: argparse.Namespace) -> Choice:
    from ..identify.bag_reading import Choice, given_offsets

    for name, value in (("--mass", args.mass), ("--density", args.density)):
        if value is not None and not (0.0 < value < math.inf):
            raise InputError(name, value, "a finite number above 0")
    if args.density is not None and (args.mesh is None or args.mass is not None):
        raise InputError("--density", "needs --mesh, and no --mass")
    if not (0.0 <= args.first < args.last):
        raise InputError("--from", args.first, f"0 or more, and less than --to ({args.last:g})")
    if args.gravity is not None and not all(map(math.isfinite, args.gravity)):
        raise InputError("--gravity", args.gravity, "three finite numbers [m/s²]")
    if args.json and args.urdf:
        raise InputError("--urdf", "can't be combined with --json")
    topics = {sensor: getattr(args, sensor) for sensor in SENSORS if getattr(args, sensor)}
    gravity = None if args.gravity is None else tuple(args.gravity)
    return Choice(topics, given_offsets(args.offset), args.first, args.last, gravity)


def _flights(names: list[str], choice: Choice) -> tuple[list[MeasuredFlight], list]:
    """All flights of the sessions, and the scenarios of those that are ours."""
    from dataclasses import replace

    from ..identify.bag_reading import bag_flight
    from ..identify.session_reading import session_flight
    from ..rerun_view.session_files import is_bag, read_runs

    flights, scenes = [], []
    for name in names:
        path = Path(name)
        if not path.exists():
            raise InputError("session", f"there is no file and no folder {name!r}")
        runs = []
        if not choice.topics and path.suffix != ".bag" and (not is_bag(path) or has_scene(path)):
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


def has_scene(path: Path) -> bool:
    """Whether a bag says what was flown, as ours do."""
    from ..session.bag import read_bag

    if path.suffix == ".db3" or (path.is_dir() and any(path.glob("*.db3"))):
        return False
    content = read_bag(path, lambda topic: topic.endswith("/scene"))
    return any(topic.endswith("/scene") for topic in content.messages)


def _known(args: argparse.Namespace, choice: Choice, scenes: list) -> tuple[Known, dict[str, Candidate]]:
    """What is known beforehand, and the bodies that are to be compared with the motion."""
    from ..identify.comparison import Candidate
    from ..identify.identification import GUESSED_RADIUS, Known

    candidates: dict[str, Candidate] = {}
    mass, known, length = args.mass, None, GUESSED_RADIUS
    if args.mesh is not None:
        body = _mesh_body(args.mesh)
        candidates |= _models(body, args.mass, args.density)
        known = next(iter(candidates.values()))
        if args.density is not None:
            mass = known.mass
        length = 0.5 * float(np.linalg.norm(np.ptp(body.vertices, axis=0)))
    elif scenes:
        setup = scenes[0].setup
        known, length = Candidate(setup.body.mass, setup.body.inertia), setup.length
    if args.against is not None:
        candidates |= _inertials(Path(args.against))
    return Known(mass, known, length, choice.offsets), candidates


def _mesh_body(part: str) -> MeshBody:
    from ..mass.from_mesh import mesh_body

    return mesh_body(part)


def _models(body: MeshBody, mass: float | None, density: float | None) -> dict[str, Candidate]:
    """The mesh's models by name, those that it can have."""
    from ..identify.comparison import Candidate
    from ..mass.inspection import MODELS, inspect_mesh

    found = inspect_mesh(body, mass=mass or (0.0 if density or body.verdict.closed else 1.0), density=density or 1000.0)
    if not found.models:
        raise found.refusal or InputError("--mesh", body.mesh.name, "a mesh that has mass properties")
    return {
        f"{body.mesh.name} as {name}": Candidate(found.models[name].mass, found.models[name].inertia)
        for name in MODELS
        if name in found.models
    }


def _inertials(path: Path) -> dict[str, Candidate]:
    """The links of a robot file that have an inertial."""
    from ..identify.comparison import Candidate
    from ..mass.tensor import check_tensor
    from ..robots.reading import read_robot

    found = {}
    for link in read_robot(path).links:
        if not link.problem and link.mass > 0.0:
            check_tensor(link.inertia, source=f"{path.name}, {link.name}")
            found[f"{path.name}, {link.name}"] = Candidate(link.mass, link.inertia, fixes_mass=True)
    if not found:
        raise InputError("--against", str(path), "a robot file with inertials")
    return found


def _record(
    path: str,
    found: Identification,
    scenes: Sequence[Scenario],
    candidates: Mapping[str, Candidate],
    mesh: MeshBody | None,
) -> None:
    """Write the recording; raises InputError. mesh: that of --mesh; without it the first scene's is drawn."""
    try:
        from ..rerun_view.identification_picture import DrawnTensor, record_identification
    except ImportError:
        raise InputError("--record", is_missing("rerun-sdk", "rerun")) from None
    from ..identify.report import as_text

    com = found.estimate.values.center_of_mass
    given = [DrawnTensor(name, one.mass, com, one.inertia) for name, one in candidates.items()]
    if scenes:
        body = scenes[0].setup.body
        given.insert(0, DrawnTensor("the scene's", body.mass, np.zeros(3), body.inertia))
    tensors = [*_found_tensor(found), *given]
    record_identification(path, _tracked(found), tensors, _mesh(found, scenes, mesh), "\n".join(as_text(found)))


def _found_tensor(found: Identification) -> list[DrawnTensor]:
    """Where the motion tells its shape at least; an ellipsoid's axes depend on the tensor for each kg."""
    from ..rerun_view.identification_picture import DrawnTensor

    body = found.estimate.values
    if any(one.value is None for one in found.shape):
        return []
    is_whole = found.mass.value is not None and all(one.value is not None for one in found.inertia)
    label = "found" if is_whole else "found: its shape; the size isn't identified"
    return [DrawnTensor(label, body.mass, body.center_of_mass, body.inertia)]


def _mesh(
    found: Identification, scenes: Sequence[Scenario], mesh: MeshBody | None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices [m, tracked frame] and triangles. The tracked frame of a scene stands at its COM; where a mesh given by
    --mesh stands in a bag's tracked frame, nobody says: its COM is put where the found one is.
    """
    if mesh is not None:
        center = mesh.moments.mass_properties("solid", mass=1.0).center_of_mass if mesh.verdict.closed else 0.0
        return mesh.vertices - center + found.estimate.values.center_of_mass, mesh.triangles
    surface = scenes[0].setup.surface if scenes else None
    if surface is None:
        return None
    body = scenes[0].setup.body
    return surface.vertices * body.scale - body.center_of_mass, surface.triangles


def _tracked(found: Identification) -> list[TrackedFlight]:
    from ..identify import rotations as rot
    from ..identify.fitting import residuals_by_series
    from ..identify.measurements import UNITS
    from ..identify.shooting import flown
    from ..rerun_view.identification_picture import Residuals, TrackedFlight

    estimate, values = found.estimate, found.estimate.values
    left = residuals_by_series(estimate.segments, estimate.starts, values)
    tracked = []
    for segment, start in zip(estimate.segments, estimate.starts, strict=True):
        flight, motion = segment.flight, flown(segment, start, values)
        assert flight.pose is not None and motion is not None
        position, attitude = flight.pose
        times, samples, _ = motion
        turns = samples[:, 3:7]
        residuals = []
        for series in flight.series:
            sigma = estimate.sigmas[series.name]
            title = f"{series.name}, 1 is {sigma:.3g} {UNITS[series.kind]}"
            residuals.append(Residuals(title, series.times_ns - flight.begin_ns, left[id(series)] / sigma))
        tracked.append(
            TrackedFlight(
                flight.name,
                position.times_ns - flight.begin_ns,
                position.values,
                attitude.values,
                times + (segment.begin_ns - flight.begin_ns),
                samples[:, :3] - rot.turned(turns, values.center_of_mass),
                turns,
                residuals,
            )
        )
    return tracked
