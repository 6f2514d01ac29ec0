# SPDX-License-Identifier: MIT
"""Links with a mesh and an inertial, read from URDF, SDF and MJCF files as these formats define them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base.bounded_file import read_bounded
from ..base.errors import InputError

MAX_BYTES = 50_000_000


@dataclass(frozen=True)
class MeshUse:
    """A mesh as a link shows it: file name, scale (3,), rotation (3, 3) and position (3,) [m] in the link's frame."""

    file: str
    scale: np.ndarray
    rotation: np.ndarray
    position: np.ndarray


@dataclass(frozen=True)
class LinkInertial:
    """What a file says of one link: mass [kg], COM (3,) [m] and tensor (3, 3) [kg m²] about it, both in the link's
    axes; ``problem`` instead when the file's numbers can't be read."""

    link: str
    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray
    meshes: tuple[MeshUse, ...]
    problem: str = ""


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
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def read_robot(path: Path) -> list[LinkInertial]:
    """The links of a robot file that have an inertial or a mesh; raises InputError when the file can't be read."""
    data = read_bounded(path, MAX_BYTES, "compare", "a URDF, SDF or MJCF file")
    if b"<!ENTITY" in data:
        raise InputError("compare", path.name, "a file without XML entities")
    if b"xacro:" in data:
        raise InputError("compare", path.name, "plain URDF: expand it first, xacro FILE > robot.urdf")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise InputError("compare", path.name, f"well-formed XML ({error})") from None
    readers = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}
    if root.tag not in readers:
        raise InputError(
            "compare", f"{path.name} begins with <{root.tag}>, not with URDF's <robot>, SDF's <sdf> or MJCF's <mujoco>"
        )
    try:
        return readers[root.tag](root)
    except (ValueError, TypeError, KeyError) as error:
        raise InputError("compare", path.name, f"numbers where the format has numbers ({error})") from None


def _floats(text: str | None, default: str, count: int | None = None) -> np.ndarray:
    values = np.array([float(word) for word in (text or default).split()])
    if count is not None and len(values) != count:
        raise ValueError(f"{text!r} instead of {count} numbers")
    return values


def _about(inertia: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    return rotation @ inertia @ rotation.T


def _symmetric(ixx: float, ixy: float, ixz: float, iyy: float, iyz: float, izz: float) -> np.ndarray:
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def _urdf(root: ElementTree.Element) -> list[LinkInertial]:
    links = []
    for link in root.iter("link"):
        meshes = []
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is not None and mesh.get("filename"):
                origin = shape.find("origin")
                get = origin.get if origin is not None else (lambda _: None)
                rotation = rotation_from_rpy(*_floats(get("rpy"), "0 0 0", 3))
                position = _floats(get("xyz"), "0 0 0", 3)
                meshes.append(
                    MeshUse(mesh.get("filename", ""), _floats(mesh.get("scale"), "1 1 1", 3), rotation, position)
                )
        inertial = link.find("inertial")
        if inertial is None:
            if meshes:
                links.append(_without(link.get("name", "?"), meshes, "no <inertial>"))
            continue
        origin, mass, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
        if mass is None or tensor is None:
            links.append(_without(link.get("name", "?"), meshes, "an <inertial> without mass or inertia"))
            continue
        get = origin.get if origin is not None else (lambda _: None)
        rotation = rotation_from_rpy(*_floats(get("rpy"), "0 0 0", 3))
        six = [float(tensor.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")]
        links.append(
            LinkInertial(
                link.get("name", "?"),
                float(mass.get("value", "nan")),
                _floats(get("xyz"), "0 0 0", 3),
                _about(_symmetric(*six), rotation),
                tuple(meshes),
            )
        )
    return links


def _without(name: str, meshes: list[MeshUse], problem: str) -> LinkInertial:
    return LinkInertial(name, math.nan, np.full(3, math.nan), np.full((3, 3), math.nan), tuple(meshes), problem)


def _sdf_pose(element: ElementTree.Element | None) -> tuple[np.ndarray, np.ndarray]:
    pose = element.find("pose") if element is not None else None
    values = _floats(pose.text if pose is not None else None, "0 0 0 0 0 0", 6)
    if pose is not None and pose.get("degrees", "false") in ("true", "1"):
        values[3:] = np.radians(values[3:])
    return rotation_from_rpy(*values[3:]), values[:3]


def _sdf(root: ElementTree.Element) -> list[LinkInertial]:
    links = []
    for link in root.iter("link"):
        meshes = []
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is not None and mesh.findtext("uri"):
                rotation, position = _sdf_pose(shape)
                scale = _floats(mesh.findtext("scale"), "1 1 1", 3)
                meshes.append(MeshUse(mesh.findtext("uri", "").strip(), scale, rotation, position))
        inertial = link.find("inertial")
        name = link.get("name", "?")
        if inertial is None:
            if meshes:
                links.append(_without(name, meshes, "no <inertial>"))
            continue
        rotation, position = _sdf_pose(inertial)
        tensor = inertial.find("inertia")
        if tensor is None or inertial.findtext("mass") is None:
            links.append(_without(name, meshes, "an <inertial> without mass or inertia"))
            continue
        six = [
            float(tensor.findtext(tag, "1" if tag in ("ixx", "iyy", "izz") else "0"))
            for tag in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        ]
        inertia = _about(_symmetric(*six), rotation)
        links.append(LinkInertial(name, float(inertial.findtext("mass", "")), position, inertia, tuple(meshes)))
    return links


def _mjcf_rotation(element: ElementTree.Element, degrees: bool, sequence: str) -> np.ndarray:
    """Orientation of an MJCF element: quat, axisangle, xyaxes, zaxis or euler."""
    turn = math.pi / 180.0 if degrees else 1.0
    if element.get("axisangle"):
        x, y, z, angle = _floats(element.get("axisangle"), "", 4)
        axis = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        half = 0.5 * angle * turn
        return rotation_from_wxyz([math.cos(half), *(math.sin(half) * axis)])
    if element.get("xyaxes"):
        values = _floats(element.get("xyaxes"), "", 6)
        x = values[:3] / np.linalg.norm(values[:3])
        y = values[3:] - x * (x @ values[3:])
        y /= np.linalg.norm(y)
        return np.stack([x, y, np.cross(x, y)], axis=1)
    if element.get("zaxis"):
        z = _floats(element.get("zaxis"), "", 3)
        z = z / np.linalg.norm(z)
        return rotation_from_wxyz([1.0 + z[2], -z[1], z[0], 0.0] if z[2] > -1.0 else [0.0, 1.0, 0.0, 0.0])
    if element.get("euler"):
        rotation = np.eye(3)
        for letter, angle in zip(sequence, _floats(element.get("euler"), "", 3) * turn, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            single = rotation_from_wxyz([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * axis)])
            rotation = rotation @ single if letter.islower() else single @ rotation  # intrinsic, or extrinsic
        return rotation
    return rotation_from_wxyz(_floats(element.get("quat"), "1 0 0 0", 4))


def _mjcf(root: ElementTree.Element) -> list[LinkInertial]:
    compiler = root.find("compiler")
    get = compiler.get if compiler is not None else (lambda _name, default=None: default)
    degrees = get("angle", "degree") != "radian"
    sequence = get("eulerseq", "xyz")
    folder = get("meshdir") or get("assetdir") or ""
    assets = {}
    for mesh in root.iter("mesh"):
        if mesh.get("file"):
            file = mesh.get("file", "")
            name = mesh.get("name", Path(file).stem)
            assets[name] = (str(Path(folder) / file) if folder else file, _floats(mesh.get("scale"), "1 1 1", 3))
    links = []
    for body in root.iter("body"):
        meshes = []
        for geom in body.findall("geom"):
            if geom.get("mesh", "") in assets:
                file, scale = assets[geom.get("mesh", "")]
                rotation = _mjcf_rotation(geom, degrees, sequence)
                meshes.append(MeshUse(file, scale, rotation, _floats(geom.get("pos"), "0 0 0", 3)))
        inertial = body.find("inertial")
        name = body.get("name", "?")
        if inertial is None:
            continue  # MuJoCo then computes it itself
        position = _floats(inertial.get("pos"), "0 0 0", 3)
        if inertial.get("fullinertia"):
            xx, yy, zz, xy, xz, yz = _floats(inertial.get("fullinertia"), "", 6)
            inertia = _symmetric(xx, xy, xz, yy, yz, zz)
        else:
            inertia = np.diag(_floats(inertial.get("diaginertia"), "", 3))
        inertia = _about(inertia, _mjcf_rotation(inertial, degrees, sequence))
        links.append(LinkInertial(name, float(inertial.get("mass", "nan")), position, inertia, tuple(meshes)))
    return links
