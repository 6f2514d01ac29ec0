# SPDX-License-Identifier: MIT
"""One row of a study as a scene and a script: what the row means, however it is flown."""

from __future__ import annotations

import copy
import shlex
from collections import ChainMap
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.files import output_file
from ..scene.declaration import Value
from ..scene.parameters import Parameters
from ..scene.scenario import BodyMesh, Scenario, build_scenario, load_body_mesh
from ..scene.script import expand_script
from ..scene.yaml_text import dump_yaml
from ..simulation.commands import Command
from .sampling import VERTEX, Draw
from .study import Study

MESHES_KEPT = 16
"""Meshes with their moments that a process keeps."""


@dataclass(frozen=True)
class Variation:
    """script: its entries, as YAML gives them."""

    parameters: Parameters
    script: list[Any]

    @property
    def scenario(self) -> Scenario:
        """The scenario of the parameters; raises InputError where no body or flight has them."""
        return build_scenario(self.parameters, body_mesh_of(self.parameters))

    @property
    def commands(self) -> list[Command]:
        """The script's commands; raises InputError."""
        return expand_script(self.script, "script")


def variation(study: Study, row: int) -> Variation:
    """Row ``row`` of a study."""
    return apply(study, [column[0] for column in study.columns(np.array([row], np.int64))])


def apply(study: Study, chosen: list[Any]) -> Variation:
    """The variation with these values of what varies."""
    changes: dict[str, Value] = {}
    values, entries = ChainMap(changes, study.parameters.named()), copy.deepcopy(study.script)
    if study.density_decides:
        values["mass"] = 0.0
    vertices = []
    for vary, value in zip(study.vary, chosen, strict=True):
        if isinstance(vary.form, Draw) and vary.form.shape == VERTEX:
            vertices.append((vary.target, value))
        else:
            vary.target.put(values, entries, plain(value))
    parameters = study.parameters.replaced(changes)
    for target, value in vertices:
        target.put(values, entries, {"vertex": vertex_number(value, body_mesh_of(parameters))})
    return Variation(parameters, entries)


def vertex_number(uniform: float, body_mesh: BodyMesh | None) -> int:
    """Which vertex a uniform number in [0, 1) chooses; 0 without a mesh, which is then refused for want of one."""
    return int(uniform * len(body_mesh.surface.vertices)) if body_mesh else 0


def plain(value: Any) -> object:
    """A value as YAML has it."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return list(value) if isinstance(value, tuple) else value


def body_mesh_of(parameters: Parameters) -> BodyMesh | None:
    """The mesh that the parameters name, with its moments; read once in a process."""
    # Only a body without a mesh asks for its model.
    model = "solid" if parameters.mesh else parameters.inertia_model
    return _body_mesh(parameters.mesh, parameters.mesh_repair, parameters.mesh_fallback, model)


@lru_cache(maxsize=MESHES_KEPT)
def _body_mesh(mesh: str, repair: bool, fallback: str, model: str) -> BodyMesh | None:
    return load_body_mesh(Parameters(mesh=mesh, mesh_repair=repair, mesh_fallback=fallback, inertia_model=model))


def write_scene(study: Study, row: Variation, file: Path, time: float | None) -> dict[str, Any]:
    """Write the row as a scene, its script beside it as NAME_script.yaml; returns the files and the
    command that flies them.
    """
    duration = time if time is not None else study.duration_ns / 1e9
    scenario, commands = row.scenario, row.commands
    output_file("--as-scene", file)
    try:
        file.write_text(scenario.text, encoding="utf-8")
        words = ["rigid_proto", "simulate", str(file), "--duration", repr(duration)]
        if commands:
            script = file.with_name(f"{file.stem}_script.yaml")
            script.write_text(dump_yaml(row.script), encoding="utf-8")
            words += ["--script", str(script)]
    except OSError as error:
        raise InputError("--as-scene", str(file), f"a file that can be written ({error.strerror})") from None
    return {"scene": str(file), "fly": shlex.join(words)}
