# SPDX-License-Identifier: MIT
"""Some rows of a study, flown and measured: what a thread of a sweep does.

Rows that differ in numbers alone go through the compiled batch together. Those that it can't fly or check are flown
one by one by ``Simulation``, which is what a row is by definition, with the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..scene.offline import OfflineRun
from ..scene.scenario import Scenario
from ..simulation.batch import Results, fly_rows, new_results
from ..simulation.observables import floor_text
from ..simulation.quantities import CONTEXT, STATE, begin, first_satisfied, measure_flight
from ..simulation.simulation import Simulation
from .columns import Columns, NotBatchable
from .sampling import VERTEX, Draw, as_text
from .study import Study
from .variation import Variation, apply, body_mesh_of, plain, vertex_number


class FailedFlight(Exception):
    """Why a row has no result."""


_NO_ROW = (InputError, TypeError, AttributeError, KeyError, IndexError)
"""Raised where values don't fit the scene or its script together."""


@dataclass
class Chunk:
    """Columns of a table by name: float64, int64, or objects (text or None). simulated: how many rows the
    simulation flew.
    """

    columns: dict[str, np.ndarray]
    simulated: int

    def __len__(self) -> int:
        return len(self.columns["row"])


@lru_cache(maxsize=16)
def _sides(study: Study) -> list[Columns]:
    """What makes batches of the study's rows, and then of their references if it has any; none where the simulation
    must fly them.
    """
    try:
        references = [] if study.reference is None else [Columns(study, dict(study.reference))]
        return [Columns(study, None), *references]
    except (NotBatchable, *_NO_ROW):
        return []


def run_chunk(study: Study, first: int, last: int) -> Chunk:
    """Rows first to last − 1; a row that fails is a row with its reason."""
    rows, measures = np.arange(first, last, dtype=np.int64), study.measures
    columns = study.columns(rows)
    results = new_results(len(rows), len(measures.table))
    if sides := _sides(study):
        (batch, good), *beside = [side.batch(columns, len(rows)) for side in sides]
        references = beside[0][0] if beside else None
        results = fly_rows(batch, references, measures.sample_ns, measures.watched, measures.stops, measures.table)
        results.status[~np.logical_and.reduce([good, *(also for _, also in beside)])] = 0
    left = np.flatnonzero(results.status == 0).tolist()
    failures = np.full(len(rows), None, dtype=object)
    for i in left:
        results.measured[i], results.stop[i] = np.nan, -1
        try:
            simulate_row(study, apply(study, [column[i] for column in columns]), i, results)
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


def simulate_row(study: Study, row: Variation, i: int, results: Results) -> None:
    """The row's flight by ``Simulation``, beside its reference if the study has one, into results i; raises
    FailedFlight, InputError.
    """
    measures = study.measures
    states, others = (np.zeros((len(measures.sample_ns), STATE)) for _ in range(2))
    context, scenario = np.zeros(CONTEXT), row.scenario
    if study.reference is not None:
        reference = scenario.with_changes(study.reference)
        _simulate(reference, row, study, others, context, measures.stops[:0], "reference: ")
    simulation, reached, stop = _simulate(scenario, row, study, states, context, measures.stops)
    results.stop[i], results.end_ns[i] = stop, measures.sample_ns[reached - 1]
    results.floors[i] = simulation.floors
    measure_flight(
        measures.table, states, others, measures.sample_ns, measures.watched, reached, context, results.measured[i]
    )
    results.status[i] = 1


def _simulate(
    scenario: Scenario,
    row: Variation,
    study: Study,
    states: np.ndarray,
    context: np.ndarray,
    stops: np.ndarray,
    whose: str = "",
) -> tuple[Simulation, int, int]:
    """Fill ``states`` at the sample times, and the context; how many were reached, and which stop held or −1."""
    simulation, sample_ns = OfflineRun(scenario, row.commands).simulation, study.measures.sample_ns
    body = simulation.setup.body
    begin(body.mass, body.inertia.ravel(), simulation.setup.gravity, _state(simulation), context)
    reached, stop = 0, -1
    while reached < len(sample_ns) and stop < 0:
        simulation.advance(int(sample_ns[reached]))
        if simulation.failure:
            raise FailedFlight(whose + simulation.failure)
        states[reached] = _state(simulation)
        stop = first_satisfied(stops, states[reached], context)
        reached += 1
    if simulation.refused:
        # A row whose commands were refused in flight isn't the row that was asked for.
        counts = (f"{count} commands refused: {reason}" for reason, count in simulation.refused.items())
        raise FailedFlight(whose + "; ".join(counts))
    return simulation, reached, stop


def _state(simulation: Simulation) -> np.ndarray:
    """State row and the string's energy (STATE,)."""
    string = simulation.string
    energy = string.potential_energy(simulation.setup.body, simulation.state) if string else 0.0
    return np.array([*simulation.state.row, energy])


def _table(
    study: Study, rows: np.ndarray, columns: list[np.ndarray], results: Results, failures: np.ndarray
) -> dict[str, np.ndarray]:
    table: dict[str, np.ndarray] = {"row": rows}
    for vary, column in zip(study.vary, columns, strict=True):
        if isinstance(vary.form, Draw) and vary.form.shape == VERTEX:
            table[f"{vary.target.name}.vertex"] = _vertices(study, columns, column)
        elif column.ndim == 2:
            names = vary.target.component_names(column.shape[1])
            table.update({name: column[:, k] for k, name in enumerate(names)})
        else:
            table[vary.target.name] = _as_objects(column) if column.dtype == object else column
    failed = results.status == 0
    table["time"] = np.where(failed, np.nan, results.end_ns * 1e-9)
    for k, name in enumerate(study.measures.columns):
        table[name] = np.where(failed, np.nan, results.measured[:, k])
    if study.measures.stop_names:
        names = np.array([*study.measures.stop_names, None], dtype=object)
        table["stopped"] = names[results.stop]
    floors = np.full(len(rows), None, dtype=object)
    for i in np.flatnonzero(results.floors.any(axis=1) & ~failed).tolist():
        floors[i] = floor_text(results.floors[i])
    table["accuracy_floor"] = floors
    table["failure"] = failures
    return table


def _as_objects(column: np.ndarray) -> np.ndarray:
    text = np.empty(len(column), dtype=object)
    text[:] = [as_text(plain(value)) for value in column]
    return text


def _vertices(study: Study, columns: list[np.ndarray], uniforms: np.ndarray) -> np.ndarray:
    """Vertex numbers (n,) that uniform numbers (n,) choose on each row's mesh; −1 where that can't be read."""
    numbers = np.full(len(uniforms), -1)
    of_mesh = {v.target.name: c for v, c in zip(study.vary, columns, strict=True) if v.target.name.startswith("mesh")}
    for i, uniform in enumerate(uniforms):
        try:
            body_mesh = body_mesh_of(study.parameters.replaced({name: c[i] for name, c in of_mesh.items()}))
        except InputError:
            continue
        numbers[i] = vertex_number(uniform, body_mesh)
    return numbers
