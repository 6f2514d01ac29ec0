# SPDX-License-Identifier: MIT
"""Some rows of a study, flown and measured: what a thread or a process of a sweep does.

Rows that differ in numbers alone go through the compiled batch together. Those that it can't fly or check are flown
one by one by ``Simulation``, which is what a row is by definition, with the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..scene.declaration import Value
from ..scene.offline import OfflineRun
from ..scene.scenario import Scenario
from ..simulation.batch import Results, fly_rows, new_results
from ..simulation.observables import floor_text
from ..simulation.quantities import CONTEXT, STATE, begin, first_satisfied, measure_flight
from ..simulation.simulation import Simulation
from .rows import Group, NotBatchable, is_structural
from .sampling import VERTEX, Draw, as_text
from .study import Study
from .variation import Variation, apply, body_mesh_of, parameters_of, plain, vertex_number

GROUPS_KEPT = 512
"""Groups of rows that a process keeps ready."""


class FailedFlight(Exception):
    """Why a row has no result."""


@dataclass
class Chunk:
    """Columns of a table by name: float64, int64, or objects (text or None). simulated: how many rows the
    simulation flew.
    """

    columns: dict[str, np.ndarray]
    simulated: int

    def __len__(self) -> int:
        return len(self.columns["row"])


@dataclass
class _Rows:
    """What became of rows; failures: why there is no result, by place."""

    results: Results
    failures: dict[int, str] = field(default_factory=dict)
    simulated: int = 0


def run_chunk(study: Study, first: int, last: int) -> Chunk:
    """Rows first to last − 1; a row that fails is a row with its reason."""
    rows = np.arange(first, last, dtype=np.int64)
    columns = study.columns(rows)
    flown = _Rows(new_results(len(rows), len(study.measures.table)))
    for key, members in _groups(study, columns, len(rows)):
        _fly_group(study, key, members, columns, flown)
    for i in np.flatnonzero(flown.results.status == 0).tolist():
        _fly_alone(study, i, columns, flown)
    return Chunk(_table(study, rows, columns, flown), flown.simulated)


def row_summary(study: Study, row: int) -> dict[str, Any]:
    """The row of the table by column, as JSON has it."""
    columns = run_chunk(study, row, row + 1).columns
    found: dict[str, Any] = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def is_batchable(study: Study, rows: NDArray[np.int64]) -> bool:
    """Whether the compiled batch can fly any of these rows (n,), many at once."""
    if any(is_structural(v) and isinstance(v.form, Draw) for v in study.vary):
        return False  # a batch for each
    return any(all(_sides(study, key)) for key, _ in _groups(study, study.columns(rows), len(rows)))


# By the batch


def _groups(study: Study, columns: list[np.ndarray], count: int) -> Iterator[tuple[tuple[Any, ...], NDArray[np.int64]]]:
    """Values of what is structural, and the rows that have them."""
    structural = [c for v, c in zip(study.vary, columns, strict=True) if is_structural(v)]
    members: dict[tuple[Any, ...], list[int]] = {}
    for i in range(count if structural else 0):
        values = [plain(c[i]) for c in structural]
        key = tuple(tuple(value) if isinstance(value, list) else value for value in values)
        members.setdefault(key, []).append(i)
    for key, listed in (members if structural else {(): range(count)}).items():
        yield key, np.array(listed, np.int64)


def _sides(study: Study, key: tuple[Any, ...]) -> list[Group | None]:
    """The group of rows with these values, and that of their references, if the study has any."""
    return [_group(study, key, False)] + ([_group(study, key, True)] if study.reference is not None else [])


def _structural(study: Study, key: tuple[Any, ...]) -> dict[str, Value]:
    """The values in a key by name."""
    return dict(zip([v.target.name for v in study.vary if is_structural(v)], key, strict=True))


@lru_cache(maxsize=GROUPS_KEPT)
def _group(study: Study, key: tuple[Any, ...], with_reference: bool) -> Group | None:
    try:
        return Group(study, _structural(study, key), study.reference if with_reference else None)
    except (NotBatchable, InputError):
        return None


def _fly_group(
    study: Study, key: tuple[Any, ...], members: NDArray[np.int64], columns: list[np.ndarray], flown: _Rows
) -> None:
    sides = _sides(study, key)
    groups = [group for group in sides if group is not None]
    if len(groups) < len(sides):
        return
    measures, own = study.measures, [column[members] for column in columns]
    (batch, good), *beside = [group.batch(own, len(members)) for group in groups]
    references = beside[0][0] if beside else None
    done = fly_rows(batch, references, measures.sample_ns, measures.watched, measures.stops, measures.table)
    done.status[~np.logical_and.reduce([good, *(also for _, also in beside)])] = 0
    for name, values in vars(done).items():
        getattr(flown.results, name)[members] = values


# By the simulation


def _fly_alone(study: Study, i: int, columns: list[np.ndarray], flown: _Rows) -> None:
    flown.simulated += 1
    results = flown.results
    results.measured[i], results.stop[i] = np.nan, -1
    try:
        simulate_row(study, apply(study, [column[i] for column in columns]), i, results)
    except (FailedFlight, InputError, TypeError, AttributeError, KeyError, IndexError) as error:
        flown.failures[i] = " ".join(str(error).split())


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


# The table


def _table(study: Study, rows: np.ndarray, columns: list[np.ndarray], flown: _Rows) -> dict[str, np.ndarray]:
    results = flown.results
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
    failures = np.full(len(rows), None, dtype=object)
    for i, reason in flown.failures.items():
        failures[i] = reason
    table["failure"] = failures
    return table


def _as_objects(column: np.ndarray) -> np.ndarray:
    text = np.empty(len(column), dtype=object)
    text[:] = [as_text(plain(value)) for value in column]
    return text


def _vertices(study: Study, columns: list[np.ndarray], uniforms: np.ndarray) -> NDArray[np.int64]:
    """Vertex numbers (n,) that uniform numbers (n,) choose: they depend on each row's mesh."""
    numbers = np.full(len(uniforms), -1)
    for key, members in _groups(study, columns, len(uniforms)):
        try:
            body_mesh = body_mesh_of(parameters_of(study, _structural(study, key)))
        except InputError:
            continue
        numbers[members] = [vertex_number(uniform, body_mesh) for uniform in uniforms[members]]
    return numbers
