# SPDX-License-Identifier: MIT
"""MJCF: geoms and inertials of bodies; included files, default classes and frames as MuJoCo's compiler takes them."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from ..base.files import read_bounded
from .reading import (
    COLLISION,
    MAX_BYTES,
    VISUAL,
    LinkInertial,
    Shape,
    floats,
    link_inertial,
    parse_xml,
    placed,
    rotation_from_wxyz,
)

MAX_INCLUDES = 200
"""Files that one model may include; MuJoCo takes each file once."""

_Attributes = Mapping[str, str]


@dataclass(frozen=True)
class Model:
    """What holds for all bodies: angles in degrees, Euler sequence, mesh assets by name, attributes by class, tag."""

    degrees: bool
    sequence: str
    meshes: dict[str, _Attributes]
    folder: str
    bare_names: bool
    defaults: dict[str, dict[str, _Attributes]]

    def attributes(self, element: Element, childclass: str) -> _Attributes:
        """The element's own attributes, then those of its class, or of the class that its body's children have."""
        name = element.get("class") or childclass or "main"
        if name not in self.defaults:
            raise InputError("robot file", f"default class {name}", f"one of {', '.join(self.defaults)}")
        return ChainMap(dict(element.attrib), dict(self.defaults[name].get(element.tag, {})))


def _with_includes(root: Element, path: Path) -> None:
    """Put the content of included files, named from the main file's folder, in the place of each <include>."""
    taken = {path.resolve()}
    waiting = [root]
    while waiting:
        parent = waiting.pop()
        for place, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                waiting.append(child)
                continue
            file = (path.parent / child.get("file", "")).resolve()
            if file in taken or len(taken) > MAX_INCLUDES:
                raise InputError(
                    "robot file", f"<include file={child.get('file')!r}>", "each file included once, at most 200"
                )
            taken.add(file)
            content = parse_xml(read_bounded(file, MAX_BYTES, "robot file", "an MJCF file to include"), file)
            parent[place : place + 1] = list(content)
            waiting.extend(content)
            waiting.append(parent)


def _defaults(root: Element) -> dict[str, dict[str, _Attributes]]:
    """Attributes by class and tag; a class has those of the class that it stands in, but for its own."""
    found: dict[str, dict[str, _Attributes]] = {"main": {}}

    def take(element: Element, name: str, inherited: dict[str, _Attributes]) -> None:
        own = {**inherited, **found.get(name, {})}
        for child in element:
            if child.tag != "default":
                own[child.tag] = {**own.get(child.tag, {}), **child.attrib}
        found[name] = own
        for child in element.findall("default"):
            take(child, child.get("class", "main"), own)

    for element in root.findall("default"):
        take(element, element.get("class", "main"), {})
    return found


def mjcf_model(root: Element) -> Model:
    """What holds for all bodies of a model whose included files have been put in."""
    compiler: dict[str, str] = {}
    for element in root.findall("compiler"):
        compiler.update(element.attrib)
    if compiler.get("coordinate", "local") != "local":
        raise InputError(
            "robot file", f"coordinate={compiler['coordinate']!r}", "local coordinates, as MuJoCo since 2.3.4"
        )
    model = Model(
        compiler.get("angle", "degree") != "radian",
        compiler.get("eulerseq", "xyz"),
        {},
        compiler.get("meshdir") or compiler.get("assetdir") or "",
        compiler.get("strippath", "false") == "true",
        _defaults(root),
    )
    for asset in root.findall("asset"):
        for mesh in asset.findall("mesh"):
            attributes = model.attributes(mesh, "")
            name = attributes.get("name") or Path(attributes.get("file", "")).stem
            model.meshes[name] = attributes
    return model


def element_rotation(attributes: _Attributes, model: Model) -> np.ndarray:
    """Orientation of an MJCF element: quat, axisangle, xyaxes, zaxis or euler."""
    turn = math.pi / 180.0 if model.degrees else 1.0
    if attributes.get("axisangle"):
        x, y, z, angle = floats(attributes["axisangle"], "", 4)
        axis = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        half = 0.5 * angle * turn
        return rotation_from_wxyz([math.cos(half), *(math.sin(half) * axis)])
    if attributes.get("xyaxes"):
        values = floats(attributes["xyaxes"], "", 6)
        x = values[:3] / np.linalg.norm(values[:3])
        y = values[3:] - x * (x @ values[3:])
        y /= np.linalg.norm(y)
        return np.stack([x, y, np.cross(x, y)], axis=1)
    if attributes.get("zaxis"):
        return _turn_to(floats(attributes["zaxis"], "", 3))
    if attributes.get("euler"):
        rotation = np.eye(3)
        for letter, angle in zip(model.sequence, floats(attributes["euler"], "", 3) * turn, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            single = rotation_from_wxyz([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis)])
            rotation = rotation @ single if letter.islower() else single @ rotation  # intrinsic, or extrinsic
        return rotation
    return rotation_from_wxyz(floats(attributes.get("quat"), "1 0 0 0", 4))


def _turn_to(direction: np.ndarray) -> np.ndarray:
    """The shortest turn (3, 3) that brings z to ``direction`` (3,)."""
    z = direction / np.linalg.norm(direction)
    return rotation_from_wxyz([1.0 + z[2], -z[1], z[0], 0.0] if z[2] > -1.0 else [0.0, 1.0, 0.0, 0.0])


def _geom(geom: Element, model: Model, childclass: str) -> Shape | None:
    """The shape of a geom in its parent's frame; None for those that are no solid (planes, height fields)."""
    attributes = model.attributes(geom, childclass)
    touches = attributes.get("contype", "1") != "0" or attributes.get("conaffinity", "1") != "0"
    role = COLLISION if touches else VISUAL
    kind = attributes.get("type", "sphere")
    rotation = element_rotation(attributes, model)
    position = floats(attributes.get("pos"), "0 0 0", 3)
    if kind in ("plane", "hfield"):
        return None
    if kind == "mesh":
        return _mesh(Shape(role, kind, rotation, position), attributes.get("mesh", ""), model)
    shape = Shape(role, kind, rotation, position)
    if kind not in ("box", "cylinder", "sphere", "capsule", "ellipsoid"):
        return replace(shape, problem=f"a geom of type {kind}, which isn't known here")
    if attributes.get("mesh"):
        return replace(shape, problem=f"a {kind} fitted to a mesh")
    size = [float(word) for word in attributes.get("size", "").split()]
    if attributes.get("fromto"):
        ends = floats(attributes["fromto"], "", 6).reshape(2, 3)
        along = ends[1] - ends[0]
        shape = replace(shape, rotation=_turn_to(along), position=ends.mean(axis=0))
        half = 0.5 * float(np.linalg.norm(along))
        size = [*size[:1], half] if kind in ("cylinder", "capsule") else [size[0], size[0], half]
    full = {
        "box": lambda: (2.0 * size[0], 2.0 * size[1], 2.0 * size[2]),
        "cylinder": lambda: (size[0], 2.0 * size[1]),
        "capsule": lambda: (size[0], 2.0 * size[1]),
        "sphere": lambda: (size[0],),
        "ellipsoid": lambda: (size[0], size[1], size[2]),
    }
    try:
        return replace(shape, size=full[kind]())
    except IndexError:
        raise ValueError(f"size={attributes.get('size')!r} of a {kind}") from None


def _mesh(shape: Shape, name: str, model: Model) -> Shape:
    if name not in model.meshes:
        return replace(shape, file=name, problem=f"mesh {name!r}, which no <asset> declares")
    mesh = model.meshes[name]
    file = mesh.get("file", "")
    if not file:
        return replace(shape, file=name, problem="a mesh that is written out in the file itself")
    if any(floats(mesh.get("refpos"), "0 0 0", 3)) or mesh.get("refquat", "1 0 0 0").split() != ["1", "0", "0", "0"]:
        return replace(shape, file=file, problem="a mesh with refpos or refquat")
    bare = Path(file).name if model.bare_names else file
    return replace(shape, file=str(Path(model.folder) / bare), scale=floats(mesh.get("scale"), "1 1 1", 3))


def _shapes(body: Element, model: Model, childclass: str) -> Iterator[Shape]:
    """The shapes of a body's geoms, those in its frames included, in the body's frame."""
    for child in body:
        if child.tag == "geom":
            shape = _geom(child, model, childclass)
            if shape is not None:
                yield shape
        elif child.tag == "frame":
            rotation = element_rotation(child.attrib, model)
            position = floats(child.get("pos"), "0 0 0", 3)
            for shape in _shapes(child, model, child.get("childclass") or childclass):
                yield placed(shape, rotation, position)


def _bodies(element: Element, childclass: str) -> Iterator[tuple[Element, str]]:
    """The bodies below an element with the class that their geoms have."""
    for child in element:
        if child.tag in ("body", "frame", "replicate"):
            inner = child.get("childclass") or childclass
            if child.tag == "body":
                yield child, inner
            yield from _bodies(child, inner)


def read_mjcf(root: Element, path: Path) -> list[LinkInertial]:
    """Bodies of an MJCF that have an inertial; of the others MuJoCo computes it itself."""
    _with_includes(root, path)
    model = mjcf_model(root)
    links = []
    for world in root.findall("worldbody"):
        for body, childclass in _bodies(world, ""):
            inertial = body.find("inertial")
            if inertial is None:
                continue
            rotation = element_rotation(inertial.attrib, model)
            words = inertial.get("fullinertia", "").split()
            if words:
                xx, yy, zz, xy, xz, yz = words
                six = [xx, xy, xz, yy, yz, zz]
            else:
                a, b, c = inertial.get("diaginertia", "").split()
                six = [a, "0", "0", b, "0", c]
            shapes = list(_shapes(body, model, childclass))
            name = body.get("name", "?")
            mass, position = inertial.get("mass", ""), inertial.get("pos")
            links.append(link_inertial(name, mass, position, six, rotation, shapes, inertial))
    return links
