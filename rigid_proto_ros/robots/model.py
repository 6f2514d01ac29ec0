# SPDX-License-Identifier: MIT
"""A robot as its file has it, in whichever format: links with inertials and shapes, and where they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from ..base.rotation import matrix_from_quaternion
from ..mass.tensor import tensor_from_six

VISUAL, COLLISION = "visual", "collision"
WATER = 1000.0
"""kg/m³ of a shape of which nothing else is said."""
MAX_BYTES = 50_000_000
"""Of a robot's file."""


@dataclass(frozen=True)
class Pose:
    """Rotation (3, 3) and position (3,) [m] of a frame in another."""

    rotation: np.ndarray
    position: np.ndarray

    def __matmul__(self, inner: Pose) -> Pose:
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.position + self.position)


HERE = Pose(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class Shape:
    """A shape as a link shows it or collides with it: kind "mesh" with ``file`` and scale (3,), or with ``size`` [m] a
    "box" (sides), "cylinder" or "capsule" (radius, length along z, the capsule's without its caps), "sphere" (radius)
    or "ellipsoid" (semi-axes); rotation (3, 3) and position (3,) [m] in the link's frame; ``problem``: why it can't be
    taken; density [kg/m³]."""

    role: str
    kind: str
    rotation: np.ndarray
    position: np.ndarray
    file: str = ""
    scale: np.ndarray = field(default_factory=lambda: np.ones(3))
    size: tuple[float, ...] = ()
    problem: str = ""
    density: float = WATER


@dataclass(frozen=True)
class Link:
    """What a file says of one link: mass [kg], COM (3,) [m] and tensor (3, 3) [kg m²] about it, both in the link's
    axes; ``problem`` says why when it doesn't. The steps are half a unit of the last digit printed, for mass, COM
    (3,) and tensor (3, 3): what a number may be off by for its printing alone. ``element``: the <inertial> that was
    read, None where the file has it from elsewhere. ``computed``: a
    simulator computes the inertial from the collision shapes, for the mass if there is one.
    """

    name: str
    shapes: tuple[Shape, ...] = ()
    problem: str = "no <inertial>"
    mass: float = math.nan
    center_of_mass: np.ndarray = field(default_factory=lambda: np.full(3, math.nan))
    inertia: np.ndarray = field(default_factory=lambda: np.full((3, 3), math.nan))
    mass_step: float = 0.0
    center_step: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia_step: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    element: Element | None = None
    computed: bool = False


@dataclass
class Robot:
    """``links``: those with an inertial or a shape, in the file's order. ``poses`` gives the pose of each link by name
    with all joints at 0, in the frame of the root link (URDF), of the model (SDF) or of the world (MJCF), and raises
    InputError for links that make no tree. ``simulated``: the links with the inertials that the format's own simulator
    takes, where these aren't the file's."""

    links: list[Link]
    poses: Callable[[], dict[str, Pose]]
    simulated: Callable[[], list[Link]] | None = None

    def __post_init__(self) -> None:
        self.links = [link for link in self.links if link.shapes or not link.problem]


def parse_xml(data: bytes, path: Path) -> Element:
    """The root of a file's XML, names as they are written: SDFs use prefixes (gz:) that they don't declare.

    Raises InputError for what is no XML, or has entities.
    """
    if b"<!ENTITY" in data:
        raise InputError("robot file", path.name, "a file without XML entities")
    tree = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.data
    try:
        parser.Parse(data, True)
        return tree.close()
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError("robot file", path.name, f"well-formed XML ({error})") from None


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


@contextmanager
def valid_numbers(file: str) -> Iterator[None]:
    """Raise InputError for what is no number in a robot file of this name."""
    try:
        yield
    except InputError:
        raise
    except (ValueError, TypeError, KeyError) as error:
        raise InputError("robot file", file, f"valid numbers ({error})") from None


def floats(text: str | None, default: str, count: int) -> np.ndarray:
    """``count`` numbers of a text; raises ValueError for others."""
    values = np.array([float(word) for word in (text or default).split()])
    if len(values) != count:
        raise ValueError(f"{text!r} instead of {count} numbers")
    return values


def printed_steps(words: list[str]) -> np.ndarray:
    """Half a unit of the last digit that a group of numbers is printed with: 0.0005 for 0.012 alone; 0 for zeros."""
    decimals = []
    for word in words:
        mantissa, _, exponent = word.strip().lower().partition("e")
        decimals.append(len(mantissa.partition(".")[2]) - int(exponent or 0))
    step = 0.5 * 10.0 ** min(-max(decimals), 300) if any(float(word) for word in words) else 0.0
    return np.full(len(words), step)


def printed_link(
    bare: Link, mass: str, center: list[str], six: list[str], rotation: np.ndarray, element: Element | None
) -> Link:
    """The link with an inertial from a file's words: mass, COM (three, or none for 0), and the six entries of the
    tensor in axes turned by ``rotation``.
    """
    step = tensor_from_six(printed_steps(six).tolist())
    return replace(
        bare,
        mass=float(mass),
        center_of_mass=floats(" ".join(center), "0 0 0", 3),
        inertia=rotation @ tensor_from_six([float(word) for word in six]) @ rotation.T,
        problem="",
        mass_step=float(printed_steps([mass])[0]),
        center_step=printed_steps(center) if center else np.zeros(3),
        inertia_step=np.abs(rotation) @ step @ np.abs(rotation).T,
        element=element,
    )
