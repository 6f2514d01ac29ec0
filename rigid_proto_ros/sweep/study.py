# SPDX-License-Identifier: MIT
"""A study: a scene, a script, what varies and what is measured. It is read and checked completely before anything runs.

Row i is a function of the study and i only. Grids give all combinations, the first grid varying slowest. All lists
advance together and count as one more grid. If anything is random, each combination is drawn ``samples`` times.
"""

from __future__ import annotations

import copy
import hashlib
import math
from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.bundled import example_names, example_path, study_names, study_path
from ..base.errors import InputError, MeshError, did_you_mean
from ..base.library import stamp
from ..base.provenance import MOTION
from ..base.vectors import IntArray
from ..base.yaml_text import load_yaml, plain, read_text
from ..mesh.reading import Mesh, load_mesh
from ..parameters.declarations import (
    READ_ONLY,
    Parameters,
    Value,
    convert_all,
    parameter_named,
    with_mass_of_density,
)
from ..scene.scenario import BodyMesh, Scenario, build_scenario, load_body_mesh, make_scenario
from ..scene.scenario_run import OfflineRun
from ..scene.scene_file import scene_file, scene_values
from ..scene.script import expand_script
from ..scene.sensitivity import finer_values
from ..simulation.commands import Command, nanoseconds
from .fields import mapping, number, whole
from .measures import Measures, read_measures
from .sampling import GRID, LIST, VERTEX, Draw, Levels, read_form, row_uniforms
from .targets import Target, read_target

MAX_ROWS = 10_000_000
_KEYS = ("scene", "script", "duration", "set", "vary", "reference", "seed", "samples", "watch", "measure")
MESHES_KEPT = 16
"""Largest number of meshes, with their moments, that a study caches."""


class Meshes:
    """Meshes with their moments, each read once. contents: by name, meshes to use instead of reading the files, or the
    errors of those that can't be read.
    """

    def __init__(self, contents: Mapping[str, Mesh | MeshError] | None = None) -> None:
        self._contents = dict(contents or {})
        self._made = lru_cache(maxsize=MESHES_KEPT)(self._make)

    def __reduce__(self) -> tuple[type[Meshes], tuple[dict[str, Mesh | MeshError]]]:
        """Pickle the contents only; another process computes the moments again."""
        return Meshes, (self._contents,)

    def of(self, parameters: Parameters) -> BodyMesh | None:
        """The mesh that the parameters name. Raises MeshError."""
        return self._made(parameters.mesh, parameters.mesh_repair, parameters.mesh_fallback)

    def _make(self, mesh: str, repair: bool, fallback: str) -> BodyMesh | None:
        parameters = Parameters(mesh=mesh, mesh_repair=repair, mesh_fallback=fallback)
        given = self._contents.get(mesh)
        if isinstance(given, MeshError):
            raise given
        return load_body_mesh(parameters, given)


@dataclass(frozen=True)
class Variation:
    """A row: its parameters, and the script's entries as parsed YAML."""

    parameters: Parameters
    script: list[Any]
    meshes: Meshes

    @property
    def scenario(self) -> Scenario:
        """The scenario of the parameters. Raises InputError if no body or flight can have them."""
        return build_scenario(self.parameters, self.meshes.of(self.parameters))

    @property
    def commands(self) -> list[Command]:
        """The script's commands. Raises InputError."""
        return expand_script(self.script, "script")


@dataclass(frozen=True)
class Vary:
    """A varied target, and how it varies."""

    target: Target
    form: Levels | Draw

    @property
    def is_random_vertex(self) -> bool:
        """Whether it selects a random vertex of the row's mesh."""
        return isinstance(self.form, Draw) and self.form.shape == VERTEX


@dataclass(frozen=True, eq=False)
class Study:
    """parameters: of the scene that the study varies. script: entries as parsed YAML. samples: number of rows for each
    combination of grids and lists. reference: parameters that differ in the reference flight, or None.
    """

    name: str
    parameters: Parameters
    script: list[Any]
    duration_ns: int
    seed: int
    samples: int
    vary: tuple[Vary, ...]
    reference: Mapping[str, Value] | None
    measures: Measures
    meshes: Meshes = field(default_factory=Meshes)

    @property
    def density_decides(self) -> bool:
        """Whether the density varies and the mass doesn't: the scene's mass is then ignored, since it would take
        precedence.
        """
        varied = {v.target.parameter for v in self.vary}
        return "density" in varied and "mass" not in varied

    @property
    def grids(self) -> list[int]:
        """Number of levels of each grid, then of the lists, if any."""
        given = [v.form for v in self.vary if isinstance(v.form, Levels)]
        sizes = [len(form.values) for form in given if form.kind == GRID]
        return sizes + [len(form.values) for form in given if form.kind == LIST][:1]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return math.prod(self.grids) * self.samples

    def columns(self, rows: IntArray) -> list[NDArray[Any]]:
        """The varied values of rows (n,), one array for each of ``vary``: numbers (n,) or (n, k), or objects (n,)."""
        points = self._points(rows)
        dimensions = sum(v.form.uniforms for v in self.vary if isinstance(v.form, Draw))
        drawn = row_uniforms(self.seed, rows, dimensions) if dimensions else np.empty((len(rows), 0))
        found, at = [], 0
        for vary, index in zip(self.vary, points, strict=True):
            if isinstance(vary.form, Draw):
                found.append(vary.form.shaped(drawn[:, at : at + vary.form.uniforms]))
                at += vary.form.uniforms
            else:
                found.append(vary.form.array[index])
        return found

    def _points(self, rows: IntArray) -> list[IntArray | None]:
        """For each of ``vary``, the index of each row in its grid or list; None for a random one."""
        rest = rows // self.samples
        digits: list[IntArray] = []
        for size in reversed(self.grids):
            digits.append(rest % size)
            rest = rest // size
        digits.reverse()
        found: list[IntArray | None] = []
        at = 0
        for vary in self.vary:
            if vary.form.kind == GRID:
                found.append(digits[at])
                at += 1
            else:
                found.append(digits[-1] if vary.form.kind == LIST else None)
        return found

    def variation(self, row: int) -> Variation:
        """The variation of a row."""
        return self.applied([column[0] for column in self.columns(np.array([row], np.int64))])

    def applied(self, chosen: list[Any]) -> Variation:
        """The variation with these varied values."""
        changes: dict[str, Value] = {}
        values, entries = ChainMap(changes, self.parameters.named()), copy.deepcopy(self.script)
        if self.density_decides:
            values["mass"] = 0.0
        pairs = list(zip(self.vary, chosen, strict=True))
        for vary, value in pairs:
            if not vary.is_random_vertex:
                vary.target.put(values, entries, plain(value))
        parameters = self.parameters.replaced(changes)
        for vary, value in pairs:
            if vary.is_random_vertex:
                vary.target.put(values, entries, {"vertex": vertex_number(value, self.meshes.of(parameters))})
        return Variation(parameters, entries, self.meshes)

    @cached_property
    def contents(self) -> dict[str, Mesh | MeshError]:
        """The initial meshes of rows and references by name, or the error of one that can't be read, which fails its
        rows.
        """
        named = [self.parameters.mesh, (self.reference or {}).get("mesh", "")]
        for vary in self.vary:
            if vary.target.parameter == "mesh" and isinstance(vary.form, Levels):
                named += vary.form.values
        found: dict[str, Mesh | MeshError] = {}
        for name in filter(None, map(str, named)):
            try:
                found[name] = load_mesh(name)
            except MeshError as error:
                found[name] = error
        return found

    @cached_property
    def fingerprint(self) -> str:
        """Hash of everything that determines the rows: studies with equal hashes have the same rows, bit for bit."""
        measures = self.measures
        given = (
            *(sorted(self.parameters.named().items()), self.script, self.duration_ns, self.seed, self.samples),
            *([(vary.target.name, vary.form) for vary in self.vary], self.reference),
            *(measures.columns, measures.table.tolist(), measures.sample_ns.tolist()),
            {name: mesh.sha256 if isinstance(mesh, Mesh) else str(mesh) for name, mesh in self.contents.items()},
            *(MOTION, stamp()),
        )
        return hashlib.sha256(repr(given).encode()).hexdigest()


def vertex_number(uniform: float, body_mesh: BodyMesh | None) -> int:
    """Index of the vertex that a uniform number in [0, 1) selects. 0 without a mesh, which the command then refuses."""
    return int(uniform * len(body_mesh.surface.vertices)) if body_mesh else 0


def study_file(name: str) -> Path:
    """Path of a study given by path or bundled name. Raises InputError."""
    path = Path(name)
    if not path.is_file() and "/" not in name and name.removesuffix(".yaml") in study_names():
        return study_path(name.removesuffix(".yaml"))
    if not path.is_file():
        hint = did_you_mean(path.stem, study_names())
        known = f"the bundled studies are {', '.join(study_names()) or 'none'}"
        raise InputError(
            "study", f"there is no file and no bundled study {name!r}; {' '.join(filter(None, [hint, known]))}"
        )
    return path


def _yaml(path: Path) -> Any:
    return load_yaml(read_text(path, "a YAML file"), str(path))


def read_study(name: str) -> Study:
    """Read and check a study file, by path or bundled name. Raises InputError, which names the field."""
    path = study_file(name)
    return make_study(_yaml(path), str(path), path.parent)


def make_study(spec: Any, name: str = "study", folder: Path = Path()) -> Study:
    """Make a study of parsed YAML. folder: where scene and script are searched first. Raises InputError."""
    spec = mapping(spec, name, _KEYS, ("scene", "duration", "vary"))
    scene = str(spec["scene"])
    beside = folder / scene
    path = beside if beside.is_file() else scene_file(scene)
    own = convert_all(_settings(spec.get("set"), f"{name}, set"))
    base = make_scenario({**scene_values(path, lambda _text: None), **with_mass_of_density(own)})
    script = _script(spec.get("script"), folder, f"{name}, script")
    duration_s = number(spec["duration"], f"{name}, duration", 1e-9, 1e9)
    seed = whole(spec.get("seed", 0), f"{name}, seed", 0, 1 << 128)
    watch = number(spec.get("watch", 50.0), f"{name}, watch", 1e-6, 1e6)
    measures = read_measures(spec.get("measure"), watch, duration_s, f"{name}, measure")
    vary = _vary(spec["vary"], name, base.parameters, script)
    reference = _reference(spec.get("reference"), f"{name}, reference")
    if measures.needs_finer:
        if reference is not None:
            raise InputError(f"{name}, measure.sensitivity", "with a reference", "a study without one")
        reference = _finer(base, vary, script, f"{name}, measure.sensitivity")
    if measures.needs_reference and reference is None:
        raise InputError(f"{name}, reference", None, "parameters of a reference, since a difference is measured")
    samples = _samples(spec.get("samples"), f"{name}, samples", vary)
    study = Study(name, base.parameters, script, nanoseconds(duration_s), seed, samples, vary, reference, measures)
    if study.rows > MAX_ROWS:
        raise InputError(f"{name}, samples", f"{study.rows} rows in all", f"at most {MAX_ROWS}")
    # The scene itself and its reference must start with the script. Later errors belong to single rows.
    commands = expand_script(script, "script")
    OfflineRun(base, commands)
    if reference is not None:
        OfflineRun(base.with_changes(reference), commands)
    return study


def _settings(spec: Any, field: str) -> dict[str, Any]:
    if spec is None:
        return {}
    if not isinstance(spec, dict):
        raise InputError(field, spec, "{parameter: value, ...}")
    found: dict[str, Any] = {}
    for key, value in spec.items():
        if isinstance(value, dict):
            found.update(_settings({f"{key}.{k}": v for k, v in value.items()}, field))
            continue
        try:
            found[str(key)] = parameter_named(str(key)).convert(value)
        except InputError as error:
            raise InputError(f"{field}.{key}", error.received, error.accepted) from None
    return found


def _script(spec: Any, folder: Path, field: str) -> list[Any]:
    if spec is None:
        return []
    if isinstance(spec, str):
        beside = folder / spec
        if not beside.is_file() and spec.removesuffix(".yaml") in example_names():
            beside = example_path(spec.removesuffix(".yaml"))
        if not beside.is_file():
            raise InputError(field, spec, f"a script file, or one of the bundled {', '.join(example_names())}")
        field, spec = str(beside), _yaml(beside)
    expand_script(spec, field)
    return list(spec or [])


def _vary(spec: Any, name: str, parameters: Parameters, entries: list[Any]) -> tuple[Vary, ...]:
    if not isinstance(spec, dict) or not spec:
        raise InputError(f"{name}, vary", spec, "{name: how, ...} with at least one entry")
    found = []
    values = parameters.named()
    for key, how in spec.items():
        field = f"{name}, vary.{key}"
        target = read_target(str(key), f"{name}, vary", values, entries)
        form = read_form(how, field)
        if target.is_vertex and isinstance(form, Draw):
            whole_point = target.name.removesuffix(".vertex")
            raise InputError(field, how, f"a grid or list of whole numbers, or {whole_point}: random_vertex")
        # Numbers need no conversion, and there may be a million of them.
        if target.parameter and isinstance(form, Levels) and not {type(v) for v in form.values} <= {int, float}:
            given = [_checked(target, value, field, values, entries) for value in form.values]
            form = replace(form, values=tuple(_of_one_length(given)))
        else:
            for probe in form.probes:
                _checked(target, probe, field, values, entries)
        found.append(Vary(target, form))
    for vector, part in permutations(map(str, spec), 2):
        if part.startswith(f"{vector}."):
            raise InputError(f"{name}, vary", f"{vector} and {part}", "one of them: each replaces the other")
    lengths = {len(v.form.values) for v in found if isinstance(v.form, Levels) and v.form.kind == LIST}
    if len(lengths) > 1:
        raise InputError(f"{name}, vary", sorted(lengths), "lists of the same length; they advance together")
    return tuple(found)


def _of_one_length(given: list[Any]) -> list[Any]:
    """The values of a parameter with all vectors of one length: a vector of one number stands for equal components. If
    every vector has one number, the numbers themselves.
    """
    longest = max((len(value) for value in given if isinstance(value, list)), default=0)
    if longest == 1:
        return [value[0] for value in given]
    return [value * longest if isinstance(value, list) and len(value) == 1 else value for value in given]


def _checked(target: Target, value: Any, field: str, values: Mapping[str, Value], entries: list[Any]) -> Any:
    """Check a value by putting it into its place. Returns a parameter's value as converted. Raises InputError."""
    changed: dict[str, Value] = {target.parameter: values[target.parameter]} if target.parameter else {}
    copied = copy.deepcopy(entries) if target.entry else []
    try:
        target.put(changed, copied, value)
        if target.entry:
            expand_script(copied, "script")
    except InputError as error:
        where = f"{field} ({error.field})" if target.entry else field
        raise InputError(where, error.received, error.accepted) from None
    except (TypeError, AttributeError, IndexError, KeyError):
        raise InputError(field, value, f"a value that fits {target.name}") from None
    whole: Any = changed.get(target.parameter)
    return whole[target.path[0]] if target.parameter and target.path else whole


def _reference(spec: Any, field: str) -> dict[str, Any] | None:
    if spec is None:
        return None
    changes = _settings(spec, field)
    if not changes:
        raise InputError(field, spec, "{parameter: value, ...}, at least one")
    for parameter in changes:
        if parameter == "record" or parameter_named(parameter).changes == READ_ONLY:
            raise InputError(f"{field}.{parameter}", changes[parameter], "a parameter that changes the motion")
    return changes


def _finer(base: Scenario, vary: tuple[Vary, ...], entries: list[Any], field: str) -> Mapping[str, Value]:
    """The reference of a sensitivity; the same for all rows."""
    of_accuracy = {"accuracy", "step", "integrator"}
    changed = {v.target.parameter for v in vary} | {v.target.path[-1] for v in vary if v.target.entry}
    for entry in entries:
        changed |= set(entry.get("set", {}))
    if found := sorted(map(str, of_accuracy & changed)):
        raise InputError(field, f"with {found[0]} varied or set", "a study in which accuracy, step and integrator stay")
    return finer_values(base.parameters, base.setup.integrator.order)


def _samples(spec: Any, field: str, vary: tuple[Vary, ...]) -> int:
    if all(isinstance(v.form, Levels) for v in vary):
        if spec not in (None, 1):
            raise InputError(field, spec, "no samples: nothing in the study is random")
        return 1
    if spec is None and all(isinstance(v.form, Draw) for v in vary):
        raise InputError(field, None, "how many rows to draw")
    return whole(1 if spec is None else spec, field, 1, MAX_ROWS)
