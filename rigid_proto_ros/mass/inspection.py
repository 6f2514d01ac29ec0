# SPDX-License-Identifier: MIT
"""All that is to be said of one mesh at one scale and mass: every model's mass properties, and the remarks on them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from . import INERTIA_MODELS
from .exact_moments import exact_solid_moments, relative_errors
from .from_mesh import MeshBody
from .model_difference import ModelDifference, model_difference
from .moments import referenced_vertices
from .properties import MassProperties, scale_vector
from .tensor import principal_axes
from .verdict import WARNING, Finding, stated_unit, unit_suspicion

MODELS = tuple(model for model in INERTIA_MODELS if model != "explicit")
JSON_KEYS = (
    *("mesh", "vertices", "triangles", "watertight", "winding_consistent", "components", "volume", "area", "mass"),
    *("density", "center_of_mass", "inertia", "principal_moments", "principal_axes", "bounding_box", "models"),
    "verdict",
)


@dataclass(frozen=True)
class Inspection:
    """All that is known of a mesh at one scale, mass and model. ``refusal`` is the error that stands in the way of the
    chosen model, ``models`` the mass properties of those that can be had. lower and upper (3,): the scaled mesh's
    box, NaN when its coordinates aren't finite."""

    body: MeshBody
    scale: np.ndarray
    model: str
    models: dict[str, MassProperties]
    findings: list[Finding]
    refusal: InputError | None
    volume: float | None
    area: float | None
    lower: np.ndarray
    upper: np.ndarray
    density: float | None

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
    ballast: Iterable = (),
) -> Inspection:
    """Mass properties of every model that ``body`` can have, and the remarks that belong to them."""
    s = scale_vector(scale)
    unit = stated_unit(body.mesh.unit)
    findings = [*([unit] if unit else []), *body.verdict.findings]
    if not body.verdict.usable:
        refusal = InputError(body.mesh.name, body.verdict.reason)
        nowhere = np.full(3, np.nan)
        return Inspection(body, s, model, {}, findings, refusal, None, None, nowhere, nowhere, None)
    moments = body.moments
    points = referenced_vertices(body.vertices, body.moments.triangles) * s
    lower, upper = points.min(axis=0), points.max(axis=0)
    suspicion = unit_suspicion(float(np.max(upper - lower)))
    if suspicion:
        findings.append(suspicion)
    models, refusal = {}, None
    # Mass, density, scale and ballast are checked by any model: their refusal comes first and is the same for all.
    for name in (model, *(other for other in MODELS if other != model)):
        try:
            models[name] = moments.mass_properties(name, scale=s, mass=mass, density=density, ballast=ballast)
        except InputError as error:
            if name == model:
                refusal = error
            elif refusal is None and not (name == "solid" and not body.verdict.closed):
                findings.append(Finding(f"model_{name}", WARNING, str(error)))
            continue
        findings += [Finding("tensor", WARNING, text) for text in models[name].warnings]
    volume = None
    if body.verdict.closed or moments.stand_in is not None:
        volume = moments.moments("solid").measure * float(np.prod(np.abs(s)))
    shell = moments.moments("shell", s) if "shell" in models else None
    area = None if shell is None else shell.measure * float(s[0]) ** 2
    implied = density
    if mass > 0.0:
        implied = mass / volume if volume else None
    return Inspection(body, s, model, models, findings, refusal, volume, area, lower, upper, implied)


def as_json(inspection: Inspection) -> dict:
    """The inspection as the command's JSON object."""
    verdict = [finding.as_dict() for finding in inspection.findings]
    if inspection.refusal is not None:
        return {**dict.fromkeys(JSON_KEYS), "verdict": verdict}
    body, chosen = inspection.body, inspection.chosen
    moments, axes = principal_axes(chosen.inertia)
    return {
        "mesh": body.mesh.path,
        "vertices": len(body.mesh.vertices),
        "triangles": len(body.triangles),
        "watertight": body.verdict.watertight,
        "winding_consistent": body.verdict.winding_consistent,
        "components": body.verdict.components,
        "volume": inspection.volume,
        "area": inspection.area,
        "mass": chosen.mass,
        "density": inspection.density,
        "center_of_mass": chosen.center_of_mass.tolist(),
        "inertia": chosen.inertia.tolist(),
        "principal_moments": moments.tolist(),
        "principal_axes": axes.tolist(),
        "bounding_box": {"min": inspection.lower.tolist(), "max": inspection.upper.tolist()},
        "models": {
            name: None
            if name not in inspection.models
            else {
                "mass": inspection.models[name].mass,
                "center_of_mass": inspection.models[name].center_of_mass.tolist(),
                "inertia": inspection.models[name].inertia.tolist(),
            }
            for name in MODELS
        },
        "verdict": verdict,
    }


def verify_moments(body: MeshBody, scale: np.ndarray) -> dict[str, float]:
    """Errors of the solid's volume, centroid and inertia against rational arithmetic on the same vertices."""
    moments = body.moments
    vertices, triangles = moments.solid_surface()  # refuses what bounds no solid
    exact = exact_solid_moments(vertices, triangles, scale.tolist())
    unit = moments.mass_properties("solid", scale=scale, density=1.0)
    points = referenced_vertices(vertices, triangles) * scale
    diagonal = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    volume = moments.moments("solid").measure * float(np.prod(np.abs(scale)))
    return relative_errors(exact, volume, unit.center_of_mass, unit.inertia, diagonal)
