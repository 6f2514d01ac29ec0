# SPDX-License-Identifier: MIT
"""Some rows of a study, flown and measured: what a thread here and a worker of a cluster both do.

Rows that differ in numbers alone go through the compiled batch together. Those that it can't fly or check are flown
one by one by the simulation, with the same bits.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..base.errors import InputError
from ..scene.declaration import Value
from ..simulation.batch import Results, fly_rows, new_results
from ..simulation.readings import floor_text
from .forms import VERTEX, Draw, as_text
from .row_flight import fly_row
from .rows import Group, NotBatchable, is_structural
from .study import Study
from .variation import apply, body_mesh_of, plain, vertex_number

GROUPS_KEPT = 512
"""Groups of rows that a process keeps ready."""


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


def row_summary(study: Study, row: int) -> dict:
    """The row of the table by column, as JSON has it."""
    columns = run_chunk(study, row, row + 1).columns
    found = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def is_batchable(study: Study, rows: np.ndarray) -> bool:
    """Whether the compiled batch can fly any of these rows (n,)."""
    columns = study.columns(rows)
    keys = [key for key, _ in _groups(study, columns, len(rows))]
    sides = (False, True) if study.reference is not None else (False,)
    return any(all(_group(_ByFingerprint(study), key, side) for side in sides) for key in keys)


def _groups(study: Study, columns: list[np.ndarray], count: int) -> Iterator[tuple[tuple, np.ndarray]]:
    """Values of what is structural, and the rows that have them."""
    structural = [c for v, c in zip(study.vary, columns, strict=True) if is_structural(v)]
    if not structural:
        yield (), np.arange(count)
        return
    members: dict[tuple, list[int]] = {}
    for i in range(count):
        values = [plain(c[i]) for c in structural]
        key = tuple(tuple(value) if isinstance(value, list) else value for value in values)
        members.setdefault(key, []).append(i)
    for key, listed in members.items():
        yield key, np.array(listed)


@lru_cache(maxsize=GROUPS_KEPT)
def _group(study: _ByFingerprint, key: tuple, with_reference: bool) -> Group | None:
    own = study.study
    names = [v.target.name for v in own.vary if is_structural(v)]
    structural = dict(zip(names, key, strict=True))
    try:
        return Group(own, structural, own.reference if with_reference else None)
    except (NotBatchable, InputError):
        return None


class _ByFingerprint:
    """A study as a key: equal content, equal groups."""

    def __init__(self, study: Study) -> None:
        self.study = study

    def __hash__(self) -> int:
        return hash(self.study.fingerprint)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByFingerprint) and self.study.fingerprint == other.study.fingerprint


def _fly_group(study: Study, key: tuple, members: np.ndarray, columns: list[np.ndarray], flown: _Rows) -> None:
    group = _group(_ByFingerprint(study), key, False)
    beside = _group(_ByFingerprint(study), key, True) if study.reference is not None else None
    if group is None or (study.reference is not None and beside is None):
        return
    measures = study.measures
    own = [column[members] for column in columns]
    batch, good = group.batch(own, len(members))
    references = None
    if beside is not None:
        references, also_good = beside.batch(own, len(members))
        good &= also_good
    done = fly_rows(batch, references, measures.sample_ns, measures.watched, measures.stops, measures.table)
    done.status[~good] = 0
    for name in ("status", "end_ns", "stop", "measured", "states", "floors"):
        getattr(flown.results, name)[members] = getattr(done, name)


def _fly_alone(study: Study, i: int, columns: list[np.ndarray], flown: _Rows) -> None:
    flown.simulated += 1
    results = flown.results
    try:
        row = apply(study, [column[i] for column in columns])
    except (InputError, TypeError, AttributeError, KeyError, IndexError) as error:
        results.measured[i] = np.nan
        results.stop[i] = -1
        flown.failures[i] = " ".join(str(error).split())
        return
    result = fly_row(study, row)
    results.measured[i], results.stop[i] = result.measured, result.stop
    results.end_ns[i], results.states[i], results.floors[i] = result.end_ns, result.state, result.floors
    if result.failure:
        flown.failures[i] = result.failure
    else:
        results.status[i] = 1


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


def _vertices(study: Study, columns: list[np.ndarray], column: np.ndarray) -> np.ndarray:
    """Vertex numbers (n,): they depend on each row's mesh."""
    structural = [(v, c) for v, c in zip(study.vary, columns, strict=True) if is_structural(v)]
    numbers = np.empty(len(column), np.int64)
    named = study.parameters.named()
    for i, uniform in enumerate(column):
        changes: dict[str, Value] = {}
        try:
            for vary, own in structural:
                vary.target.put(ChainMap(changes, named), [], plain(own[i]))
            numbers[i] = vertex_number(uniform, body_mesh_of(study.parameters.replaced(changes)))
        except InputError:
            numbers[i] = -1
    return numbers
