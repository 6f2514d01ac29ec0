# SPDX-License-Identifier: MIT
"""Robots read from URDF, SDF and MJCF files as these formats define them."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from ..base.errors import InputError
from .mjcf import read_mjcf
from .model import Robot, valid_numbers
from .robot_xml import robot_root
from .sdf import read_sdf
from .urdf import read_urdf


def read_robot(path: Path, folders: tuple[Path, ...] = (), xacro: tuple[str, ...] = ()) -> Robot:
    """The robot that a file describes; arguments and errors of robot_root."""
    return robot_of(robot_root(path, folders, xacro), path)


def robot_of(root: Element, path: Path) -> Robot:
    """The robot below the root of a file; raises InputError for what is none, or holds what are no numbers."""
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
