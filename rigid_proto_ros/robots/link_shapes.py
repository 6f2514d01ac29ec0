# SPDX-License-Identifier: MIT
"""The shapes of a link as solids of one density: meshes, and primitives in closed form."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.vectors import Matrix3, Points, Triangles, Vector3
from ..mass.from_mesh import MeshBody, mesh_body
from ..mass.properties import MassProperties
from ..mesh.locate import Search, resolve_mesh
from ..mesh.reading import Mesh, load_mesh
from .reading import Link, Pose, Shape, check_finite

SEGMENTS = 48
"""Number of corners of a round shape's circle; a multiple of 4, so that its bounding box is exact."""
NEAR = 1e-12
"""Smallest ratio of a shape's size to its distance from the link's origin; below it rounding destroys the shape."""


def check_shape(shape: Shape) -> None:
    """Raises InputError for a shape that isn't supported."""
    named = shape.file or shape.kind
    if shape.problem:
        raise InputError(named, shape.problem)
    pose = shape.pose
    check_finite(named, position=pose.position, orientation=pose.rotation, scale=shape.scale, size=shape.size)
    if shape.kind != "mesh" and not min(shape.size) > 0.0:
        raise InputError(f"size of {named}", shape.size, "sizes > 0")


def primitive_solid(kind: str, size: tuple[float, ...]) -> MassProperties:
    """Mass properties of a primitive of density 1 about its centre. size: as in Shape."""
    if kind == "box":
        volume = math.prod(size)
        squares = volume * np.square(size) / 12.0  # integrals of x², y², z²
    elif kind in ("sphere", "ellipsoid"):
        axes = np.array(size * 3 if kind == "sphere" else size)
        volume = 4.0 / 3.0 * math.pi * float(np.prod(axes))
        squares = volume * axes**2 / 5.0
    else:
        r, length = size
        volume = math.pi * r * r * length
        squares = volume * np.array([r * r / 4.0, r * r / 4.0, length * length / 12.0])
    if kind == "capsule":
        # Two hemispheres whose flat sides lie length/2 from the centre, and their centroids 3r/8 farther out.
        ball = 4.0 / 3.0 * math.pi * r**3
        across = ball * r * r / 5.0
        along = across + ball * (length * length / 4.0 + 2.0 * (length / 2.0) * (3.0 * r / 8.0))
        volume, squares = volume + ball, squares + np.array([across, across, along])
    return MassProperties(volume, np.zeros(3), np.diag(squares.sum() - squares))


def primitive_surface(kind: str, size: tuple[float, ...]) -> tuple[Points, Triangles]:
    """Vertices (n, 3) and outward triangles (m, 3) of a primitive about its centre. Round ones are inscribed and have
    the same bounding box. size: as in Shape.
    """
    from trimesh import creation

    # Made at unit size, since trimesh merges points closer than 1e-8.
    if kind == "box":
        made, stretch = creation.box((1.0, 1.0, 1.0)), size
    elif kind in ("sphere", "ellipsoid"):
        made, stretch = creation.icosphere(subdivisions=3), size * 3 if kind == "sphere" else size
    elif kind == "cylinder":
        made, stretch = creation.cylinder(1.0, 1.0, sections=SEGMENTS), (size[0], *size)
    else:
        made, stretch = creation.capsule(2.0, 1.0, count=(SEGMENTS, SEGMENTS // 2)), (size[0],) * 3
    vertices = np.asarray(made.vertices) - made.bounds.mean(axis=0)
    shift = 0.5 * size[1] - size[0] if kind == "capsule" else 0.0
    upward = np.sign(vertices[:, 2:]) * (0.0, 0.0, shift)
    return vertices * stretch + upward, np.asarray(made.faces, dtype=np.int64)


def placed_surface(shape: Shape, mesh: Mesh | None) -> tuple[Points, Triangles]:
    """Vertices (n, 3) and triangles (m, 3) of a shape in the link's frame. mesh: None for a primitive. Raises
    InputError if they aren't finite.
    """
    if mesh is None:
        vertices, triangles = primitive_surface(shape.kind, shape.size)
    else:
        used, local = np.unique(mesh.triangles, return_inverse=True)
        vertices, triangles = mesh.vertices[used] * shape.scale, local.reshape(-1, 3)
        if np.prod(shape.scale) < 0.0:
            triangles = triangles[:, ::-1]
    points = vertices @ shape.pose.rotation.T + shape.pose.position
    named, reach = shape.file or shape.kind, float(np.abs(points).max(initial=0.0))
    check_finite(named, reach=reach)
    size = float(np.ptp(points, axis=0).max())
    if size < NEAR * reach:
        raise InputError(named, f"{size:.3g} m across, {reach:.3g} m away", f"at least {NEAR:g} of the distance across")
    return points, triangles


def placed(body: MassProperties | Link, pose: Pose) -> MassProperties:
    """A body's mass properties transformed from the frame of ``pose``."""
    R = pose.rotation
    return MassProperties(body.mass, R @ body.center_of_mass + pose.position, R @ body.inertia @ R.T)


def of_mass(body: MassProperties, mass: float) -> MassProperties:
    """The body scaled to another mass."""
    return replace(body, mass=mass, inertia=body.inertia * (mass / body.mass))


def parallel_axis(mass: float, offset: Vector3) -> Matrix3:
    """Inertia (3, 3) of a point mass about a point at the distance ``offset`` (3,)."""
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def combined(bodies: Sequence[MassProperties], whole: str) -> MassProperties:
    """Bodies merged into one, about their common COM. Raises InputError if the total mass isn't finite and above 0."""
    mass = sum(body.mass for body in bodies)
    if not 0.0 < mass < math.inf:
        raise InputError(f"mass of {whole}", mass, "a finite mass or volume > 0")
    center = sum((body.mass * body.center_of_mass for body in bodies), np.zeros(3)) / mass
    each = (body.inertia + parallel_axis(body.mass, body.center_of_mass - center) for body in bodies)
    inertia = sum(each, np.zeros((3, 3)))
    return MassProperties(mass, center, 0.5 * (inertia + inertia.T))


class Meshes:
    """The meshes that a robot's shapes name, each loaded once. accept_open: as in ``mesh_body``."""

    def __init__(self, search: Search, accept_open: float = 0.0) -> None:
        self._search = search
        self._body = functools.cache(lambda path: mesh_body(load_mesh(path), accept_open=accept_open))

    def _load(self, shape: Shape) -> MeshBody | None:
        """The body of a shape's mesh; None for a primitive. Raises InputError, which says whether the mesh wasn't found
        or can't be read.
        """
        try:
            check_shape(shape)
            path = str(resolve_mesh(shape.file, self._search)) if shape.kind == "mesh" else ""
        except MeshError as error:
            raise InputError(f"{shape.role} mesh not found", str(error).removeprefix("mesh: ")) from None
        except InputError as error:
            raise InputError(f"{shape.role} {shape.kind} that can't be taken", str(error)) from None
        try:
            return self._body(path) if path else None
        except InputError as error:
            raise InputError(f"{shape.role} mesh that can't be read", str(error)) from None

    def parts(self, shapes: Sequence[Shape]) -> LinkShapes:
        """The shapes with their meshes. Raises InputError, which names one that can't be used."""
        taken, lost = [], []
        for shape in shapes:
            try:
                taken.append((shape, self._load(shape)))
            except InputError as error:
                lost.append(error)
        if lost:
            others = f", and {len(lost) - 1} more" if len(lost) > 1 else ""
            raise InputError(lost[0].field, f"{lost[0].received}{others}")
        return LinkShapes(taken)


_UPRIGHT = {
    "X": Pose(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), np.zeros(3)),
    "Y": Pose(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3)),
}
"""By the up axis of a COLLADA file, the pose that turns it to z."""


class LinkShapes:
    """Shapes in a link's frame, meshes with their body. points (n, 3): their vertices; round primitives are
    inscribed.
    """

    def __init__(self, parts: list[tuple[Shape, MeshBody | None]]) -> None:
        self.parts = parts
        self.first = parts[0][0]
        self.points = np.concatenate([placed_surface(shape, body.mesh if body else None)[0] for shape, body in parts])

    @property
    def names(self) -> str:
        """Names of the meshes and kinds of the primitives."""
        return ", ".join(dict.fromkeys(body.mesh.name if body else shape.kind for shape, body in self.parts))

    @property
    def are_primitives(self) -> bool:
        """Whether none of the shapes is a mesh."""
        return all(body is None for _, body in self.parts)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of all shapes, in the link's axes [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def upright(self) -> LinkShapes | None:
        """The shapes with those meshes turned whose file declares an up axis other than z, as some programs do and
        others don't. None if no file declares one.
        """
        turns = [_UPRIGHT.get(body.mesh.up_axis) if body else None for _, body in self.parts]
        if not any(turns):
            return None
        poses = (shape.pose @ turn if turn else shape.pose for (shape, _), turn in zip(self.parts, turns, strict=True))
        return LinkShapes(
            [(replace(shape, pose=pose), body) for (shape, body), pose in zip(self.parts, poses, strict=True)]
        )

    @cached_property
    def solids(self) -> list[MassProperties]:
        """Each shape as a solid of density 1, in the link's axes. Raises InputError for a mesh that encloses none."""
        found = []
        for shape, body in self.parts:
            own = body and body.moments.mass_properties(scale=shape.scale, density=1.0)
            found.append(placed(own or primitive_solid(shape.kind, shape.size), shape.pose))
        return found

    def uniform(self, mass: float) -> MassProperties:
        """``mass`` kg spread evenly over the shapes, in the link's axes; overlaps count twice."""
        return of_mass(combined(self.solids, self.names), mass)

    def summed_about_own_centers(self, mass: float) -> Matrix3:
        """The sum of the parts' tensors (3, 3), each about its own centre, without the parallel axis terms."""
        volume = sum(solid.mass for solid in self.solids)
        return sum((solid.inertia for solid in self.solids), np.zeros((3, 3))) * (mass / volume)

    def shell(self, mass: float) -> MassProperties:
        """``mass`` kg spread evenly over the surfaces of the meshes, in the link's axes. Raises InputError if a shape
        is a primitive.
        """
        found = []
        for shape, body in self.parts:
            if body is None:
                raise InputError("shell", shape.kind, "meshes alone")
            area = body.moments.moments("shell", shape.scale).measure * float(shape.scale[0]) ** 2
            found.append(placed(body.moments.mass_properties("shell", scale=shape.scale, mass=area), shape.pose))
        return of_mass(combined(found, self.names), mass)

    def box(self, mass: float) -> MassProperties:
        """The bounding box of all shapes, in the first shape's axes, as a solid of ``mass`` kg."""
        R = self.first.pose.rotation
        local = self.points @ R
        middle = R @ (0.5 * (local.min(axis=0) + local.max(axis=0)))
        solid = primitive_solid("box", tuple(np.ptp(local, axis=0).tolist()))
        return of_mass(placed(solid, Pose(R, middle)), mass)
