# SPDX-License-Identifier: MIT
"""Links with their shapes and inertials, read from URDF, SDF and MJCF files as these formats define them."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from ..base.files import read_bounded
from ..base.rotation import matrix_from_quaternion
from ..mesh.locate import Search
from .xacro import expand_xacro

MAX_BYTES = 50_000_000
VISUAL, COLLISION = "visual", "collision"


@dataclass(frozen=True)
class Shape:
    """A shape as a link shows it or collides with it: kind "mesh" with ``file`` and scale (3,), or with ``size`` [m] a
    "box" (sides), "cylinder" or "capsule" (radius, length along z, the capsule's without its caps), "sphere" (radius)
    or "ellipsoid" (semi-axes); rotation (3, 3) and position (3,) [m] in the link's frame; ``problem``: why it can't be
    taken."""

    role: str
    kind: str
    rotation: np.ndarray
    position: np.ndarray
    file: str = ""
    scale: np.ndarray = field(default_factory=lambda: np.ones(3))
    size: tuple[float, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class LinkInertial:
    """What a file says of one link: mass [kg], COM (3,) [m] and tensor (3, 3) [kg m²] about it, both in the link's
    axes; ``problem`` instead when there are none. The steps are half a unit of the last digit printed, for mass, COM
    (3,) and tensor (3, 3): what a number may be off by for its printing alone. ``element``: the <inertial> that was
    read, or the whole link where it has none that can be.
    """

    link: str
    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray
    shapes: tuple[Shape, ...]
    problem: str = ""
    mass_step: float = 0.0
    center_step: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia_step: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    element: ElementTree.Element | None = None


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation (3, 3) of fixed-axes roll, pitch, yaw [rad], as URDF and SDF have them."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_wxyz(quaternion: ArrayLike) -> np.ndarray:
    """Rotation (3, 3) of a quaternion (w, x, y, z), MuJoCo's order, of any length but 0."""
    w, x, y, z = (np.asarray(quaternion, dtype=float) / np.linalg.norm(np.asarray(quaternion, dtype=float))).tolist()
    return matrix_from_quaternion([x, y, z, w])


def floats(text: str | None, default: str, count: int) -> np.ndarray:
    """``count`` numbers of a text; raises ValueError for others."""
    values = np.array([float(word) for word in (text or default).split()])
    if len(values) != count:
        raise ValueError(f"{text!r} instead of {count} numbers")
    return values


def printed_steps(words: list[str]) -> np.ndarray:
    """Half a unit of the last digit of each number of a group, as a printer of fixed decimals or of fixed digits leaves
    it open: 0.0005 for 0.012 alone. Trailing zeros that such a printer drops count, as the others of the group show
    them.
    """
    values = [float(word) for word in words]
    if not any(values):
        return np.zeros(len(words))
    decimals, digits = [], []
    for word in words:
        mantissa, _, exponent = word.strip().lower().partition("e")
        decimals.append(len(mantissa.partition(".")[2]) - int(exponent or 0))
        digits.append(len(mantissa.replace(".", "").lstrip("+-0")))
    steps = []
    for value, own in zip(values, decimals, strict=True):
        leading = math.floor(math.log10(abs(value))) if value and math.isfinite(value) else -400
        steps.append(0.5 * 10.0 ** max(-max(decimals), min(-own, leading - max(digits) + 1)))
    return np.array(steps)


def symmetric(six: ArrayLike) -> np.ndarray:
    """ixx, ixy, ixz, iyy, iyz, izz as a matrix (3, 3)."""
    ixx, ixy, ixz, iyy, iyz, izz = np.asarray(six, dtype=float).tolist()
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def link_inertial(
    link: str,
    mass: str,
    center: str | None,
    six: list[str],
    rotation: np.ndarray,
    shapes: list[Shape],
    element: ElementTree.Element,
) -> LinkInertial:
    """An inertial from a file's words: mass, COM, and the six entries of the tensor in axes turned by ``rotation``."""
    tensor = symmetric([float(word) for word in six])
    step = symmetric(printed_steps(six))
    return LinkInertial(
        link,
        float(mass),
        floats(center, "0 0 0", 3),
        rotation @ tensor @ rotation.T,
        tuple(shapes),
        "",
        float(printed_steps([mass])[0]),
        printed_steps(center.split()) if center else np.zeros(3),
        np.abs(rotation) @ step @ np.abs(rotation).T,
        element,
    )


def without_inertial(link: str, shapes: list[Shape], problem: str, element: ElementTree.Element) -> LinkInertial:
    """A link of which the file doesn't say the mass or the tensor."""
    nothing = math.nan, np.full(3, math.nan), np.full((3, 3), math.nan)
    return LinkInertial(link, *nothing, tuple(shapes), problem, element=element)


def is_xacro(root: ElementTree.Element, path: Path) -> bool:
    """Whether the file is to be expanded by xacro before it is a robot's description."""
    return path.suffix == ".xacro" or any("xacro" in str(element.tag) for element in root.iter())


def read_robot(path: Path, folders: tuple[Path, ...] = (), xacro: tuple[str, ...] = ()) -> list[LinkInertial]:
    """The links of a robot file that have an inertial or a shape; arguments and errors of robot_root."""
    return links_of(robot_root(path, folders, xacro), path)


def robot_root(path: Path, folders: tuple[Path, ...] = (), xacro: tuple[str, ...] = ()) -> ElementTree.Element:
    """The root of a robot file, xacro expanded with arguments like ``name:=value``, packages looked for upwards from
    the file and in ``folders``; raises InputError when the file can't be read.
    """
    root = parse_xml(read_bounded(path, MAX_BYTES, "robot file", "a URDF, SDF or MJCF file"), path)
    if is_xacro(root, path):
        return parse_xml(expand_xacro(path, Search(path.parent, folders), xacro), path)
    if xacro:
        raise InputError("--xacro", " ".join(xacro), "a file that xacro expands")
    return root


def links_of(root: ElementTree.Element, path: Path) -> list[LinkInertial]:
    """The links below the root of a robot file that have an inertial or a shape; raises InputError as read_robot."""
    from .mjcf import read_mjcf
    from .urdf import read_sdf, read_urdf

    readers: dict[str, Callable[[ElementTree.Element, Path], list[LinkInertial]]] = {
        "robot": read_urdf,
        "sdf": read_sdf,
        "mujoco": read_mjcf,
    }
    if root.tag not in readers:
        tag = re.sub(r"[^\w:.{}/-]", "?", str(root.tag))[:40]
        accepted = "URDF's <robot>, SDF's <sdf> or MJCF's <mujoco>"
        raise InputError("robot file", f"{path.name} begins with <{tag}>, not with {accepted}")
    try:
        return readers[root.tag](root, path)
    except (ValueError, TypeError, KeyError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("robot file", path.name, f"valid numbers ({error})") from None


def parse_xml(data: bytes, path: Path) -> ElementTree.Element:
    """The root of a file's XML; raises InputError for what is none, or has entities."""
    if b"<!ENTITY" in data:
        raise InputError("robot file", path.name, "a file without XML entities")
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError("robot file", path.name, f"well-formed XML ({error})") from None


def placed(shape: Shape, rotation: np.ndarray, position: np.ndarray) -> Shape:
    """The shape in a frame in which its own has ``rotation`` and ``position``."""
    return replace(shape, rotation=rotation @ shape.rotation, position=rotation @ shape.position + position)
