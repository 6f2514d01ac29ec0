# SPDX-License-Identifier: MIT
"""The shapes of a link put together as solids of one density: meshes, and primitives by closed form."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np

from ..base.errors import InputError
from ..mass.from_mesh import MeshBody, mesh_body
from ..mass.moments import solid_moments
from ..mass.properties import MassProperties
from ..mass.tensor import tensor_from_six
from ..mesh.locate import Search
from ..mesh.reading import Mesh, load_mesh
from ..mesh.solids import convex_hull
from .reading import Shape

SEGMENTS = 48
"""Corners of a round shape's circle; a multiple of 4, so that its box is exact."""


def primitive_solid(kind: str, size: tuple[float, ...]) -> tuple[float, np.ndarray]:
    """(volume, second moments (3,) of x², y², z² over it) of a primitive about its centre, ``size`` as in
    Shape.
    """
    if not size or not all(0.0 < value < math.inf for value in size):
        raise InputError(kind, size, "finite sizes > 0")
    if kind == "box":
        return math.prod(size), math.prod(size) * np.square(size) / 12.0
    if kind in ("sphere", "ellipsoid"):
        axes = np.array(size * 3 if kind == "sphere" else size)
        volume = 4.0 / 3.0 * math.pi * float(np.prod(axes))
        return volume, volume * axes**2 / 5.0
    r, length = size
    volume = math.pi * r * r * length
    square = np.array([volume * r * r / 4.0, volume * r * r / 4.0, volume * length * length / 12.0])
    if kind == "capsule":
        # Two half balls whose flat sides lie length/2 from the centre; their centroids 3r/8 beyond.
        ball = 4.0 / 3.0 * math.pi * r**3
        across = ball * r * r / 5.0
        along = across + ball * (length * length / 4.0 + 2.0 * (length / 2.0) * (3.0 * r / 8.0))
        return volume + ball, square + np.array([across, across, along])
    return volume, square


def primitive_surface(kind: str, size: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and outward triangles (m, 3) of a primitive about its centre, ``size`` as in Shape; round ones
    are inscribed, with the same bounding box.
    """
    from trimesh import creation

    # Of unit size, since trimesh takes points closer than 1e-8 for one.
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


def placed_surface(shape: Shape, mesh: Mesh | None) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of a shape, a mesh or for None a primitive, in the link's frame."""
    if mesh is None:
        vertices, triangles = primitive_surface(shape.kind, shape.size)
    else:
        used, local = np.unique(mesh.triangles, return_inverse=True)
        vertices, triangles = mesh.vertices[used] * shape.scale, local.reshape(-1, 3)
        if np.prod(shape.scale) < 0.0:
            triangles = triangles[:, ::-1]
    return vertices @ shape.rotation.T + shape.position, triangles


class Meshes:
    """The meshes that a robot's shapes name, each loaded once; accept_open as in ``mesh_body``."""

    def __init__(self, search: Search, accept_open: float = 0.0) -> None:
        self.search = search
        self.accept_open = accept_open
        self.body = functools.cache(self._body)

    def _body(self, file: str) -> MeshBody:
        return mesh_body(load_mesh(file, search=self.search), accept_open=self.accept_open)

    def parts(self, shapes: Iterable[Shape]) -> LinkShapes:
        """The shapes with their meshes; raises InputError for one that can't be taken."""
        found: list[tuple[Shape, MeshBody | None]] = []
        for shape in shapes:
            if shape.problem:
                raise InputError(shape.file or shape.kind, shape.problem)
            if shape.kind != "mesh":
                primitive_solid(shape.kind, shape.size)
            found.append((shape, self.body(shape.file) if shape.kind == "mesh" else None))
        return LinkShapes(found)


class LinkShapes:
    """Shapes, meshes with their body, in a link's frame."""

    def __init__(self, parts: list[tuple[Shape, MeshBody | None]]) -> None:
        self.parts = parts
        self.first = parts[0][0]

    @property
    def names(self) -> str:
        """What the shapes are called: mesh names and kinds."""
        return ", ".join(dict.fromkeys(body.mesh.name if body else shape.kind for shape, body in self.parts))

    @cached_property
    def points(self) -> np.ndarray:
        """Vertices (n, 3) of all shapes, round primitives as inscribed surfaces, in the link's frame."""
        return np.concatenate([placed_surface(shape, body.mesh if body else None)[0] for shape, body in self.parts])

    @property
    def diagonal(self) -> float:
        """Diagonal of the box, in the link's axes, around all."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def _moments(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Volume, centroid (3,) and second moments (3, 3) about it of each shape, in the link's axes."""
        found = []
        for shape, body in self.parts:
            R = shape.rotation
            if body is None:
                size, squares = primitive_solid(shape.kind, shape.size)
                found.append((size, shape.position, R @ np.diag(squares) @ R.T))
                continue
            size = body.moments.moments("solid").measure * math.prod(np.abs(shape.scale).tolist())
            own = body.moments.mass_properties("solid", scale=shape.scale, mass=size)
            moment = 0.5 * np.trace(own.inertia) * np.eye(3) - own.inertia
            found.append((size, R @ own.center_of_mass + shape.position, R @ moment @ R.T))
        return found

    def volume(self) -> float:
        """Volume [m³], what overlaps counted twice; raises InputError for a mesh that bounds none."""
        return sum(size for size, _, _ in self._moments)

    def properties(self, mass: float) -> MassProperties:
        """Mass properties of ``mass`` kg spread evenly over the shapes, in the link's axes."""
        volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
        for size, center, moment in self._moments:
            volume += size
            first += size * center
            second += size * np.outer(center, center) + moment
        if not 0.0 < volume < math.inf or not np.isfinite(second).all():
            raise InputError(self.names, f"a volume of {volume:g}; a body needs a finite one > 0")
        center = first / volume
        return _spread(mass, center, second / volume - np.outer(center, center))

    def summed_about_own_centers(self, mass: float) -> np.ndarray:
        """What comes out (3, 3) when the parts' tensors are added as if all had one centre of mass."""
        moment = np.sum([own for _, _, own in self._moments], axis=0) / self.volume()
        return _spread(mass, np.zeros(3), moment).inertia

    def box(self, mass: float) -> MassProperties:
        """The box around all, in the first shape's axes, as a solid of ``mass`` kg."""
        R = self.first.rotation
        local = self.points @ R
        middle = 0.5 * (local.min(axis=0) + local.max(axis=0))
        return _spread(mass, R @ middle, R @ np.diag(np.ptp(local, axis=0) ** 2 / 12.0) @ R.T)

    def hull(self, mass: float) -> MassProperties | None:
        """The convex hull of all as a solid of ``mass`` kg; None when it has no volume."""
        try:
            hull = solid_moments(*convex_hull(self.points))
        except InputError:
            return None
        return _spread(mass, hull.centroid, tensor_from_six((hull.second / hull.measure).tolist()))


def _spread(mass: float, center: np.ndarray, moment: np.ndarray) -> MassProperties:
    """Mass properties from the variances (3, 3) [m²] of the mass about its centre."""
    return MassProperties(mass, center, mass * (np.trace(moment) * np.eye(3) - moment))
