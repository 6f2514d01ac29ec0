# SPDX-License-Identifier: MIT
"""The body's tab: mesh, size, mass and tensor, the true one next to an approximate one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import viser

from ..base.bundled import body_names
from ..base.errors import InputError
from ..mass.inspection import model_difference
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes, six_from_tensor
from ..picture.style import without_rounding
from ..scene.scenario import Scenario
from .controls import TYPING_S, Controls, parse_numbers
from .flight import Flight
from .upload import UploadFolder

OWN_FILE = "(a file)"


class BodyTab:
    """Everything about mass and shape. ``changed`` is called whenever the parameters have. fly(values) begins a scene
    of these parameters, and says whether it was taken.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        controls: Controls,
        flight: Flight,
        fly: Callable[[dict[str, object]], Any],
    ) -> None:
        self._controls = controls
        self._flight = flight
        self._base_scale = self._base_mass = 1.0
        with tabs.add_tab("Body"):
            with gui.add_folder("Size and mass"):
                controls.factor("Size ×", "All three scales together (scale)", 1.0, self._size_factor, self._set_size)
                hint = "Times the original mass, without ballast (mass)"
                controls.factor("Mass ×", hint, 2.0, self._mass_factor, self._set_mass)
                controls.numbers("density", "Density [kg/m³]")
            with gui.add_folder("Inertia"):
                controls.choice("inertia_model", "Model")
                self._table = gui.add_markdown("")
                hint = "ixx ixy ixz iyy iyz izz [kg m²], about the COM, mesh axes (explicit_inertia.tensor)"
                tensor = gui.add_text("Tensor", "", hint=hint)
            with gui.add_folder("Mesh"):
                mesh = gui.add_dropdown(
                    "Body", (OWN_FILE, *body_names()), initial_value=OWN_FILE, hint="Bundled (mesh)"
                )
                self.upload = UploadFolder(gui, flight, fly, self.show_verdict)
                self._verdict = gui.add_markdown("")

        def named(values: Mapping[str, Any]) -> str:
            return values["mesh"] if values["mesh"] in body_names() else OWN_FILE

        controls.bind(mesh, named, lambda name: None if name == OWN_FILE else {"mesh": name})
        accepted = "six numbers: ixx ixy ixz iyy iyz izz"
        controls.bind(tensor, self._tensor_text, self._set_tensor, TYPING_S, accepted)

    @property
    def table(self) -> str:
        """The true tensor beside another, as it is shown."""
        return str(self._table.content)

    def changed(self, scenario: Scenario, another: bool) -> None:
        """Show what follows from the parameters in force; ``another`` body is the measure of "times" from now on."""
        if another:
            self._base_scale = float(np.prod(np.abs(scenario.setup.body.scale))) ** (1.0 / 3.0)
            self._base_mass = _own_mass(scenario)
        self._table.content = comparison(scenario)

    def show_verdict(self, lines: Sequence[str]) -> None:
        """What is to be said of a mesh, one line each."""
        self._verdict.content = "\n".join(f"- {line}" for line in lines)

    def _size_factor(self, values: Mapping[str, Any]) -> float:
        scale = values["scale"]
        return float(math.prod(abs(s) for s in scale)) ** (1.0 / len(scale)) / self._base_scale

    def _set_size(self, factor: float) -> dict[str, object]:
        scale = self._flight.scenario.setup.body.scale
        present = float(np.prod(np.abs(scale))) ** (1.0 / 3.0)
        # The root's rounding would stand in what is shown and refused: 999999999999.9991 for 1e12.
        return {"scale": [float(f"{x:.14g}") for x in scale * (factor * self._base_scale / present)]}

    def _mass_factor(self, _: Mapping[str, Any]) -> float:
        return _own_mass(self._flight.scenario) / self._base_mass if self._base_mass > 0.0 else 1.0

    def _set_mass(self, factor: float) -> dict[str, object]:
        explicit = self._flight.scenario.parameters.inertia_model == "explicit"
        return {"explicit_inertia.mass" if explicit else "mass": factor * self._base_mass}

    def _tensor_text(self, _: Mapping[str, Any]) -> str:
        inertia = self._flight.scenario.setup.body.inertia
        largest = float(np.abs(inertia).max())
        return " ".join(f"{without_rounding(x, largest):.9g}" for x in six_from_tensor(inertia))

    def _set_tensor(self, text: str) -> dict[str, object] | None:
        """The present body with another tensor."""
        scenario, numbers = self._flight.scenario, parse_numbers(text, 6)
        if numbers is None:
            return None
        body = scenario.setup.body
        changes: dict[str, object] = {
            "inertia_model": "explicit",
            "explicit_inertia.mass": body.mass,
            "explicit_inertia.center_of_mass": (body.center_of_mass / body.scale).tolist(),
            "explicit_inertia.tensor": numbers,
        }
        for name, (_, *place) in scenario.parameters.ballast.items():
            changes[f"ballast.{name}"] = [0.0, *place]
        return changes


def _own_mass(scenario: Scenario) -> float:
    """Mass [kg] without ballast: as its parameter says, or what the density gives."""
    parameters = scenario.parameters
    explicit = parameters.inertia_model == "explicit"
    given = parameters.explicit_inertia.mass if explicit else parameters.mass
    weights = sum(mass for mass, *_ in parameters.point_masses)
    return given if given > 0.0 else scenario.setup.body.mass - weights


# The true tensor beside an approximate one

TURNED = 1e-6
"""[°] The same of an angle between axes, whose moments may be close to each other."""

TITLES = {"solid": "solid (true)", "shell": "shell", "points": "points", "bounding_box": "bounding box"}


def model_properties(scenario: Scenario, model: str, com: str = "") -> MassProperties:
    """Mass properties of the scenario's body under a model; raises InputError where that can't be had. com: one of
    MODEL_COMS, as the scenario has it where it is empty.
    """
    changes = {"inertia_model": model, "inertia_model_com": com or scenario.parameters.inertia_model_com}
    body = scenario.with_changes(changes).setup.body
    return MassProperties(body.mass, body.center_of_mass, body.inertia)


def comparison(scenario: Scenario) -> str:
    """The true tensor and the one in force, or the bounding box's where that is the true one, as a table.

    Errors are relative to each moment.
    """
    flying = str(scenario.parameters.inertia_model)
    other = "bounding_box" if flying == "solid" else flying
    try:
        true, approximate = model_properties(scenario, "solid"), model_properties(scenario, other)
        own = model_properties(scenario, other, com="model")
    except InputError as error:
        return f"Simulating: **{flying}**. Nothing to compare with: {error}"
    difference = model_difference(approximate, true)
    surface = scenario.setup.surface
    size = 1.0 if surface is None else float(np.linalg.norm(surface.extent * scenario.setup.body.scale))
    away = float(np.linalg.norm(own.center_of_mass - true.center_of_mass))
    turned = math.degrees(difference.axes_turned)
    lines = [
        f"Simulating: **{TITLES.get(flying, flying)}**",
        "",
        f"|  | {TITLES['solid']} | {TITLES.get(other, other)} | error |",
        "| --- | --- | --- | --- |",
    ]
    moments = principal_axes(true.inertia)[0], principal_axes(approximate.inertia)[0], difference.principal_moments
    for name, a, b, error in zip("₁₂₃", *moments, strict=True):
        lines.append(f"| I{name} [kg m²] | {a:.4g} | {b:.4g} | **{_per_cent(error)} %** |")
    error = approximate.mass / true.mass - 1.0
    lines += [
        f"| principal axes turned by | | | **{turned if turned > TURNED else 0.0:.3g}°** |",
        f"| mass [kg] | {true.mass:.5g} | {approximate.mass:.5g} | {_per_cent(error)} % |",
        f"| COM of its own, off by | | {away:.3g} m | **{100.0 * away / size:.2g} % of the size** |",
    ]
    if np.linalg.norm(difference.center_of_mass) < 1e-9 * size < away:
        lines += ["", "It is simulated with the COM of the solid."]
    return "\n".join(lines)


def _per_cent(error: float) -> str:
    seen = without_rounding(error)
    return f"{100.0 * seen:+.3g}" if seen else "0"
