# SPDX-License-Identifier: MIT
"""MJCF: bodies with geoms and inertials, as MuJoCo's own compiler takes default classes, frames, attached models and
orientations.
"""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import read_bounded
from .model import (
    COLLISION,
    MAX_BYTES,
    OTHER,
    SLIDES,
    TURNS,
    VISUAL,
    Connection,
    Joint,
    Link,
    Pose,
    Robot,
    Shape,
    bare_link,
    parse_xml,
    printed_link,
    rotation_from_wxyz,
)

MAX_INCLUDES = 200


def _with_includes(parent: Element, path: Path, above: tuple[Path, ...]) -> int:
    """Put the content of included files, named from the main file's folder, in the place of each <include>, and count
    them; ``above``: the files that are being read.
    """
    count = 0
    for child in list(parent):
        if child.tag != "include":
            count += _with_includes(child, path, above)
            continue
        file = (path.parent / child.get("file", "")).resolve()
        if file in above or len(above) > MAX_INCLUDES:
            raise InputError(
                "robot file", f"<include file={child.get('file')!r}>", "files that don't include themselves"
            )
        content = parse_xml(read_bounded(file, MAX_BYTES, "robot file", "an MJCF file to include"), file)
        count += 1 + _with_includes(content, path, (*above, file))
        place = list(parent).index(child)
        parent[place : place + 1] = list(content)
    if count > MAX_INCLUDES:
        raise InputError("robot file", f"{path.name} includes {count} files", f"at most {MAX_INCLUDES}")
    return count


class _Source:
    """A model's text, and what MuJoCo makes of it; files that it names are looked for beside it."""

    def __init__(self, root: Element, path: Path) -> None:
        try:
            import mujoco
        except ImportError:
            raise InputError("robot file", f"MJCF: {is_missing('mujoco', 'robots')}") from None
        self.mujoco: ModuleType = mujoco
        self.text = ElementTree.tostring(root, encoding="unicode")
        self.path = path

    def parsed(self) -> Any:
        """A new MjSpec: what the file says, default classes applied, models attached, nothing computed."""
        try:
            with contextlib.chdir(self.path.parent):
                spec = self.mujoco.MjSpec.from_string(self.text)
        except ValueError as error:
            raise self._refusal("reads", error) from None
        spec.compiler.fusestatic = spec.compiler.discardvisual = False  # which would drop bodies and geoms
        unneeded = ("keys", "sensors", "actuators", "equalities", "tendons", "pairs", "excludes", "skins", "tuples")
        for kind in unneeded:
            for element in list(getattr(spec, kind)):
                spec.delete(element)
        return spec

    def compiled(self, spec: Any) -> Any:
        """The MjModel of a spec."""
        try:
            with contextlib.chdir(self.path.parent), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of attributes that will be dropped some day
                return spec.compile()
        except ValueError as error:
            raise self._refusal("compiles", error) from None

    def _refusal(self, verb: str, error: ValueError) -> InputError:
        reason = " ".join(str(error).replace("XML Error:", "").replace("Error:", "").split())
        return InputError("robot file", self.path.name, f"what MuJoCo {verb} ({reason})")

    def without_files(self) -> Any:
        """A new spec whose meshes, height fields and textures are gone: small spheres stand where they were."""
        spec = self.parsed()
        drawn = self.mujoco.mjtGeom
        for geom in spec.geoms:
            if geom.meshname or geom.type in (drawn.mjGEOM_HFIELD, drawn.mjGEOM_PLANE, drawn.mjGEOM_SDF):
                geom.type, geom.size, geom.fromto = drawn.mjGEOM_SPHERE, [1.0, 0.0, 0.0], [np.nan, 0, 0, 0, 0, 0]
            geom.meshname = geom.hfieldname = geom.material = ""
        for site in spec.sites:
            site.material = ""
        for kind in ("meshes", "hfields", "materials", "textures"):
            for element in list(getattr(spec, kind)):
                spec.delete(element)
        return spec


def _shape(spec: Any, raw: Any, meshes: dict[str, Any], model: Any, number: int) -> Shape | None:
    """The shape of a geom, raw as the file has it, at its compiled place; None for those that are no solid."""
    kind = str(raw.type).rpartition("_")[2].lower()
    if kind in ("plane", "hfield"):
        return None
    role = COLLISION if raw.contype or raw.conaffinity else VISUAL
    shape = Shape(role, kind, rotation_from_wxyz(model.geom_quat[number]), model.geom_pos[number].copy())
    if kind == "mesh":
        return _mesh(shape, raw.meshname, meshes, spec.strippath)
    if raw.meshname:
        return replace(shape, problem=f"a {kind} fitted to a mesh")
    a, b, c = (2.0 * model.geom_size[number]).tolist()
    sizes = {
        "box": (a, b, c),
        "cylinder": (0.5 * a, b),
        "capsule": (0.5 * a, b),
        "sphere": (0.5 * a,),
        "ellipsoid": (0.5 * a, 0.5 * b, 0.5 * c),
    }
    if kind not in sizes:
        return replace(shape, problem=f"a geom of type {kind}, which isn't known here")
    return replace(shape, size=sizes[kind])


def _mesh(shape: Shape, name: str, meshes: dict[str, Any], strip: bool) -> Shape:
    if name not in meshes:
        return replace(shape, file=name, problem=f"mesh {name!r}, which no <asset> declares")
    mesh = meshes[name]
    if not mesh.file:
        return replace(shape, file=name, problem="a mesh that is written out in the file itself")
    if np.any(mesh.refpos) or mesh.refquat.tolist() != [1.0, 0.0, 0.0, 0.0]:
        return replace(shape, file=mesh.file, problem="a mesh with refpos or refquat")
    file = Path(mesh.file).name if strip else mesh.file
    return replace(shape, file=str(Path(mesh.compiler.meshdir or "") / file), scale=mesh.scale.copy())


def _link(spec: Any, body: Any, name: str, shapes: list[Shape | None], inertial: Element | None) -> Link:
    """A body with the inertial that the file has."""
    bare = bare_link(name, shapes, None)
    if not body.explicitinertial:
        return bare
    if np.isnan(body.fullinertia[0]):
        a, b, c = body.inertia.tolist()
        six = [a, 0.0, 0.0, b, 0.0, c]
    else:
        xx, yy, zz, xy, xz, yz = body.fullinertia.tolist()
        six = [xx, xy, xz, yy, yz, zz]
    quaternion = body.iquat
    if body.ialt.type != type(body.ialt.type).mjORIENTATION_QUAT:
        of = body.compiler
        quaternion = spec.resolve_orientation(degree=of.degree, sequence=of.eulerseq, orientation=body.ialt)
    center = [repr(value) for value in body.ipos.tolist()]
    return printed_link(bare, repr(body.mass), center, [repr(v) for v in six], rotation_from_wxyz(quaternion), inertial)


def _connections(source: _Source, model: Any, names: list[str]) -> list[Connection]:
    """The bodies in their parents, with their joints."""
    kinds = {int(source.mujoco.mjtJoint.mjJNT_HINGE): TURNS, int(source.mujoco.mjtJoint.mjJNT_SLIDE): SLIDES}
    found = []
    for body in range(1, model.nbody):
        path: list[Pose | Joint] = [Pose(rotation_from_wxyz(model.body_quat[body]), model.body_pos[body])]
        for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            anchor = Pose(np.eye(3), model.jnt_pos[joint])
            kind = kinds.get(int(model.jnt_type[joint]), OTHER)
            zero = float(model.qpos0[model.jnt_qposadr[joint]]) if kind != OTHER else 0.0
            name = model.joint(joint).name or f"joint {joint}"
            path += [anchor, Joint(name, kind, model.jnt_axis[joint], zero), anchor.inverse()]
        parent = int(model.body_parentid[body])
        found.append(Connection(names[parent] if parent else None, names[body], tuple(path)))
    return found


def _simulated(source: _Source, links: list[Link], names: list[str]) -> list[Link]:
    """The links with the masses that MuJoCo takes: of its <compiler>, and of the geoms where there are no inertials."""
    spec = source.parsed()
    from_geoms = spec.compiler.inertiafromgeom == source.mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if not from_geoms and all(body.explicitinertial or not body.geoms for body in spec.bodies[1:]):
        spec = source.without_files()
    model = source.compiled(spec)
    known = {link.name: link for link in links}
    found = []
    for body, name in list(enumerate(names))[1:]:
        rotation = rotation_from_wxyz(model.body_iquat[body])
        inertia = rotation @ np.diag(model.body_inertia[body]) @ rotation.T
        link = known.get(name) or bare_link(name, (), None)
        problem = "" if model.body_mass[body] > 0.0 else "no mass"
        center = model.body_ipos[body].copy()
        found.append(
            replace(link, mass=float(model.body_mass[body]), center_of_mass=center, inertia=inertia, problem=problem)
        )
    return found


def read_mjcf(root: Element, path: Path) -> Robot:
    """The bodies of a <mujoco>; raises InputError for what MuJoCo refuses, and without it."""
    inertials = {body.get("name", ""): body.find("inertial") for body in root.iter("body")}
    _with_includes(root, path, (path.resolve(),))
    source = _Source(root, path)
    spec, frames = source.parsed(), source.without_files()
    for body in frames.bodies[1:]:  # what the file says of inertials may be what MuJoCo refuses
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
        body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
    model = source.compiled(frames)
    names = [model.body(body).name or f"body {body}" for body in range(model.nbody)]
    meshes = {mesh.name: mesh for mesh in spec.meshes}
    shapes: dict[int, list[Shape | None]] = {body: [] for body in range(model.nbody)}
    for raw, placed in zip(spec.geoms, frames.geoms, strict=True):
        shapes[int(model.geom_bodyid[placed.id])].append(_shape(spec, raw, meshes, model, placed.id))
    links = []
    for raw, placed in zip(spec.bodies[1:], frames.bodies[1:], strict=True):
        link = _link(spec, raw, names[placed.id], shapes[placed.id], inertials.get(raw.name) if raw.name else None)
        if link.shapes or not link.problem:
            links.append(link)
    return Robot(
        links,
        names[1:],
        lambda: _connections(source, model, names),
        lambda: _simulated(source, links, names),
    )
