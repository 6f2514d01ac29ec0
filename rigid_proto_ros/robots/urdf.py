# SPDX-License-Identifier: MIT
"""URDF: links with visuals, collisions and inertials, and the joints that place them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from xml.etree.ElementTree import Element

from ..base.errors import InputError
from .model import COLLISION, HERE, VISUAL, Link, Pose, Robot, Shape, bare_link, floats, printed_link, rotation_from_rpy

SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SIZES = {
    "box": [("size", 3)],
    "cylinder": [("radius", 1), ("length", 1)],
    "capsule": [("radius", 1), ("length", 1)],
    "sphere": [("radius", 1)],
}


def _get(element: Element | None, name: str) -> str | None:
    return None if element is None else element.get(name)


def _pose(element: Element | None) -> Pose:
    """Of an <origin>."""
    return Pose(rotation_from_rpy(*floats(_get(element, "rpy"), "0 0 0", 3)), floats(_get(element, "xyz"), "0 0 0", 3))


def _shape(role: str, element: Element) -> Shape | None:
    pose = _pose(element.find("origin"))
    geometry = element.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None:
        return None
    plain = Shape(role, shape.tag, pose.rotation, pose.position)
    return sized(plain, shape.get("filename", ""), shape.get("scale"), SIZES, shape.get)


def sized(
    shape: Shape,
    file: str,
    scale: str | None,
    sizes: dict[str, list[tuple[str, int]]],
    text: Callable[[str], str | None],
) -> Shape:
    """The shape with its mesh's file and scale, or the sizes of its kind as ``text`` gives them by name."""
    if shape.kind == "mesh":
        problem = shape.problem or ("" if file else "a mesh without a file")
        return replace(shape, file=file, scale=floats(scale, "1 1 1", 3), problem=problem)
    if shape.kind not in sizes:
        return replace(shape, problem=f"a shape <{shape.kind}>, which isn't known here")
    numbers = [float(value) for name, count in sizes[shape.kind] for value in floats(text(name), "", count)]
    return replace(shape, size=tuple(numbers))


def _link(link: Element) -> Link:
    shapes = [_shape(role, part) for role in (VISUAL, COLLISION) for part in link.findall(role)]
    bare = bare_link(link.get("name", "?"), shapes)
    inertial = link.find("inertial")
    if inertial is None:
        return bare
    origin, mass, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    if mass is None or tensor is None or mass.get("value") is None:
        return replace(bare, problem="an <inertial> without mass or inertia")
    six = [tensor.get(entry, "0") for entry in SIX]
    center = (_get(origin, "xyz") or "").split()
    return printed_link(bare, mass.get("value", ""), center, six, _pose(origin).rotation, inertial)


def _poses(root: Element) -> dict[str, Pose]:
    """Poses of the links in the frame of the root link."""
    above: dict[str, tuple[str, Pose]] = {}
    for joint in root.findall("joint"):
        parent, child = (_get(joint.find(tag), "link") for tag in ("parent", "child"))
        if not parent or not child:
            raise InputError("lump", f"joint {joint.get('name')!r} without a parent or a child")
        if child in above:
            accepted = "joints that make a tree"
            raise InputError("lump", f"link {child!r} is the child of two joints; accepted: {accepted}")
        above[child] = parent, _pose(joint.find("origin"))
    roots = [link.get("name", "?") for link in root.findall("link") if link.get("name", "?") not in above]
    if len(roots) != 1:
        raise InputError("lump", f"{len(roots)} root links ({', '.join(roots[:4])}); accepted: one tree of links")
    poses = {roots[0]: HERE}
    while placed := [child for child, (parent, _) in above.items() if parent in poses]:
        for child in placed:
            parent, pose = above.pop(child)
            poses[child] = poses[parent] @ pose
    return poses


def read_urdf(root: Element) -> Robot:
    """The robot below a <robot>; raises ValueError for what are no numbers."""
    links = [_link(link) for link in root.iter("link")]
    return Robot([link for link in links if link.shapes or not link.problem], lambda: _poses(root))
