# SPDX-License-Identifier: MIT
"""The body's tab: size, mass and tensor, the true tensor next to an approximate one, and its mesh.

Uploaded meshes are checked as by ``inspect``; the user gives the unit, then they are simulated. A body reads its mesh
by path, and so does a run that is looked back at, so the files are kept in temporary folders until the page ends; a
saved recording contains those it needs.
"""

from __future__ import annotations

import asyncio
import math
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import viser

from ..base.bundled import body_names
from ..base.errors import InputError, MeshError
from ..base.vectors import Vector3
from ..mass.from_mesh import PASSING, mesh_body
from ..mass.inspection import Inspection, inspect_mesh, model_difference
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes, six_from_tensor
from ..mesh.reading import OWN_FORMATS, load_mesh
from ..picture.style import without_rounding
from ..scene.scenario import Scenario
from .controls import NOTE, TYPING_S, Controls, parse_numbers
from .flight import Flight

OWN_FILE = "(a file)"

PUNCTUATION = re.compile(r"[!-/:-@\[-`{-~]")
"""All that can mean something in Markdown or HTML."""


class BodyTab:
    """Everything about mass and shape. ``changed`` is called whenever the parameters have changed. fly(values) starts a
    scene with these parameters, and returns whether it was accepted.
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
                controls.factor("Size ×", "Factor on all three scales (scale)", 1.0, self._size_factor, self._set_size)
                hint = "Factor on the original mass, without ballast (mass)"
                controls.factor("Mass ×", hint, 2.0, self._mass_factor, self._set_mass)
                self._size_and_mass = gui.add_html("")
                controls.numbers("density", "Density [kg/m³]", check=self._check_density)
            with gui.add_folder("Inertia"):
                controls.choice("inertia_model", "Model")
                controls.choice("ghost.inertia_model", "Ghost")
                self._table = gui.add_markdown("")
                hint = "ixx ixy ixz iyy iyz izz [kg m²], about the COM, mesh axes (explicit_inertia.tensor)"
                tensor = gui.add_text("Tensor", "", hint=hint)
            with gui.add_folder("Mesh"):
                mesh = gui.add_dropdown(
                    "Body", (OWN_FILE, *body_names()), initial_value=OWN_FILE, hint="A bundled mesh (mesh)"
                )
                self.upload = UploadFolder(gui, flight, fly, self.show_verdict)
                self._verdict = gui.add_markdown("")

        def named(values: Mapping[str, Any]) -> str:
            return values["mesh"] if values["mesh"] in body_names() else OWN_FILE

        controls.bind(mesh, named, lambda name: None if name == OWN_FILE else {"mesh": name})
        controls.bind(tensor, self._tensor_text, self._set_tensor, TYPING_S)

    def changed(self, scenario: Scenario, another: bool) -> None:
        """Show the results of the parameters in force; with ``another``, this body is the new reference of factors."""
        if another:
            self._base_scale = float(np.prod(np.abs(scenario.setup.body.scale))) ** (1.0 / 3.0)
            self._base_mass = _own_mass(scenario)
        body, surface = scenario.setup.body, scenario.setup.surface
        sides = [] if surface is None else [_sides(surface.extent * np.abs(body.scale))]
        self._size_and_mass.content = NOTE.format(", ".join((*sides, f"{body.mass:.4g} kg")))
        self._table.content = comparison(scenario)

    def show_verdict(self, lines: Sequence[str]) -> None:
        """Show these remarks on a mesh, one per line."""
        self._verdict.content = "\n".join(f"- {as_words(line)}" for line in lines)

    def _size_factor(self, values: Mapping[str, Any]) -> float:
        scale = values["scale"]
        return float(math.prod(map(abs, scale)) ** (1.0 / len(scale)) / self._base_scale)

    def _set_size(self, factor: float) -> dict[str, object]:
        scale = self._flight.scenario.setup.body.scale
        present = float(np.prod(np.abs(scale))) ** (1.0 / 3.0)
        # Otherwise the rounding of the root would be visible in values and messages: 999999999999.9991 for 1e12.
        return {"scale": [float(f"{x:.14g}") for x in scale * (factor * self._base_scale / present)]}

    def _mass_factor(self, _: Mapping[str, Any]) -> float:
        return _own_mass(self._flight.scenario) / self._base_mass if self._base_mass > 0.0 else 1.0

    def _set_mass(self, factor: float) -> dict[str, object]:
        explicit = self._flight.scenario.parameters.inertia_model == "explicit"
        return {"explicit_inertia.mass" if explicit else "mass": factor * self._base_mass}

    def _check_density(self) -> None:
        if self._flight.scenario.parameters.inertia_model == "explicit":
            why = "with the model explicit, as after a tensor was typed, the mass doesn't follow from the density"
            raise InputError("Density", f"{why}; set Mass ×, or choose another Model first")

    def _tensor_text(self, _: Mapping[str, Any]) -> str:
        inertia = self._flight.scenario.setup.body.inertia
        largest = float(np.abs(inertia).max())
        return " ".join(f"{without_rounding(x, largest):.9g}" for x in six_from_tensor(inertia))

    def _set_tensor(self, text: str) -> dict[str, object]:
        """The present body with another tensor."""
        scenario, numbers = self._flight.scenario, parse_numbers(text, 6)
        if numbers is None:
            raise InputError("Tensor", text, "six numbers: ixx ixy ixz iyy iyz izz")
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


def _sides(sides_m: Vector3) -> str:
    return f"{' × '.join(f'{side:.3g}' for side in sides_m)} m"


def _own_mass(scenario: Scenario) -> float:
    """Mass [kg] without ballast: that of its parameter, or that computed from the density."""
    parameters = scenario.parameters
    explicit = parameters.inertia_model == "explicit"
    given = parameters.explicit_inertia.mass if explicit else parameters.mass
    weights = sum(mass for mass, *_ in parameters.point_masses)
    return given if given > 0.0 else scenario.setup.body.mass - weights


def as_words(text: object) -> str:
    """A text of words alone for the page, which takes Markdown and all of HTML, scripts too: files' words are in it."""
    return PUNCTUATION.sub(lambda found: f"&#{ord(found[0])};", str(text))


# Comparison of the true tensor with an approximate one

TURNED = 1e-6
"""[°] Smaller angles between axes are shown as 0: they are rounding, since moments may be close to each other."""

TITLES = {"solid": "solid (true)", "shell": "shell", "points": "points", "bounding_box": "bounding box"}


def model_properties(scenario: Scenario, model: str, com: str = "") -> MassProperties:
    """Mass properties of the scenario's body under a model; raises InputError if they don't exist. com: one of
    MODEL_COMS; empty means that of the scenario.
    """
    changes = {"inertia_model": model, "inertia_model_com": com or scenario.parameters.inertia_model_com}
    body = scenario.with_changes(changes).setup.body
    return MassProperties(body.mass, body.center_of_mass, body.inertia)


def comparison(scenario: Scenario) -> str:
    """Table of the true tensor and the tensor in force, or that of the bounding box if the true one is in force.

    Errors are relative to each moment.
    """
    flying = str(scenario.parameters.inertia_model)
    other = "bounding_box" if flying == "solid" else flying
    try:
        true, approximate = model_properties(scenario, "solid"), model_properties(scenario, other)
        own = model_properties(scenario, other, com="model")
    except InputError as error:
        return f"Simulating: **{flying}**. Nothing to compare with: {as_words(error)}"
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
        f"| distance of its own COM | | {away:.3g} m | **{100.0 * away / size:.2g} % of the size** |",
    ]
    if np.linalg.norm(difference.center_of_mass) < 1e-9 * size < away:
        lines += ["", "The simulation uses the COM of the solid."]
    return "\n".join(lines)


def _per_cent(error: float) -> str:
    seen = without_rounding(error)
    return f"{100.0 * seen:+.3g}" if seen else "0"


# Uploaded meshes

MAX_BYTES = 256_000_000
"""Largest upload: it is sent over the page's socket and held completely in memory. Give larger files by path."""

ACCEPTED = (*OWN_FORMATS, "glb")
"""Extensions of files that contain the whole mesh: .gltf and .dae may refer to other files, .3mf is a zip."""

Y_UP = ("glb", "obj")
"""glTF requires y up, and most tools write .obj like that; a comment ``# z up`` in an .obj takes precedence."""

Z_UP_COMMENT = re.compile(rb"^#.*\bz[ -]?(?:axis )?(?:is )?up\b", re.IGNORECASE | re.MULTILINE)

OPTION, ACCEPT_OPEN = re.compile(r"--[\w-]+(?: \S+)? \((\w+)\)"), re.compile(r", which --accept-open \S+ accepts")

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Length in metres of each unit that a file may use."""

HALF = math.sqrt(0.5)
UPRIGHT = {"z": [0.0, 0.0, 0.0, 1.0], "y": [HALF, 0.0, 0.0, HALF]}
"""Attitudes xyzw that turn a file's up axis to the world's z."""

ROOM_SIZE = 20.0
"""A file whose longest side is larger than this is assumed not to be in metres, but in millimetres, as most meshes of
objects are.
"""

SENSIBLE_DENSITY = 1000.0
"""[kg/m³] Water's, the default."""


@dataclass(frozen=True)
class Upload:
    """name: as shown. path: for the parameter ``mesh``. up: the axis that points up, as far as known. inspection: the
    result of the check.
    """

    name: str
    path: str
    up: str
    inspection: Inspection

    @property
    def sides(self) -> Vector3:
        """Sides (3,) of its bounding box, in the file's numbers."""
        lower, upper = self.inspection.lower, self.inspection.upper
        return np.zeros(3) if lower is None or upper is None else upper - lower

    @property
    def likely_unit(self) -> str:
        """The most likely one of UNITS."""
        return "m" if self.name.endswith(".glb") or float(self.sides.max()) <= ROOM_SIZE else "mm"

    @property
    def refusal(self) -> str:
        """Why it can't be simulated as a solid without changes, or empty."""
        return "" if self.inspection.refusal is None else _without_options(str(self.inspection.refusal))

    @property
    def verdict(self) -> list[str]:
        """One line per remark, beginning with the severity. The page asks for the unit, with the size in sight."""
        findings = (finding for finding in self.inspection.findings if finding.code != "unit_suspicion")
        return [f"{finding.severity}: {_without_options(finding.message)}" for finding in findings]

    def size_and_mass(self, unit: str) -> str:
        """Size and mass in one line, for coordinates in this unit and SENSIBLE_DENSITY."""
        metres = UNITS[unit]
        sides, volume = _sides(self.sides * metres), self.inspection.volume
        if volume is None:
            return sides
        return f"{sides}, {SENSIBLE_DENSITY * volume * metres**3:.3g} kg at {SENSIBLE_DENSITY:g} kg/m³"

    def scene(self, unit: str, stand_in: dict[str, object]) -> dict[str, object]:
        """Parameters of a scene with only this body, at rest; stand_in: parameters that replace an open mesh."""
        return {
            "mesh": self.path,
            "scale": [UNITS[unit]] * 3,
            "density": SENSIBLE_DENSITY,
            "initial.orientation_xyzw": UPRIGHT[self.up],
            **stand_in,
        }


def _without_options(message: str) -> str:
    """A remark of ``inspect`` with the parameters that the page has in place of the command's options."""
    return OPTION.sub(r"\1", ACCEPT_OPEN.sub("", message))


def take_upload(file_name: str, data: bytes, within: str | None = None) -> Upload:
    """Check a file and keep it in a new folder, since a body that is given the same path again sees no change. within:
    the folder in which that is made.

    A readable mesh that bounds no solid is kept, too; its ``refusal`` has the reason. Raises MeshError for a file that
    isn't a mesh, or that the disk doesn't take; nothing of it is kept.
    """
    name, suffix = shown_name(file_name)
    if suffix not in ACCEPTED:
        raise MeshError("upload", name, f"a file named .{', .'.join(ACCEPTED)}")
    if len(data) > MAX_BYTES:
        limit = f"at most {MAX_BYTES} are accepted, so name a larger file by its path"
        raise MeshError("upload", f"{name} has {len(data)} bytes; {limit}")
    try:
        path = Path(tempfile.mkdtemp(prefix=PASSING, dir=within)) / name
        try:
            path.write_bytes(data)
            inspection = inspect_mesh(mesh_body(load_mesh(str(path))))
        except BaseException:
            shutil.rmtree(path.parent)
            raise
    except OSError as error:
        raise MeshError("upload", name, f"a disk that takes it ({error.strerror})") from None
    z_up = suffix == "obj" and Z_UP_COMMENT.search(data[:4096])
    return Upload(name, str(path), "y" if suffix in Y_UP and not z_up else "z", inspection)


def shown_name(file_name: str) -> tuple[str, str]:
    """A file's name reduced to plain characters, at most 40 before the extension; and the extension."""
    stem, _, suffix = re.split(r"[/\\]", file_name)[-1].rpartition(".")
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", stem).strip("_")[:40] or "mesh"
    suffix = re.sub(r"[^a-z0-9]+", "", suffix.lower())[:8]
    return f"{stem}.{suffix}", suffix


class UploadFolder:
    """viser's upload button, and the inputs that are needed before a file is simulated. fly(values) starts a scene with
    these parameters; show_verdict(lines) shows the remarks on a file. Files stay on the disk until ``close`` removes
    all of them: the run or its past may need any.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        flight: Flight,
        fly: Callable[[dict[str, object]], Any],
        show_verdict: Callable[[Sequence[str]], None],
    ) -> None:
        self._flight = flight
        self._fly_scene = fly
        self._show_verdict = show_verdict
        self.present: Upload | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        with gui.add_folder("Upload"):
            button = gui.add_upload_button(
                "Upload a mesh",
                icon=viser.Icon.UPLOAD,
                mime_type=",".join(f".{suffix}" for suffix in ACCEPTED),
                hint=f".{', .'.join(ACCEPTED)}; at most {MAX_BYTES // 1_000_000} MB",
            )
            self._unit: Any = gui.add_dropdown(
                "Its unit", tuple(UNITS), visible=False, hint="Unit of the file's coordinates (scale)"
            )
            self._size = gui.add_markdown("", visible=False)
            self._as_it_is = gui.add_button("Simulate it", visible=False)
            self._stand_in: Any = gui.add_button_group("Simulate", ("it repaired", "its hull"), visible=False)

        @button.on_upload
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self.take(button.value.name, button.value.content)

        @self._unit.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            self._show_size()

        @self._as_it_is.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self._fly({})

        @self._stand_in.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            repaired = self._stand_in.value == "it repaired"
            await self._fly({"mesh_repair": True} if repaired else {"mesh_fallback": "hull"})

    def close(self) -> None:
        """Remove all files."""
        if self._folder is not None:
            self._folder.cleanup()

    async def take(self, name: str, content: bytes) -> None:
        """Check a file and show the remarks."""
        try:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix=PASSING, ignore_cleanup_errors=True)
            upload = await asyncio.to_thread(take_upload, name, content, self._folder.name)
        except (InputError, OSError) as error:
            self._show([f"refused: {error}"], None)
            return
        lines = [*upload.verdict, *([f"refused: {upload.refusal}"] if upload.refusal else [])]
        self._show([f"{upload.name}:", *lines] if lines else [f"{upload.name}: no problems found"], upload)

    def _show(self, lines: list[str], upload: Upload | None) -> None:
        """Show the verdict, and the inputs that are needed before this upload is simulated; None: no inputs."""
        self.present = upload
        self._show_verdict(lines)
        if upload is not None:
            self._unit.value = upload.likely_unit
            self._show_size()
        self._unit.visible = self._size.visible = upload is not None
        self._as_it_is.visible = upload is not None and not upload.refusal
        self._stand_in.visible = upload is not None and bool(upload.refusal)

    def _show_size(self) -> None:
        if self.present is not None:
            self._size.content = f"**{self.present.size_and_mass(self._unit.value)}**"

    async def _fly(self, stand_in: dict[str, object]) -> None:
        upload = self.present
        if upload is None:
            return
        taken = await self._fly_scene(upload.scene(self._unit.value, stand_in))
        if taken and self.present is upload:  # and no other one was uploaded meanwhile
            self._show([f"{upload.name}: simulated"], None)
