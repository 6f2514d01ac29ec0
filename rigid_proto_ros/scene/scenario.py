# SPDX-License-Identifier: MIT
"""Scenario: checked parameters with the Setup that the simulation runs.

The node, the offline run and replay all make their Setup here, so that a scene gives the same motion in each.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from ..base.arithmetic import exact_quotient
from ..base.compilation import copy_fields, copy_of, new_record
from ..base.errors import CommandRefused, InputError, MeshError
from ..base.vectors import Vector3
from ..base.yaml_text import yaml_value
from ..mass import INERTIA_MODELS
from ..mass.from_mesh import mesh_body
from ..mass.moments import STRETCHED
from ..mass.properties import MeshMoments
from ..mesh.locate import resolve_mesh
from ..mesh.reading import Mesh
from ..motion.surface import Surface
from ..parameters.declarations import (
    PARAMETERS,
    READ_ONLY,
    Parameters,
    Value,
    convert_all,
    parameter_named,
    with_mass_of_density,
)
from ..simulation.commands import nanoseconds
from ..simulation.record import MAX_BALLASTS, MESH, SCENE, SCENE_PARAMETERS, field_of
from ..simulation.setup import Setup, make_setup
from ..simulation.thrusters import make_thruster
from .scene_file import named_values, read_scene_text

_HASH = re.compile(r"^# mesh_sha256: ([0-9a-f]{64})$", re.MULTILINE)


@dataclass(eq=False)
class BodyMesh:
    """A mesh with what is computed from it once: its moments, its surface wound outward, and its numbers (MESH), filled
    for the inertia models that scenes have used so far. volume: for a body of parts, the sum of the parts' volumes.
    """

    mesh: Mesh
    moments: MeshMoments
    surface: Surface
    numbers: np.record
    volume: float | None = None

    def provide(self, model: str, scale: Vector3) -> np.record:
        """The numbers, with the moments of a model at this scale (3,) added. Raises MeshError."""
        numbers = new_record(MESH)
        copy_fields(self.numbers, numbers)  # a copy: setups keep the present record
        number = INERTIA_MODELS.index(model)
        if model == "walled":
            copy_fields(self.moments.walls(scale), numbers["walls"])
        else:
            copy_fields(self.moments.moments(model, scale).record, numbers["moments"][number])
        numbers["known"][number] = True
        if model in STRETCHED:
            numbers["stretch"][number] = np.abs(scale) / abs(scale[0])
        self.numbers = numbers
        return numbers


@dataclass(frozen=True)
class Scenario:
    """Checked parameters and what is derived from them; immutable.

    body_mesh: None without a mesh. warnings: one line each. ghost: setup of the ghost, if there is one.
    """

    parameters: Parameters
    body_mesh: BodyMesh | None
    setup: Setup
    warnings: tuple[str, ...] = ()
    ghost: Setup | None = None

    def __reduce__(self) -> tuple[Callable[..., Scenario], tuple[Parameters, Mesh | None]]:
        """Pickle parameters and mesh only: compiled functions and their addresses are valid in this process only."""
        return _scenario_of, (self.parameters, self.body_mesh.mesh if self.body_mesh else None)

    def with_changes(
        self, changes: Mapping[str, object], mesh: Mesh | None = None, at_hand: Scenario | None = None
    ) -> Scenario:
        """A scenario with these parameters changed and all checked together. Raises InputError; this scenario never
        changes.

        mesh: a loaded mesh, used instead of the one that the parameter names. at_hand: a scenario whose mesh is reused
        if the parameters name the same mesh.
        """
        values = with_mass_of_density(check_values(changes))
        parameters = self.parameters.with_values(values)
        for one in (self, at_hand):
            if mesh is None and one is not None and _mesh_parameters(one.parameters) == _mesh_parameters(parameters):
                return build_scenario(parameters, one.body_mesh, (self.setup, values))
        return _scenario_of(parameters, mesh)

    @property
    def text(self) -> str:
        """The scenario as a parameter file that starts the same simulation."""
        return scene_text(self.parameters.named(), self.body_mesh.mesh.sha256 if self.body_mesh else "")


def check_values(changes: Mapping[str, object]) -> dict[str, Value]:
    """Convert values to their parameters' types. Raises InputError for a change that no running scenario can take: an
    unknown name, a value of another type or out of bounds, a parameter that can be set at start only.
    """
    values = convert_all(changes)
    for name, value in values.items():
        if parameter_named(name).changes == READ_ONLY:
            raise InputError(
                name, value, "a parameter that can be changed while running; this one is set at start only"
            )
    return values


def scene_text(values: Mapping[str, Value], mesh_sha256: str = "") -> str:
    """Parameters by name as a parameter file for a node of any name, with the hash of the mesh file in a comment."""
    lines = [f"    {name}: {yaml_value(value)}" for name, value in sorted(values.items())]
    mesh = [f"# mesh_sha256: {mesh_sha256}"] if mesh_sha256 else []
    return "\n".join([*mesh, "/**:", "  ros__parameters:", *lines, ""])


def mesh_sha256_of(scene: str) -> str:
    """The hash of the mesh file from the comment that ``scene_text`` writes, or ""."""
    found = _HASH.search(scene)
    return found.group(1) if found else ""


def mesh_file(scene: str, at_hand: Iterable[tuple[str, bytes]] = ()) -> tuple[str, bytes] | None:
    """Name and bytes of a scene's mesh file, to be put into a recording. It is read from the scene's path or taken from
    ``at_hand``. None if the file has changed or is missing since it was loaded, or if the mesh consists of several
    files.
    """
    files = [*at_hand]
    with suppress(InputError, OSError):
        path = resolve_mesh(str(read_scene_text(scene).values.get("mesh", "")))
        files.append((path.name, path.read_bytes()))
    sha256 = mesh_sha256_of(scene)
    return next(((name, data) for name, data in files if hashlib.sha256(data).hexdigest() == sha256), None)


def make_scenario(values: Mapping[str, object], mesh: Mesh | None = None) -> Scenario:
    """A scenario of parameters by name, the others at their defaults. Raises InputError or a subclass.

    mesh: a loaded mesh, used instead of the one that the parameter names.
    """
    return _scenario_of(Parameters().replaced(values), mesh)


def _scenario_of(parameters: Parameters, mesh: Mesh | None) -> Scenario:
    return build_scenario(parameters, load_body_mesh(parameters, mesh))


def read_scene(
    name: str, settings: Mapping[str, object] | None = None, warn: Callable[[str], None] = print
) -> Scenario:
    """The scenario of a scene file or of a mesh, by path or bundled name, with ``settings`` on top.

    An unknown name raises InputError in a section for this node, and gives a warning in ``/**``. A density in the
    settings sets the scene's mass to 0, as it does in flight, because a mass would take precedence.
    """
    return make_scenario({**named_values(name, warn), **with_mass_of_density(settings or {})})


def load_body_mesh(parameters: Parameters, mesh: Mesh | None = None) -> BodyMesh | None:
    """Load the mesh that the parameters name, or take the one given, and compute its moments. None without a mesh.
    Raises MeshError.
    """
    if parameters.mesh == "":
        return None
    body = mesh_body(mesh or parameters.mesh, repair=parameters.mesh_repair, fallback=parameters.mesh_fallback)
    if not body.verdict.usable:
        raise MeshError(f"mesh {parameters.mesh}", body.verdict.reason)
    surface, numbers = Surface(body.vertices, body.triangles), new_record(MESH)
    numbers["has_surface"], numbers["extent"] = True, surface.extent
    volume = body.volume() if body.parts and not body.moments.no_solid else None
    return BodyMesh(body.mesh, body.moments, surface, numbers, volume)


def _mesh_parameters(parameters: Parameters) -> tuple[str, bool, str]:
    """The parameters that determine which mesh is loaded."""
    return parameters.mesh, parameters.mesh_repair, parameters.mesh_fallback


def build_scenario(
    parameters: Parameters, body_mesh: BodyMesh | None, like: tuple[Setup, Collection[str]] | None = None
) -> Scenario:
    """The scenario of parameters whose mesh is already loaded. Raises InputError. like: a setup, and the names of the
    parameters that may differ from it.
    """
    setup = _setup(parameters, body_mesh, like)
    return Scenario(parameters, body_mesh, setup, setup.warnings, _ghost_setup(parameters, body_mesh))


def _ghost_setup(parameters: Parameters, body_mesh: BodyMesh | None) -> Setup | None:
    ghost = parameters.ghost
    if not ghost.inertia_model and not ghost.integrator:
        return None
    own = replace(
        parameters,
        inertia_model=ghost.inertia_model or parameters.inertia_model,
        integrator=ghost.integrator or parameters.integrator,
    )
    try:
        return _setup(own, body_mesh)
    except CommandRefused as refusal:
        raise InputError("ghost.integrator", refusal.received, refusal.accepted) from None


_SCENE_VALUES = {name: (field_of(name), PARAMETERS[name].choices, attrgetter(name)) for name in SCENE_PARAMETERS}
"""By parameter that is a number of a scene: the field of the record, the choices that the number is an index of, and
the getter of its value.
"""


def scene_record(parameters: Parameters, like: tuple[Setup, Collection[str]] | None = None) -> np.record:
    """The numbers of parameters (simulation/record.py, SCENE). Raises InputError for more ballast than the record
    holds. like: as in ``build_scenario``.
    """
    scene: np.record = new_record(SCENE) if like is None else copy_of(like[0].scene)
    names = PARAMETERS if like is None else like[1]
    for name in names:
        if name in _SCENE_VALUES:
            field, choices, value_of = _SCENE_VALUES[name]
            value = value_of(parameters)
            scene[field] = choices.index(value) if choices else value
    if like is not None and not any(name.startswith("ballast.") for name in names):
        return scene
    points = [mass for mass in parameters.point_masses if mass[0] != 0.0]
    if len(points) > MAX_BALLASTS:
        raise InputError("ballast", f"{len(points)} point masses", f"at most {MAX_BALLASTS} with a mass")
    scene["ballasts"] = len(points)
    for place, point in zip(scene.ballast, points, strict=False):
        place[:] = point
    return scene


def _setup(
    parameters: Parameters, body_mesh: BodyMesh | None, like: tuple[Setup, Collection[str]] | None = None
) -> Setup:
    thrusters = (
        like[0].thrusters
        if like
        else {
            name: make_thruster(
                name, numbers, parameters.thruster.bidirectional, nanoseconds(parameters.thruster.minimum_on_time)
            )
            for name, numbers in sorted(parameters.thrusters.items())
        }
    )
    try:
        setup = make_setup(
            scene_record(parameters, like),
            new_record(MESH) if body_mesh is None else body_mesh.numbers,
            surface=body_mesh.surface if body_mesh else None,
            mesh_sha256=body_mesh.mesh.sha256 if body_mesh else "",
            contacts=like[0].contacts if like else dict(parameters.contacts),
            thrusters=thrusters,
            provide=None if body_mesh is None else body_mesh.provide,
            mesh_name=body_mesh.mesh.name if body_mesh else "",
        )
    except InputError as error:
        if error.field == "scale":  # reported as it was given: one number or three
            raise InputError("scale", list(parameters.scale), error.accepted) from None
        raise
    if parameters.imu_contact and parameters.imu_contact not in parameters.contacts:
        known = ", ".join(sorted(parameters.contacts)) or "the body has none"
        raise InputError("imu_contact", parameters.imu_contact, f"'' for the COM, or a contact ({known})")
    return setup


def with_inertia(scenario: Scenario, content: Mapping[str, Any]) -> Scenario:
    """The scenario with the explicit inertia of an event's content. Raises CommandRefused (``nonfinite``, ``tensor``).

    com (3,): scaled mesh coordinates, or metres from the present COM if ``relative``. The explicit inertia is that of
    the whole body, so every ballast mass becomes 0.
    """
    numbers = [content["mass"], *content["com"], *content["tensor"]]
    if not np.isfinite(numbers).all():
        raise CommandRefused("nonfinite", "inertia", numbers, "finite numbers")
    body = scenario.setup.body
    center = np.array(content["com"], dtype=float) + (body.center_of_mass if content["relative"] else 0.0)
    changes: dict[str, object] = {
        "inertia_model": "explicit",
        "explicit_inertia.mass": content["mass"],
        "explicit_inertia.center_of_mass": [exact_quotient(c, s) for c, s in zip(center, body.scale, strict=True)],
        "explicit_inertia.tensor": list(content["tensor"]),
    }
    for name, (_, *place) in scenario.parameters.ballast.items():
        changes[f"ballast.{name}"] = [0.0, *place]
    try:
        return scenario.with_changes(changes)
    except InputError as error:
        raise CommandRefused("tensor", error.field, error.received, error.accepted) from None


def publication_ns(k: int, publish_rate: float) -> int:
    """Simulated time of publication k: round(k·1e9/publish_rate), in integer arithmetic on the rate's exact value."""
    numerator, denominator = publish_rate.as_integer_ratio()
    return (2 * k * 1_000_000_000 * denominator + numerator) // (2 * numerator)
