# SPDX-License-Identifier: MIT
"""Rows of a study as arrays for the compiled batch: a group for each mesh, model and integrator, filled by columns.

Numbers of the script that vary are written straight into the table of commands, where it has them as they are. Where a
poke acts, or how often, is read row by row.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, MeshError
from ..motion.integrators import check_supported
from ..motion.integrators.integrator import ANGULAR_DAMPING
from ..motion.loads import Load
from ..motion.string import RAMP_NS
from ..scene.declaration import HUGE, Value
from ..scene.parameters import Parameters, parameter_named, with_mass_of_density
from ..scene.scenario import BodyMesh, build_scenario
from ..scene.script import MAX_TIME_S, expand_script, with_contacts
from ..simulation import batch
from ..simulation import flight as fl
from ..simulation.checks import check_command, check_start
from ..simulation.commands import (
    CLEAR,
    NO_SLOT,
    Change,
    ClearWrench,
    Command,
    MoveString,
    Pending,
    ReleaseString,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)
from ..simulation.setup import Setup
from ..simulation.simulation import thrusts
from ..simulation.thrusters import ThrusterControl
from .sampling import VERTEX, Draw
from .study import Study, Vary, script_entries
from .variation import body_mesh_of, parameters_of, plain, vertex_number

MAX_COMMANDS = 2000
"""Of a script in the compiled batch; longer ones are rare, and rows of them are the simulation's."""

DIRECT = {"t", "duration", "force", "impulse", "torque", "angular_impulse", "push", "target", "wrench", "string"}
"""Names on the way to a field of the script whose number a table of commands may have as it is."""

CHANGED = {"mass", "density", "scale", "gravity", "linear_damping", "angular_damping"} | {
    name for name in batch.NUMBERS if name.startswith("explicit")
}
"""Fields of a row that may change in flight."""

_BOUNDS = {"at_ns": (0.0, MAX_TIME_S), "duration_ns": (1e-9, MAX_TIME_S), "load": (-HUGE, HUGE)}
"""Of numbers written into a table of commands [s, N, N m, m], by its fields."""
_FIXED = ("kind", "slot")
"""Its other fields."""


class NotBatchable(Exception):
    """The compiled batch can't fly the row; the simulation can, or knows why not."""


_CANT_BE_READ = (NotBatchable, InputError, TypeError, AttributeError, KeyError)


def is_structural(vary: Vary) -> bool:
    """Whether rows with other values of it can't go through the batch together."""
    return bool(vary.target.parameter) and _field_of(vary.target.parameter) not in batch.NUMBERS


def _field_of(parameter: str) -> str:
    return parameter.replace(".", "_")


def new_row(parameters: Parameters, body_mesh: BodyMesh | None) -> NDArray[np.void]:
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


# The script of a row

Knots = dict[tuple[float, ...], tuple[float, ...]]
"""Points of a surface nearest to others, as far as they were asked for."""


@dataclass(frozen=True)
class Timetable:
    """What acts, rows (c,) LOAD_ROW, and the entries of the script that it comes from (c,); the parameters that are
    changed on the way.
    """

    rows: NDArray[np.void]
    entries: NDArray[np.int64]
    changes: list[Mapping[str, Any]]

    @property
    def has_loads_alone(self) -> bool:
        """There is nothing that thrusters and strings do."""
        return bool(((self.rows["kind"] < batch.TIE) & (self.rows["slot"] >= NO_SLOT)).all())

    @property
    def by_entry(self) -> Timetable:
        """In the order of the script."""
        order = np.argsort(self.entries, kind="stable")
        return Timetable(self.rows[order], self.entries[order], self.changes)


@dataclass
class _Plan:
    """Puts commands in order of time as the compiled flight takes them, and what the clocks of string and thrusters do
    between them. knot: where the string will be tied, or None where the parameters say.
    """

    setup: Setup
    knots: Knots
    thrusters: ThrusterControl
    tied: bool
    knot: tuple[float, ...] | None = None
    target_ns: int = 0
    release_ns: int = fl.NEVER
    rows: list[Pending] = field(default_factory=list)
    entries: list[int] = field(default_factory=list)
    changes: list[Mapping[str, Any]] = field(default_factory=list)

    def put(self, *rows: Pending, entry: int = 0) -> None:
        """Behind what is there."""
        self.rows += rows
        self.entries += [entry] * len(rows)

    def pass_until(self, at_ns: int) -> None:
        """What the clocks do up to a time, that included."""
        while (due_ns := min(self.release_ns, self.thrusters.due_ns)) <= at_ns:
            if self.release_ns == due_ns:
                self.put(self.untied(due_ns))
            if self.thrusters.due_ns == due_ns:
                self.thrust(due_ns, self.thrusters.end_due(due_ns, self.setup.wrench_timeout_ns)[0])

    def thrust(self, at_ns: int, loads: list[tuple[int, Load]]) -> None:
        """Thrusters, by number, push otherwise."""
        self.put(*(thrusts(loads, at_ns) or [Pending(at_ns, ClearWrench(), kind=batch.CUT)]))

    def untied(self, at_ns: int) -> Pending:
        """The string lets go."""
        self.tied, self.release_ns = False, fl.NEVER
        return Pending(at_ns, ReleaseString(), kind=batch.UNTIE)

    def moved(self, at_ns: int, command: MoveString) -> Pending:
        """The string's free end goes elsewhere, or the string is tied."""
        knot = (0.0,) * 4 if self.knot is None else (*self.knot, 1.0)
        row = Pending(at_ns, command, kind=batch.TIE, row=np.array([*command.point, *knot, *[0.0] * 7]).tobytes())
        if self.tied:
            row.kind, row.duration_ns = batch.MOVE, min(at_ns - self.target_ns, RAMP_NS)
        timeout_ns = self.setup.string.timeout_ns
        self.tied, self.target_ns = True, at_ns
        self.release_ns = at_ns + timeout_ns if timeout_ns else fl.NEVER
        return row

    def attached(self, at_ns: int, command: TieString) -> Pending:
        """The string will be tied elsewhere."""
        if self.tied or command.axes != "mesh":
            raise NotBatchable
        if command.point not in self.knots:
            surface = self.setup.surface
            self.knots[command.point] = tuple(surface.nearest_point(command.point)) if surface else command.point
        self.knot = self.knots[command.point]
        return Pending(at_ns, command, kind=batch.CUT)

    @property
    def timetable(self) -> Timetable:
        """All that was put there."""
        rows = np.zeros(len(self.rows), fl.LOAD_ROW)
        for row, pending in zip(rows, self.rows, strict=True):
            row["at_ns"], row["duration_ns"] = pending.time_ns, pending.duration_ns
            row["kind"], row["slot"] = pending.kind, pending.slot
            if pending.row:
                row["load"] = np.frombuffer(pending.row)
        return Timetable(rows, np.array(self.entries, np.int64), self.changes)


def timetable(commands: list[Command], setup: Setup, knots: Knots) -> Timetable:
    """What acts of a script's commands, in order of time; raises NotBatchable, InputError."""
    if len(commands) > MAX_COMMANDS:
        raise NotBatchable
    plan = _Plan(setup, knots, ThrusterControl(setup.thrusters), setup.string.attached)
    for command in with_contacts(commands, setup.contacts):
        at_ns, entry = command.stamp_ns, command.entry
        row = check_command(command, setup)
        plan.pass_until(at_ns)
        if isinstance(command, WrenchCommand):
            if not row:
                raise NotBatchable  # a ray
            pending = Pending(at_ns, command)
            pending.set_load(command, row, setup)
            plan.put(pending, entry=entry)
        elif isinstance(command, ThrusterCommand):
            plan.thrust(at_ns, plan.thrusters.command(command.forces, at_ns, setup.wrench_timeout_ns))
        elif isinstance(command, TieString):
            plan.put(plan.attached(at_ns, command), entry=entry)
        elif isinstance(command, MoveString):
            plan.put(plan.moved(at_ns, command), entry=entry)
        elif isinstance(command, ReleaseString):
            plan.put(plan.untied(at_ns), entry=entry)
        elif isinstance(command, ClearWrench):
            plan.thrusters.clear()
            plan.put(Pending(at_ns, command), entry=entry)
        elif isinstance(command, Change):
            plan.changes.append(command.content)
            plan.put(Pending(at_ns, command, kind=batch.CHANGE), entry=entry)
        else:
            raise NotBatchable
    plan.pass_until(fl.NEVER - 1)
    return plan.timetable


# Rows

Number = tuple[int, int, str, tuple[np.ndarray, ...]]
"""Of the things that vary one, which of its numbers, and where in a table of commands that stands: field, indices."""


class Group:
    """Rows that share all but numbers. Making one raises InputError or NotBatchable: then the simulation flies its
    rows, and says what is wrong. structural: values of what is structural, by name. reference: parameters that the
    reference flight has otherwise.
    """

    def __init__(self, study: Study, structural: Mapping[str, Value], reference: Mapping[str, Value] | None) -> None:
        self._study, self._reference = study, with_mass_of_density(reference or {})
        parameters = parameters_of(study, structural).replaced(self._reference)
        self._body_mesh = body_mesh_of(parameters)
        self._setup = setup = build_scenario(parameters, self._body_mesh).setup
        check_start(setup)
        if any(v.target.parameter == "angular_damping" for v in study.vary):
            check_supported(setup.integrator, frozenset({ANGULAR_DAMPING}))
        if setup.string.attached and setup.initial_string_mass:
            raise NotBatchable
        self._ballast = np.array([m for m in parameters.point_masses if m[0] > 0.0], dtype=float).reshape(-1, 4)
        self._knots: Knots = {}
        self._of_script = [k for k, vary in enumerate(study.vary) if vary.target.entry]
        self._changes = self._read([]).changes
        self._table, self._numbers = self._find_numbers()
        self._stages = self._find_stages(parameters)

    def _find_stages(self, parameters: Parameters) -> list[tuple[NDArray[np.void], set[str]]]:
        """The row at first and after each change in flight, and the parameters that are no longer the study's."""
        others = set(self._reference)
        stages = [(new_row(parameters, self._body_mesh), others)]
        for changes in map(with_mass_of_density, self._changes):
            parameters, others = parameters.replaced(changes), {*others, *changes}
            if not all(_field_of(name) in CHANGED for name in changes):
                raise NotBatchable
            check_start(build_scenario(parameters, self._body_mesh).setup)
            stages.append((new_row(parameters, self._body_mesh), others))
        return stages

    def batch(self, columns: list[np.ndarray], count: int) -> tuple[batch.Batch, NDArray[np.bool_]]:
        """``count`` rows with these values of what varies, and which of them the batch may check (n,)."""
        good = np.ones(count, bool)
        rows = np.repeat(np.concatenate([row for row, _ in self._stages])[None], count, axis=0)
        for vary, column in zip(self._study.vary, columns, strict=True):
            parameter = vary.target.parameter
            if not parameter or is_structural(vary) or parameter in self._reference:
                continue
            declared = parameter_named(parameter)
            _keep(good, (column > declared.lower if declared.above else column >= declared.lower))
            _keep(good, column <= declared.upper)
            for stage, (_, others) in enumerate(self._stages):
                own = rows[_field_of(parameter)][:, stage]
                if parameter in others:
                    continue
                if vary.target.path:
                    own[:, vary.target.path[0]] = column
                else:
                    own[:] = column[:, None] if own.ndim > column.ndim else column
        commands = self._read_by_row(columns, good) if self._numbers is None else self._written(columns, good)
        return batch.Batch(rows, self._ballast, self._setup, commands), good

    def _read(self, values: Sequence[Any]) -> Timetable:
        """What acts with these values of what varies in the script, or with the script's own."""
        script = copy.deepcopy(self._study.script)
        for k, value in zip(self._of_script, values, strict=False):
            vary = self._study.vary[k]
            if isinstance(vary.form, Draw) and vary.form.shape == VERTEX:
                value = {"vertex": vertex_number(value, self._body_mesh)}
            vary.target.put({}, script_entries(script), plain(value))
        found = timetable(expand_script(script, "script"), self._setup, self._knots)
        if values and found.changes != self._changes:
            raise NotBatchable
        return found

    def _read_by_row(self, columns: list[np.ndarray], good: NDArray[np.bool_]) -> NDArray[np.void]:
        """Tables of commands (n, c), padded with some that never come."""
        tables: list[NDArray[np.void]] = []
        for i in range(len(good)):
            try:
                tables.append(self._read([columns[k][i] for k in self._of_script]).rows)
            except _CANT_BE_READ:
                tables.append(self._table[:0])
                good[i] = False
        commands = np.zeros((len(good), max(map(len, tables), default=0)), fl.LOAD_ROW)
        commands["at_ns"], commands["kind"] = fl.NEVER, CLEAR
        for own, table in zip(commands, tables, strict=True):
            own[: len(table)] = table
        return commands

    def _written(self, columns: list[np.ndarray], good: NDArray[np.bool_]) -> NDArray[np.void]:
        """Tables of commands (n or 1, c), with the numbers that vary written where they stand."""
        commands = np.repeat(self._table[None], len(good) if self._numbers else 1, axis=0)
        for k, j, name, where in self._numbers or ():
            column = columns[k] if columns[k].ndim == 1 else columns[k][:, j]
            lower, upper = _BOUNDS[name]
            within = (column >= lower) & (column <= upper)
            _keep(good, within)
            values = np.where(within, column, 0.0)
            # To the nearest nanosecond, halves to even, as round() has it.
            every: Any = (slice(None), *where)
            commands[name][every] = (values if name == "load" else np.rint(values * 1e9))[:, None]
        # Stable: equal times act in the order of the script.
        order = np.argsort(commands["at_ns"], axis=1, kind="stable")
        return np.take_along_axis(commands, order, axis=1)

    def _find_numbers(self) -> tuple[NDArray[np.void], list[Number] | None]:
        """A table of commands, and where in it the numbers that vary stand as they are; None where they don't, which
        two readings with other numbers tell.
        """
        columns = [self._study.columns(np.zeros(1, np.int64))[k] for k in self._of_script]
        names = {key for k in self._of_script for key in self._study.vary[k].target.path if isinstance(key, str)}
        if not names <= DIRECT or any(column.dtype != np.float64 for column in columns):
            return self._read([]).rows, None
        probes = [[a + 0.01 * k + 0.001 * np.arange(c.size) for k, c in enumerate(columns)] for a in (0.3, 0.7)]
        try:
            shaped = [[x.reshape(c.shape)[0] for x, c in zip(probe, columns, strict=True)] for probe in probes]
            first, second = map(self._read, shaped)
        except _CANT_BE_READ:
            return self._read([]).rows, None
        if first.has_loads_alone and second.has_loads_alone:
            # No clock but their own: their times may vary, too.
            first, second = first.by_entry, second.by_entry
        elif not np.array_equal(first.rows["at_ns"], second.rows["at_ns"]):
            return first.rows, None
        a, b = first.rows, second.rows
        if any(not np.array_equal(x, y) for x, y in ((first.entries, second.entries), *((a[n], b[n]) for n in _FIXED))):
            return a, None
        found: list[Number] = []
        changed = {name: a[name] != b[name] for name in _BOUNDS}
        for k, own, other in zip(self._of_script, *probes, strict=True):
            for j in range(len(own)):
                for name, left in changed.items():
                    x, y = (own[j], other[j]) if name == "load" else np.rint((own[j] * 1e9, other[j] * 1e9))
                    where = left & (a[name] == x) & (b[name] == y)
                    if where.any():
                        found.append((k, j, name, np.nonzero(where)))
                    left &= ~where
        wanted = {(k, j) for k, own in zip(self._of_script, probes[0], strict=True) for j in range(len(own))}
        is_whole = {(k, j) for k, j, _, _ in found} == wanted and not any(left.any() for left in changed.values())
        return a, found if is_whole else None


def _keep(good: NDArray[np.bool_], within: NDArray[np.bool_]) -> None:
    """Only rows whose numbers (n,) or (n, k) are within bounds are good any more."""
    good &= within if within.ndim == 1 else within.all(axis=1)
