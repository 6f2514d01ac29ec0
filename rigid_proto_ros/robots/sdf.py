# SPDX-License-Identifier: MIT
"""SDF: links with visuals, collisions and inertials, their frames, and the joints between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from .model import (
    COLLISION,
    HERE,
    OTHER,
    VISUAL,
    WATER,
    Connection,
    Joint,
    Link,
    Pose,
    Robot,
    Shape,
    bare_link,
    floats,
    printed_link,
    rotation_from_rpy,
)
from .urdf import KINDS, SIX, SIZES, end_of, sized


def _pose(element: Element) -> Pose:
    """Of an element's <pose>, relative to whatever that is."""
    pose = element.find("pose")
    values = floats(pose.text if pose is not None else None, "0 0 0 0 0 0", 6)
    if pose is not None and pose.get("degrees", "false") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return Pose(rotation_from_rpy(*values[3:]), values[:3])


def _is_true(text: str | None) -> bool:
    return (text or "").strip() in ("true", "1")


def _shape(role: str, element: Element, link: str, density: float) -> Shape | None:
    geometry = element.find("geometry")
    shape = next((child for child in geometry if child.tag != "empty"), None) if geometry is not None else None
    if shape is None:
        return None
    own, pose = _pose(element), element.find("pose")
    relative = pose.get("relative_to", "") if pose is not None else ""
    problem = f"a pose relative to {relative!r}, not to the link" if relative not in ("", link) else ""
    if shape.tag == "mesh" and shape.find("submesh") is not None:
        problem = problem or "one submesh of a mesh file"
    density = float(element.findtext("density", str(density)))
    plain = Shape(role, shape.tag, own.rotation, own.position, problem=problem, density=density)
    sizes = {**SIZES, "ellipsoid": [("radii", 3)]}
    return sized(plain, shape.findtext("uri", "").strip(), shape.findtext("scale"), sizes, shape.findtext)


def _link(link: Element) -> Link:
    name, inertial = link.get("name", "?"), link.find("inertial")
    density = WATER if inertial is None else float(inertial.findtext("density", str(WATER)))
    shapes = [_shape(role, part, name, density) for role in (VISUAL, COLLISION) for part in link.findall(role)]
    bare = bare_link(name, shapes, link)
    if inertial is None:
        return bare
    tensor, mass = inertial.find("inertia"), inertial.findtext("mass")
    if _is_true(inertial.get("auto")):
        computed = replace(bare, problem="the simulator computes its inertial (auto='true')", computed=True)
        return computed if mass is None else replace(computed, mass=float(mass))
    if tensor is None or mass is None:
        return bare_link(name, shapes, link, "an <inertial> without mass or inertia")
    six = [tensor.findtext(entry, "1" if entry in ("ixx", "iyy", "izz") else "0") for entry in SIX]
    center = (inertial.findtext("pose") or "").split()[:3]
    return printed_link(bare, mass, center, six, _pose(inertial).rotation, inertial)


def _frames(model: Element) -> dict[str, Pose]:
    """Poses of links, joints and frames of a model in its frame while all joints are at 0."""
    elements = {
        element.get("name", "?"): element for tag in ("link", "joint", "frame") for element in model.findall(tag)
    }
    found = {"": HERE, "__model__": HERE, "world": HERE}
    open_ones: list[str] = []

    def pose_of(name: str) -> Pose:
        if name in found:
            return found[name]
        if name not in elements or name in open_ones:
            raise InputError("lump", f"frame {name!r}", "poses relative to links, joints and frames of the model")
        open_ones.append(name)
        element = elements[name]
        pose = element.find("pose")
        base = "" if pose is None else pose.get("relative_to", "")
        if not base and element.tag == "joint":
            base = end_of(element, "child")
        if not base and element.tag == "frame":
            base = element.get("attached_to", "")
        found[name] = pose_of(base) @ _pose(element)
        open_ones.pop()
        return found[name]

    for name in elements:
        pose_of(name)
    return found


def _axis(joint: Element, frame: Pose, zero: dict[str, Pose]) -> np.ndarray:
    """The joint's axis (3,) in its own frame."""
    xyz = joint.find("axis/xyz")
    direction = floats(None if xyz is None else xyz.text, "0 0 1", 3)
    within = "" if xyz is None else xyz.get("expressed_in", "")
    if _is_true(joint.findtext("axis/use_parent_model_frame")):
        within = "__model__"
    if within and within not in zero:
        raise InputError("lump", f"frame {within!r}", "axes expressed in links, joints and frames of the model")
    return frame.rotation.T @ zero[within].rotation @ direction if within else direction


def _connections(root: Element) -> Iterator[Connection]:
    models = list(root.iter("model"))
    if len(models) != 1 or next(root.iter("include"), None) is not None:
        raise InputError("lump", f"{len(models)} models", "an SDF of one model, without <include>")
    zero = _frames(models[0])
    joints = models[0].findall("joint")
    children = {end_of(joint, "child") for joint in joints}
    for link in models[0].findall("link"):  # each root stands where it was put
        name = link.get("name", "?")
        if name not in children:
            yield Connection(None, name, (zero[name],))
    for joint in joints:
        parent, child = end_of(joint, "parent"), end_of(joint, "child")
        if parent not in zero or child not in zero:
            raise InputError("lump", f"joint {joint.get('name')!r}", "joints that make trees")
        frame = zero[joint.get("name", "?")]
        kind = KINDS.get(joint.get("type", ""), OTHER)
        moving = Joint(joint.get("name", "?"), kind, _axis(joint, frame, zero))
        before, after = zero[parent].inverse() @ frame, frame.inverse() @ zero[child]
        yield Connection(None if parent == "world" else parent, child, (before, moving, after))


def read_sdf(root: Element) -> Robot:
    """The links below an <sdf>, and the joints of its one model; raises ValueError for what are no numbers."""
    links = [_link(link) for link in root.iter("link")]
    names = [link.get("name", "?") for model in root.iter("model") for link in model.findall("link")]
    return Robot([link for link in links if link.shapes or not link.problem], names, lambda: _connections(root))
