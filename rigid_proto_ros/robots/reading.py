# SPDX-License-Identifier: MIT
"""Robot files of any format: links with inertials and shapes, and their poses. URDF and SDF are read here as these
formats define them, MJCF through MuJoCo (robots/mjcf.py).
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Callable, Iterator
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
from ..base.vectors import FloatArray, Matrix3, Numbers, Vector3
from ..mass.tensor import SIX, tensor_from_six

VISUAL, COLLISION = "visual", "collision"
NO_INERTIAL = "no <inertial>"
WATER = 1000.0
"""Default density of a shape [kg/m³]."""
MAX_BYTES = 50_000_000
"""Largest size of a robot's file [bytes]."""
LARGEST = 1e50
"""Largest mass, length or moment [SI units]; its powers and products don't overflow."""
ZEROS = "0 0 0"
SIZES = {
    "box": ("size", 3),
    "cylinder": ("radius length", 2),
    "capsule": ("radius length", 2),
    "sphere": ("radius", 1),
    "ellipsoid": ("radii", 3),
}
"""By kind of primitive, the names of its sizes and how many numbers they have."""


@dataclass(frozen=True)
class Pose:
    """Rotation (3, 3) and position (3,) [m] of a frame in another."""

    rotation: Matrix3
    position: Vector3

    def __matmul__(self, inner: Pose) -> Pose:
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.position + self.position)


HERE = Pose(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class Shape:
    """A visual or collision shape of a link. kind: "mesh" with ``file`` and scale (3,), or with ``size`` [m] a "box"
    (sides), "cylinder" or "capsule" (radius, length along z, the capsule's without its caps), "sphere" (radius) or
    "ellipsoid" (semi-axes). pose: in the link's frame. problem: why it can't be used. density [kg/m³].
    """

    role: str
    kind: str
    pose: Pose
    file: str = ""
    scale: Vector3 = field(default_factory=lambda: np.ones(3))
    size: tuple[float, ...] = ()
    problem: str = ""
    density: float = WATER


@dataclass(frozen=True)
class Link:
    """A link as its file describes it: mass [kg], COM (3,) [m] and tensor (3, 3) [kg m²] about it, both in the link's
    axes. problem: why they are missing. The steps are half a unit of the last printed digit of mass, COM (3,) and
    tensor (3, 3), which is the error that printing alone may cause. element: the <inertial>; None if the inertial has
    another source. owner: the <link>. computed: a simulator computes the inertial from the collision shapes, for the
    mass if one is given.
    """

    name: str
    shapes: tuple[Shape, ...] = ()
    problem: str = NO_INERTIAL
    mass: float = math.nan
    center_of_mass: Vector3 = field(default_factory=lambda: np.full(3, math.nan))
    inertia: Matrix3 = field(default_factory=lambda: np.full((3, 3), math.nan))
    mass_step: float = 0.0
    center_step: Vector3 = field(default_factory=lambda: np.zeros(3))
    inertia_step: Matrix3 = field(default_factory=lambda: np.zeros((3, 3)))
    element: Element | None = None
    computed: bool = False
    owner: Element | None = None


@dataclass
class Robot:
    """links: those with an <inertial> or a shape, in the file's order. poses(): the pose of each link by name with all
    joints at 0, in the frame of the root link (URDF), of the model (SDF) or of the world (MJCF); raises InputError for
    links that don't form a tree. simulated(): the links with the inertials that the format's own simulator uses, if
    these aren't the file's.
    """

    links: list[Link]
    poses: Callable[[], dict[str, Pose]]
    simulated: Callable[[], list[Link]] | None = None

    def __post_init__(self) -> None:
        self.links = [link for link in self.links if link.shapes or link.problem != NO_INERTIAL]


def parse_xml(data: bytes, path: Path) -> Element:
    """The root of a file's XML, with names as they are written: SDF files use prefixes (gz:) that they don't declare.

    Raises InputError for text that isn't XML, or has entities.
    """

    def check_doctype(_name: str, _system: str | None, _public: str | None, has_declarations: bool) -> None:
        if has_declarations:
            raise InputError("robot file", path.name, "a file without XML entities or other declarations")

    tree = ElementTree.TreeBuilder()
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = check_doctype
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler = tree.data
    try:
        parser.Parse(data.lstrip(), True)  # without blank lines before the declaration, as other readers do
        return tree.close()
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError("robot file", path.name, f"well-formed XML ({error})") from None


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Matrix3:
    """Rotation (3, 3) of roll, pitch and yaw about fixed axes [rad], as in URDF and SDF."""
    cr, sr, cp, sp, cy, sy = (float(f(a)) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_wxyz(quaternion: Numbers) -> Matrix3:
    """Rotation (3, 3) of a quaternion (w, x, y, z), in MuJoCo's order; of any length but 0."""
    w, x, y, z = (np.asarray(quaternion, dtype=float) / np.linalg.norm(np.asarray(quaternion, dtype=float))).tolist()
    return matrix_from_quaternion([x, y, z, w])


def floats(name: str, text: str, count: int = 3) -> FloatArray:
    """Parse ``count`` numbers (count,). name: of the text in error messages. Raises InputError for anything else."""
    try:
        values = np.array([float(word.replace("_", "?")) for word in text.split()])  # Python accepts _ in numbers
    except ValueError:
        values = np.zeros(0)
    if len(values) != count:
        raise InputError(name, text, f"{count} numbers" if count > 1 else "a number")
    return values


def check_finite(what: str, **numbers: ArrayLike) -> None:
    """Raises InputError for named numbers that aren't finite or are beyond LARGEST."""
    for name, values in numbers.items():
        if not np.all(np.abs(values) <= LARGEST):
            received = " ".join(f"{value:g}" for value in np.ravel(values))
            raise InputError(f"{name.replace('_', ' ')} of {what}", received, f"finite numbers up to {LARGEST:g}")


def check_inertial(link: Link) -> None:
    """Raises InputError for a link's inertial with numbers that aren't finite or are beyond LARGEST."""
    check_finite(f"link {link.name}", mass=link.mass, center_of_mass=link.center_of_mass, inertia=link.inertia)


def number(name: str, text: str) -> float:
    """Parse one number. name: of the text in error messages. Raises InputError for anything else."""
    return float(floats(name, text, 1)[0])


def printed_steps(words: list[str]) -> FloatArray:
    """Half a unit of the last digit that is printed in a group of numbers: 0.0005 for 0.012 alone; 0 for zeros."""
    decimals = []
    for word in words:
        mantissa, _, exponent = word.strip().lower().partition("e")
        decimals.append(len(mantissa.partition(".")[2]) - float(exponent or 0))
    step = 0.5 * 10.0 ** min(-max(decimals), 300) if any(float(word) for word in words) else 0.0
    return np.full(len(words), step)


def printed_link(
    bare: Link, mass: str, center: str, six: list[str], rotation: Matrix3, element: Element | None
) -> Link:
    """The link with an inertial parsed from a file's text: mass, COM, and the six entries of the tensor in axes turned
    by ``rotation``.
    """
    of = f"of link {bare.name}"
    entries = [number(f"{name} {of}", word) for name, word in zip(SIX, six, strict=True)]
    step = tensor_from_six(printed_steps(six).tolist())
    return replace(
        bare,
        mass=number(f"mass {of}", mass),
        center_of_mass=floats(f"COM {of}", center),
        inertia=rotation @ tensor_from_six(entries) @ rotation.T,
        problem="",
        mass_step=float(printed_steps([mass])[0]),
        center_step=printed_steps(center.split()),
        inertia_step=np.abs(rotation) @ step @ np.abs(rotation).T,
        element=element,
    )


def read_robot(path: Path) -> Robot:
    """Read the robot in a file. Raises InputError if it can't be read."""
    data = read_bounded(path, MAX_BYTES, "robot file", "a URDF, SDF or MJCF file")
    return robot_of(parse_xml(data, path), path)


def robot_of(root: Element, path: Path) -> Robot:
    """The robot below the root of a file. Raises InputError for other content, or for text in place of numbers."""
    if path.suffix == ".xacro" or any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError("robot file", path.name, f"plain URDF: xacro {shlex.quote(str(path))} > EXPANDED.urdf")
    if root.tag == "robot":
        return Robot([_urdf_link(link) for link in root.findall("link")], lambda: _urdf_poses(root))
    if root.tag == "sdf":
        return Robot(_sdf_links(root), lambda: _sdf_poses(root))
    if root.tag == "mujoco":
        from .mjcf import read_mjcf

        return read_mjcf(root, path)
    tag = re.sub(r"[^\w:.{}/-]", "?", str(root.tag))[:40]
    accepted = "URDF's <robot>, SDF's <sdf> or MJCF's <mujoco>"
    raise InputError("robot file", f"{path.name} begins with <{tag}>, not with {accepted}")


def _with_size(shape: Shape, link: str, file: str, scale: str, text: Callable[[str], str | None]) -> Shape:
    """A link's shape with the file and scale of its mesh, or with the size of its kind, which ``text`` gives by
    name.
    """
    if shape.kind == "mesh":
        problem = shape.problem or ("" if file else "a mesh without a file")
        return replace(shape, file=file, scale=floats(f"scale of a mesh of link {link}", scale), problem=problem)
    if shape.kind not in SIZES:
        return replace(shape, problem=f"a shape <{shape.kind}>, which isn't supported")
    names, count = SIZES[shape.kind]
    words = " ".join(text(name) or "" for name in names.split())
    return replace(shape, size=tuple(floats(f"{names} of a {shape.kind} of link {link}", words, count).tolist()))


def _drawn(link: Element) -> Iterator[tuple[str, Element, Element]]:
    """Role, <visual> or <collision> element, and content of its <geometry>, for each shape of a link."""
    for role in (VISUAL, COLLISION):
        for part in link.findall(role):
            held = next((child for child in part.iterfind("geometry/*") if child.tag != "empty"), None)
            if held is not None:
                yield role, part, held


# URDF


def _urdf_pose(origin: Element | None, owner: str) -> Pose:
    words = {} if origin is None else origin.attrib
    rpy, xyz = (floats(f"{name} of {owner}", words.get(name, ZEROS)) for name in ("rpy", "xyz"))
    return Pose(rotation_from_rpy(*rpy), xyz)


def _urdf_link(link: Element) -> Link:
    name, shapes = link.get("name", "?"), []
    for role, part, of in _drawn(link):
        plain = Shape(role, of.tag, _urdf_pose(part.find("origin"), f"a {role} of link {name}"))
        shapes.append(_with_size(plain, name, of.get("filename", ""), of.get("scale", "1 1 1"), of.get))
    bare = Link(name, tuple(shapes), owner=link)
    inertial = link.find("inertial")
    if inertial is None:
        return bare
    origin, mass, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    if mass is None or tensor is None or mass.get("value") is None:
        return replace(bare, problem="an <inertial> without mass or inertia")
    center = ZEROS if origin is None else origin.get("xyz", ZEROS)
    six = [tensor.get(entry, "0") for entry in SIX]
    rotation = _urdf_pose(origin, f"the inertial of link {name}").rotation
    return printed_link(bare, mass.get("value", ""), center, six, rotation, inertial)


def _urdf_poses(root: Element) -> dict[str, Pose]:
    """Poses of the links in the frame of the root link."""
    above: dict[str, tuple[str, Pose]] = {}
    names = dict.fromkeys(link.get("name", "?") for link in root.findall("link"))
    for joint in root.findall("joint"):
        ends = [joint.find(tag) for tag in ("parent", "child")]
        parent, child = ("" if end is None else end.get("link", "") for end in ends)
        if not parent or not child or child in above:
            raise InputError("lump", f"joint {joint.get('name')!r} of {parent!r} and {child!r}", "a tree of links")
        if parent not in names or child not in names:
            missing = parent if parent not in names else child
            raise InputError("lump", f"there is no link {missing!r}, which joint {joint.get('name')!r} connects")
        above[child] = parent, _urdf_pose(joint.find("origin"), f"joint {joint.get('name', '?')}")
    roots = [name for name in names if name not in above]
    if len(roots) != 1:
        raise InputError("lump", f"{len(roots)} root links ({', '.join(roots[:4])}); accepted: one tree of links")
    below: dict[str, list[str]] = {}
    for child, (parent, _) in above.items():
        below.setdefault(parent, []).append(child)
    poses, reached = {roots[0]: HERE}, [roots[0]]
    for parent in reached:
        for child in below.get(parent, ()):
            poses[child] = poses[parent] @ above[child][1]
            reached.append(child)
    return poses


# SDF


def _text(element: Element, tag: str, default: str) -> str:
    """Text of an element's child, or the default if it is missing or empty."""
    return (element.findtext(tag) or "").strip() or default


def _is_true(word: str) -> bool:
    return word.lower() in ("true", "1")


def _frame_of_pose(element: Element) -> str:
    """The frame that an element's <pose> is relative to, or "". Up to SDF 1.6 the attribute is ``frame``."""
    pose = element.find("pose")
    return "" if pose is None else pose.get("relative_to", "") or pose.get("frame", "")


def _sdf_pose(element: Element, owner: str) -> Pose:
    """The pose in an element's <pose>, relative to its frame."""
    pose, what = element.find("pose"), f"pose of {owner}"
    words = {} if pose is None else pose.attrib
    form = words.get("rotation_format", "euler_rpy")
    if form not in ("euler_rpy", "quat_xyzw"):
        raise InputError(f"rotation_format of the {what}", form, "euler_rpy, quat_xyzw")
    if form == "quat_xyzw":
        values = floats(what, _text(element, "pose", f"{ZEROS} {ZEROS} 1"), 7)
        if not np.any(values[3:]):
            raise InputError(what, _text(element, "pose", ""), "a quaternion other than 0")
        return Pose(rotation_from_wxyz(values[[6, 3, 4, 5]]), values[:3])
    values = floats(what, _text(element, "pose", f"{ZEROS} {ZEROS}"), 6)
    if _is_true(words.get("degrees", "")):
        values[3:] = np.radians(values[3:])
    return Pose(rotation_from_rpy(*values[3:]), values[:3])


def _sdf_links(root: Element) -> list[Link]:
    """All links; those of several models, which may share names, as ``model::link``."""
    models = list(root.iter("model"))
    owner = {link: model.get("name", "?") for model in models for link in model.findall("link") if len(models) > 1}
    links = [(element, _sdf_link(element)) for element in root.iter("link")]
    return [replace(link, name=f"{owner[at]}::{link.name}") if at in owner else link for at, link in links]


def _sdf_link(link: Element) -> Link:
    name, inertial = link.get("name", "?"), link.find("inertial")
    owner, density = f"link {name}", str(WATER) if inertial is None else _text(inertial, "density", str(WATER))
    shapes = []
    for role, part, of in _drawn(link):
        relative = _frame_of_pose(part)
        problem = f"a pose relative to {relative!r}, not to the link" if relative not in ("", name) else ""
        if of.tag == "mesh" and of.find("submesh") is not None:
            problem = problem or "one submesh of a mesh file"
        dense = number(f"density of {owner}", _text(part, "density", density))
        own = _sdf_pose(part, f"a {role} of {owner}")
        plain = Shape(role, of.tag, own, problem=problem, density=dense)
        shapes.append(_with_size(plain, name, _text(of, "uri", ""), _text(of, "scale", "1 1 1"), of.findtext))
    bare = Link(name, tuple(shapes), owner=link)
    if inertial is None:
        return bare
    if _is_true(inertial.get("auto", "")):
        mass = inertial.findtext("mass")
        computed = replace(bare, problem="the simulator computes its inertial (auto='true')", computed=True)
        return computed if mass is None else replace(computed, mass=number(f"mass of {owner}", mass))
    relative = _frame_of_pose(inertial)
    if relative not in ("", name):
        return replace(bare, problem=f"an <inertial> whose pose is relative to {relative!r}")
    # SDF's defaults, which simulators use: 1 kg, and 1 kg m² about each axis.
    six = [_text(inertial, f"inertia/{entry}", "1" if entry in ("ixx", "iyy", "izz") else "0") for entry in SIX]
    rotation = _sdf_pose(inertial, f"the inertial of {owner}").rotation
    center = " ".join(_text(inertial, "pose", ZEROS).split()[:3])
    return printed_link(bare, _text(inertial, "mass", "1"), center, six, rotation, inertial)


def _sdf_poses(root: Element) -> dict[str, Pose]:
    """Poses of the only model's links, joints and frames in the model's frame."""
    models = list(root.iter("model"))
    if len(models) != 1 or next(root.iter("include"), None) is not None:
        raise InputError("lump", f"{len(models)} models", "an SDF of one model, without <include>")
    elements = {
        element.get("name", "?"): element for tag in ("link", "joint", "frame") for element in models[0].findall(tag)
    }
    found = {"": HERE, "__model__": HERE}
    for one in elements:
        name, bases = one, dict[str, str]()
        while name not in found:
            if name not in elements or name in bases:
                raise InputError("lump", f"frame {name!r}", "poses relative to links, joints and frames of the model")
            element = elements[name]
            base = _frame_of_pose(element)
            if element.tag == "joint":
                base = base or (element.findtext("child") or "").strip()
            if element.tag == "frame":
                base = base or element.get("attached_to", "")
            bases[name] = base
            name = base
        for name, base in reversed(bases.items()):
            found[name] = found[base] @ _sdf_pose(elements[name], f"{elements[name].tag} {name}")
    return {name: found[name] for name in elements}
