# SPDX-License-Identifier: MIT
"""URDF and SDF: visuals, collisions and inertials of every link, in the link's frame."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from .reading import (
    COLLISION,
    VISUAL,
    LinkInertial,
    Shape,
    floats,
    link_inertial,
    rotation_from_rpy,
    without_inertial,
)

_SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def _get(element: Element | None, name: str) -> str | None:
    return None if element is None else element.get(name)


def urdf_pose(element: Element | None) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and position (3,) of an <origin>."""
    return rotation_from_rpy(*floats(_get(element, "rpy"), "0 0 0", 3)), floats(_get(element, "xyz"), "0 0 0", 3)


def _urdf_shape(role: str, element: Element) -> Shape | None:
    rotation, position = urdf_pose(element.find("origin"))
    geometry = element.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None:
        return None
    if shape.tag == "mesh":
        file, scale = shape.get("filename", ""), floats(shape.get("scale"), "1 1 1", 3)
        return Shape(role, "mesh", rotation, position, file, scale, problem="" if file else "a mesh without a filename")
    sizes = {"box": [("size", 3)], "cylinder": [("radius", 1), ("length", 1)], "sphere": [("radius", 1)]}
    sizes["capsule"] = sizes["cylinder"]
    if shape.tag not in sizes:
        return Shape(role, shape.tag, rotation, position, problem=f"a shape <{shape.tag}>, which isn't known here")
    numbers = [float(value) for name, count in sizes[shape.tag] for value in floats(shape.get(name), "", count)]
    return Shape(role, shape.tag, rotation, position, size=tuple(numbers))


def read_urdf(root: Element, _path: Path) -> list[LinkInertial]:
    """Links of a URDF that have an inertial or a shape."""
    links = []
    for link in root.iter("link"):
        found = [_urdf_shape(role, part) for role in (VISUAL, COLLISION) for part in link.findall(role)]
        shapes = [shape for shape in found if shape is not None]
        name = link.get("name", "?")
        inertial = link.find("inertial")
        if inertial is None:
            if shapes:
                links.append(without_inertial(name, shapes, "no <inertial>", link))
            continue
        origin, mass, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
        if mass is None or tensor is None or mass.get("value") is None:
            links.append(without_inertial(name, shapes, "an <inertial> without mass or inertia", link))
            continue
        six = [tensor.get(entry, "0") for entry in _SIX]
        rotation, _ = urdf_pose(origin)
        links.append(link_inertial(name, mass.get("value", ""), _get(origin, "xyz"), six, rotation, shapes, inertial))
    return links


def sdf_pose(element: Element) -> tuple[np.ndarray, str]:
    """Rotation (3, 3) of an element's <pose>, and the position's words."""
    pose = element.find("pose")
    values = floats(pose.text if pose is not None else None, "0 0 0 0 0 0", 6)
    if pose is not None and pose.get("degrees", "false") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    words = ((pose.text if pose is not None else None) or "0 0 0").split()
    return rotation_from_rpy(*values[3:]), " ".join(words[:3])


def _sdf_shape(role: str, element: Element, link: str) -> Shape | None:
    rotation, words = sdf_pose(element)
    position = floats(words, "", 3)
    geometry = element.find("geometry")
    shape = next((child for child in geometry if child.tag != "empty"), None) if geometry is not None else None
    if shape is None:
        return None
    pose = element.find("pose")
    relative = _get(pose, "relative_to") or ""
    problem = f"a pose relative to {relative!r}, not to the link" if relative not in ("", link) else ""
    if shape.tag == "mesh":
        if shape.find("submesh") is not None:
            problem = problem or "one submesh of a mesh file"
        file, scale = shape.findtext("uri", "").strip(), floats(shape.findtext("scale"), "1 1 1", 3)
        return Shape(role, "mesh", rotation, position, file, scale, problem=problem)
    sizes = {
        "box": [("size", 3)],
        "cylinder": [("radius", 1), ("length", 1)],
        "capsule": [("radius", 1), ("length", 1)],
        "sphere": [("radius", 1)],
        "ellipsoid": [("radii", 3)],
    }
    if shape.tag not in sizes:
        return Shape(role, shape.tag, rotation, position, problem=f"a shape <{shape.tag}>, which isn't known here")
    numbers = [float(value) for name, count in sizes[shape.tag] for value in floats(shape.findtext(name), "", count)]
    return Shape(role, shape.tag, rotation, position, size=tuple(numbers), problem=problem)


def read_sdf(root: Element, _path: Path) -> list[LinkInertial]:
    """Links of an SDF that have an inertial or a shape."""
    links = []
    for link in root.iter("link"):
        name = link.get("name", "?")
        found = [_sdf_shape(role, part, name) for role in (VISUAL, COLLISION) for part in link.findall(role)]
        shapes = [shape for shape in found if shape is not None]
        inertial = link.find("inertial")
        if inertial is None:
            if shapes:
                links.append(without_inertial(name, shapes, "no <inertial>", link))
            continue
        tensor, mass = inertial.find("inertia"), inertial.findtext("mass")
        if tensor is None or mass is None:
            links.append(without_inertial(name, shapes, "an <inertial> without mass or inertia", link))
            continue
        six = [tensor.findtext(entry, "1" if entry in ("ixx", "iyy", "izz") else "0") for entry in _SIX]
        rotation, position = sdf_pose(inertial)
        links.append(link_inertial(name, mass, position, six, rotation, shapes, inertial))
    return links
