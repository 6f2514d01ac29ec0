# SPDX-License-Identifier: MIT
"""``rigid_proto inspect``: mass properties of a mesh under every model, with a verdict before any number."""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from ..base.errors import InputError
from ..base.progress import Progress
from ..mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from ..mass.from_mesh import FALLBACKS, UNION, mesh_body
from ..mass.inspection import JSON_KEYS, MODELS, Inspection, as_json, inspect_mesh, verify_moments
from ..mass.properties import scale_vector
from ..mass.verdict import ERROR, Finding
from ..mesh.locate import resolve_mesh
from ..mesh.reading import MAX_TRIANGLES, load_mesh
from .inspect_report import print_report
from .inspect_robot import add_robot_arguments, check_robot_options, compare, lump

DENSITY = 1000.0
"""kg/m³, water's, when neither density nor mass is given."""
LARGE_FILE, LARGE_MESH = 10_000_000, 100_000
"""Bytes and triangles from which work may take longer than a second."""
VERIFIED = 1e-13
"""Largest error against rational arithmetic with which ``--verify`` is content."""


EXAMPLES = (
    ("rigid_proto inspect hammer --density 7850", "mass, COM, inertia and what is wrong with the mesh"),
    (
        "rigid_proto inspect part.stl --scale 0.001 --mass 1.2 --urdf",
        "a part drawn in mm that weighs 1.2 kg, as a URDF <inertial>",
    ),
    ("rigid_proto inspect hammer --verify", "the errors against exact rational arithmetic"),
    ("rigid_proto inspect --compare robot.urdf", "the errors of a robot's inertials"),
    (
        "rigid_proto inspect --compare robot.urdf --fix fixed.urdf",
        "the same file with right inertials",
    ),
    (
        "rigid_proto inspect --lump robot.urdf --joint elbow=0.5 --as-scene robot.yaml",
        "the robot with its joints held, as a scene of one body",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Mass, centre of mass and inertia of a mesh under every model; a mesh that encloses no volume is refused."
    )
    parser.add_argument(
        "mesh", nargs="*", metavar="MESH", help="a path, package:// URI or bundled name; several are inspected in turn"
    )
    parser.add_argument("--density", type=float, metavar="D", help=f"kg/m³ (default {DENSITY:g})")
    parser.add_argument("--mass", type=float, metavar="M", help="kg, instead of a density")
    parser.add_argument("--scale", nargs="+", default=["1"], metavar="S", help="one or three numbers (0.001: mm to m)")
    parser.add_argument("--model", choices=MODELS, default="solid", help="inertia model (default solid)")
    parser.add_argument(
        "--ballast", nargs=4, type=float, action="append", default=[], metavar=("M", "X", "Y", "Z"),
        help="a point mass in kg at mesh coordinates; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--repair",
        nargs="?",
        const=True,
        default=False,
        metavar="union",
        help="weld edges, remove duplicate faces, orient faces, cap holes; union: also join parts that overlap",
    )
    parser.add_argument(
        "--fallback", choices=FALLBACKS[1:], default="", help="fallback shape for a mesh that encloses no volume"
    )
    parser.add_argument(
        "--accept-open", type=float, default=0.0, metavar="B",
        help="close holes with flat caps where whatever closes them changes volume and tensor by at most that part "
        "of themselves (0.01: 1 %%); also of a robot's meshes",
    )  # fmt: skip
    parser.add_argument("--max-triangles", type=int, default=MAX_TRIANGLES, metavar="N", help="refuse larger meshes")
    parser.add_argument(
        "--verify", action="store_true", help="compare with exact rational arithmetic (exit 1 above 1e-13)"
    )
    add_robot_arguments(parser)
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print one JSON object")
    output.add_argument("--urdf", action="store_true", help="a URDF <inertial> on stdout")
    output.add_argument("--sdf", action="store_true", help="an SDF <inertial> on stdout")
    output.add_argument("--mjcf", action="store_true", help="an MJCF <inertial> on stdout")


def _scale_and_meshes(args: argparse.Namespace) -> tuple[list[float], list[str]]:
    """``--scale 2 cow.obj`` leaves the mesh among the scale's words: give it back."""
    words, meshes = list(args.scale), list(args.mesh)
    while not meshes and len(words) > 1 and _as_number(words[-1]) is None:
        numbers = next(k for k, word in enumerate([*words[1:], "end"], 1) if _as_number(word) is None)
        words, meshes = words[:numbers], words[numbers:]
    scale = [number for word in words if (number := _as_number(word)) is not None]
    if len(scale) != len(words) or len(scale) not in (1, 3):
        raise InputError("scale", " ".join(words), "one or three numbers, each with 1e-9 <= |s| <= 1e9")
    return scale, meshes


def _repair_and_meshes(args: argparse.Namespace, meshes: list[str]) -> tuple[bool | str, list[str]]:
    """``--repair cow.obj`` leaves the mesh as the repair's kind: give it back."""
    if args.repair in (True, False, UNION):
        return args.repair, meshes
    if meshes and not Path(args.repair).is_file():
        raise InputError("--repair", args.repair, f"--repair alone, or --repair {UNION}")
    return True, [args.repair, *meshes]


def _as_number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def run(args: argparse.Namespace) -> int:
    """Inspect, print, and return the exit status; raises InputError for what is refused."""
    scale, meshes = _scale_and_meshes(args)
    args.repair, meshes = _repair_and_meshes(args, meshes)
    args.mesh = meshes
    _check_numbers(args)
    scale_vector(scale)
    check_robot_options(args, meshes)
    if args.lump is not None:
        return lump(args)
    if args.compare is not None:
        return compare(args, meshes, scale)
    mass, density = args.mass or 0.0, args.density or DENSITY
    if not meshes:
        raise InputError("MESH", "missing: give a path, a package:// URI or a bundled name, or --compare ROBOT")
    found = [_inspect(args, name, scale, mass, density) for name in meshes]
    if len(meshes) == 1:
        one = found[0]
        if args.json and one.report is not None:
            print(json.dumps(one.report))
        if one.refusal is not None:
            raise one.refusal
        return one.status
    if args.json:
        print(json.dumps({"meshes": [{"name": one.name, **(one.report or _unread(one))} for one in found]}))
    return max(one.status for one in found)


def _check_numbers(args: argparse.Namespace) -> None:
    """Refuse numbers that no mesh can have."""
    for name, value in (("mass", args.mass), ("density", args.density)):
        if value is not None and not 0.0 < value < math.inf:
            raise InputError(name, value, "a finite number > 0")
    if args.mass and args.density:
        raise InputError("--density", args.density, "--mass or --density, not both")
    if args.max_triangles < 1:
        raise InputError("max-triangles", args.max_triangles, "an integer >= 1")


@dataclass(frozen=True)
class _Inspected:
    """What became of one mesh: exit status, JSON object (None where it couldn't be read), and what refused it."""

    name: str
    status: int
    report: dict | None
    refusal: InputError | None = None


def _unread(one: _Inspected) -> dict:
    """The JSON object of a mesh that couldn't be read, among others."""
    return {**dict.fromkeys(JSON_KEYS), "verdict": [Finding("unread", ERROR, str(one.refusal)).as_dict()]}


def _inspect(args: argparse.Namespace, name: str, scale: list[float], mass: float, density: float) -> _Inspected:
    """One mesh inspected and printed, but for JSON; what refuses it goes to stderr where it is one of several."""
    report = None
    try:
        inspection = _inspection(args, name, scale, mass, density)
        report = as_json(inspection)
        if inspection.refusal is not None:
            raise inspection.refusal
        status = _verify(inspection, report) if args.verify else 0
    except InputError as error:
        if len(args.mesh) > 1:
            print(f"rigid_proto inspect: {' '.join(str(error).split())}", file=sys.stderr)
        return _Inspected(name, 2, report, error)
    if not args.json:
        _print(inspection, report, args)
    return _Inspected(name, status, report)


def _inspection(args: argparse.Namespace, name: str, scale: list[float], mass: float, density: float) -> Inspection:
    path = resolve_mesh(name)
    with Progress(f"reading {name}", path.stat().st_size > LARGE_FILE):
        mesh = load_mesh(name, max_triangles=args.max_triangles)
    with Progress(f"examining {len(mesh.triangles)} triangles", len(mesh.triangles) > LARGE_MESH):
        body = mesh_body(mesh, repair=args.repair, fallback=args.fallback, accept_open=args.accept_open)
        return inspect_mesh(body, model=args.model, scale=scale, mass=mass, density=density, ballast=args.ballast)


def _print(inspection: Inspection, report: dict, args: argparse.Namespace) -> None:
    exports = {"urdf": urdf_inertial, "sdf": sdf_inertial, "mjcf": mjcf_inertial}
    export = next((export for name, export in exports.items() if getattr(args, name)), None)
    if export is None:
        print_report(inspection, report)
        if len(args.mesh) > 1:
            print()
    else:
        print(export(inspection.chosen), end="")
        for finding in inspection.findings:
            if finding.severity != "info":
                print(f"{finding.severity}: {finding.message}", file=sys.stderr)


def _verify(inspection: Inspection, report: dict) -> int:
    """Put the ``verification`` into the report, null where it is refused; returns the exit status."""
    report["verification"] = None
    body = inspection.body
    with Progress("checking in rational arithmetic", len(body.triangles) > LARGE_MESH) as progress:
        report["verification"] = verify_moments(body, inspection.scale, progress.fraction)
    if max(report["verification"].values()) <= VERIFIED:
        return 0
    print("rigid_proto inspect: errors beyond 1e-13 against rational arithmetic", file=sys.stderr)
    return 1
