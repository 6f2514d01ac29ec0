# SPDX-License-Identifier: MIT
"""``rigid_proto inspect`` for robots: ``--compare`` checks inertials, ``--fix`` corrects them, ``--lump`` computes a
robot as one rigid body.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError, printable
from ..base.files import is_same_file, whole_file
from ..base.rotation import quaternion_from_matrix
from ..mass.properties import scale_vector
from ..mass.tensor import principal_axes, six_from_tensor
from ..mesh.solids import hull_is_missing
from .inspect_report import print_inertial, row_of, table, tensor_rows

if TYPE_CHECKING:
    from ..robots.composite_inertia import Lump
    from ..robots.diagnosis import LinkDiagnosis


def add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options for robots."""
    parser.add_argument(
        "--compare", nargs="+", metavar="ROBOT",
        help="compare the inertials in URDF, SDF or MJCF files with the links' shapes, or that of one link with MESH; "
        "exit 1 if one is wrong",
    )  # fmt: skip
    parser.add_argument(
        "--package-path", type=Path, action="append", metavar="DIR",
        help="with --compare or --lump: folder of the packages or models that the file refers to; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", type=float, metavar="T",
        help="with --compare: exit 1 also for an inertial that differs from a uniform solid's by more than T",
    )  # fmt: skip
    parser.add_argument("--strict", action="store_true", help="with --compare: exit 1 also for a link that is unknown")
    parser.add_argument(
        "--fix", metavar="OUT",
        help="with --compare: write the file to OUT with corrected inertials, and with --density also those missing",
    )  # fmt: skip
    parser.add_argument("--all", action="store_true", help="with --fix: correct those that aren't uniform, too")
    parser.add_argument("--lump", metavar="ROBOT", help="a URDF, SDF or MJCF with its joints at 0, as one rigid body")
    parser.add_argument("--as-scene", metavar="FILE.yaml", help="with --lump: write a scene of this body, and its mesh")


def given(args: argparse.Namespace, name: str) -> bool:
    """Whether an option was given, even as 0."""
    value = getattr(args, {"for": "engine"}.get(name, name.replace("-", "_")))
    return value is not None and value is not False


def _refuse(args: argparse.Namespace, use: str, *names: str) -> None:
    """Raises InputError for options that have no meaning for robots."""
    for name in names:
        if given(args, name):
            raise InputError(f"--{name}", f"can't be used with --{use}, which takes what the robot's file says")


def compare(args: argparse.Namespace) -> int:
    """Run ``inspect [MESH] --compare ROBOT...``. Exit status: 1 if a link's inertial is wrong, otherwise 0. With a mesh
    or a tolerance also 1 if an inertial differs from that of the uniform solid, or if nothing could be compared. With
    --strict also 1 if a link is unknown.
    """
    _check_options(args)
    _report_missing_hulls()
    if args.fix is not None:
        return _fix(args)
    if len(args.compare) == 1:
        status, report = _judge(args, args.compare[0])
        if args.json:
            print(json.dumps(report))
        return status
    found = []
    for robot in args.compare:
        if not args.json:
            print(f"{robot}:")
        try:
            found.append(_judge(args, robot))
        except InputError as error:  # reported; the other robots are still checked
            print(f"rigid_proto inspect: {robot}: {' '.join(str(error).split())}", file=sys.stderr)
            found.append((2, {"compare": robot, "links": None, "refused": str(error)}))
    if args.json:
        print(json.dumps({"robots": [report for _, report in found]}))
    return max(status for status, _ in found)


def _check_options(args: argparse.Namespace) -> None:
    """Raises InputError for options that can't be combined with ``--compare`` or that need another one."""
    _refuse(args, "compare", "lump", "as-scene", "verify", "urdf", "sdf", "mjcf", "for", "model", "ballast", "mass")
    _refuse(args, "compare", "repair", "fallback")
    if args.scale and not args.mesh:
        raise InputError("--scale", "needs the MESH of one link; the robot's file gives the scales of its own meshes")
    if args.tolerance is not None and not 0.0 < args.tolerance < math.inf:
        raise InputError("--tolerance", args.tolerance, "a finite number > 0")
    if args.strict and args.fix is not None:
        raise InputError("--strict", "checks alone; --fix says of each link what was left and why")
    if args.density is not None and args.fix is None:
        raise InputError("--density", "needs --fix OUT, which gives links without an inertial that of their shapes")
    if args.density is not None and not 0.0 < args.density < math.inf:
        raise InputError("density", args.density, "a finite number > 0")
    if args.all and args.fix is None:
        raise InputError("--all", "needs --fix OUT")
    if len(args.compare) > 1 and (args.mesh or args.fix):
        raise InputError("--compare", " ".join(args.compare), "one robot, with MESH or --fix")


def _report_missing_hulls() -> None:
    if missing := hull_is_missing():
        left_out = "nobody looks along the normals of a shape's hull, nor for a hull as the cause"
        print(f"rigid_proto inspect: {missing}; until then {left_out}", file=sys.stderr)


def _judge(args: argparse.Namespace, robot: str) -> tuple[int, dict[str, Any]]:
    """Exit status and JSON object of one robot; prints the report unless JSON is asked for."""
    from ..robots.causes import LIMIT
    from ..robots.diagnosis import NOT_JUDGED, NOT_UNIFORM, UNKNOWN, WRONG, compare_robot

    diagnoses = compare_robot(
        Path(robot),
        mesh=args.mesh,
        scale=None if args.scale is None else scale_vector(args.scale),
        folders=tuple(args.package_path or ()),
        accept_open=args.accept_open or 0.0,
        tolerance=args.tolerance or LIMIT,
    )
    if not args.json:
        _print_diagnoses(diagnoses)
    close = args.mesh is not None or args.tolerance is not None
    counted = (*WRONG, *([NOT_UNIFORM] if close else []), *([UNKNOWN] if args.strict else []))
    with_shapes = [d for d in diagnoses if d.mesh]
    # If nothing could be compared, the status must not be that of a comparison without findings.
    nothing = close and with_shapes and all(d.status in (UNKNOWN, NOT_JUDGED) for d in with_shapes)
    status = 1 if nothing or any(d.status in counted for d in diagnoses) else 0
    return status, {"compare": robot, "links": [d.as_dict() for d in diagnoses]}


def _print_diagnoses(diagnoses: list[LinkDiagnosis]) -> None:
    """Print a line for each link, the causes and the expected numbers, and the counts."""
    for d in diagnoses:
        name = f" ({d.mesh})" if d.mesh else ""
        note = f"; {d.note}" if d.note else ""
        print(printable(f"{d.link}{name}: {d.status}{note}"))
        if d.inertia_error is not None:
            errors = f"inertia {d.inertia_error:.2g} ({d.ratio:.3g} times as large)"
            center = f"centre of mass {d.center_of_mass_error:.2g} of the size"
            print(f"  differs from the uniform solid of its {d.judged_by} shapes: {errors}, {center}")
        for cause in d.causes:
            print(f"  cause: {cause}")
        for remark in d.info:
            print(printable(f"  info: {remark}"))
        if d.expected is not None and d.status not in ("uniform", "not uniform"):
            center_of_mass, six = d.expected.center_of_mass, six_from_tensor(d.expected.inertia)
            print(f"  expected: com {' '.join(f'{value:.9g}' for value in center_of_mass)}")
            print(f"  expected: ixx ixy ixz iyy iyz izz {' '.join(f'{value:.9g}' for value in six)}")
    if len(diagnoses) > 1:
        counts = Counter(d.status for d in diagnoses)
        print(f"{len(diagnoses)} links: {', '.join(f'{count} {status}' for status, count in counts.items())}")


def _fix(args: argparse.Namespace) -> int:
    """Write OUT. Returns 0 if no inertial is wrong any longer, otherwise 1."""
    from ..robots.diagnosis import WRONG
    from ..robots.fix import fix_robot

    if args.mesh or args.tolerance:
        raise InputError("--fix", args.fix, "the whole robot: --compare ROBOT without a MESH or a tolerance")
    robot = Path(args.compare[0])
    if is_same_file(robot, args.fix):
        raise InputError("--fix", args.fix, "another file than the robot's")
    folders = tuple(args.package_path or ())
    data, links = fix_robot(
        robot,
        folders=folders,
        accept_open=args.accept_open or 0.0,
        everything=args.all,
        density=args.density or 0.0,
    )
    with whole_file("--fix", args.fix) as path:
        path.write_bytes(data)
    if args.json:
        rows = [{**link.before.as_dict(), "written": link.written, "left": link.left} for link in links]
        print(json.dumps({"compare": args.compare[0], "fix": args.fix, "links": rows}))
    else:
        for link in links:
            became = " -> uniform" if link.written else f"; left: {link.left}" if link.left else ""
            print(printable(f"{link.before.link}: {link.before.status}{became}"))
        written, left = sum(link.written for link in links), sum(bool(link.left) for link in links)
        print(f"{args.fix}: {written} of {len(links)} inertials rewritten, {left} left as they are")
    return 1 if any(link.before.status in WRONG and not link.written for link in links) else 0


def lump(args: argparse.Namespace) -> int:
    """Run ``inspect --lump ROBOT``: print the robot as one body, and write it as a scene if requested."""
    from ..robots.composite_inertia import lump_robot

    _refuse(
        args,
        "lump",
        "mesh",
        "compare",
        "fix",
        "all",
        "tolerance",
        "strict",
        "verify",
        "ballast",
        "mass",
        "density",
        "model",
    )
    _refuse(args, "lump", "scale", "repair", "fallback", "accept-open")
    whole = lump_robot(Path(args.lump), tuple(args.package_path or ()))
    written = () if args.as_scene is None else _write_scene(whole, args.as_scene)
    if args.json:
        print(json.dumps(_lump_as_dict(args.lump, whole)))
    elif not print_inertial(args, whole.properties):
        _print_lump(whole, written)
    return 0


def _lump_as_dict(robot: str, whole: Lump) -> dict[str, Any]:
    moments, axes = principal_axes(whole.properties.inertia)
    return {
        "lump": robot,
        **whole.properties.as_dict(),
        "principal_moments": moments.tolist(),
        "principal_axes": axes.tolist(),
        "principal_orientation_xyzw": quaternion_from_matrix(axes).tolist(),
        "links": dict(whole.links),
        "massless": list(whole.massless),
        "absent": list(whole.absent),
        "vertices": len(whole.vertices),
        "triangles": len(whole.triangles),
    }


def _print_lump(whole: Lump, written: tuple[str, ...]) -> None:
    properties = whole.properties
    rows: list[tuple[str, ...]] = [("links", f" {len(whole.links)}", ""), ("mass", f"{properties.mass: .9g}", "kg")]
    rows.append(("centre of mass", row_of(properties.center_of_mass), "m"))
    rows += tensor_rows(properties.inertia)
    rows.append(("principal moments", row_of(principal_axes(properties.inertia)[0]), "kg m²"))
    table(rows)
    if whole.massless:
        print(printable(f"without an inertial, and so without mass: {', '.join(whole.massless)}"))
    for text in whole.absent:
        print(printable(f"not in the mesh: {text}"))
    for name in written:
        print(f"wrote {name}")


def _write_scene(whole: Lump, name: str) -> tuple[str, ...]:
    """Write the scene, and the mesh, which is only drawn, into the same folder. Returns the names of the files."""
    from ..robots.composite_inertia import obj_text
    from ..scene.scenario import scene_text

    with whole_file("--as-scene", name) as scene:
        mesh = Path(name).absolute().with_suffix(".obj")
        if mesh == Path(name).absolute():
            raise InputError("--as-scene", name, "the name of a scene; its mesh is written beside it as .obj")
        own = next((file for file in whole.files if is_same_file(file, name) or is_same_file(file, mesh)), None)
        if own is not None:
            raise InputError("--as-scene", name, f"another name, which leaves the robot's own {own.name} as it is")
        values: dict[str, Any] = {
            "mesh": str(mesh) if len(whole.triangles) else "",
            "inertia_model": "explicit",
            "explicit_inertia.mass": whole.properties.mass,
            "explicit_inertia.center_of_mass": whole.properties.center_of_mass.tolist(),
            "explicit_inertia.tensor": list(six_from_tensor(whole.properties.inertia)),
        }
        if len(whole.triangles):
            with whole_file("--as-scene", mesh) as file:
                file.write_text(obj_text(whole.vertices, whole.triangles), encoding="utf-8")
        scene.write_text(scene_text(values), encoding="utf-8")
    return (name, str(mesh)) if len(whole.triangles) else (name,)
