# SPDX-License-Identifier: MIT
"""Fly and measure a range of a study's rows: the work of one thread of a sweep.

Rows that differ only in numbers of parameters and of the script's pokes and wrenches go through the compiled batch
together, filled by columns. Rows that the batch can't fly or check are flown one by one with ``Simulation``. Both give
the same bits; ``Simulation`` is the definition of a row.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.files import output_file
from ..base.vectors import BoolArray, FloatArray, IntArray, Records
from ..base.yaml_text import plain
from ..motion.loads import FORCE, TORQUE
from ..parameters.declarations import HUGE, Value, parameter_named, with_mass_of_density
from ..scene.scenario import Scenario, build_scenario
from ..scene.scenario_run import OfflineRun
from ..scene.script import MAX_TIME_S, expand_script, script_text
from ..simulation import batch
from ..simulation import flight as fl
from ..simulation.commands import ClearWrench, Command, Pending, WrenchCommand, row_of
from ..simulation.quantities import CONTEXT, STATE, begin_context, measure_flight
from ..simulation.record import SCENE, SCENE_PARAMETERS, field_of
from ..simulation.setup import Setup, check_command
from ..simulation.simulation import Simulation
from .sampling import Draw, as_text
from .study import Study, Variation, Vary, vertex_number
from .targets import Target

_LOADS = {"force": FORCE, "impulse": FORCE, "push": FORCE, "torque": TORQUE, "angular_impulse": TORQUE}
"""Index of an entry's numbers in its load, by key."""

_BOUNDS = {"at_ns": (0.0, MAX_TIME_S), "duration_ns": (1e-9, MAX_TIME_S), "load": (-HUGE, HUGE)}
"""Bounds of numbers in a table of commands [s, s, N or N m], by field."""


class NotBatchable(Exception):
    """The compiled batch can't fly the rows of a study; ``Simulation`` can."""


def _is_number_of_scene(parameter: str) -> bool:
    """Whether a parameter is a number in a scene's record."""
    return parameter in SCENE_PARAMETERS and parameter_named(parameter).type in ("double", "doubles")


class BatchMaker:
    """Makes batches of a study's rows, or of their references. reference: parameters that differ in a reference flight;
    None for the rows themselves. Raises NotBatchable or InputError if ``Simulation`` must fly the rows.
    """

    def __init__(self, study: Study, reference: dict[str, Value] | None) -> None:
        self._study, self._reference = study, with_mass_of_density(reference or {})
        for vary in study.vary:
            parameter = vary.target.parameter
            if vary.is_random_vertex or (parameter and not _is_number_of_scene(parameter)):
                raise NotBatchable
        typical = study.applied([vary.form.probes[-1] for vary in study.vary])
        parameters = study.parameters.replaced({"mass": 0.0} if study.density_decides else {})
        parameters = parameters.replaced(self._reference)
        self._setup = setup = build_scenario(parameters, study.meshes.of(parameters)).setup
        self._table, entries = _commands_of(typical.script, setup)
        self._places = [_place_of(v, typical.script, entries) if v.target.entry else None for v in study.vary]
        if any(self._places) and not setup.integrator.supports_loads:
            raise NotBatchable

    def batch(self, columns: list[NDArray[Any]], count: int) -> tuple[batch.Batch, BoolArray]:
        """A batch of ``count`` rows with these varied values, and which rows (n,) the batch may fly: those with numbers
        within bounds.
        """
        good = np.ones(count, bool)
        rows = np.repeat(np.array([self._setup.scene], SCENE), count)
        commands = np.repeat(self._table[None], count if any(self._places) else 1, axis=0)
        for vary, column, place in zip(self._study.vary, columns, self._places, strict=True):
            if place is not None:
                _write(commands, place, column, good)
            elif vary.target.parameter not in self._reference:
                own = rows[field_of(vary.target.parameter)]
                if vary.target.path:
                    own[:, vary.target.path[0]] = column
                else:
                    own[:] = column[:, None] if own.ndim > column.ndim else column
        # A stable sort: commands at equal times act in the order of the script.
        order = np.argsort(commands["at_ns"], axis=1, kind="stable")
        return batch.Batch(rows, self._setup.mesh, np.take_along_axis(commands, order, axis=1)), good


def _commands_of(script: list[Any], setup: Setup) -> tuple[Records, list[int]]:
    """A table (c,) LOAD_ROW of the script's pokes and wrenches in the order of entries, and the entry numbers (c,)."""
    commands = sorted(expand_script(script, "script"), key=lambda command: command.entry)
    table = np.zeros(len(commands), fl.LOAD_ROW)
    for row, command in zip(table, commands, strict=True):
        if not isinstance(command, WrenchCommand | ClearWrench):
            raise NotBatchable
        pending = Pending(command.stamp_ns, command)
        if isinstance(command, WrenchCommand):
            if command.frame.point[0] == "ray":
                raise NotBatchable
            pending.row = check_command(command, setup)
            row["load"] = np.frombuffer(pending.row)
        row["at_ns"], row["duration_ns"], row["kind"], row["slot"], _ = row_of(pending)
    return table, [command.entry for command in commands]


Place = tuple[int, str, slice | int]
"""Row of a table of commands, field of the row, and indices in the field."""


def _place_of(vary: Vary, script: list[Any], entries: list[int]) -> Place:
    """Place of a varied number of the script in its table of commands."""
    target: Target = vary.target
    is_number = isinstance(vary.form, Draw) or vary.form.array.dtype == np.float64
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


def _write(commands: Records, place: Place, column: FloatArray, good: BoolArray) -> None:
    row, name, where = place
    lower, upper = _BOUNDS[name]
    within = (column >= lower) & (column <= upper)
    _restrict(good, within)
    values = np.where(within, column, 0.0)
    if name == "load":
        commands[name][:, row, where] = values
    else:
        # Rounded to the nearest nanosecond, ties to even, as round() does.
        commands[name][:, row] = np.rint(values * 1e9)


def _restrict(good: BoolArray, within: BoolArray) -> None:
    """Clear ``good`` for rows with numbers (n,) or (n, k) out of bounds."""
    good &= within if within.ndim == 1 else within.all(axis=1)


class FailedFlight(Exception):
    """A row has no result; the message says why."""


_ROW_ERRORS = (InputError, TypeError, AttributeError, KeyError, IndexError)
"""Exceptions for values that don't fit the scene or its script together."""


@dataclass
class Chunk:
    """Columns of a table by name: float64, int64, or objects (text or None). simulated: number of rows flown with
    ``Simulation``.
    """

    columns: dict[str, NDArray[Any]]
    simulated: int

    def __len__(self) -> int:
        return len(self.columns["row"])


@lru_cache(maxsize=16)
def _batch_makers(study: Study) -> list[BatchMaker]:
    """Makers of batches for the study's rows and, if it has a reference, for the references. Empty if ``Simulation``
    must fly the rows.
    """
    try:
        references = [] if study.reference is None else [BatchMaker(study, dict(study.reference))]
        return [BatchMaker(study, None), *references]
    except (NotBatchable, *_ROW_ERRORS):
        return []


def run_chunk(study: Study, first: int, last: int) -> Chunk:
    """Fly rows first to last − 1. A row that fails has the reason in its ``failure``."""
    rows, measures = np.arange(first, last, dtype=np.int64), study.measures
    columns = study.columns(rows)
    results = batch.new_results(len(rows), len(measures.table))
    if sides := _batch_makers(study):
        (own, good), *beside = [side.batch(columns, len(rows)) for side in sides]
        references = beside[0][0] if beside else None
        results = batch.fly_rows(own, references, measures.sample_ns, measures.table)
        results.status[~np.logical_and.reduce([good, *(also for _, also in beside)])] = 0
    left = np.flatnonzero(results.status == 0).tolist()
    failures = np.full(len(rows), None, dtype=object)
    for i in left:
        results.measured[i] = np.nan
        try:
            simulate_row(study, study.applied([column[i] for column in columns]), i, results)
        except (FailedFlight, *_ROW_ERRORS) as error:
            failures[i] = " ".join(str(error).split())
    return Chunk(_table(study, rows, columns, results, failures), len(left))


def row_summary(study: Study, row: int) -> dict[str, Any]:
    """A row of the table by column, as JSON values."""
    columns = run_chunk(study, row, row + 1).columns
    found: dict[str, Any] = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def simulate_row(study: Study, row: Variation, i: int, results: batch.Results) -> None:
    """Fly a row with ``Simulation``, and its reference if the study has one, and measure it into row i of results.
    Raises FailedFlight, InputError.
    """
    measures = study.measures
    states, others = (np.zeros((len(measures.sample_ns), STATE)) for _ in range(2))
    context, scenario, commands = np.zeros(CONTEXT), row.scenario, row.commands
    if study.reference is not None:
        try:
            _simulate(scenario.with_changes(study.reference), commands, measures.sample_ns, others, context)
        except FailedFlight as failed:
            raise FailedFlight(f"reference: {failed}") from None
    simulation = _simulate(scenario, commands, measures.sample_ns, states, context)
    results.floors[i] = simulation.floors
    measure_flight(measures.table, states, others, measures.sample_ns, context, results.measured[i])
    results.status[i] = 1


def _simulate(
    scenario: Scenario, commands: list[Command], sample_ns: IntArray, states: FloatArray, context: FloatArray
) -> Simulation:
    """Fill ``states`` at the sample times, and the context. Returns the simulation at the last of them."""
    simulation = OfflineRun(scenario, commands).simulation
    simulation.fill_state(states[0])
    begin_context(states[0], context)
    for state, time_ns in zip(states, sample_ns.tolist(), strict=True):
        simulation.advance(time_ns)
        if simulation.failure:
            raise FailedFlight(simulation.failure)
        simulation.fill_state(state)
    if simulation.refused:
        # A row with refused commands is not the flight that was asked for.
        refused = simulation.refused.items()
        texts = (f"commands refused: {count}, {reason}: {simulation.refusals[reason]}" for reason, count in refused)
        raise FailedFlight("; ".join(texts))
    return simulation


def _table(
    study: Study, rows: IntArray, columns: list[NDArray[Any]], results: batch.Results, failures: NDArray[np.object_]
) -> dict[str, NDArray[Any]]:
    table: dict[str, NDArray[Any]] = {"row": rows}
    for vary, column in zip(study.vary, columns, strict=True):
        if vary.is_random_vertex:
            table[f"{vary.target.name}.vertex"] = _vertices(study, columns, column)
        elif column.ndim == 2:
            names = vary.target.component_names(column.shape[1])
            table.update({name: column[:, k] for k, name in enumerate(names)})
        else:
            table[vary.target.name] = _as_objects(column) if column.dtype == object else column
    failed = results.status == 0
    table["time"] = np.where(failed, np.nan, study.duration_ns * 1e-9)
    for k, name in enumerate(study.measures.columns):
        table[name] = np.where(failed, np.nan, results.measured[:, k])
    floors = np.full(len(rows), None, dtype=object)
    for i in np.flatnonzero(results.floors.any(axis=1) & ~failed).tolist():
        floors[i] = fl.floor_text(results.floors[i])
    table["accuracy_floor"] = floors
    table["failure"] = failures
    return table


def _as_objects(column: NDArray[np.object_]) -> NDArray[np.object_]:
    text = np.empty(len(column), dtype=object)
    text[:] = [as_text(plain(value)) for value in column]
    return text


def _vertices(study: Study, columns: list[NDArray[Any]], uniforms: FloatArray) -> IntArray:
    """Vertex indices (n,) that uniform numbers (n,) select on each row's mesh; −1 where the mesh can't be read."""
    numbers = np.full(len(uniforms), -1)
    of_mesh = {v.target.name: c for v, c in zip(study.vary, columns, strict=True) if v.target.name.startswith("mesh")}
    for i, uniform in enumerate(uniforms):
        try:
            body_mesh = study.meshes.of(study.parameters.replaced({name: c[i] for name, c in of_mesh.items()}))
        except InputError:
            continue
        numbers[i] = vertex_number(uniform, body_mesh)
    return numbers


def write_scene(study: Study, row: int, file: Path) -> dict[str, Any]:
    """Write a row as a scene, and its script beside it as NAME_script.yaml. Returns the file and the command that flies
    it.
    """
    variation = study.variation(row)
    scenario, commands = variation.scenario, variation.commands
    output_file("--as-scene", file)
    try:
        file.write_text(scenario.text, encoding="utf-8")
        words = ["rigid_proto", "simulate", str(file), "--duration", repr(study.duration_ns / 1e9)]
        if commands:
            script = file.with_name(f"{file.stem}_script.yaml")
            script.write_text(script_text(variation.script), encoding="utf-8")
            words += ["--script", str(script)]
    except OSError as error:
        raise InputError("--as-scene", str(file), f"a file that can be written ({error.strerror})") from None
    return {"scene": str(file), "fly": shlex.join(words)}
