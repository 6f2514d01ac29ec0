# SPDX-License-Identifier: MIT
"""The body's tab: mesh, size, mass, ballast, and the tensor, true next to approximate."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser

from ..base.bundled import body_names
from ..base.errors import InputError
from ..mass.from_mesh import mesh_body
from ..mass.model_difference import model_difference
from ..mass.properties import MassProperties, explicit_mass_properties
from ..mass.tensor import check_tensor, principal_axes, six_from_tensor, tensor_from_six
from ..mesh.reading import Mesh
from ..scene.scenario import Scenario
from .controls import Controls, parse_numbers
from .flight import Flight
from .upload import UploadFolder

OWN_FILE = "(a file)"
ANOTHER = "(another one)"


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
        say: Callable[[str], None],
        fly: Callable[[dict[str, object]], Any],
    ) -> None:
        self._gui = gui
        self._controls = controls
        self._flight = flight
        self._say = say
        self._base_scale = self._base_mass = 1.0
        self._judged_mesh: tuple[object, ...] = ()
        self._weights: dict[str, list[float]] = {}
        with tabs.add_tab("Body"):
            self._size_and_mass_folder()
            self._inertia_folder()
            self._mesh_folder(fly)
            self._ballast_folder()

    @property
    def table(self) -> str:
        """The true tensor beside another, as it is shown."""
        return str(self._table.content)

    def changed(self, scenario: Scenario, another: bool) -> None:
        """Show what follows from the parameters in force; ``another`` body is the measure of "times" from now on."""
        body = scenario.setup.body
        if another:
            self._base_scale = float(np.prod(np.abs(body.scale))) ** (1.0 / 3.0)
            self._base_mass = _own_mass(scenario)
        self._table.content = comparison(scenario)
        mesh = str(scenario.parameters.mesh)
        self._file.content = "" if mesh in body_names() else f"Mesh file: `{Path(mesh).name}`"
        self._ballast_changed(scenario)
        parameters = scenario.parameters
        key = (parameters.mesh, parameters.mesh_repair, parameters.mesh_fallback)
        if key != self._judged_mesh and scenario.body_mesh is not None:
            self._judged_mesh = key
            asyncio.get_running_loop().create_task(
                self._check_mesh(scenario.body_mesh.mesh, parameters.mesh_repair, parameters.mesh_fallback)
            )

    async def _check_mesh(self, mesh: Mesh, repair: bool | str, fallback: str) -> None:
        body = await asyncio.to_thread(mesh_body, mesh, repair=repair, fallback=fallback)
        self.show_verdict(
            [f"{finding.severity}: {finding.message}" for finding in body.verdict.findings]
            or ["closed and consistently wound: no problems found"]
        )

    def show_verdict(self, lines: Sequence[str]) -> None:
        """What is to be said of a mesh, one line each."""
        self._verdict.content = "**Verdict**\n\n" + "\n".join(f"- {line}" for line in lines)

    # Mesh

    def _mesh_folder(self, fly: Callable[[dict[str, object]], Any]) -> None:
        gui = self._gui
        with gui.add_folder("Mesh"):
            mesh = gui.add_dropdown(
                "Body", (OWN_FILE, *body_names()), initial_value=OWN_FILE, hint="Bundled bodies (mesh)"
            )
            self._file = gui.add_markdown("")
            self.upload = UploadFolder(gui, self._flight, fly, self.show_verdict)
            self._verdict = gui.add_markdown("")
            self._controls.checkbox("mesh_repair", "Repair")
            self._controls.choice("mesh_fallback", "Fallback if open")

        def shown(values: Mapping[str, Any]) -> str:
            return values["mesh"] if values["mesh"] in body_names() else OWN_FILE

        self._controls.bind(mesh, shown, lambda name: None if name == OWN_FILE else {"mesh": name})

    # Size and mass

    def _size_and_mass_folder(self) -> None:
        gui, controls = self._gui, self._controls
        with gui.add_folder("Size and mass"):
            controls.factor("Size ×", "All three scales together (scale)", 1.0, self._size_factor, self._set_size)
            controls.numbers("scale", "Scale x y z", 3)
            hint = "Times the original mass, without ballast (mass)"
            controls.factor("Mass ×", hint, 2.0, self._mass_factor, self._set_mass)
            controls.numbers("mass", "Mass [kg]; 0: by density")
            controls.numbers("density", "Density [kg/m³]")

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
        return {_mass_parameter(self._flight.scenario): factor * self._base_mass}

    # Inertia

    def _inertia_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Inertia"):
            self._controls.choice("inertia_model", "Model")
            self._controls.choice("inertia_model_com", "Its COM")
            self._table = gui.add_markdown("")
            with gui.add_folder("Edit the tensor", expand_by_default=False):
                tensor: Any = gui.add_text(
                    "Tensor", "", hint="ixx ixy ixz iyy iyz izz [kg m²], about the COM, mesh axes"
                )
                verdict: Any = gui.add_markdown("")
                present = gui.add_button("Copy the current tensor")
                apply = gui.add_button(
                    "Use this tensor", disabled=True, hint="inertia_model explicit, with present mass and COM"
                )

        def check() -> list[float] | None:
            numbers = parse_numbers(tensor.value, 6)
            valid, verdict.content = tensor_verdict(numbers)
            apply.disabled = not valid
            return numbers if valid else None

        @tensor.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            check()

        @present.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            inertia = self._flight.scenario.setup.body.inertia
            tensor.value = " ".join(f"{x:.9g}" for x in six_from_tensor(inertia))

        @apply.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            numbers = check()
            if numbers is not None:
                self._flight.set(_explicit(self._flight.scenario, numbers))

    # Ballast

    def _ballast_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Ballast"):
            weight: Any = gui.add_dropdown("Weight", (ANOTHER,), initial_value=ANOTHER)
            name: Any = gui.add_text("Its name", "weight", hint="Small letters, digits and _")
            mass: Any = gui.add_text("Its mass [kg]", "0", hint="0 removes it")
            place: Any = gui.add_text("At x y z", "0 0 0", hint="Mesh coordinates")
            put = gui.add_button("Put it there")
        self._weight, self._name, self._weight_mass, self._place = weight, name, mass, place

        @weight.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                self._show_weight()

        @put.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            numbers = parse_numbers(f"{mass.value} {place.value}", 4)
            chosen = name.value if weight.value == ANOTHER else weight.value
            if numbers is None or not re.fullmatch(r"[a-z][a-z0-9_]*", chosen):
                received = f"got {chosen[:40]!r}, {mass.value[:40]!r}, {place.value[:80]!r}"
                self._say(f"Ballast: {received}; accepted: a name of small letters, a mass, three coordinates")
            else:
                self._flight.set({f"ballast.{chosen}": numbers})

    def _ballast_changed(self, scenario: Scenario) -> None:
        weights = {name: list(value) for name, value in scenario.parameters.ballast.items()}
        if weights == self._weights:
            return
        added = [name for name in weights if name not in self._weights]
        self._weights = weights
        chosen = self._weight.value
        self._weight.options = (*weights, ANOTHER)
        self._weight.value = added[0] if added else chosen if chosen in weights else ANOTHER
        self._show_weight()

    def _show_weight(self) -> None:
        chosen = self._weight.value
        self._name.visible = chosen == ANOTHER
        mass, *place = self._weights.get(chosen, (0.0, 0.0, 0.0, 0.0))
        self._weight_mass.value = f"{mass:g}"
        self._place.value = " ".join(f"{x:.9g}" for x in place)


def _own_mass(scenario: Scenario) -> float:
    """Mass [kg] without ballast: as its parameter says, or what the density gives."""
    parameters = scenario.parameters
    explicit = parameters.inertia_model == "explicit"
    given = parameters.explicit_inertia.mass if explicit else parameters.mass
    weights = sum(mass for mass, *_ in parameters.point_masses)
    return given if given > 0.0 else scenario.setup.body.mass - weights


def _mass_parameter(scenario: Scenario) -> str:
    return "explicit_inertia.mass" if scenario.parameters.inertia_model == "explicit" else "mass"


def _explicit(scenario: Scenario, numbers: list[float]) -> dict[str, object]:
    """The present body with another tensor."""
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


# The true tensor beside an approximate one

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
