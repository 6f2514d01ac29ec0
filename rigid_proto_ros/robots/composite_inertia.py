# SPDX-License-Identifier: MIT
"""A robot with its joints at 0 as one rigid body: mass properties from its inertials, and one mesh of its links."""

from __future__ import annotations

import contextlib
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.errors import InputError
from ..base.vectors import Points, Triangles
from ..mass.properties import MassProperties
from ..mass.tensor import check_tensor
from ..mesh.locate import Search, resolve_mesh
from ..mesh.reading import load_mesh
from .link_shapes import Meshes, check_shape, combined, of_mass, placed, placed_surface
from .reading import COLLISION, NO_INERTIAL, VISUAL, Link, Pose, check_finite, check_inertial, read_robot


@dataclass(frozen=True)
class Lump:
    """A robot as one body. properties: of all links together. vertices (n, 3), triangles (m, 3): their shapes. links:
    names and masses of links with an inertial. massless: names of links without one. absent: why shapes aren't in the
    mesh. files: the robot's file and those of its meshes that were found.
    """

    properties: MassProperties
    vertices: Points
    triangles: Triangles
    links: tuple[tuple[str, float], ...]
    massless: tuple[str, ...]
    absent: tuple[str, ...]
    files: tuple[Path, ...]


@np.errstate(all="ignore")  # for numbers near the largest, which are refused
def lump_robot(path: Path, folders: tuple[Path, ...] = ()) -> Lump:
    """Merge a robot with all joints at 0, in the frame of its root link (URDF), of the model (SDF) or of the world
    (MJCF).

    Raises InputError for a file without inertials, and for links that don't form a tree.
    """
    robot = read_robot(path)
    search = Search(path.parent, folders)
    links = robot.simulated() if robot.simulated else [_with_inertial(link, Meshes(search)) for link in robot.links]
    poses = robot.poses()
    for name, pose in poses.items():
        check_finite(f"link {name}", position=pose.position, orientation=pose.rotation)
    names = [link.name for link in links]
    twice = next((name for name, times in Counter(names).items() if times > 1), None)
    if twice is not None:
        raise InputError("lump", f"two links {twice!r}", "links with names of their own")
    lost = next((name for name in names if name not in poses), None)
    if lost is not None:
        raise InputError("lump", f"link {lost!r} is connected to no other; accepted: one tree of links")
    for link in links:
        if link.problem not in ("", NO_INERTIAL):
            raise InputError(f"link {link.name}", link.problem, "inertials with mass and inertia, or none")
    heavy = [(link, poses[link.name]) for link in links if not link.problem]
    if not heavy:
        raise InputError("lump", path.name, "a file with inertials")
    for link, _ in heavy:
        check_inertial(link)
        if link.mass < 0.0:
            raise InputError(f"mass of link {link.name}", link.mass, "masses >= 0")
    properties = combined([placed(link, pose) for link, pose in heavy], path.name)
    check_tensor(properties.inertia, source=f"tensor of {path.name} as one body")
    vertices, triangles, absent = _merge([(link, poses[link.name]) for link in links], search)
    masses = tuple((link.name, link.mass) for link, _ in heavy)
    massless = tuple(link.name for link in links if link.problem)
    files = [path]
    for name in {shape.file for link in links for shape in link.shapes if shape.file}:
        with contextlib.suppress(InputError):
            files.append(resolve_mesh(name, search))
    return Lump(properties, vertices, triangles, masses, massless, absent, tuple(files))


def _with_inertial(link: Link, meshes: Meshes) -> Link:
    """The link with the inertial that an SDF leaves to the simulator: that of its collision shapes at their densities,
    scaled to the mass if one is given. Raises InputError for shapes that enclose no volume.
    """
    if not link.computed:
        return link
    parts = [meshes.parts([shape]) for shape in link.shapes if shape.role == COLLISION]
    solids = [of_mass(solid, part.first.density * solid.mass) for part in parts for solid in part.solids]
    whole = combined(solids, f"link {link.name}")
    if link.mass > 0.0:
        whole = of_mass(whole, link.mass)
    return replace(link, mass=whole.mass, center_of_mass=whole.center_of_mass, inertia=whole.inertia, problem="")


def _merge(links: list[tuple[Link, Pose]], search: Search) -> tuple[Points, Triangles, tuple[str, ...]]:
    """Vertices and triangles of the visual shapes, or of the collision shapes of links without visual ones; and what is
    missing.
    """
    vertices, triangles, count, absent = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0, []
    for link, pose in links:
        shown = [shape for shape in link.shapes if shape.role == VISUAL]
        for shape in shown or link.shapes:
            try:
                check_shape(shape)
                mesh = load_mesh(shape.file, search=search) if shape.kind == "mesh" else None
                points, corners = placed_surface(shape, mesh)
            except InputError as error:
                absent.append(f"{link.name}: {error}")
                continue
            vertices.append(points @ pose.rotation.T + pose.position)
            triangles.append(corners + count)
            count += len(points)
    return np.concatenate(vertices), np.concatenate(triangles), tuple(absent)


def obj_text(vertices: Points, triangles: Triangles) -> str:
    """A mesh as the text of an .obj file, with all digits."""
    points = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    return points + "".join(f"f {a} {b} {c}\n" for a, b, c in (triangles + 1).tolist())
