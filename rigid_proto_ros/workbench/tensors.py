# SPDX-License-Identifier: MIT
"""The true tensor beside an approximate one, as the page shows them; and what is to be said of a tensor
as it is typed.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.errors import InputError
from ..mass.model_difference import model_difference
from ..mass.properties import MassProperties, explicit_mass_properties
from ..mass.tensor import check_tensor, principal_axes, tensor_from_six
from ..scene.scenario import Scenario

ROUNDING = 1e-9
"""Relative: what is smaller comes from the arithmetic, or from the digits of the mesh's coordinates."""

TURNED = 1e-6
"""[°] The same of an angle between axes, whose moments may be close to each other."""

TITLES = {"solid": "solid (true)", "shell": "shell", "points": "points", "bounding_box": "bounding box"}


def model_properties(scenario: Scenario, model: str, com: str = "") -> MassProperties:
    """Mass properties of the scenario's body under a model; raises InputError where that can't be had. com: one of
    MODEL_COMS, as the scenario has it where it is empty.
    """
    parameters = scenario.parameters
    ballast = parameters.point_masses
    if model == "explicit":
        given = parameters.explicit_inertia
        return explicit_mass_properties(given.mass, given.center_of_mass, given.tensor, ballast, parameters.scale)
    if scenario.body_mesh is None:
        raise InputError("mesh", "a mesh is needed")
    return scenario.body_mesh.moments.mass_properties(
        model,
        scale=parameters.scale,
        mass=parameters.mass,
        density=parameters.density,
        ballast=ballast,
        com=com or parameters.inertia_model_com,
    )


def comparison(scenario: Scenario) -> str:
    """The true tensor and the one in force, or the bounding box's where that is the true one: what counts for the
    motion in a sentence, and a table of the numbers.

    Errors of moments are relative to each moment, those of entries to the true tensor's largest, as ``inspect`` has
    them.
    """
    flying = str(scenario.parameters.inertia_model)
    other = "bounding_box" if flying == "solid" else flying
    try:
        true = model_properties(scenario, "solid")
    except InputError as error:
        return _alone(scenario, f"No true tensor: {error}")
    try:
        approximate = model_properties(scenario, other)
        own = model_properties(scenario, other, com="model")
    except InputError as error:
        return _alone(scenario, f"No {other} to compare with: {error}")
    difference = model_difference(approximate, true)
    title = TITLES.get(other, other)
    what = f"Simulating: **{TITLES.get(flying, flying)}**. "
    what += f"The {title} would have" if flying == "solid" else "Compared with the true solid, it has"
    percents = ", ".join(_per_cent(error) for error in difference.principal_moments)
    lines = [
        what,
        "",
        f"- principal moments off by **{percents} %**",
        f"- principal axes turned by **{_degrees(difference.axes_turned)}**",
        f"- {_com_text(scenario, difference.center_of_mass, own.center_of_mass - true.center_of_mass)}",
        "",
        f"|  | {TITLES['solid']} | {title} | error |",
        "| --- | --- | --- | --- |",
    ]
    moments = zip(
        principal_axes(true.inertia)[0],
        principal_axes(approximate.inertia)[0],
        difference.principal_moments,
        strict=True,
    )
    lines += [
        f"| I{'₁₂₃'[k]} [kg m²] | {a:.5g} | {b:.5g} | {_per_cent(error)} % |" for k, (a, b, error) in enumerate(moments)
    ]
    lines.append(
        f"| mass [kg] | {true.mass:.5g} | {approximate.mass:.5g} | {_per_cent(approximate.mass / true.mass - 1.0)} % |"
    )
    largest = float(np.abs(true.inertia).max())
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        a, b = (_rounded(float(properties.inertia[i, j]), largest) for properties in (true, approximate))
        lines.append(f"| I{'xyz'[i]}{'xyz'[j]} [kg m²] | {a:.5g} | {b:.5g} | {_per_cent((b - a) / largest)} % |")
    relative = "Errors of I₁ I₂ I₃ are relative to each of them, those of the entries to the largest entry."
    return "\n".join([*lines, "", relative])


def _com_text(scenario: Scenario, off: np.ndarray, own: np.ndarray) -> str:
    surface = scenario.setup.surface
    size = 1.0 if surface is None else float(np.linalg.norm(surface.extent * scenario.setup.body.scale))
    away, own_away = float(np.linalg.norm(off)), float(np.linalg.norm(own))
    text = f"COM offset **{away:.3g} m**, {100.0 * away / size:.2g} % of the size"
    if away < 1e-9 * size < own_away:
        share = f"{100.0 * own_away / size:.2g} % of the size"
        return f"COM of the solid; the model's own is {own_away:.3g} m off, {share}"
    return text


def _degrees(angle: float) -> str:
    degrees = math.degrees(angle)
    return f"{degrees if degrees > TURNED else 0.0:.3g}°"


def _per_cent(error: float) -> str:
    return f"{100.0 * error if abs(error) > ROUNDING else 0.0:+.3g}"


def _rounded(entry: float, largest: float) -> float:
    """0 for what rounding alone left of an entry."""
    return entry if abs(entry) > ROUNDING * largest else 0.0


def _alone(scenario: Scenario, reason: str) -> str:
    body = scenario.setup.body
    lines = [f"Simulating: **{scenario.parameters.inertia_model}**. {reason}", "", "|  |  |", "| --- | --- |"]
    lines.append(f"| mass [kg] | {body.mass:.5g} |")
    lines += [f"| I{'₁₂₃'[k]} principal [kg m²] | {m:.5g} |" for k, m in enumerate(body.principal_moments)]
    return "\n".join(lines)


def tensor_verdict(numbers: list[float] | None) -> tuple[bool, str]:
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
