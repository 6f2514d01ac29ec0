# SPDX-License-Identifier: MIT
"""SDF: links with visuals, collisions and inertials, and their frames."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from .model import (
    COLLISION,
    HERE,
    VISUAL,
    WATER,
    Link,
    Pose,
    Robot,
    Shape,
    bare_link,
    floats,
    printed_link,
    rotation_from_rpy,
)
from .urdf import SIX, SIZES, sized


def _pose(element: Element) -> Pose:
    """Of an element's <pose>, relative to whatever that is."""
    pose = element.find("pose")
    values = floats(pose.text if pose is not None else None, "0 0 0 0 0 0", 6)
    if pose is not None and pose.get("degrees", "false") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return Pose(rotation_from_rpy(*values[3:]), values[:3])


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
    bare = bare_link(name, shapes)
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
    return printed_link(bare, mass, center, six, _pose(inertial).rotation, inertial)


def _poses(root: Element) -> dict[str, Pose]:
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
            found[name] = pose_of(base, (*below, name)) @ _pose(element)
        return found[name]

    return {name: pose_of(name) for name in elements}


def read_sdf(root: Element) -> Robot:
    """The links below an <sdf>; raises ValueError for what are no numbers."""
    links = [_link(link) for link in root.iter("link")]
    return Robot([link for link in links if link.shapes or not link.problem], lambda: _poses(root))
