# SPDX-License-Identifier: MIT
"""``rigid_proto inspect`` of a whole robot: ``--compare`` checks its inertials, ``--fix`` rewrites them, ``--lump``
takes it as one rigid body.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..base.files import whole_file
from ..mass.tensor import principal_axes, six_from_tensor
from .inspect_report import print_diagnoses, print_diagnosis_lines, print_fixed_links, print_lump

if TYPE_CHECKING:
    from ..robots.composite_inertia import Lump
    from ..robots.diagnosis import LinkDiagnosis, Options
    from ..robots.fix import FixedLink

_COMPARES = ("link", "fix", "all", "tolerance")
_LUMPS = ("joint", "as_scene")
ROBOT_SUFFIXES = (".urdf", ".sdf", ".xml", ".mjcf")


def joint_value(text: str) -> tuple[str, float]:
    """``elbow=0.5`` as name and number; raises ValueError for others."""
    name, _, number = text.rpartition("=")
    if not name or not math.isfinite(float(number)):
        raise ValueError(f"{text!r} instead of NAME=VALUE")
    return name, float(number)


def add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what concerns robots."""
    parser.add_argument(
        "--compare", metavar="ROBOT", help="judge the inertials in a URDF, SDF or MJCF; exit 1 for wrong ones"
    )
    parser.add_argument("--link", metavar="NAME", help="with --compare: this link alone")
    parser.add_argument(
        "--package-path", type=Path, action="append", default=[], metavar="DIR",
        help="with --compare or --lump: a folder that holds packages or models that the file names; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", type=float, metavar="T",
        help="with --compare: one line per link; exit 1 also when one differs from a uniform solid by more than T",
    )  # fmt: skip
    parser.add_argument("--fix", metavar="OUT", help="with --compare: write the file to OUT, wrong inertials rewritten")
    parser.add_argument("--all", action="store_true", help="with --fix: rewrite those that aren't uniform, too")
    parser.add_argument("--lump", metavar="ROBOT", help="a URDF, SDF or MJCF with its joints held, as one rigid body")
    parser.add_argument(
        "--joint", type=joint_value, action="append", metavar="NAME=VALUE",
        help="with --lump: where a joint is held, in rad or m (default 0); may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--as-scene", metavar="FILE.yaml", help="with --lump: write a scene that simulates it, and its mesh"
    )


def check_robot_options(args: argparse.Namespace, meshes: list[str]) -> None:
    """Refuse options that need a robot, or another of its uses."""
    for names, use in ((_COMPARES, "compare"), (_LUMPS, "lump")):
        for name in names:
            if getattr(args, use) is None and getattr(args, name) not in (None, False, []):
                raise InputError(f"--{name.replace('_', '-')}", f"needs --{use} ROBOT")
    if args.package_path and args.compare is None and args.lump is None:
        raise InputError("--package-path", "needs --compare ROBOT or --lump ROBOT")
    if args.compare is not None and len(meshes) > 1 and not _are_robots(meshes):
        raise InputError("--compare", " ".join(meshes), "one MESH, or none for all links, or further robots")
    if args.compare is not None and _are_robots(meshes) and args.fix is not None:
        raise InputError("--fix", args.fix, "one robot")
    if args.lump is not None and (args.compare is not None or meshes):
        raise InputError("--lump", "can't be combined with MESH or --compare")


def compare(args: argparse.Namespace, meshes: list[str], scale: list[float]) -> int:
    """``inspect [MESH] --compare ROBOT``, or with several robots: 1 when a link's inertial is wrong, otherwise 0; with
    a mesh or a tolerance also 1 for one that differs from the uniform solid, and when nothing could be compared.
    """
    robots = [args.compare, *meshes] if _are_robots(meshes) else [args.compare]
    mesh = meshes[0] if meshes and len(robots) == 1 else None
    _check(args, mesh, scale)
    chosen = None if scale == [1.0] else np.array(scale * 3 if len(scale) == 1 else scale)
    options = _options(args)
    if args.fix is not None:
        return _fix(args, options)
    if len(robots) == 1:
        status, report = _judge(args, args.compare, options, mesh, chosen)
        if args.json:
            print(json.dumps(report))
        return status
    found = [_judge_one_of_several(args, robot, options) for robot in robots]
    if args.json:
        print(json.dumps({"robots": [report for _, report in found]}))
    return max(status for status, _ in found)


def _are_robots(names: list[str]) -> bool:
    """Whether names given where a mesh may stand are those of further robots."""
    return bool(names) and all(Path(name).suffix in ROBOT_SUFFIXES for name in names)


def _judge_one_of_several(args: argparse.Namespace, robot: str, options: Options) -> tuple[int, dict]:
    """Exit status and JSON object of one robot, 2 where it is refused; the others are judged none the less."""
    if not args.json:
        print(f"{robot}:")
    try:
        return _judge(args, robot, options, None, None)
    except InputError as error:
        print(f"rigid_proto inspect: {robot}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2, {"compare": robot, "links": None, "refused": str(error)}


def _judge(
    args: argparse.Namespace, robot: str, options: Options, mesh: str | None, scale: np.ndarray | None
) -> tuple[int, dict]:
    """Exit status and JSON object of one robot, printed but for JSON."""
    from ..robots.diagnosis import NOT_UNIFORM, UNKNOWN, WRONG, compare_robot

    diagnoses = compare_robot(Path(robot), options, mesh=mesh, scale=scale, link=args.link)
    if not args.json and args.tolerance is not None:
        print_diagnosis_lines(diagnoses)
    elif not args.json:
        print_diagnoses(diagnoses)
    strict = mesh is not None or args.tolerance is not None
    counted = (*WRONG, NOT_UNIFORM) if strict else WRONG
    with_shapes = [d for d in diagnoses if d.mesh]
    # A comparison of nothing must not look like one that found nothing.
    nothing = strict and with_shapes and all(d.status == UNKNOWN for d in with_shapes)
    status = 1 if nothing or any(d.status in counted for d in diagnoses) else 0
    return status, {"compare": robot, "links": [d.as_dict() for d in diagnoses]}


def lump(args: argparse.Namespace) -> int:
    """``inspect --lump ROBOT``: the robot as one body, printed, and written as a scene where it is asked for."""
    from ..mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
    from ..robots.composite_inertia import lump_robot

    unused = {"scale": ["1"], "model": "solid"}  # with their defaults; the others' are false
    for flag in ("verify", "ballast", "mass", "density", "repair", "fallback", "accept-open", *unused):
        value = getattr(args, flag.replace("-", "_"))
        if value and value != unused.get(flag):
            raise InputError(f"--{flag}", "can't be used with --lump, which takes the robot's own inertials")
    whole = lump_robot(Path(args.lump), dict(args.joint or []), tuple(args.package_path))
    written = _write_scene(whole, args.as_scene) if args.as_scene else ()
    exports = {"urdf": urdf_inertial, "sdf": sdf_inertial, "mjcf": mjcf_inertial}
    export = next((export for name, export in exports.items() if getattr(args, name)), None)
    if args.json:
        print(json.dumps(_lump_as_dict(args, whole)))
    elif export is not None:
        print(export(whole.properties), end="")
    else:
        print_lump(whole, written)
    return 0


def _lump_as_dict(args: argparse.Namespace, whole: Lump) -> dict:
    moments, axes = principal_axes(whole.properties.inertia)
    return {
        "lump": args.lump,
        "joints": dict(args.joint or []),
        "mass": whole.properties.mass,
        "center_of_mass": whole.properties.center_of_mass.tolist(),
        "inertia": whole.properties.inertia.tolist(),
        "principal_moments": moments.tolist(),
        "principal_axes": axes.tolist(),
        "links": dict(whole.links),
        "massless": list(whole.massless),
        "absent": list(whole.absent),
        "doubts": list(whole.doubts),
        "vertices": len(whole.vertices),
        "triangles": len(whole.triangles),
    }


def _write_scene(whole: Lump, name: str) -> tuple[str, ...]:
    """Write the scene, and beside it the mesh, which carries the picture alone; returns what was written."""
    from ..robots.composite_inertia import obj_text
    from ..scene.scenario import scene_text

    with whole_file("--as-scene", name) as scene:
        mesh = Path(name).absolute().with_suffix(".obj")
        values: dict = {
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


def _check(args: argparse.Namespace, mesh: str | None, scale: list[float]) -> None:
    """Refuse what makes no sense with a robot."""
    for flag in ("verify", "urdf", "sdf", "mjcf"):
        if getattr(args, flag):
            raise InputError(f"--{flag}", "can't be used with --compare, which takes --json alone")
    # Solids of one density are what a robot's inertials are compared with.
    if args.model != "solid" or args.ballast:
        flag = "ballast" if args.ballast else "model"
        raise InputError(f"--{flag}", "can't be used with --compare, which compares solids")
    if mesh is None and scale != [1.0]:
        raise InputError("--scale", "needs the MESH of one link; the robot's file gives the scales of its own meshes")
    if args.tolerance is not None and not 0.0 < args.tolerance < math.inf:
        raise InputError("--tolerance", args.tolerance, "a finite number > 0")
    if args.all and args.fix is None:
        raise InputError("--all", "needs --fix OUT")
    if mesh is not None and args.fix is not None:
        raise InputError("--fix", "needs the whole robot: --compare ROBOT without a MESH")


def _options(args: argparse.Namespace) -> Options:
    from ..robots.diagnosis import LIMIT, Options

    return Options(
        args.mass or 0.0,
        args.density or 0.0,
        args.repair,
        args.fallback,
        args.accept_open,
        args.max_triangles,
        tuple(args.package_path),
        args.tolerance or LIMIT,
    )


def _fix(args: argparse.Namespace, options: Options) -> int:
    """Write OUT; 0 when no link's inertial is wrong any longer, otherwise 1."""
    from ..robots.diagnosis import WRONG
    from ..robots.fix import fix_robot

    data, links = fix_robot(Path(args.compare), options, link=args.link, everything=args.all)
    with whole_file("--fix", args.fix) as path:
        path.write_bytes(data)
    if args.json:
        print(json.dumps({"compare": args.compare, "fix": args.fix, "links": [_as_dict(link) for link in links]}))
    else:
        print_fixed_links(links, args.fix)
    return 1 if any(link.after.status in WRONG for link in links) else 0


def _as_dict(link: FixedLink) -> dict:
    def state(d: LinkDiagnosis) -> dict:
        full = d.as_dict()
        return {key: full[key] for key in ("status", "mass", "mass_error", "center_of_mass_error", "inertia_error")}

    whole = link.before.as_dict()
    return {**whole, "written": link.written, "left": link.left, "after": state(link.after)}
