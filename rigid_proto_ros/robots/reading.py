# SPDX-License-Identifier: MIT
"""Robots from files, in whichever format: links with inertials and shapes, and where they are. URDF and SDF are read
here, as these formats define them, MJCF through MuJoCo (robots/mjcf.py).
"""

from __future__ import annotations

import math
import re
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
from ..base.files import read_bounded
from ..base.rotation import matrix_from_quaternion
from ..mass.tensor import tensor_from_six

VISUAL, COLLISION = "visual", "collision"
WATER = 1000.0
"""kg/m³ of a shape of which nothing else is said."""
MAX_BYTES = 50_000_000
"""Of a robot's file."""
SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
SIZES = {
    "box": ("size", 3),
    "cylinder": ("radius length", 2),
    "capsule": ("radius length", 2),
    "sphere": ("radius", 1),
    "ellipsoid": ("radii", 3),
}
"""Names of what says a primitive's size, and how many numbers that is."""


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
        parser.Parse(data.lstrip(), True)  # blank lines before the declaration, which other readers skip
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
            from .mjcf import read_mjcf

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
