# SPDX-License-Identifier: MIT
"""MJCF: bodies with geoms and inertials, as MuJoCo's own compiler takes default classes, frames, attached models and
orientations.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import read_bounded
from . import reading as rd

MAX_ELEMENTS = 20_000
"""Of one model, replicated and attached ones counted: 3000 bodies with a geom each took 3.4 s of a core and 116 MB."""
PIXELS = 1000
"""Of a texture or height field that count as one element."""
MAX_INCLUDES = 200
"""Of one model, the includes of included files counted."""


def _include(parent: Element, main: Path, path: Path, left: Iterator[int]) -> None:
    """Put the content of included files, named from the main file's folder or from that of ``path``, the file that
    includes them, in the place of each <include>: MuJoCo itself takes no file twice. ``left``: how many more may
    follow.
    """
    for child in list(parent):
        if child.tag != "include":
            _include(child, main, path, left)
            continue
        if next(left, None) is None:
            raise InputError("robot file", f"{main.name} includes more files", f"at most {MAX_INCLUDES}")
        places = [folder / child.get("file", "") for folder in (main.parent, path.parent)]
        file = next((place for place in places if place.is_file()), places[0])
        text = read_bounded(file, rd.MAX_BYTES, "robot file", "an MJCF file to include", ordinary=True)
        content = rd.parse_xml(text, file)
        _include(content, main, file, left)
        place = list(parent).index(child)
        parent[place : place + 1] = list(content)


def _whole(text: str | None) -> int:
    """A count as a file has it, at least 1; 1 also for what MuJoCo will refuse."""
    try:
        return max(1, int(float(text or "1")))
    except (ValueError, OverflowError):
        return 1


def _elements(element: Element, models: dict[str, int]) -> int:
    """Elements that MuJoCo makes of one: what is replicated as often as that, the points of what is composed, pixels of
    textures and height fields, and the models (elements of each, by name) that are attached.
    """
    total = 1 + sum(_elements(child, models) for child in element)
    words = {name: [_whole(word) for word in text.split()] for name, text in element.attrib.items()}
    if element.tag == "replicate":
        return total * math.prod(words.get("count", []))
    if element.tag in ("composite", "flexcomp"):
        return total + math.prod(words.get("count", []))
    if element.tag in ("texture", "hfield"):
        return (
            total + math.prod(math.prod(words.get(name, [])) for name in ("width", "height", "nrow", "ncol")) // PIXELS
        )
    return total + models.get(element.get("model", ""), 0) if element.tag == "attach" else total


def _check_size(root: Element, path: Path, known: dict[Path, int]) -> None:
    """Put into ``known`` how many elements MuJoCo makes of a file, with the models that it attaches. Raises InputError
    beyond MAX_ELEMENTS, for which MuJoCo may take hours and all memory.
    """
    models, known[path] = {}, 0  # of a model within itself, which MuJoCo refuses
    for model in root.iter("model"):
        file = path.parent / model.get("file", "")
        if file.is_file() and file not in known:
            content = rd.parse_xml(read_bounded(file, rd.MAX_BYTES, "robot file", "an MJCF file", ordinary=True), file)
            _check_size(content, file, known)
        models[model.get("name", "") or file.stem] = known.get(file, 0)
    total = _elements(root, models)
    if total > MAX_ELEMENTS:
        raise InputError("robot file", f"{path.name} replicates to {total:.3g} elements", f"at most {MAX_ELEMENTS}")
    known[path] = total


class _Source:
    """A model's text, and what MuJoCo makes of it; files that it names are looked for beside it."""

    def __init__(self, root: Element, path: Path) -> None:
        try:
            import mujoco
        except ImportError:
            raise InputError("robot file", f"MJCF: {is_missing('mujoco', 'robots')}") from None
        self.mujoco: Any = mujoco
        mujoco.set_mju_user_warning(lambda _: None)  # which would be written into a file beside the robot
        self.text = ElementTree.tostring(root, encoding="unicode")
        self.path = path

    def parsed(self) -> Any:
        """A new MjSpec: what the file says, default classes applied, models attached, nothing computed."""
        with self._refusing("reads"):
            spec = self.mujoco.MjSpec.from_string(self.text)
        spec.compiler.fusestatic = spec.compiler.discardvisual = False  # which would drop bodies and geoms
        for joint in spec.joints:
            joint.align = False  # which would move a body's frame into its principal axes
        self._delete(spec, "keys sensors actuators equalities tendons pairs excludes skins tuples")
        return spec

    def _delete(self, spec: Any, kinds: str) -> None:
        for kind in kinds.split():
            for element in list(getattr(spec, kind)):
                spec.delete(element)

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
        self._delete(spec, "meshes hfields materials textures")
        return spec

    def compiled(self, spec: Any) -> Any:
        """The MjModel of a spec."""
        with self._refusing("compiles"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of attributes that will be dropped some day
            return spec.compile()

    @contextlib.contextmanager
    def _refusing(self, verb: str) -> Iterator[None]:
        try:
            with contextlib.chdir(self.path.parent):
                yield
        except Exception as error:  # MuJoCo raises others, too, for a file that it doesn't expect
            reason = " ".join(str(error).replace("XML Error:", "").replace("Error:", "").split())
            raise InputError("robot file", self.path.name, f"what MuJoCo {verb} ({reason})") from None


def _shape(spec: Any, raw: Any, meshes: dict[str, Any], model: Any, number: int) -> rd.Shape | None:
    """The shape of a geom, raw as the file has it, at its compiled place; None for those that are no solid."""
    kind = str(raw.type).rpartition("_")[2].lower()
    if kind in ("plane", "hfield"):
        return None
    role = rd.COLLISION if raw.contype or raw.conaffinity else rd.VISUAL
    pose = rd.Pose(rd.rotation_from_wxyz(model.geom_quat[number]), model.geom_pos[number].copy())
    shape = rd.Shape(role, kind, pose)
    if kind == "mesh":
        mesh = meshes.get(raw.meshname)
        if mesh is None or not mesh.file or np.any(mesh.refpos) or mesh.refquat.tolist() != [1.0, 0.0, 0.0, 0.0]:
            return replace(shape, file=raw.meshname, problem="a mesh without a file, or with refpos or refquat")
        file = Path(mesh.file).name if spec.strippath else mesh.file
        return replace(shape, file=str(Path(mesh.compiler.meshdir or "") / file), scale=mesh.scale.copy())
    a, b, c = (2.0 * model.geom_size[number]).tolist()
    sizes = {
        "box": (a, b, c),
        "cylinder": (0.5 * a, b),
        "capsule": (0.5 * a, b),
        "sphere": (0.5 * a,),
        "ellipsoid": (0.5 * a, 0.5 * b, 0.5 * c),
    }
    if raw.meshname or kind not in sizes:
        return replace(shape, problem=f"a {kind} fitted to a mesh" if raw.meshname else f"a geom of type {kind}")
    return replace(shape, size=sizes[kind])


def _link(spec: Any, body: Any, name: str, shapes: list[rd.Shape | None], inertial: Element | None) -> rd.Link:
    """A body with the inertial that the file has."""
    bare = rd.Link(name, tuple(filter(None, shapes)))
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
    center, rotation = " ".join(map(repr, body.ipos.tolist())), rd.rotation_from_wxyz(quaternion)
    return rd.printed_link(bare, repr(body.mass), center, [repr(value) for value in six], rotation, inertial)


def _poses(model: Any, names: list[str]) -> dict[str, rd.Pose]:
    """Poses of the bodies in the world, as the file has them."""
    poses = [rd.HERE]
    for body in range(1, model.nbody):
        own = rd.Pose(rd.rotation_from_wxyz(model.body_quat[body]), model.body_pos[body])
        poses.append(poses[model.body_parentid[body]] @ own)
    return dict(zip(names, poses, strict=True))


def _simulated(source: _Source, links: list[rd.Link], names: list[str]) -> list[rd.Link]:
    """The links with the masses that MuJoCo takes: of its <compiler>, and of the geoms where there are no inertials."""
    spec = source.parsed()
    always = source.mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    from_geoms = any(body.compiler.inertiafromgeom == always for body in spec.bodies)  # attached ones have their own
    if not from_geoms and all(body.explicitinertial or not body.geoms for body in spec.bodies[1:]):
        spec = source.without_files()
    model = source.compiled(spec)
    known = {link.name: link for link in links}
    found = []
    for body, name in list(enumerate(names))[1:]:
        rotation = rd.rotation_from_wxyz(model.body_iquat[body])
        link = replace(
            known.get(name) or rd.Link(name),
            mass=float(model.body_mass[body]),
            center_of_mass=model.body_ipos[body].copy(),
            inertia=rotation @ np.diag(model.body_inertia[body]) @ rotation.T,
            problem="" if model.body_mass[body] > 0.0 else rd.NO_INERTIAL,
        )
        found.append(link)
    return found


def read_mjcf(root: Element, path: Path) -> rd.Robot:
    """The bodies of a <mujoco>; raises InputError for what MuJoCo refuses, and without it."""
    inertials = {body.get("name", ""): body.find("inertial") for body in root.iter("body")}
    try:
        _include(root, path, path, iter(range(MAX_INCLUDES)))
        _check_size(root, path, {})
    except RecursionError:
        raise InputError("robot file", path.name, "elements within each other as deep as MuJoCo takes them") from None
    if any(not model.get("file") for model in root.iter("model")):  # MuJoCo may loop at a later file after such a one
        raise InputError("robot file", path.name, "a file for each <model>")
    source = _Source(root, path)
    spec, frames = source.parsed(), source.without_files()
    for body in frames.bodies[1:]:  # what the file says of inertials may be what MuJoCo refuses
        body.explicitinertial, body.mass, body.inertia = True, 1.0, [1.0, 1.0, 1.0]
        body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
    model = source.compiled(frames)
    names = [model.body(body).name or f"body {body}" for body in range(model.nbody)]
    meshes = {mesh.name: mesh for mesh in spec.meshes}
    shapes: dict[int, list[rd.Shape | None]] = {body: [] for body in range(model.nbody)}
    for raw, placed in zip(spec.geoms, frames.geoms, strict=True):
        shapes[int(model.geom_bodyid[placed.id])].append(_shape(spec, raw, meshes, model, placed.id))
    links = [
        _link(spec, raw, names[placed.id], shapes[placed.id], inertials.get(raw.name) if raw.name else None)
        for raw, placed in zip(spec.bodies[1:], frames.bodies[1:], strict=True)
    ]
    return rd.Robot(links, lambda: _poses(model, names), lambda: _simulated(source, links, names))
