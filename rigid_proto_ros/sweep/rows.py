# SPDX-License-Identifier: MIT
"""Some rows of a study, flown and measured: what a thread of a sweep does.

Rows that differ in numbers alone, of parameters and of pokes and wrenches in the script, go through the compiled batch
together, filled by columns. Those that it can't fly or check are flown one by one by ``Simulation``, which is what a
row is by definition, with the same bits.
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
"""Where the numbers of a script's entry stand in its load."""

_BOUNDS = {"at_ns": (0.0, MAX_TIME_S), "duration_ns": (1e-9, MAX_TIME_S), "load": (-HUGE, HUGE)}
"""Of numbers written into a table of commands [s, N, N m], by its fields."""


class NotBatchable(Exception):
    """The compiled batch can't fly the rows of a study; the simulation can."""


def _is_number_of_scene(parameter: str) -> bool:
    """Whether a parameter is one of the numbers in a scene's record."""
    return parameter in SCENE_PARAMETERS and parameter_named(parameter).type in ("double", "doubles")


class BatchMaker:
    """Makes batches of a study's rows, or of the flights that it compares with when there is a ``reference``:
    parameters that those have otherwise. Raises NotBatchable or InputError where the simulation must fly the rows.
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
        self._written = [_place_of(v, typical.script, entries) if v.target.entry else None for v in study.vary]
        if any(self._written) and not setup.integrator.supports_loads:
            raise NotBatchable

    def batch(self, columns: list[NDArray[Any]], count: int) -> tuple[batch.Batch, BoolArray]:
        """``count`` rows with these values of what varies, and which of them the batch may check (n,)."""
        good = np.ones(count, bool)
        rows = np.repeat(np.array([self._setup.scene], SCENE), count)
        commands = np.repeat(self._table[None], count if any(self._written) else 1, axis=0)
        for vary, column, place in zip(self._study.vary, columns, self._written, strict=True):
            if place is not None:
                _write(commands, place, column, good)
            elif vary.target.parameter not in self._reference:
                own = rows[field_of(vary.target.parameter)]
                if vary.target.path:
                    own[:, vary.target.path[0]] = column
                else:
                    own[:] = column[:, None] if own.ndim > column.ndim else column
        # Stable: equal times act in the order of the script.
        order = np.argsort(commands["at_ns"], axis=1, kind="stable")
        return batch.Batch(rows, self._setup.mesh, np.take_along_axis(commands, order, axis=1)), good


def _commands_of(script: list[Any], setup: Setup) -> tuple[Records, list[int]]:
    """A table (c,) LOAD_ROW of the script's pokes and wrenches in its own order, and the entries (c,) they are of."""
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
"""Row of a table of commands, its field, and which numbers of that."""


def _place_of(vary: Vary, script: list[Any], entries: list[int]) -> Place:
    """Where the numbers of what varies in the script stand in its table of commands."""
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
    _keep(good, within)
    values = np.where(within, column, 0.0)
    if name == "load":
        commands[name][:, row, where] = values
    else:
        # To the nearest nanosecond, halves to even, as round() has it.
        commands[name][:, row] = np.rint(values * 1e9)


def _keep(good: BoolArray, within: BoolArray) -> None:
    """Only rows whose numbers (n,) or (n, k) are within bounds are good any more."""
    good &= within if within.ndim == 1 else within.all(axis=1)


class FailedFlight(Exception):
    """Why a row has no result."""


_NO_ROW = (InputError, TypeError, AttributeError, KeyError, IndexError)
"""Raised where values don't fit the scene or its script together."""


@dataclass
class Chunk:
    """Columns of a table by name: float64, int64, or objects (text or None). simulated: how many rows the
    simulation flew.
    """

    columns: dict[str, NDArray[Any]]
    simulated: int

    def __len__(self) -> int:
        return len(self.columns["row"])


@lru_cache(maxsize=16)
def _sides(study: Study) -> list[BatchMaker]:
    """What makes batches of the study's rows, and then of their references if it has any; none where the simulation
    must fly them.
    """
    try:
        references = [] if study.reference is None else [BatchMaker(study, dict(study.reference))]
        return [BatchMaker(study, None), *references]
    except (NotBatchable, *_NO_ROW):
        return []


def run_chunk(study: Study, first: int, last: int) -> Chunk:
    """Rows first to last − 1; a row that fails is a row with its reason."""
    rows, measures = np.arange(first, last, dtype=np.int64), study.measures
    columns = study.columns(rows)
    results = batch.new_results(len(rows), len(measures.table))
    if sides := _sides(study):
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
        except (FailedFlight, *_NO_ROW) as error:
            failures[i] = " ".join(str(error).split())
    return Chunk(_table(study, rows, columns, results, failures), len(left))


def row_summary(study: Study, row: int) -> dict[str, Any]:
    """The row of the table by column, as JSON has it."""
    columns = run_chunk(study, row, row + 1).columns
    found: dict[str, Any] = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def simulate_row(study: Study, row: Variation, i: int, results: batch.Results) -> None:
    """The row's flight by ``Simulation``, beside its reference if the study has one, into results i; raises
    FailedFlight, InputError.
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
    """Fill ``states`` at the sample times, and the context; the simulation at their end."""
    simulation = OfflineRun(scenario, commands).simulation
    simulation.fill_state(states[0])
    begin_context(states[0], context)
    for state, time_ns in zip(states, sample_ns.tolist(), strict=True):
        simulation.advance(time_ns)
        if simulation.failure:
            raise FailedFlight(simulation.failure)
        simulation.fill_state(state)
    if simulation.refused:
        # A row whose commands were refused in flight isn't the row that was asked for.
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
    """Vertex numbers (n,) that uniform numbers (n,) choose on each row's mesh; −1 where that can't be read."""
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
    """Write a row as a scene, its script beside it as NAME_script.yaml; returns the file and the command that flies
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
