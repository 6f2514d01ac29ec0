# SPDX-License-Identifier: MIT
"""``rigid_proto inspect``: mass properties of a mesh under every model, with a verdict before any number."""

from __future__ import annotations

import argparse
import json
import re
import sys
from dataclasses import dataclass

import numpy as np

from rigid_proto_ros.cli.progress import Progress
from rigid_proto_ros.core.errors import InputError
from rigid_proto_ros.core.inertia_tensor import degenerate_pairs, equimomental_shapes, principal_axes
from rigid_proto_ros.core.mass_properties import INERTIA_MODELS, MassProperties, scale_vector
from rigid_proto_ros.core.mesh_topology_verdict import WARNING, Finding, unit_suspicion
from rigid_proto_ros.inertial_export import FRAMES, mjcf_inertial, sdf_inertial, urdf_inertial
from rigid_proto_ros.mesh_body import FALLBACKS, MeshBody, mesh_body
from rigid_proto_ros.mesh_io import MAX_TRIANGLES, load_mesh

MODELS = tuple(model for model in INERTIA_MODELS if model != "explicit")
DENSITY = 1000.0
"""kg/m³, water's, when neither density nor mass is given."""
VERIFIED = 1e-13
"""Largest error against rational arithmetic with which ``--verify`` is content."""
SHOWN_DEGENERATE = 1e-9
JSON_KEYS = (
    *("mesh", "vertices", "triangles", "watertight", "winding_consistent", "components", "volume", "area", "mass"),
    *("density", "center_of_mass", "inertia", "principal_moments", "principal_axes", "principal_degenerate"),
    *("equimomental_box", "equimomental_ellipsoid", "bounding_box", "models", "verdict"),
)


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Declare the command on ``subparsers``."""
    parser = subparsers.add_parser(
        "inspect",
        help="mass properties of a mesh, and a verdict on it",
        description="Mass, centre of mass and inertia of a mesh under every model; a broken mesh is told, not summed.",
    )
    # argparse takes -1e-3 for an option otherwise.
    parser._negative_number_matcher = re.compile(r"^-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
    parser.add_argument("mesh", nargs="?", metavar="MESH", help="a path, package:// URI or bundled name")
    mass = parser.add_mutually_exclusive_group()
    mass.add_argument("--density", type=float, metavar="D", help=f"kg/m^3 (default {DENSITY:g})")
    mass.add_argument("--mass", type=float, default=0.0, metavar="M", help="kg, whatever the size")
    parser.add_argument("--scale", nargs="+", default=["1"], metavar="S", help="one or three numbers (0.001: mm to m)")
    parser.add_argument("--model", choices=MODELS, default="solid", help="how mass is spread (default solid)")
    parser.add_argument(
        "--ballast", nargs=4, type=float, action="append", default=[], metavar=("M", "X", "Y", "Z"),
        help="a point mass in kg at mesh coordinates; may be repeated",
    )  # fmt: skip
    parser.add_argument("--repair", action="store_true", help="weld, drop copies, orient and cap what isn't closed")
    parser.add_argument("--fallback", choices=FALLBACKS[1:], default="", help="what stands in for an open surface")
    parser.add_argument("--max-triangles", type=int, default=MAX_TRIANGLES, metavar="N", help="refuse larger meshes")
    parser.add_argument(
        "--verify", action="store_true", help="compare with exact rational arithmetic (exit 1 above 1e-13)"
    )
    parser.add_argument("--compare", metavar="ROBOT", help="how far a URDF's, SDF's or MJCF's inertials are off")
    parser.add_argument("--record", metavar="FILE.rrd", help="write a picture of it all for the Rerun viewer")
    parser.add_argument("--frame", choices=FRAMES, default="mesh", help="where the exported link's frame is")
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="one JSON object on stdout")
    output.add_argument("--urdf", action="store_true", help="a URDF <inertial> on stdout")
    output.add_argument("--sdf", action="store_true", help="an SDF <inertial> on stdout")
    output.add_argument("--mjcf", action="store_true", help="an MJCF <inertial> on stdout")
    parser.set_defaults(run=run)
    return parser


@dataclass(frozen=True)
class Inspection:
    """All that is known of a mesh at one scale, mass and model. ``refusal`` is the error that stands in the way of the
    chosen model, ``models`` the mass properties of those that can be had."""

    body: MeshBody
    scale: np.ndarray
    model: str
    models: dict[str, MassProperties]
    findings: list[Finding]
    refusal: InputError | None
    volume: float | None
    area: float | None
    lower: np.ndarray | None
    upper: np.ndarray | None
    density: float | None

    @property
    def chosen(self) -> MassProperties:
        """Mass properties of the chosen model."""
        return self.models[self.model]


def inspect_mesh(
    body: MeshBody, *, model: str = "solid", scale=1.0, mass: float = 0.0, density: float = 1000.0, ballast=()
) -> Inspection:
    """Mass properties of every model that ``body`` can have, and the remarks that belong to them."""
    s = scale_vector(scale)
    findings = list(body.verdict.findings)
    if not body.verdict.usable:
        refusal = InputError(body.mesh.name, body.verdict.reason, "finite vertices that span a body")
        return Inspection(body, s, model, {}, findings, refusal, None, None, None, None, None)
    moments = body.moments
    points = body.vertices[np.unique(body.triangles)] * s
    lower, upper = points.min(axis=0), points.max(axis=0)
    suspicion = unit_suspicion(float(np.max(upper - lower)))
    if suspicion:
        findings.append(suspicion)
    models, refusal = {}, None
    # Mass, density, scale and ballast are checked by any model: their refusal comes first and is the same for all.
    for name in (model, *(other for other in MODELS if other != model)):
        try:
            models[name] = moments.mass_properties(name, scale=s, mass=mass, density=density, ballast=ballast)
        except InputError as error:
            if name == model:
                refusal = error
            elif refusal is None and not (name == "solid" and not body.verdict.closed):
                findings.append(Finding(f"model_{name}", WARNING, str(error)))
            continue
        findings += [Finding("tensor", WARNING, text) for text in models[name].warnings]
    volume = None
    if body.verdict.closed or moments.stand_in is not None:
        volume = moments.moments("solid").measure * float(np.prod(np.abs(s)))
    shell = moments.moments("shell", s) if "shell" in models else None
    area = None if shell is None else shell.measure * float(s[0]) ** 2
    implied = density
    if mass > 0.0:
        implied = mass / volume if volume else None
    return Inspection(body, s, model, models, findings, refusal, volume, area, lower, upper, implied)


def as_json(inspection: Inspection) -> dict:
    """The inspection as the command's JSON object."""
    verdict = [finding.as_dict() for finding in inspection.findings]
    if inspection.refusal is not None:
        return {**dict.fromkeys(JSON_KEYS), "verdict": verdict}
    body, chosen = inspection.body, inspection.chosen
    moments, axes = principal_axes(chosen.inertia)
    box, ellipsoid = equimomental_shapes(chosen.mass, moments)
    return {
        "mesh": body.mesh.path,
        "vertices": len(body.mesh.vertices),
        "triangles": len(body.triangles),
        "watertight": body.verdict.watertight,
        "winding_consistent": body.verdict.winding_consistent,
        "components": body.verdict.components,
        "volume": inspection.volume,
        "area": inspection.area,
        "mass": chosen.mass,
        "density": inspection.density,
        "center_of_mass": chosen.center_of_mass.tolist(),
        "inertia": chosen.inertia.tolist(),
        "principal_moments": moments.tolist(),
        "principal_axes": axes.tolist(),
        "principal_degenerate": list(degenerate_pairs(moments, SHOWN_DEGENERATE)),
        "equimomental_box": box.tolist(),
        "equimomental_ellipsoid": ellipsoid.tolist(),
        "bounding_box": {"min": inspection.lower.tolist(), "max": inspection.upper.tolist()},
        "models": {
            name: None
            if name not in inspection.models
            else {
                "mass": inspection.models[name].mass,
                "center_of_mass": inspection.models[name].center_of_mass.tolist(),
                "inertia": inspection.models[name].inertia.tolist(),
            }
            for name in MODELS
        },
        "verdict": verdict,
    }


def verify(body: MeshBody, scale: np.ndarray, progress: Progress) -> dict[str, float]:
    """Errors of the solid's volume, centroid and inertia against rational arithmetic on the same vertices."""
    from rigid_proto_ros.core.exact_moments import exact_solid_moments, relative_errors

    moments = body.moments
    moments.solid_raw()  # refuses what bounds no solid
    vertices, triangles = moments.stand_in or (moments.vertices, moments.triangles)
    exact = exact_solid_moments(vertices, triangles, progress.fraction).outward().scaled(scale)
    unit = moments.mass_properties("solid", scale=scale, density=1.0)
    points = vertices[np.unique(triangles)] * scale
    diagonal = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    volume = moments.moments("solid").measure * float(np.prod(np.abs(scale)))
    return relative_errors(exact, volume, unit.center_of_mass, unit.inertia, diagonal)


def print_report(inspection: Inspection, report: dict) -> None:
    """The human-readable report on stdout."""
    body, chosen = inspection.body, inspection.chosen
    print(f"{body.mesh.path}: {report['vertices']} vertices, {report['triangles']} triangles, ", end="")
    closed = "closed" if report["watertight"] else "open"
    wound = "" if report["winding_consistent"] else ", inconsistently wound"
    print(f"{closed}{wound}, {report['components']} component{'s' if report['components'] != 1 else ''}")
    for finding in inspection.findings:
        print(f"  {finding.severity}: {finding.message} [{finding.code}]")
    size = inspection.upper - inspection.lower
    print(f"size             {size[0]:.6g} x {size[1]:.6g} x {size[2]:.6g} m")
    if report["volume"] is not None:
        print(f"volume           {report['volume']:.9g} m^3")
    if report["area"] is not None:
        print(f"area             {report['area']:.9g} m^2")
    density = "" if report["density"] is None else f"  ({report['density']:.6g} kg/m^3)"
    print(f"mass             {chosen.mass:.9g} kg{density}")
    print(f"centre of mass   {_row(chosen.center_of_mass)} m")
    for label, row in zip(("inertia          ", " " * 17, " " * 17), chosen.inertia, strict=True):
        print(f"{label}{_row(row)}{' kg m^2, about the centre of mass' if label.strip() else ''}")
    moments, axes = principal_axes(chosen.inertia)
    print(f"principal        {_row(moments)} kg m^2")
    for column, (moment, name) in enumerate(zip(moments, ("A", "B", "C"), strict=True)):
        print(f"  axis {name}         {_row(axes[:, column])}   {moment:.6g}")
    if any(report["principal_degenerate"]):
        pairs = [pair for pair, same in zip(("A = B", "B = C"), report["principal_degenerate"], strict=True) if same]
        print(f"  {' and '.join(pairs)}: axes within their span are arbitrary")
    print(f"same inertia     box {_row(report['equimomental_box'])} m, ", end="")
    print(f"ellipsoid of semi-axes {_row(report['equimomental_ellipsoid'])} m")
    solid = inspection.models.get("solid")
    print("model          mass [kg]   ixx          iyy          izz          off the solid's inertia")
    for name, properties in inspection.models.items():
        off = ""
        if solid is not None and name != "solid":
            off = f"{inertia_difference(properties, solid):.3g}"
        diagonal = "".join(f"{value:<13.6g}" for value in np.diag(properties.inertia))
        print(f"{'* ' if name == inspection.model else '  '}{name:<13}{properties.mass:<12.6g}{diagonal}{off}")
    if "verification" in report:
        errors = ", ".join(
            f"{name.removesuffix('_error')} {value:.1e}" for name, value in report["verification"].items()
        )
        print(f"against exact rational arithmetic: {errors}")


def inertia_difference(properties: MassProperties, truth: MassProperties) -> float:
    """max|ΔI|/max|I| of two tensors."""
    return float(np.max(np.abs(properties.inertia - truth.inertia)) / np.max(np.abs(truth.inertia)))


def _row(values) -> str:
    return " ".join(f"{value:>13.6g}" for value in values)


def _scale_and_mesh(args: argparse.Namespace) -> tuple[list[float], str | None]:
    """``--scale 2 cow.obj`` leaves the mesh among the scale's words: give it back."""
    words, mesh = list(args.scale), args.mesh
    if mesh is None and len(words) > 1 and _as_number(words[-1]) is None:
        mesh = words.pop()
    scale = [_as_number(word) for word in words]
    if None in scale or len(scale) not in (1, 3):
        raise InputError("scale", " ".join(words), "one or three numbers, each with 1e-9 <= |s| <= 1e9")
    return scale, mesh


def _as_number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def run(args: argparse.Namespace) -> int:
    """Inspect, print, and return the exit status; raises InputError for what is refused."""
    scale, mesh_name = _scale_and_mesh(args)
    _check_amount("mass", args.mass, zero=True)
    density = DENSITY if args.density is None else args.density
    _check_amount("density", density, zero=False)
    if args.compare is not None:
        from rigid_proto_ros.inertia_doctor import run_compare

        return run_compare(args, mesh_name, scale)
    if mesh_name is None:
        raise InputError("MESH", None, "a mesh (path, package:// URI or bundled name), or --compare ROBOT")
    scale_vector(scale)
    if args.max_triangles < 1:
        raise InputError("max-triangles", args.max_triangles, "an integer >= 1")
    with Progress(f"reading {mesh_name}"):
        mesh = load_mesh(mesh_name, max_triangles=args.max_triangles)
    with Progress(f"examining {len(mesh.triangles)} triangles"):
        body = mesh_body(mesh, repair=args.repair, fallback=args.fallback)
        inspection = inspect_mesh(
            body, model=args.model, scale=scale, mass=args.mass, density=density, ballast=args.ballast
        )
    report = as_json(inspection)
    if inspection.refusal is not None:
        if args.json:
            print(json.dumps(report))
        raise inspection.refusal
    status = 0
    if args.verify:
        with Progress("checking in rational arithmetic") as progress:
            report["verification"] = verify(body, inspection.scale, progress)
        if max(report["verification"].values()) > VERIFIED:
            print("rigid_proto inspect: errors beyond 1e-13 against rational arithmetic", file=sys.stderr)
            status = 1
    if args.record:
        from rigid_proto_ros.inspect_view import record_inspection

        record_inspection(args.record, inspection)
    if args.json:
        print(json.dumps(report))
    elif args.urdf:
        print(urdf_inertial(inspection.chosen, args.frame), end="")
    elif args.sdf:
        print(sdf_inertial(inspection.chosen, args.frame), end="")
    elif args.mjcf:
        print(mjcf_inertial(inspection.chosen, args.frame), end="")
    else:
        print_report(inspection, report)
    if not args.json and (args.urdf or args.sdf or args.mjcf):
        for finding in inspection.findings:
            if finding.severity != "info":
                print(f"{finding.severity}: {finding.message}", file=sys.stderr)
    return status


def _check_amount(name: str, value: float, *, zero: bool) -> None:
    if not (value > 0.0 or (zero and value == 0.0)) or value == float("inf"):
        raise InputError(name, value, "a finite number > 0")
