# SPDX-License-Identifier: MIT
"""From parameters to a body in motion: the one place where a scene becomes the core's Setup.

The node, the offline run and replay all come through here, so that one scene means one motion.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError, MeshError
from ..base.rotation import matrix_from_quaternion, unit_quaternion
from ..mass.from_mesh import mesh_body
from ..mass.properties import MeshMoments, explicit_mass_properties, scale_vector
from ..mass.tensor import check_tensor
from ..mesh.reading import Mesh
from ..motion.body import make_body
from ..motion.integrators import check_carried, integrator_named
from ..motion.state import state_row
from ..motion.string import StringSettings
from ..motion.surface import Surface
from ..simulation.setup import Setup
from ..simulation.simulation import needs_of
from . import parameters

_MESH_PARAMETERS = ("mesh", "mesh_repair", "mesh_fallback")


@dataclass(frozen=True)
class BodyMesh:
    """A mesh with what is computed from it once: its moments, and its surface wound outward. made_of: the values of
    _MESH_PARAMETERS that it was loaded for.
    """

    mesh: Mesh
    moments: MeshMoments
    surface: Surface
    made_of: tuple


@dataclass(frozen=True)
class Scenario:
    """A complete, checked set of parameter values and what follows from them; immutable.

    values: every parameter by name, in its own type. body_mesh: None without a mesh. warnings: one line each. ghost: the
    setup of the ghost, when one is asked for.
    """

    values: Mapping[str, Any]
    body_mesh: BodyMesh | None
    setup: Setup
    warnings: tuple[str, ...] = ()
    ghost: Setup | None = None

    def with_changes(
        self, changes: Mapping[str, object], mesh: Mesh | None = None, at_hand: BodyMesh | None = None
    ) -> Scenario:
        """The scenario with these parameters changed, checked together; raises InputError and leaves this one as it is.

        mesh: a mesh at hand, used instead of loading the one that the parameter names. at_hand: a loaded one, used where it is
        the one that the parameters ask for.
        """
        changes = parameters.convert_all(changes)
        for name, value in changes.items():
            if parameters.parameter_named(name).changes == parameters.READ_ONLY:
                raise InputError(
                    name, value, "a parameter that can be changed while running; this one is set at start only"
                )
        values = {**self.values, **changes}
        if "density" in changes and "mass" not in changes:
            values["mass"] = 0.0
        if mesh is None:
            if all(values[name] == self.values[name] for name in _MESH_PARAMETERS):
                return build_scenario(values, self.body_mesh)
            if at_hand is not None and at_hand.made_of == _made_of(values):
                return build_scenario(values, at_hand)
        return build_scenario(values, load_body_mesh(values, mesh))

    def with_inertia(self, mass: float, com, tensor6, relative: bool) -> Scenario:
        """The scenario with an explicit inertia, as a message gives it; raises InputError.

        com (3,): scaled mesh coordinates, or metres from the present COM when ``relative``. tensor6: ixx ixy ixz iyy iyz
        izz about it. It stands for the whole body, so every ballast mass becomes 0.
        """
        scale = self.setup.body.scale
        com = np.asarray(com, dtype=float) + (self.setup.body.center_of_mass if relative else 0.0)
        changes: dict[str, object] = {
            "inertia_model": "explicit",
            "explicit_inertia.mass": mass,
            "explicit_inertia.center_of_mass": [_divided(c, s) for c, s in zip(com, scale, strict=True)],
            "explicit_inertia.tensor": list(tensor6),
        }
        for name, value in self.values.items():
            if name.startswith("ballast."):
                changes[name] = [0.0, *value[1:]]
        return self.with_changes(changes)

    @property
    def text(self) -> str:
        """The scenario as a parameter file that starts the same simulation."""
        return scene_text(self.values, self.body_mesh.mesh.sha256 if self.body_mesh else "")


def scene_text(values: Mapping[str, object], mesh_sha256: str = "") -> str:
    """Parameter values as a parameter file, the hash of the mesh's file in a comment."""
    lines = [f"    {name}: {yaml_value(value)}" for name, value in sorted(values.items())]
    mesh = [f"# mesh_sha256: {mesh_sha256}"] if mesh_sha256 else []
    return "\n".join([*mesh, "rigid_body:", "  ros__parameters:", *lines, ""])


def make_scenario(values: Mapping[str, object], mesh: Mesh | None = None) -> Scenario:
    """A scenario from some parameters, the others at their defaults; raises InputError or one of its family.

    mesh: a mesh at hand, used instead of loading the one that the parameter names.
    """
    complete = {**parameters.defaults(), **parameters.convert_all(values)}
    return build_scenario(complete, load_body_mesh(complete, mesh))


def load_body_mesh(values: Mapping[str, object], mesh: Mesh | None = None) -> BodyMesh | None:
    """The mesh that checked values name (or the one at hand), with its moments; None without one. Raises MeshError."""
    if values["mesh"] == "":
        if values["inertia_model"] != "explicit":
            raise InputError("mesh", "a mesh is needed, unless inertia_model is explicit")
        return None
    body = mesh_body(mesh or values["mesh"], repair=values["mesh_repair"], fallback=values["mesh_fallback"])
    if not body.verdict.usable:
        raise MeshError(f"mesh {values['mesh']}", body.verdict.reason or "the surface has no extent")
    triangles = body.triangles[:, [0, 2, 1]] if body.verdict.inward else body.triangles
    surface = Surface(body.vertices, np.ascontiguousarray(triangles))
    return BodyMesh(body.mesh, body.moments, surface, _made_of(values))


def _made_of(values: Mapping[str, object]) -> tuple:
    return tuple(values[name] for name in _MESH_PARAMETERS)


def build_scenario(values: Mapping[str, object], body_mesh: BodyMesh | None) -> Scenario:
    """The scenario of a complete set of checked values whose mesh is loaded already; raises InputError."""
    setup, warnings = _setup(values, body_mesh)
    ghost = {name: values[f"ghost.{name}"] for name in ("inertia_model", "integrator") if values[f"ghost.{name}"]}
    ghost_setup = _setup({**values, **ghost}, body_mesh)[0] if ghost else None
    if "integrator" in ghost:
        try:
            check_carried(ghost_setup.integrator, needs_of(ghost_setup, (), ghost_setup.string.attached))
        except CommandRefused as refusal:
            raise InputError("ghost.integrator", refusal.received, refusal.accepted) from None
    return Scenario(values, body_mesh, setup, warnings, ghost_setup)


def _setup(values: Mapping[str, object], body_mesh: BodyMesh | None) -> tuple[Setup, tuple[str, ...]]:
    scale = scale_vector(values["scale"])
    properties = _mass_properties(values, body_mesh, scale)
    check_tensor(properties.inertia)
    # Within an ulp of where it is, at a product of mesh coordinate and scale: so it survives being sent back by message.
    center_of_mass = [_divided(c, s) * s for c, s in zip(properties.center_of_mass, scale, strict=True)]
    body = make_body(properties.mass, center_of_mass, properties.inertia, scale)
    quaternion = unit_quaternion(values["initial.orientation_xyzw"], "initial.orientation_xyzw")
    R = matrix_from_quaternion(quaternion)
    w = np.asarray(values["initial.angular_velocity"])
    omega_body = R[0] * w[0] + R[1] * w[1] + R[2] * w[2]
    contacts = {n.removeprefix("contacts."): tuple(v) for n, v in values.items() if n.startswith("contacts.")}
    if values["imu_contact"] and values["imu_contact"] not in contacts:
        known = ", ".join(sorted(contacts)) or "the body has none"
        raise InputError("imu_contact", values["imu_contact"], f"'' for the COM, or a contact ({known})")
    setup = Setup(
        body=body,
        inertia_model=values["inertia_model"],
        surface=body_mesh.surface if body_mesh else None,
        geometry=(body_mesh.mesh.sha256 if body_mesh else "", *scale.tolist()),
        contacts=contacts,
        gravity=np.asarray(values["gravity"]),
        linear_damping=values["linear_damping"],
        angular_damping=values["angular_damping"],
        gyroscopic=values["gyroscopic"],
        integrator=integrator_named(values["integrator"]),
        step_ns=max(1, nanoseconds(values["step"])),
        wrench_timeout_ns=nanoseconds(values["wrench_timeout"]),
        poke_duration_ns=max(1, nanoseconds(values["poke_duration"])),
        string=StringSettings(
            attached=values["string.attached"],
            attach=tuple(values["string.attach"]),
            target=tuple(values["string.target"]),
            stiffness=values["string.stiffness"],
            frequency=values["string.frequency"],
            damping_ratio=values["string.damping_ratio"],
            rest_length=values["string.rest_length"],
            bilateral=values["string.bilateral"],
            timeout_ns=nanoseconds(values["string.timeout"]),
        ),
        accuracy=values["accuracy"],
        initial=state_row(values["initial.position"], quaternion, values["initial.linear_velocity"], omega_body),
        initial_string_mass=values["initial.string_mass"],
    )
    return setup, tuple(properties.warnings)


def _mass_properties(values, body_mesh, scale):
    ballast = [tuple(v) for n, v in sorted(values.items()) if n.startswith("ballast.")]
    if values["inertia_model"] == "explicit":
        given = (values[f"explicit_inertia.{part}"] for part in ("mass", "center_of_mass", "tensor"))
        return explicit_mass_properties(*given, ballast=ballast, scale=scale)
    if body_mesh is None:
        raise InputError("mesh", "a mesh is needed, unless inertia_model is explicit")
    return body_mesh.moments.mass_properties(
        values["inertia_model"],
        scale=scale,
        mass=values["mass"],
        density=values["density"],
        ballast=ballast,
        com=values["inertia_model_com"],
    )


def check_inertia(scenario: Scenario, content: Mapping) -> Scenario:
    """The scenario with the inertia of an event's content; raises CommandRefused (``nonfinite``, ``tensor``)."""
    numbers = [content["mass"], *content["com"], *content["tensor"]]
    if not np.isfinite(numbers).all():
        raise CommandRefused("nonfinite", "inertia", numbers, "finite numbers")
    try:
        return scenario.with_inertia(content["mass"], content["com"], content["tensor"], content["relative"])
    except InputError as error:
        raise CommandRefused("tensor", error.field, error.received, error.accepted) from None


def _divided(product: float, factor: float) -> float:
    """x with x · factor == product in double precision where there is one, else the nearest."""
    x = product / factor
    for near in (x, math.nextafter(x, math.inf), math.nextafter(x, -math.inf)):
        if near * factor == product:
            return near
    return x


def nanoseconds(seconds: float) -> int:
    """Seconds to whole nanoseconds, to the nearest."""
    return round(seconds * 1e9)


def publication_ns(k: int, publish_rate: float) -> int:
    """Simulated time of publication k: round(k·1e9/publish_rate), in integer arithmetic on the rate's exact value."""
    numerator, denominator = publish_rate.as_integer_ratio()
    return (2 * k * 1_000_000_000 * denominator + numerator) // (2 * numerator)


def yaml_value(value: object) -> str:
    """A parameter's value as it stands in a YAML file, with all its digits."""
    # JSON is YAML; repr keeps all digits, and a double keeps its point so that it is read back as one.
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return yaml_double(value)
    if isinstance(value, list):
        return "[" + ", ".join(yaml_double(v) for v in value) + "]"
    return json.dumps(value)


def yaml_double(value: float) -> str:
    """A double as YAML 1.1 and rcl read it back as one."""
    text = repr(value)
    return text if any(c in text for c in ".n") else text.replace("e", ".0e")
