# SPDX-License-Identifier: MIT
"""The true tensor beside an approximate one, as the page shows them; and what is to be said of a tensor as it is typed."""

from __future__ import annotations

import numpy as np

from ..core.errors import InputError
from ..core.inertia_tensor import check_tensor, principal_axes, tensor_from_six
from ..core.mass_properties import MassProperties, explicit_mass_properties
from ..scenario import Scenario

NAMES = ("solid", "shell", "points", "bounding_box")
TITLES = {"solid": "solid (true)", "shell": "shell", "points": "points", "bounding_box": "bounding box"}


def model_properties(scenario: Scenario, model: str) -> MassProperties:
    """Mass properties of the scenario's body under a model; raises InputError where that can't be had."""
    values = scenario.values
    ballast = [value for name, value in values.items() if name.startswith("ballast.")]
    if model == "explicit":
        mass, com, tensor = (values[f"explicit_inertia.{name}"] for name in ("mass", "center_of_mass", "tensor"))
        return explicit_mass_properties(mass, com, tensor, ballast, values["scale"])
    if scenario.body_mesh is None:
        raise InputError("mesh", "", "a mesh")
    return scenario.body_mesh.moments.mass_properties(
        model, scale=values["scale"], mass=values["mass"], density=values["density"], ballast=ballast
    )


def comparison(scenario: Scenario) -> str:
    """A table: the true tensor and the one that flies, or the bounding box's where the true one flies; errors in per cent.

    Errors of tensor entries are relative to the true tensor's largest, as those of ``inspect`` are; moments each to itself;
    the COM's distance to the true one is given in per cent of the body's size.
    """
    flying = str(scenario.values["inertia_model"])
    other = "bounding_box" if flying == "solid" else flying
    try:
        true = model_properties(scenario, "solid")
    except InputError as error:
        return _alone(scenario, f"No true tensor: {error}")
    try:
        approximate = model_properties(scenario, other)
    except InputError as error:
        return _alone(scenario, f"No {other} to compare with: {error}")
    largest = float(np.abs(true.inertia).max())
    rows = [("mass [kg]", true.mass, approximate.mass, _percent(approximate.mass, true.mass, true.mass))]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        a, b = float(true.inertia[i, j]), float(approximate.inertia[i, j])
        rows.append((f"I{'xyz'[i]}{'xyz'[j]} [kg m²]", a, b, _percent(b, a, largest)))
    moments = (principal_axes(true.inertia)[0], principal_axes(approximate.inertia)[0])
    for k, (a, b) in enumerate(zip(*moments, strict=True)):
        rows.append((f"I{'₁₂₃'[k]} principal", float(a), float(b), _percent(float(b), float(a), float(a))))
    size = _size(scenario)
    away = float(np.linalg.norm(approximate.center_of_mass - true.center_of_mass))
    worst = float(np.abs(approximate.inertia - true.inertia).max()) / largest
    lines = [f"|  | {TITLES['solid']} | {TITLES.get(other, other)} | error |", "| --- | --- | --- | --- |"]
    lines += [f"| {name} | {a:.5g} | {b:.5g} | {error} |" for name, a, b, error in rows]
    lines.append(f"| COM apart [m] | | {away:.3g} | {100.0 * away / size:.2g} % of the size |")
    head = f"**{flying}** flies. Largest error of {TITLES.get(other, other)}: **{100.0 * worst:.3g} %**"
    return "\n".join([head, "", *lines])


def _alone(scenario: Scenario, reason: str) -> str:
    body = scenario.setup.body
    lines = [f"**{scenario.values['inertia_model']}** flies. {reason}", "", "|  |  |", "| --- | --- |"]
    lines.append(f"| mass [kg] | {body.mass:.5g} |")
    lines += [f"| I{'₁₂₃'[k]} principal [kg m²] | {m:.5g} |" for k, m in enumerate(body.principal_moments)]
    return "\n".join(lines)


def _size(scenario: Scenario) -> float:
    surface = scenario.setup.surface
    return float(np.linalg.norm(surface.extent * scenario.setup.body.scale))


def _percent(value: float, true: float, scale: float) -> str:
    return f"{100.0 * (value - true) / scale:+.3g} %"


def judged(numbers: list[float] | None) -> tuple[bool, str]:
    """Whether six numbers ixx ixy ixz iyy iyz izz are a tensor that a body can have, and why not or what it means."""
    if numbers is None:
        return False, "✗ six numbers: ixx ixy ixz iyy iyz izz [kg m²]"
    inertia = tensor_from_six(numbers)
    try:
        warnings = check_tensor(inertia, source="tensor")
    except InputError as error:
        return False, f"✗ {error}"
    moments = ", ".join(f"{m:.5g}" for m in principal_axes(inertia)[0])
    return True, f"✓ principal moments {moments} kg m²" + "".join(f"  \n⚠ {warning}" for warning in warnings)
