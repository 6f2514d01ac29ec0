# SPDX-License-Identifier: MIT
"""Rows of a study as arrays for the compiled batch, filled by columns: rows that differ in numbers alone, of parameters
and of pokes and wrenches in the script.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import MeshError
from ..motion.integrators import check_supported
from ..motion.integrators.integrator import ANGULAR_DAMPING
from ..motion.loads import FORCE, TORQUE
from ..scene.declaration import HUGE, Value
from ..scene.parameters import Parameters, parameter_named, with_mass_of_density
from ..scene.scenario import BodyMesh, build_scenario
from ..scene.script import MAX_TIME_S, expand_script
from ..simulation import batch
from ..simulation import flight as fl
from ..simulation.checks import check_command, check_start
from ..simulation.commands import ClearWrench, Pending, WrenchCommand
from ..simulation.setup import Setup
from .sampling import VERTEX, Draw
from .study import Study, Vary
from .targets import Target
from .variation import apply, body_mesh_of

_LOADS = {"force": FORCE, "impulse": FORCE, "push": FORCE, "torque": TORQUE, "angular_impulse": TORQUE}
"""Where the numbers of a script's entry stand in its load."""

_BOUNDS = {"at_ns": (0.0, MAX_TIME_S), "duration_ns": (1e-9, MAX_TIME_S), "load": (-HUGE, HUGE)}
"""Of numbers written into a table of commands [s, N, N m], by its fields."""


class NotBatchable(Exception):
    """The compiled batch can't fly the rows of a study; the simulation can."""


def _field_of(parameter: str) -> str:
    return parameter.replace(".", "_")


def batch_row(parameters: Parameters, body_mesh: BodyMesh | None) -> NDArray[np.void]:
    """The row (1,) batch.ROW of parameters; raises InputError."""
    row = np.zeros(1, batch.ROW)
    for name, value in parameters.named().items():
        if _field_of(name) in batch.PARAMETERS:
            row[_field_of(name)] = value
    if body_mesh is not None:
        row["has_surface"], row["extent"] = True, body_mesh.surface.extent
    if parameters.inertia_model == "explicit" or body_mesh is None:
        row["model"] = batch.EXPLICIT
        return row
    moments = body_mesh.moments.moments(parameters.inertia_model)
    try:
        row["solid_measure"] = body_mesh.moments.moments("solid").measure
    except MeshError:
        row["solid_measure"] = np.nan
    row["model"] = batch.SHELL if parameters.inertia_model == "shell" else batch.ORDINARY
    places = moments if parameters.inertia_model_com == "model" else body_mesh.moments.moments("solid")
    row["measure"], row["second"] = moments.measure, moments.second
    row["reference"], row["center"], row["center_low"] = places.reference, places.center, places.center_low
    return row


class Columns:
    """Makes batches of a study, or of the flights that it compares with when there is a ``reference``: parameters that
    those have otherwise. Raises NotBatchable or InputError where the simulation must fly the rows.
    """

    def __init__(self, study: Study, reference: dict[str, Value] | None) -> None:
        self._study, self._reference = study, with_mass_of_density(reference or {})
        for vary in study.vary:
            is_vertex = isinstance(vary.form, Draw) and vary.form.shape == VERTEX
            if is_vertex or (vary.target.parameter and _field_of(vary.target.parameter) not in batch.NUMBERS):
                raise NotBatchable
        typical = apply(study, [vary.form.probes[-1] for vary in study.vary])
        parameters = study.parameters.replaced({"mass": 0.0} if study.density_decides else {})
        parameters = parameters.replaced(self._reference)
        body_mesh = body_mesh_of(parameters)
        self._setup = setup = build_scenario(parameters, body_mesh).setup
        check_start(setup)
        if any(v.target.parameter == "angular_damping" for v in study.vary):
            check_supported(setup.integrator, frozenset({ANGULAR_DAMPING}))
        if setup.string.attached and setup.initial_string_mass:
            raise NotBatchable
        self._row = batch_row(parameters, body_mesh)
        self._ballast = np.array([m for m in parameters.point_masses if m[0] > 0.0], dtype=float).reshape(-1, 4)
        self._table, entries = _commands_of(typical.script, setup)
        self._written = [_place_of(v, typical.script, entries) if v.target.entry else None for v in study.vary]
        if any(self._written) and not setup.integrator.supports_loads:
            raise NotBatchable

    def batch(self, columns: list[np.ndarray], count: int) -> tuple[batch.Batch, NDArray[np.bool_]]:
        """``count`` rows with these values of what varies, and which of them the batch may check (n,)."""
        good = np.ones(count, bool)
        rows = np.repeat(self._row, count)
        commands = np.repeat(self._table[None], count if any(self._written) else 1, axis=0)
        for vary, column, place in zip(self._study.vary, columns, self._written, strict=True):
            if place is not None:
                _write(commands, place, column, good)
            elif vary.target.parameter not in self._reference:
                declared = parameter_named(vary.target.parameter)
                _keep(good, column > declared.lower if declared.above else column >= declared.lower)
                _keep(good, column <= declared.upper)
                own = rows[_field_of(declared.name)]
                if vary.target.path:
                    own[:, vary.target.path[0]] = column
                else:
                    own[:] = column[:, None] if own.ndim > column.ndim else column
        # Stable: equal times act in the order of the script.
        order = np.argsort(commands["at_ns"], axis=1, kind="stable")
        return batch.Batch(rows, self._ballast, self._setup, np.take_along_axis(commands, order, axis=1)), good


def _commands_of(script: list[Any], setup: Setup) -> tuple[NDArray[np.void], list[int]]:
    """A table (c,) LOAD_ROW of the script's pokes and wrenches in its own order, and the entries (c,) they are of."""
    commands = sorted(expand_script(script, "script"), key=lambda command: command.entry)
    table = np.zeros(len(commands), fl.LOAD_ROW)
    for row, command in zip(table, commands, strict=True):
        if not isinstance(command, WrenchCommand | ClearWrench):
            raise NotBatchable
        pending = Pending(command.stamp_ns, command)
        if isinstance(command, WrenchCommand):
            load = check_command(command, setup)
            if not load:
                raise NotBatchable  # a ray
            pending.set_load(command, load, setup)
            row["load"] = np.frombuffer(load)
        row["at_ns"], row["duration_ns"] = pending.time_ns, pending.duration_ns
        row["kind"], row["slot"] = pending.kind, pending.slot
    return table, [command.entry for command in commands]


Place = tuple[int, str, slice | int]
"""Row of a table of commands, its field, and which numbers of that."""


def _place_of(vary: Vary, script: list[Any], entries: list[int]) -> Place:
    """Where the numbers of what varies in the script stand in its table of commands."""
    target: Target = vary.target
    is_number = isinstance(vary.form, Draw) or vary.form.taken(np.zeros(1, np.int64)).dtype == np.float64
    if entries.count(target.entry) != 1 or "jitter" in script[target.entry - 1] or not is_number:
        raise NotBatchable
    name, *component = target.path[1:] if target.path[0] == "wrench" else target.path
    row = entries.index(target.entry)
    if name in ("t", "duration"):
        return row, "at_ns" if name == "t" else "duration_ns", 0
    if name not in _LOADS:
        raise NotBatchable
    first = _LOADS[name]
    if name == "push":
        return row, "load", first
    return row, "load", first + component[0] if component else slice(first, first + 3)


def _write(commands: NDArray[np.void], place: Place, column: np.ndarray, good: NDArray[np.bool_]) -> None:
    row, name, where = place
    lower, upper = _BOUNDS[name]
    within = (column >= lower) & (column <= upper)
    _keep(good, within)
    values = np.where(within, column, 0.0)
    if name == "load":
        commands[name][:, row, where] = values
    else:
        # To the nearest nanosecond, halves to even, as round() has it.
        commands[name][:, row] = np.rint(values * 1e9)


def _keep(good: NDArray[np.bool_], within: NDArray[np.bool_]) -> None:
    """Only rows whose numbers (n,) or (n, k) are within bounds are good any more."""
    good &= within if within.ndim == 1 else within.all(axis=1)
