# SPDX-License-Identifier: MIT
"""Inspection of one mesh at one scale and mass: mass properties of every model, their differences from the solid's that
matter for the motion, and findings.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from ..base.rotation import quaternion_from_matrix
from ..base.vectors import Matrix3, Vector3
from ..mesh.parts import DENSITY
from .exact_moments import exact_solid_moments, exact_sum, relative_errors
from .from_mesh import MeshBody
from .moments import MODELS, extent
from .properties import MassProperties, scale_vector
from .tensor import principal_axes
from .verdict import INFO, WARNING, Finding

JSON_KEYS = (
    *("mesh", "vertices", "triangles", "watertight", "winding_consistent", "components", "volume", "area", "mass"),
    *("density", "center_of_mass", "inertia", "principal_moments", "principal_axes"),
    *("principal_orientation_xyzw", "bounding_box", "models", "verdict"),
)


LARGE_M = 5.0
"""Longest side [m] above which a wrong unit is suspected: few simulated bodies are longer, but every part of more than
5 mm drawn in millimetres is."""
SMALL_M = 1e-4
"""Longest side [m] below which it is said that millimetres may have been scaled twice."""


def remarks(body: MeshBody, side: float) -> list[str]:
    """What a mesh's user may not expect of a body whose longest side is ``side`` [m], without effect on its numbers."""
    told = []
    if body.mesh.up_axis not in ("", "Z"):
        told.append(f"the file says that {body.mesh.up_axis} is up, which isn't applied: axes are those of its numbers")
    if 0.0 < side < SMALL_M:
        told.append(f"the body is {side:.3g} m across: millimetres may have been scaled to metres twice")
    return told


@dataclass(frozen=True)
class ModelDifference:
    """principal_moments (3,): relative error of each moment, in ascending order. axes_turned [rad]: the smallest
    rotation that takes the principal axes to the true ones. center_of_mass (3,): offset from the true one [m].
    """

    principal_moments: Vector3
    axes_turned: float
    center_of_mass: Vector3


def model_difference(properties: MassProperties, true: MassProperties) -> ModelDifference:
    """How ``properties`` differ from the true ones."""
    moments, axes = principal_axes(properties.inertia)
    true_moments, true_axes = principal_axes(true.inertia)
    turned = _axes_turned(axes, _symmetry_axis(moments), true_axes, _symmetry_axis(true_moments))
    return ModelDifference(moments / true_moments - 1.0, turned, properties.center_of_mass - true.center_of_mass)


ANY = -1
"""The axis of symmetry of a tensor with three equal moments: any axis."""
EQUAL = 1e-9
"""Difference, relative to the largest moment, up to which two moments count as equal: their axes are then any
orthogonal pair in the plane that they span."""


def _symmetry_axis(moments: Vector3) -> int | None:
    """The axis about which a tensor is symmetric, None without one, ANY if all moments are equal."""
    first, last = np.diff(moments) <= EQUAL * moments[2]
    if first and last:
        return ANY
    return 2 if first else 0 if last else None


def _axes_turned(axes: Matrix3, mine: int | None, others: Matrix3, theirs: int | None) -> float:
    """The smallest angle [rad] of a rotation that takes one set of principal axes (3, 3), columns, to another.

    Axes have no sign. Axes perpendicular to an axis of symmetry are arbitrary: a rotation in the plane that they span
    is no difference.
    """
    if mine is ANY or theirs is ANY:
        return 0.0
    if mine is None and theirs is None:
        angles = []
        for a, b in product((1.0, -1.0), repeat=2):
            R = others @ np.diag((a, b, a * b)) @ axes.T
            across = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
            angles.append(math.atan2(float(np.linalg.norm(across)), float(np.trace(R)) - 1.0))
        return min(angles)
    one = mine if mine is not None else theirs
    other = theirs if theirs is not None else mine
    a, b = axes[:, one], others[:, other]
    between = math.atan2(float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b)))
    # If the axes of symmetry have different numbers, mine must become perpendicular to theirs.
    return between if one == other else 0.5 * math.pi - between


@dataclass(frozen=True)
class Inspection:
    """The inspection of a mesh at one scale, mass and model. ``refusal`` is the error that prevents the chosen model,
    ``models`` the mass properties of all models that can be computed. lower and upper (3,): the scaled mesh's box, NaN
    for a mesh that isn't usable. mass: the one given, without ballast, or 0."""

    body: MeshBody
    scale: Vector3
    model: str
    models: dict[str, MassProperties]
    findings: list[Finding]
    refusal: InputError | None
    volume: float | None
    area: float | None
    lower: Vector3
    upper: Vector3
    density: float | None
    mass: float = 0.0

    @property
    def chosen(self) -> MassProperties:
        """Mass properties of the chosen model."""
        return self.models[self.model]

    def difference(self, model: str) -> ModelDifference:
        """How a model differs from the solid, or from the chosen model where there is no solid."""
        return model_difference(self.models[model], self.models.get("solid", self.chosen))


def inspect_mesh(
    body: MeshBody,
    *,
    model: str = "solid",
    scale: ArrayLike = 1.0,
    mass: float = 0.0,
    density: float = 1000.0,
    ballast: Sequence[Sequence[float]] = (),
    wall_thickness: float = 0.0,
    infill: float = 0.0,
) -> Inspection:
    """Mass properties of every model that can be computed for ``body``, and the findings on them. Of a printed part
    (walled) the others have its mass.
    """
    s = scale_vector(scale)
    findings = list(body.verdict.findings)
    if body.mesh.unit != 1.0:
        said = f"the file says that its unit is {body.mesh.unit:g} m: coordinates have been converted to metres"
        findings.insert(0, Finding("stated_unit", INFO, said))
    if not body.verdict.usable:
        refusal = InputError(body.mesh.name, body.verdict.reason)
        nowhere = np.full(3, np.nan)
        return Inspection(body, s, model, {}, findings, refusal, None, None, nowhere, nowhere, None)
    moments = body.moments
    corners = [corner * s for corner in extent(body.vertices, body.moments.triangles)[:2]]
    lower, upper = np.minimum(*corners), np.maximum(*corners)
    side = float(np.max(upper - lower))
    findings += [Finding("unexpected", INFO, text) for text in remarks(body, side)]
    if side > LARGE_M:
        units = f"it would be {side:.4g} mm if the file is in millimetres (--scale 0.001)"
        findings.append(Finding("unit_suspicion", WARNING, f"the body is {side:.4g} m across; {units} (scale)"))
    models, refusal = {}, None
    if model == "walled":
        try:
            mass, error = _printed_mass(body, s, mass, density, wall_thickness, infill)
            findings.append(Finding("walled", INFO, _said_of_walls(error)))
        except InputError as refused:
            refusal = refused
    # Every model checks mass, density, scale and ballast: a refusal of these comes first and is the same for all.
    for name in (model, *(other for other in MODELS if other != model)):
        try:
            models[name] = moments.mass_properties(
                name,
                scale=s,
                mass=mass,
                density=density,
                ballast=ballast,
                wall_thickness=wall_thickness,
                infill=infill,
            )
        except InputError as error:
            if name == model:
                refusal = refusal or error
            elif refusal is None and not (name == "solid" and not body.verdict.closed):
                findings.append(Finding(f"model_{name}", WARNING, str(error)))
            continue
        findings += [Finding("tensor", WARNING, text) for text in models[name].warnings]
    volume = None
    with contextlib.suppress(InputError):  # of a mesh that bounds no solid, and has no other shape to take
        volume = body.volume(s)
    shell = moments.moments("shell", s) if "shell" in models else None
    area = None if shell is None else shell.measure * float(s[0]) ** 2
    own = mass
    if body.parts and volume:
        own = mass or moments.body_mass(scale=s)
        findings += [
            Finding("walled", INFO, f"part {part.name}: {_said_of_walls(part.printed[1])}")
            for part in body.parts
            if part.wall_thickness > 0.0
        ]
    implied = density if not own > 0.0 else own / volume if volume else None
    return Inspection(body, s, model, models, findings, refusal, volume, area, lower, upper, implied, mass)


def _printed_mass(
    body: MeshBody, scale: Vector3, mass: float, density: float, wall_thickness: float, infill: float
) -> tuple[float, float]:
    """Mass [kg] of a printed part, and the error of its model; raises InputError."""
    moments, error = body.moments.printed(scale, wall_thickness, infill)
    return mass or density * moments.measure * abs(float(scale[0])) ** 3, error


def _said_of_walls(error: float) -> str:
    return f"mass and tensor are those of first order in the walls' thickness, whose error is {100.0 * error:.2g} %"


def as_json(inspection: Inspection) -> dict[str, Any]:
    """The inspection as the command's JSON object."""
    verdict = [vars(finding) for finding in inspection.findings]
    if inspection.refusal is not None:
        return {**dict.fromkeys(JSON_KEYS), "verdict": verdict}
    body, chosen, models = inspection.body, inspection.chosen, inspection.models
    moments, axes = principal_axes(chosen.inertia)
    names = dict.fromkeys((*MODELS, *models))
    return {
        "mesh": body.mesh.path,
        "vertices": len(body.mesh.vertices),
        "triangles": len(body.triangles),
        "watertight": body.verdict.watertight,
        "winding_consistent": body.verdict.winding_consistent,
        "components": body.verdict.components,
        "volume": inspection.volume,
        "area": inspection.area,
        "density": inspection.density,
        **chosen.as_dict(),
        "principal_moments": moments.tolist(),
        "principal_axes": axes.tolist(),
        "principal_orientation_xyzw": quaternion_from_matrix(axes).tolist(),
        "bounding_box": {"min": inspection.lower.tolist(), "max": inspection.upper.tolist()},
        "models": {name: models[name].as_dict() if name in models else None for name in names},
        **({"parts": parts_of(inspection)} if body.parts else {}),
        "verdict": verdict,
    }


def parts_of(inspection: Inspection) -> list[dict[str, Any]]:
    """Of each part: name, mass, density and volume; where the whole is given a mass, in proportion to it."""
    body, scale = inspection.body, inspection.scale
    whole = sum(float(part.own_mass) for part in body.parts)
    own = inspection.mass or body.moments.body_mass(scale=scale)
    told = []
    for part in body.parts:
        mass, volume = float(part.own_mass) * own / whole, part.volume * float(np.prod(np.abs(scale)))
        told.append({"name": part.name, "mass": mass, "density": mass / volume, "volume": volume})
    return told


def verify_moments(body: MeshBody, scale: Vector3) -> dict[str, float]:
    """Errors of the solid's volume, centroid and inertia against rational arithmetic on the same vertices."""
    moments, parts = body.moments, body.parts
    unit = moments.mass_properties("solid", scale=scale, density=DENSITY if parts else 1.0)  # or there is no solid
    if parts:
        each = [(part, exact_solid_moments(*part.surface(), scale.tolist())) for part in parts]
        if any(part.wall_thickness > 0.0 for part in parts):
            raise InputError(
                "--verify", "walls", "solid parts: walls are of first order, and nothing exact is beside them"
            )
        sx, sy, sz = (abs(Fraction(x)) for x in scale.tolist())
        stretch = sx * sy * sz
        masses = [Fraction(p.mass) * stretch if p.mass else Fraction(p.density) * own.volume for p, own in each]
        exact = exact_sum([own for _, own in each], masses)
        lower, upper, _ = extent(body.vertices, body.moments.triangles)
    else:
        vertices, triangles = moments.solid_surface()
        exact = exact_solid_moments(vertices, triangles, scale.tolist())
        lower, upper, _ = extent(vertices, triangles)
    diagonal = float(np.linalg.norm((upper - lower) * scale))
    return relative_errors(exact, body.volume(scale), unit.center_of_mass, unit.inertia, diagonal)
