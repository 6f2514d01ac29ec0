# SPDX-License-Identifier: MIT
"""``rigid_proto inspect``: the verdict on a mesh, then its mass properties under every inertia model."""

from __future__ import annotations

import argparse
import json
import math
import sys
from typing import Any

from ..base.errors import InputError
from ..mass import INERTIA_MODELS, INFILL, WALL_THICKNESS
from ..mass.engines import FORMS
from ..mass.from_mesh import FALLBACKS, mesh_body
from ..mass.inspection import Inspection, as_json, inspect_mesh, verify_moments
from ..mass.properties import scale_vector
from ..mesh.reading import Mesh
from .inspect_parts import is_link, mesh_of_texts, split_part, with_link
from .inspect_report import print_inertial, print_report
from .inspect_robot import add_robot_arguments, compare, given, lump

DENSITY = 1000.0
"""Density if neither density nor mass is given: that of water [kg/m³]."""
VERIFIED = 1e-13
"""Largest error against rational arithmetic that ``--verify`` accepts."""

NEEDS = {
    "fix": "--compare ROBOT",
    "all": "--compare ROBOT --fix OUT",
    "tolerance": "--compare ROBOT",
    "strict": "--compare ROBOT",
    "package-path": "--compare ROBOT or --lump ROBOT",
    "as-scene": "--lump ROBOT",
}
"""Options for robots only, and the options that they need."""

EXAMPLES = (
    ("rigid_proto inspect hammer --density 7850", "mass, COM, inertia and problems of the mesh"),
    (
        "rigid_proto inspect part.stl --scale 0.001 --mass 1.2 --urdf",
        "a part drawn in mm that weighs 1.2 kg, as a URDF <inertial>",
    ),
    ("rigid_proto inspect hammer --density 7850 --for unity", "mass, COM and tensor as lines to paste"),
    (
        "rigid_proto inspect body.stl=2700 cover.stl=mass:0.12 --scale 0.001",
        "parts of different material as one body",
    ),
    (
        "rigid_proto inspect hammer --density 1240 --wall-thickness 0.0012 --infill 0.15",
        "a printed part",
    ),
    ("rigid_proto inspect hammer --verify", "the errors against exact rational arithmetic"),
    ("rigid_proto inspect --compare robot.urdf", "the errors of a robot's inertials"),
    (
        "rigid_proto inspect --compare robot.urdf --fix fixed.urdf",
        "the same file with corrected inertials",
    ),
    (
        "rigid_proto inspect --lump robot.urdf --as-scene robot.yaml",
        "the robot with its joints fixed at 0, as a scene of one body",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Mass, centre of mass and inertia of a mesh under every model; a mesh that encloses no volume is refused."
    )
    parser.add_argument(
        "mesh", nargs="*", metavar="MESH",
        help="a path, package:// URI or bundled name; several, each MESH, MESH=density or MESH=mass:kg, or a YAML file "
        "of parts, are one body; ROBOT.urdf#LINK among them is the link's own inertial",
    )  # fmt: skip
    parser.add_argument("--density", type=float, metavar="D", help=f"kg/m³ (default {DENSITY:g})")
    parser.add_argument("--mass", type=float, metavar="M", help="kg, instead of a density")
    parser.add_argument(
        "--scale", nargs="+", type=float, metavar="S", help="one or three numbers, after MESH (0.001: mm to m)"
    )
    parser.add_argument("--model", choices=INERTIA_MODELS[:-1], help="inertia model (default solid)")
    parser.add_argument(
        "--wall-thickness", type=float, metavar="T",
        help="a printed part: walls of the full density, T in m (default 0.001), and --infill within",
    )  # fmt: skip
    parser.add_argument("--infill", type=float, metavar="F", help="density within the walls, 0 to 1 (default 0.2)")
    parser.add_argument(
        "--ballast", nargs=4, type=float, action="append", metavar=("M", "X", "Y", "Z"),
        help="a point mass in kg at mesh coordinates; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--repair", action="store_true", help="weld gaps, remove duplicate faces, orient faces, cap holes"
    )
    parser.add_argument("--fallback", choices=FALLBACKS[1:], help="fallback shape for a mesh that encloses no volume")
    parser.add_argument(
        "--accept-open", type=float, metavar="B",
        help="close holes with flat caps if the relative change of volume and tensor by any way to close them is at "
        "most B (0.01: 1 %%); also for a robot's meshes",
    )  # fmt: skip
    parser.add_argument(
        "--verify", action="store_true", help="compare with exact rational arithmetic (exit 1 above 1e-13)"
    )
    add_robot_arguments(parser)
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print one JSON object")
    output.add_argument("--urdf", action="store_true", help="a URDF <inertial> on stdout")
    output.add_argument("--sdf", action="store_true", help="an SDF <inertial> on stdout")
    output.add_argument("--mjcf", action="store_true", help="an MJCF <inertial> on stdout")
    output.add_argument(
        "--for", dest="engine", choices=FORMS, help="what an engine or format takes, in its axes, units and words"
    )


def run(args: argparse.Namespace) -> int:
    """Inspect, print and return the exit status. Raises InputError for refused input."""
    texts = args.mesh
    args.mesh = _single_mesh(args) if args.lump or args.compare else None
    if args.lump is not None:
        return lump(args)
    if args.compare is not None:
        return compare(args)
    for name, needed in NEEDS.items():
        if given(args, name):
            raise InputError(f"--{name}", f"needs {needed}")
    inspection = _inspection(args, texts)
    if inspection is None:
        return with_link(args, texts)
    report = as_json(inspection)
    try:
        if inspection.refusal is not None:
            raise inspection.refusal
        status = _verify(inspection, report) if args.verify else 0
    finally:
        if args.json:
            print(json.dumps(report))
    if not args.json:
        _print(inspection, report, args)
    return status


def _single_mesh(args: argparse.Namespace) -> str | None:
    """The mesh given beside a robot, if any. Raises InputError for more than one."""
    if len(args.mesh) > 1:
        option = "lump" if args.lump else "compare"
        raise InputError("MESH", " ".join(args.mesh), f"at most one with --{option}; several are the parts of one body")
    return args.mesh[0] if args.mesh else None


def _inspection(args: argparse.Namespace, texts: list[str]) -> Inspection | None:
    """The inspection of a mesh or of parts; None if one of them is a link of a robot. Raises InputError."""
    if not any(texts):
        raise InputError("MESH", "missing: give a path, a package:// URI or a bundled name, or --compare ROBOT")
    for name, value in (("mass", args.mass), ("density", args.density)):
        if value is not None and not 0.0 < value < math.inf:
            raise InputError(name, value, "a finite number > 0")
    if args.mass and args.density:
        raise InputError("--density", args.density, "--mass or --density, not both")
    if any(map(is_link, texts)):
        return None
    scale = scale_vector(1.0 if args.scale is None else args.scale)
    mesh: Mesh | str = texts[0]
    if len(texts) > 1 or split_part(texts[0])[1]:
        mesh, scale = mesh_of_texts(texts, args.density or DENSITY, args.scale), scale_vector(1.0)
    body = mesh_body(mesh, repair=args.repair, fallback=args.fallback or "", accept_open=args.accept_open or 0.0)
    if body.parts and args.density and isinstance(mesh, str):
        raise InputError("--density", args.density, "none: the file gives the densities of its parts")
    has_walls = args.wall_thickness is not None or args.infill is not None
    if has_walls and args.model not in (None, "walled"):
        raise InputError("--model", args.model, "walled, with --wall-thickness and --infill")
    return inspect_mesh(
        body,
        model=args.model or ("walled" if has_walls else "solid"),
        scale=scale,
        mass=args.mass or 0.0,
        density=DENSITY if body.parts else args.density or DENSITY,
        ballast=args.ballast or (),
        wall_thickness=WALL_THICKNESS if args.wall_thickness is None else args.wall_thickness,
        infill=INFILL if args.infill is None else args.infill,
    )


def _print(inspection: Inspection, report: dict[str, Any], args: argparse.Namespace) -> None:
    if not print_inertial(args, inspection.chosen):
        print_report(inspection, report)
        return
    for finding in inspection.findings:
        if finding.severity != "info":
            print(f"{finding.severity}: {finding.message}", file=sys.stderr)


def _verify(inspection: Inspection, report: dict[str, Any]) -> int:
    """Add ``verification`` to the report, null if it is refused. Returns the exit status."""
    report["verification"] = None
    report["verification"] = verify_moments(inspection.body, inspection.scale)
    if max(report["verification"].values()) <= VERIFIED:
        return 0
    print("rigid_proto inspect: errors beyond 1e-13 against rational arithmetic", file=sys.stderr)
    return 1
