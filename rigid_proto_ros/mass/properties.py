# SPDX-License-Identifier: MIT
"""Mass, centre of mass and inertia of a mesh for each model, in closed form except for a change of the mesh itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError, MeshError, TensorError
from ..base.vectors import FloatArray, IntArray, Matrix3, Points, Triangles, Vector3
from . import MODEL_COMS
from .closed_form import is_plainly_good, printed_moments, spread_mass
from .moments import MODELS, STRETCHED, Moments, mesh_moments
from .tensor import check_tensor
from .walls import LIMIT, refused_walls, walls_of_parts, walls_of_surface

SCALE_LIMITS = (1e-9, 1e9)
Surface = tuple[Points, Triangles]
"""Vertices (n, 3) and triangles (m, 3)."""


@dataclass(frozen=True)
class MassProperties:
    """mass [kg], center_of_mass (3,) [m, mesh axes, after scale], inertia (3, 3) [kg m², about the COM, mesh axes].

    warnings: those of the tensor check.
    """

    mass: float
    center_of_mass: Vector3
    inertia: Matrix3
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Mass, COM and inertia as a JSON object."""
        inertia = self.inertia.tolist()
        return {"mass": self.mass, "center_of_mass": self.center_of_mass.tolist(), "inertia": inertia}


def scale_vector(scale: ArrayLike) -> Vector3:
    """One or three numbers as (3,); raises InputError unless each is nonzero with 1e-9 ≤ |s| ≤ 1e9."""
    s = [float(value) for value in np.ravel(scale).tolist()]
    if len(s) == 1:
        s = s * 3
    if len(s) != 3 or not all(SCALE_LIMITS[0] <= abs(value) <= SCALE_LIMITS[1] for value in s):
        received = scale.tolist() if isinstance(scale, np.ndarray) else scale
        raise InputError("scale", received, "one or three numbers, each with 1e-9 <= |s| <= 1e9")
    return np.array(s)


def _checked_ballast(ballast: Sequence[Sequence[float]]) -> FloatArray:
    """Ballast entries with a mass above 0, (k, 4): m, x, y, z."""
    for entry in ballast:
        if not entry[0] >= 0.0 or not all(map(math.isfinite, entry)):
            raise InputError("ballast", entry, "mass >= 0 [kg] and x, y, z, all finite")
    return np.array([entry for entry in ballast if entry[0] > 0.0], dtype=float).reshape(-1, 4)


def _checked_mass(mass: float, density: float, measure: Callable[[], float], stretch: float) -> float:
    """[kg]: ``mass`` when > 0, else density × measure × stretch."""
    if not (0.0 <= mass < math.inf):
        raise InputError("mass", mass, "a finite number >= 0 (0: density decides) [kg]")
    if mass > 0.0:
        return float(mass)
    if not (0.0 < density < math.inf):
        raise InputError("density", density, "a finite number > 0 [kg/m³]")
    body = float(density) * measure() * stretch
    if not (1e-300 < body < math.inf):
        raise InputError("mass", body, "density * volume within 1e-300 .. 1e300 kg")
    return body


@dataclass
class MeshMoments:
    """A mesh's moments at unit density; each model's are computed on first use and kept.

    vertices (n, 3) and triangles (m, 3) in mesh coordinates; polygon_starts as in ``mesh_moments``. ``no_solid``: why
    the surface bounds no solid and what helps, "" if it bounds one; with it the solid model, and a density, are
    refused. ``stand_in`` returns vertices (k, 3) and triangles (l, 3) of another solid that is used instead, for a
    surface that bounds none or whose parts overlap. For a surface wound inward throughout the results are those of the
    outward one. summed: of a body of parts, the moments of their sum, which is its solid.
    """

    vertices: Points
    triangles: Triangles
    polygon_starts: IntArray | None = None
    no_solid: str = ""
    name: str = "mesh"
    stand_in: Callable[[], Surface] | None = None
    summed: Callable[[], Moments] | None = None
    _moments: dict[tuple[Any, ...], Moments] = field(default_factory=dict)
    _walls: dict[tuple[float, ...], np.record] = field(default_factory=dict)

    def solid_surface(self) -> Surface:
        """Vertices and triangles of the solid's surface; raises MeshError when the mesh's isn't closed."""
        if self.stand_in is not None:
            return self.stand_in()
        if self.no_solid:
            raise MeshError(self.name, f"{self.no_solid}, or another model with --mass (mass)")
        return self.vertices, self.triangles

    def moments(self, model: str, scale: ArrayLike = (1.0, 1.0, 1.0)) -> Moments:
        """Unscaled moments of ``model`` at unit density, outward; ``scale`` matters only for STRETCHED.

        The area elements of a shell stretch by direction, so a non-uniform scale needs a new pass over the surface; it
        is kept per ratio of the components. Its moments are then those of the shape stretched by |scale|/|scale_x|.
        """
        if model not in MODELS:
            raise InputError("inertia_model", model, ", ".join(MODELS))
        stretch = np.abs(scale_vector(scale)) if model in STRETCHED else np.ones(3)
        stretch = stretch / stretch[0]
        key = (model, *stretch.tolist())
        if key not in self._moments and model == "solid" and self.summed is not None and not self.no_solid:
            self._moments[key] = self.summed()
        if key not in self._moments:
            vertices, triangles = self.solid_surface() if model == "solid" else (self.vertices, self.triangles)
            self._moments[key] = mesh_moments(model, vertices, triangles, self.polygon_starts, stretch)
        return self._moments[key]

    def walls(self, scale: ArrayLike = (1.0, 1.0, 1.0)) -> np.record:
        """WALLS (mass/walls.py) of the solid at this scale, of which only the ratio of its components matters; raises
        MeshError where there is none.
        """
        if self.summed is not None:
            raise walls_of_parts()
        stretch = np.abs(scale_vector(scale))
        stretch = stretch / stretch[0]
        key = tuple(stretch.tolist())
        if key not in self._walls:
            solid, (vertices, triangles) = self.moments("solid"), self.solid_surface()
            own = self.polygon_starts if triangles is self.triangles else None
            self._walls[key] = walls_of_surface(vertices, triangles, own, stretch, solid)
        return self._walls[key]

    def printed(self, scale: ArrayLike, wall_thickness: float, infill: float) -> tuple[Moments, float]:
        """Moments at unit density of the walled model at this scale, in units of the mesh as stretched by
        |scale|/|scale_x|, and their error relative to mass or tensor. Raises InputError where that is above LIMIT.
        """
        if not 0.0 < wall_thickness < math.inf:
            raise InputError("wall_thickness", wall_thickness, "a finite number > 0 [m]")
        if not 0.0 <= infill <= 1.0:
            raise InputError("infill", infill, "a number from 0 to 1")
        unit = abs(float(scale_vector(scale)[0]))
        reference, center, second = np.empty(3), np.empty(3), np.empty(6)
        solid, walls = self.moments("solid").record, self.walls(scale)
        measure, error, largest = printed_moments(
            solid, walls, wall_thickness / unit, infill, reference, center, second
        )
        if not error <= LIMIT:
            raise refused_walls(wall_thickness, unit * largest, error)
        return Moments(measure, reference, center, np.zeros(3), second), error

    def body_mass(self, *, scale: ArrayLike = (1.0, 1.0, 1.0), mass: float = 0.0, density: float = 1000.0) -> float:
        """Mass [kg] without ballast: ``mass`` when > 0, else density × solid volume, the same for all models; of parts
        the sum of their masses at a density of 1000, and in proportion at another.
        """
        stretch = abs(math.prod(scale_vector(scale).tolist()))
        return _checked_mass(mass, density, lambda: self.moments("solid").measure, stretch)

    def mass_properties(
        self,
        model: str = "solid",
        *,
        scale: ArrayLike = (1.0, 1.0, 1.0),
        mass: float = 0.0,
        density: float = 1000.0,
        ballast: Sequence[Sequence[float]] = (),
        com: str = "model",
        wall_thickness: float = 0.0,
        infill: float = 0.0,
    ) -> MassProperties:
        """Mass properties of ``model`` at any scale, mass, density and ballast, in closed form from its ten moments.

        com: one of MODEL_COMS; "solid" moves the model's tensor, unchanged about its own centre, to the solid's. scale:
        one or three nonzero numbers; an odd number of negative ones mirrors the body. ballast: entries (m [kg], x, y, z
        [mesh coordinates]); the position scales with the mesh, the mass is added to the body's. wall_thickness [m] and
        infill (0 to 1): of the walled model, whose mass at a density is that of walls and infill. Raises InputError,
        MeshError (surface not closed where a volume is needed) or TensorError (collinear body).
        """
        if com not in MODEL_COMS:
            raise InputError("inertia_model_com", com, ", ".join(MODEL_COMS))
        s = scale_vector(scale)
        points = _checked_ballast(ballast)
        if model == "walled":
            moments, _ = self.printed(s, wall_thickness, infill)
            unit_m = abs(float(s[0]))
            own = _checked_mass(mass, density, lambda: moments.measure, unit_m * unit_m * unit_m)
        else:
            moments = self.moments(model, s)
            own = self.body_mass(scale=s, mass=mass, density=density)
        # A shell's moments include the stretch: the uniform part and the mirroring are left.
        left = np.copysign(abs(s[0]), s) if model in (*STRETCHED, "walled") else s
        unit, at_solid = moments.record, com == "solid"
        placed = self.moments("solid").record if at_solid else unit
        center, inertia, principal, axes = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
        total = spread_mass(own, unit, placed, at_solid, s, left, points, center, inertia, principal, axes)
        warnings = ()
        if not is_plainly_good(principal):
            try:
                warnings = check_tensor(inertia, source=f"{model} model of {self.name}")
            except TensorError as error:
                raise TensorError(f"inertia_model {model}", f"{self.name}: {error.received}", error.accepted) from None
        return MassProperties(total, center, inertia, warnings)
