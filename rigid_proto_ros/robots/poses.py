# SPDX-License-Identifier: MIT
"""Where the links of a robot file stand when its joints have given values: poses in the frame of the root link (URDF),
of the model (SDF), or of the world (MJCF).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError, one_of
from .mjcf import Model, element_rotation, mjcf_model
from .reading import floats, rotation_from_wxyz
from .urdf import sdf_pose, urdf_pose

TURNS, SLIDES, FIXED, OTHER = "turns", "slides", "fixed", "other"


@dataclass(frozen=True)
class Pose:
    """Rotation (3, 3) and position (3,) [m] of a frame in another."""

    rotation: np.ndarray
    position: np.ndarray

    def __matmul__(self, inner: Pose) -> Pose:
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.position + self.position)

    def inverse(self) -> Pose:
        """The other frame's pose in this one."""
        return Pose(self.rotation.T, -(self.rotation.T @ self.position))


HERE = Pose(np.eye(3), np.zeros(3))


def _motion(kind: str, axis: np.ndarray, value: float) -> Pose:
    """What a joint of one axis does at ``value`` [rad or m], in its own frame."""
    if value == 0.0:
        return HERE
    size = float(np.linalg.norm(axis))
    if not size > 0.0:
        raise InputError("joint", axis.tolist(), "an axis that isn't zero")
    if kind == SLIDES:
        return Pose(np.eye(3), axis / size * value)
    half = 0.5 * value
    return Pose(rotation_from_wxyz([math.cos(half), *(math.sin(half) * axis / size)]), np.zeros(3))


class Joints:
    """The values given by joint names; each must be asked for once, as a joint that can have it."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.values = dict(values)
        self.movable: list[str] = []
        self.others: dict[str, str] = {}

    def value(self, name: str, kind: str) -> float:
        """The value [rad or m] of a joint, 0 where none was given."""
        if kind in (TURNS, SLIDES):
            self.movable.append(name)
            return self.values.get(name, 0.0)
        self.others[name] = kind
        return 0.0

    def check(self) -> None:
        """Raise InputError for values of joints that aren't there, or that have no one value."""
        for name in self.values:
            if name in self.others:
                reason = "is fixed" if self.others[name] == FIXED else "has more than one axis"
                raise InputError("joint", f"{name} {reason}; {one_of('', self.movable) or 'no joint moves'}")
            if name not in self.movable:
                raise InputError("joint", name, one_of(name, self.movable) if self.movable else "a robot with joints")


_KINDS = {"revolute": TURNS, "continuous": TURNS, "prismatic": SLIDES, "fixed": FIXED}


def _child_name(joint: Element, tag: str) -> str:
    """The link that a joint names as parent or child, in an attribute (URDF) or as text (SDF)."""
    found = joint.find(tag)
    name = None if found is None else found.get("link") or (found.text or "").strip()
    if not name:
        raise InputError("lump", f"joint {joint.get('name')!r} without a {tag}")
    return name


def _along_joints(links: list[str], joints: list[Element]) -> Iterator[tuple[Element, str, str]]:
    """Joints with parent and child, from the root on; raises InputError when they make no tree."""
    below: dict[str, list[tuple[Element, str]]] = {}
    children: set[str] = set()
    for joint in joints:
        parent, child = _child_name(joint, "parent"), _child_name(joint, "child")
        if child in children:
            raise InputError("lump", f"link {child!r} is the child of two joints; accepted: joints that make a tree")
        children.add(child)
        below.setdefault(parent, []).append((joint, child))
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        raise InputError("lump", f"{len(roots)} root links ({', '.join(roots[:4])}); accepted: one tree of links")
    waiting = roots
    while waiting:
        parent = waiting.pop()
        for joint, child in below.get(parent, ()):
            yield joint, parent, child
            waiting.append(child)


def _urdf_poses(root: Element, joints: Joints) -> dict[str, Pose]:
    links = [link.get("name", "?") for link in root.findall("link")]
    elements = root.findall("joint")
    mimics = {joint.get("name", "?"): joint.find("mimic") for joint in elements}

    def value(name: str, kind: str, depth: int = 0) -> float:
        """A joint's own value, or that of the one that it mimics."""
        mimic = mimics.get(name)
        if mimic is None or name in joints.values:
            return joints.value(name, kind)
        if depth > len(mimics):
            raise InputError("lump", f"joint {name!r} mimics itself")
        joints.value(name, kind)
        followed = value(mimic.get("joint", ""), kind, depth + 1)
        return float(mimic.get("multiplier", "1")) * followed + float(mimic.get("offset", "0"))

    children = {_child_name(joint, "child") for joint in elements}
    poses = {name: HERE for name in links if name not in children}
    for joint, parent, child in _along_joints(links, elements):
        kind = _KINDS.get(joint.get("type", ""), OTHER)
        axis = joint.find("axis")
        direction = floats(None if axis is None else axis.get("xyz"), "1 0 0", 3)
        moved = _motion(kind, direction, value(joint.get("name", "?"), kind))
        poses[child] = poses[parent] @ Pose(*urdf_pose(joint.find("origin"))) @ moved
    return poses


def _sdf_frames(model: Element) -> dict[str, Pose]:
    """Poses of links, joints and frames of a model in its frame while all joints are at 0."""
    elements = {
        element.get("name", "?"): element for tag in ("link", "joint", "frame") for element in model.findall(tag)
    }
    found = {"": HERE, "__model__": HERE}
    open_ones: list[str] = []

    def pose_of(name: str) -> Pose:
        if name in found:
            return found[name]
        if name not in elements or name in open_ones:
            raise InputError("lump", f"frame {name!r}", "poses relative to links, joints and frames of the model")
        open_ones.append(name)
        element = elements[name]
        rotation, words = sdf_pose(element)
        own = Pose(rotation, floats(words, "", 3))
        stated = element.find("pose")
        base = "" if stated is None else stated.get("relative_to", "")
        if not base and element.tag == "joint":
            base = _child_name(element, "child")
        if not base and element.tag == "frame":
            base = element.get("attached_to", "")
        found[name] = pose_of(base) @ own
        open_ones.pop()
        return found[name]

    for name in elements:
        pose_of(name)
    return found


def _sdf_poses(root: Element, joints: Joints) -> dict[str, Pose]:
    models = list(root.iter("model"))
    if len(models) != 1 or next(root.iter("include"), None) is not None:
        raise InputError("lump", f"{len(models)} models", "an SDF of one model, without <include>")
    model = models[0]
    zero = _sdf_frames(model)
    links = [link.get("name", "?") for link in model.findall("link")]
    elements = model.findall("joint")
    children = {_child_name(joint, "child") for joint in elements}
    # A model may be several trees: each root stands where it was put.
    poses = {name: zero[name] for name in (*links, "world") if name in zero and name not in children}
    poses["world"] = HERE
    waiting = list(elements)
    while waiting:
        ready = [joint for joint in waiting if _child_name(joint, "parent") in poses]
        if not ready:
            raise InputError("lump", f"joint {waiting[0].get('name')!r}", "joints that make trees")
        for joint in ready:
            waiting.remove(joint)
            parent, child = _child_name(joint, "parent"), _child_name(joint, "child")
            if child in poses:
                raise InputError("lump", f"link {child!r} is the child of two joints; accepted: joints that make trees")
            kind = _KINDS.get(joint.get("type", ""), OTHER)
            frame = zero[joint.get("name", "?")]
            direction = _sdf_axis(joint, frame, zero)
            moved = _motion(kind, direction, joints.value(joint.get("name", "?"), kind))
            start = HERE if parent == "world" else zero[parent]
            poses[child] = poses[parent] @ start.inverse() @ frame @ moved @ frame.inverse() @ zero[child]
    return poses


def _sdf_axis(joint: Element, frame: Pose, zero: dict[str, Pose]) -> np.ndarray:
    """The joint's axis (3,) in its own frame."""
    xyz = joint.find("axis/xyz")
    direction = floats(None if xyz is None else xyz.text, "0 0 1", 3)
    within = "" if xyz is None else xyz.get("expressed_in", "")
    if (joint.findtext("axis/use_parent_model_frame") or "").strip() in ("true", "1"):
        within = "__model__"
    if within and within not in zero:
        raise InputError("lump", f"frame {within!r}", "axes expressed in links, joints and frames of the model")
    return frame.rotation.T @ zero[within].rotation @ direction if within else direction


def _mjcf_joint(joint: Element, model: Model, childclass: str, number: int, joints: Joints) -> Pose:
    """What one joint does to its body, in the body's frame."""
    attributes = model.attributes(joint, childclass)
    kind = {"hinge": TURNS, "slide": SLIDES}.get(attributes.get("type", "hinge"), OTHER)
    if joint.tag == "freejoint":
        kind = OTHER
    name = attributes.get("name") or f"joint {number}"
    reference = float(attributes.get("ref", "0"))
    if kind == TURNS and model.degrees:
        reference = math.radians(reference)
    value = joints.value(name, kind)
    moved = value - reference if name in joints.values else 0.0
    anchor = Pose(np.eye(3), floats(attributes.get("pos"), "0 0 0", 3))
    return anchor @ _motion(kind, floats(attributes.get("axis"), "0 0 1", 3), moved) @ anchor.inverse()


def _mjcf_poses(root: Element, joints: Joints) -> dict[int, Pose]:
    """By the id of the body's element, since bodies need no name."""
    model = mjcf_model(root)
    found: dict[int, Pose] = {}
    count = 0

    def descend(parent: Element, pose: Pose, childclass: str) -> None:
        nonlocal count
        for child in parent:
            if child.tag == "replicate":
                raise InputError("lump", "<replicate>", "bodies written out")
            if child.tag not in ("body", "frame"):
                continue
            inner = child.get("childclass") or childclass
            rotation = element_rotation(child.attrib, model)
            here = pose @ Pose(rotation, floats(child.get("pos"), "0 0 0", 3))
            if child.tag == "body":
                for joint in child:
                    if joint.tag in ("joint", "freejoint"):
                        here = here @ _mjcf_joint(joint, model, inner, count, joints)
                        count += 1
                found[id(child)] = here
            descend(child, here, inner)

    for world in root.findall("worldbody"):
        descend(world, HERE, "")
    return found


def link_poses(root: Element, path: Path, values: Mapping[str, float]) -> dict[int, Pose]:
    """Poses of the links by the id of their elements, at joint ``values`` [rad or m], the others at 0.

    Raises InputError for joints that aren't there or have no one value, and for a file whose links make no tree.
    """
    joints = Joints(values)
    try:
        if root.tag == "mujoco":
            poses = _mjcf_poses(root, joints)
        else:
            named = _urdf_poses(root, joints) if root.tag == "robot" else _sdf_poses(root, joints)
            poses = {id(link): named[link.get("name", "?")] for link in root.iter("link") if link.get("name") in named}
    except (ValueError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("lump", path.name, f"valid joints ({error})") from None
    joints.check()
    return poses
