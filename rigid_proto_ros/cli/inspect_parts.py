# SPDX-License-Identifier: MIT
"""``rigid_proto inspect PART PART ...``: parts given on the command line as one body. One of them may be a link of a
robot, to which the others are added as a payload.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path

from ..base.errors import InputError
from ..base.rotation import quaternion_from_matrix
from ..mass.from_mesh import mesh_body
from ..mass.inspection import inspect_mesh
from ..mass.properties import MassProperties
from ..mass.tensor import check_tensor, principal_axes
from ..mesh.locate import resolve_mesh
from ..mesh.parts import Part, placing
from ..mesh.reading import Mesh, load_mesh, load_part, mesh_of_parts
from .inspect_report import print_inertial, row_of, table, tensor_rows

ROBOTS = (".urdf", ".sdf", ".xml", ".xacro", ".world")


def split_part(text: str) -> tuple[str, str]:
    """Name of a mesh, and the text after its last ``=``; empty if the whole text is the name of a file."""
    name, sign, material = text.rpartition("=")
    if not sign or Path(text).is_file():
        return text, ""
    return name, material


def mesh_of_texts(texts: Sequence[str], density: float, scale: Sequence[float] | None) -> Mesh:
    """The body of parts given as MESH, MESH=density or MESH=mass:kg. density: of parts that give none [kg/m³]. scale:
    of every mesh. Raises InputError.
    """
    parts: list[Part] = []
    for text in texts:
        name, material = split_part(text)
        kind, colon, number = material.rpartition(":")
        try:
            value = float(number) if material else density
        except ValueError:
            value = math.nan
        if kind != ("mass" if colon else "") or not 0.0 < value < math.inf:
            raise InputError(name, f"={material}", "=DENSITY in kg/m³ or =mass:KG, a finite number > 0")
        mesh = load_part(name, Path())
        own = mesh.name
        while own in [part.name for part in parts]:
            own += "'"
        matrix = placing(f"part {own}", list(scale or [1.0]), [0.0] * 3, [0.0, 0.0, 0.0, 1.0])
        parts.append(Part(own, mesh, matrix, density=value, mass=value if colon else 0.0))
    return mesh_of_parts(" + ".join(part.name for part in parts), ", ".join(texts), parts, repr(texts))


def is_link(text: str) -> bool:
    """Whether a text names a link of a robot file, as FILE#LINK."""
    file, sign, _ = text.rpartition("#")
    return bool(sign) and Path(file).suffix.lower() in ROBOTS and not Path(text).is_file()


def with_link(args: argparse.Namespace, all_texts: Sequence[str]) -> int:
    """Print a link and the parts fixed to it as one body, in the link's frame. Returns the exit status."""
    from ..robots.link_shapes import combined
    from ..robots.reading import check_inertial, read_robot

    links, texts = [text for text in all_texts if is_link(text)], [text for text in all_texts if not is_link(text)]
    if len(links) > 1 or not texts:
        raise InputError("MESH", " ".join([*links, *texts]), "one ROBOT#LINK, and the parts of its payload")
    for name in ("verify", "ballast", "mass", "model", "wall_thickness", "infill"):
        if getattr(args, name):
            raise InputError(
                f"--{name.replace('_', '-')}", "has no meaning beside ROBOT#LINK, whose own inertial is taken as it is"
            )
    file, _, name = links[0].rpartition("#")
    found = {link.name: link for link in read_robot(Path(file)).links}
    if name not in found:
        raise InputError(links[0], name, f"a link of {Path(file).name}: {', '.join(found)}")
    link = found[name]
    if link.problem:
        raise InputError(links[0], link.problem, "a link with mass and inertia")
    check_inertial(link)
    if len(texts) == 1 and not split_part(texts[0])[1] and resolve_mesh(texts[0]).suffix in (".yaml", ".yml"):
        mesh = load_mesh(texts[0])
    else:
        mesh = mesh_of_texts(texts, args.density or 1000.0, args.scale)
    body = mesh_body(mesh, repair=args.repair, fallback=args.fallback or "", accept_open=args.accept_open or 0.0)
    inspection = inspect_mesh(body)
    if inspection.refusal is not None:
        raise inspection.refusal
    payload = inspection.chosen
    whole = combined([MassProperties(link.mass, link.center_of_mass, link.inertia), payload], links[0])
    check_tensor(whole.inertia, source=f"tensor of {links[0]} with its payload")
    moments, axes = principal_axes(whole.inertia)
    if args.json:
        told = {"link": links[0], "link_mass": link.mass, "payload_mass": payload.mass, **whole.as_dict()}
        told |= {"principal_moments": moments.tolist(), "principal_axes": axes.tolist()}
        told["principal_orientation_xyzw"] = quaternion_from_matrix(axes).tolist()
        print(json.dumps({**told, "verdict": [vars(finding) for finding in inspection.findings]}))
    elif not print_inertial(args, whole):
        print(f"{links[0]}, {link.mass:.9g} kg, with {mesh.name}, {payload.mass:.9g} kg:")
        for finding in inspection.findings:
            print(f"  {finding.severity}: {finding.message} [{finding.code}]")
        rows: list[tuple[str, ...]] = [("mass", f"{whole.mass: .9g}", "kg")]
        rows.append(("centre of mass", row_of(whole.center_of_mass), "m, in the link's frame"))
        table([*rows, *tensor_rows(whole.inertia), ("principal moments", row_of(moments), "kg m²")])
    return 0
