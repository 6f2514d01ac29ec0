# SPDX-License-Identifier: MIT
"""Robots from files: URDF and SDF as these formats define them, MJCF through MuJoCo."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from ..base.files import read_bounded
from .mjcf import read_mjcf
from .model import (
    COLLISION,
    HERE,
    MAX_BYTES,
    VISUAL,
    WATER,
    Link,
    Pose,
    Robot,
    Shape,
    floats,
    parse_xml,
    printed_link,
    rotation_from_rpy,
    valid_numbers,
)

SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SIZES = {
    "box": ("size", 3),
    "cylinder": ("radius length", 2),
    "capsule": ("radius length", 2),
    "sphere": ("radius", 1),
    "ellipsoid": ("radii", 3),
}
"""Names of what says a primitive's size, and how many numbers that is."""


def read_robot(path: Path) -> Robot:
    """The robot that a file describes; raises InputError when it can't be read."""
    data = read_bounded(path, MAX_BYTES, "robot file", "a URDF, SDF or MJCF file")
    return robot_of(parse_xml(data, path), path)


def robot_of(root: Element, path: Path) -> Robot:
    """The robot below the root of a file; raises InputError for what is none, or holds what are no numbers."""
    if path.suffix == ".xacro" or any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError("robot file", path.name, f"plain URDF: xacro {path} > EXPANDED.urdf")
    with valid_numbers(path.name):
        if root.tag == "robot":
            return Robot([_urdf_link(link) for link in root.iter("link")], lambda: _urdf_poses(root))
        if root.tag == "sdf":
            return Robot([_sdf_link(link) for link in root.iter("link")], lambda: _sdf_poses(root))
        if root.tag == "mujoco":
            return read_mjcf(root, path)
    tag = re.sub(r"[^\w:.{}/-]", "?", str(root.tag))[:40]
    accepted = "URDF's <robot>, SDF's <sdf> or MJCF's <mujoco>"
    raise InputError("robot file", f"{path.name} begins with <{tag}>, not with {accepted}")


def _sized(shape: Shape, file: str, scale: str | None, text: Callable[[str], str | None]) -> Shape:
    """The shape with its mesh's file and scale, or the size of its kind as ``text`` gives it by name."""
    if shape.kind == "mesh":
        problem = shape.problem or ("" if file else "a mesh without a file")
        return replace(shape, file=file, scale=floats(scale, "1 1 1", 3), problem=problem)
    if shape.kind not in SIZES:
        return replace(shape, problem=f"a shape <{shape.kind}>, which isn't known here")
    names, count = SIZES[shape.kind]
    words = " ".join(text(name) or "" for name in names.split())
    return replace(shape, size=tuple(floats(words, "", count).tolist()))


def _first_shape(element: Element) -> Element | None:
    """What an element's <geometry> holds."""
    geometry = element.find("geometry")
    return None if geometry is None else next((child for child in geometry if child.tag != "empty"), None)


# URDF


def _urdf_pose(origin: Element | None) -> Pose:
    words = {} if origin is None else origin.attrib
    return Pose(rotation_from_rpy(*floats(words.get("rpy"), "0 0 0", 3)), floats(words.get("xyz"), "0 0 0", 3))


def _urdf_link(link: Element) -> Link:
    shapes = []
    for role in (VISUAL, COLLISION):
        for part in link.findall(role):
            pose, of = _urdf_pose(part.find("origin")), _first_shape(part)
            if of is not None:
                plain = Shape(role, of.tag, pose.rotation, pose.position)
                shapes.append(_sized(plain, of.get("filename", ""), of.get("scale"), of.get))
    bare = Link(link.get("name", "?"), tuple(shapes))
    inertial = link.find("inertial")
    if inertial is None:
        return bare
    origin, mass, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    if mass is None or tensor is None or mass.get("value") is None:
        return replace(bare, problem="an <inertial> without mass or inertia")
    center = [] if origin is None else origin.get("xyz", "").split()
    six = [tensor.get(entry, "0") for entry in SIX]
    return printed_link(bare, mass.get("value", ""), center, six, _urdf_pose(origin).rotation, inertial)


def _urdf_poses(root: Element) -> dict[str, Pose]:
    """Poses of the links in the frame of the root link."""
    above: dict[str, tuple[str, Pose]] = {}
    for joint in root.findall("joint"):
        ends = [joint.find(tag) for tag in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        if not parent or not child or child in above:
            raise InputError("lump", f"joint {joint.get('name')!r} of {parent!r} and {child!r}", "a tree of links")
        above[child] = parent, _urdf_pose(joint.find("origin"))
    roots = [link.get("name", "?") for link in root.findall("link") if link.get("name", "?") not in above]
    if len(roots) != 1:
        raise InputError("lump", f"{len(roots)} root links ({', '.join(roots[:4])}); accepted: one tree of links")
    poses = {roots[0]: HERE}
    while placed := [child for child, (parent, _) in above.items() if parent in poses]:
        for child in placed:
            parent, pose = above.pop(child)
            poses[child] = poses[parent] @ pose
    return poses


# SDF


def _sdf_pose(element: Element) -> Pose:
    """Of an element's <pose>, relative to whatever that is."""
    pose = element.find("pose")
    values = floats(None if pose is None else pose.text, "0 0 0 0 0 0", 6)
    if pose is not None and pose.get("degrees", "false") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return Pose(rotation_from_rpy(*values[3:]), values[:3])


def _sdf_link(link: Element) -> Link:
    name, inertial = link.get("name", "?"), link.find("inertial")
    density = str(WATER) if inertial is None else inertial.findtext("density", str(WATER))
    shapes = []
    for role in (VISUAL, COLLISION):
        for part in link.findall(role):
            own, of, pose = _sdf_pose(part), _first_shape(part), part.find("pose")
            if of is None:
                continue
            relative = "" if pose is None else pose.get("relative_to", "")
            problem = f"a pose relative to {relative!r}, not to the link" if relative not in ("", name) else ""
            if of.tag == "mesh" and of.find("submesh") is not None:
                problem = problem or "one submesh of a mesh file"
            dense = float(part.findtext("density", density))
            plain = Shape(role, of.tag, own.rotation, own.position, problem=problem, density=dense)
            shapes.append(_sized(plain, of.findtext("uri", "").strip(), of.findtext("scale"), of.findtext))
    bare = Link(name, tuple(shapes))
    if inertial is None:
        return bare
    tensor, mass = inertial.find("inertia"), inertial.findtext("mass")
    if inertial.get("auto", "false") in ("true", "1"):
        computed = replace(bare, problem="the simulator computes its inertial (auto='true')", computed=True)
        return computed if mass is None else replace(computed, mass=float(mass))
    if tensor is None or mass is None:
        return replace(bare, problem="an <inertial> without mass or inertia")
    six = [tensor.findtext(entry, "1" if entry in ("ixx", "iyy", "izz") else "0") for entry in SIX]
    center = (inertial.findtext("pose") or "").split()[:3]
    return printed_link(bare, mass, center, six, _sdf_pose(inertial).rotation, inertial)


def _sdf_poses(root: Element) -> dict[str, Pose]:
    """Poses of the one model's links, joints and frames in its frame."""
    models = list(root.iter("model"))
    if len(models) != 1 or next(root.iter("include"), None) is not None:
        raise InputError("lump", f"{len(models)} models", "an SDF of one model, without <include>")
    elements = {
        element.get("name", "?"): element for tag in ("link", "joint", "frame") for element in models[0].findall(tag)
    }
    found = {"": HERE, "__model__": HERE, "world": HERE}

    def pose_of(name: str, below: tuple[str, ...] = ()) -> Pose:
        if name not in found:
            if name not in elements or name in below:
                raise InputError("lump", f"frame {name!r}", "poses relative to links, joints and frames of the model")
            element = elements[name]
            pose = element.find("pose")
            base = "" if pose is None else pose.get("relative_to", "")
            if element.tag == "joint":
                base = base or (element.findtext("child") or "").strip()
            if element.tag == "frame":
                base = base or element.get("attached_to", "")
            found[name] = pose_of(base, (*below, name)) @ _sdf_pose(element)
        return found[name]

    return {name: pose_of(name) for name in elements}
