# SPDX-License-Identifier: MIT
"""Robots read from URDF, SDF and MJCF files as these formats define them."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from ..base.errors import InputError
from ..base.files import read_bounded
from .mjcf import read_mjcf
from .model import MAX_BYTES, Robot, parse_xml, valid_numbers
from .sdf import read_sdf
from .urdf import read_urdf


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
            return read_urdf(root)
        if root.tag == "sdf":
            return read_sdf(root)
        if root.tag == "mujoco":
            return read_mjcf(root, path)
    tag = re.sub(r"[^\w:.{}/-]", "?", str(root.tag))[:40]
    accepted = "URDF's <robot>, SDF's <sdf> or MJCF's <mujoco>"
    raise InputError("robot file", f"{path.name} begins with <{tag}>, not with {accepted}")
