# SPDX-License-Identifier: MIT
"""Rows of a study as arrays for the compiled batch: a group for each mesh, model and integrator, filled by columns."""

from __future__ import annotations

import copy
from collections import ChainMap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..motion import loads as ld
from ..motion.integrators.taylor_adaptive import degree_for
from ..scene.declaration import Value
from ..scene.parameters import parameter_named, with_mass_of_density
from ..scene.scenario import BodyMesh
from ..scene.script import expand_script
from ..simulation import batch_body as bb
from ..simulation import flight as fl
from ..simulation.batch import Variants
from .forms import VERTEX, Draw
from .overlay import Overlay, fits, make_overlay
from .study import Study, Vary, script_entries
from .templates import (
    FAST,
    TIMES,
    LoadResolver,
    NotBatchable,
    Script,
    checked_integrator,
    constants_of,
    script_of,
    settings_of,
    times_of,
)
from .variation import body_mesh_of, plain, vertex_number


def is_numeric(vary: Vary) -> bool:
    """Whether it varies numbers of a row of settings, times or ballast."""
    parameter = vary.target.parameter
    return parameter in FAST or parameter in TIMES or parameter.startswith("ballast.")


def is_structural(vary: Vary) -> bool:
    """Whether rows with other values of it can't go through the batch together."""
    return bool(vary.target.parameter) and not is_numeric(vary)


class Group:
    """Rows that share all but numbers. Making one raises InputError or NotBatchable: then the simulation flies its
    rows, and says what is wrong.
    """

    def __init__(self, study: Study, structural: Mapping[str, Value], reference: Mapping[str, Value] | None) -> None:
        changes: dict[str, Value] = {}
        values = ChainMap(changes, study.parameters.named())
        for vary in study.vary:
            if is_structural(vary):
                vary.target.put(values, [], plain(structural[vary.target.name]))
        if study.density_decides:
            changes["mass"] = 0.0
        self.reference = with_mass_of_density(reference or {})
        self.study = study
        self.parameters = parameters = study.parameters.replaced(changes).replaced(self.reference)
        self.body_mesh: BodyMesh | None = body_mesh_of(parameters)
        self.constants = constants_of(parameters, self.body_mesh)
        self.settings, self.times = settings_of(parameters), times_of(parameters)
        self.ballast = np.array(parameters.point_masses, dtype=float).reshape(-1, 4)
        self.resolver = LoadResolver(parameters, self.body_mesh)
        self.overlay: Overlay | None = None
        if fits(study):
            self.overlay, loads = make_overlay(study, self.resolver)
        else:
            _, loads = script_of(expand_script(study.script, "script"), self.resolver)
        self.integrator = checked_integrator(parameters, loads)

    def variants(self, columns: list[np.ndarray], count: int) -> tuple[Variants, np.ndarray]:
        """Arrays of ``count`` rows with these values of what varies, and which of them the batch may check (n,)."""
        good = np.ones(count, bool)
        settings, times, ballast = self._numbers(columns, count, good)
        if self.overlay is not None:
            targets = [(v.target, c) for v, c in zip(self.study.vary, columns, strict=True) if v.target.entry]
            commands, loads, within = self.overlay.rows(targets, count if targets else 1)
            good &= within
        else:
            commands, loads = self._expanded(columns, count, good)
        return Variants(settings, times, ballast, self.constants, self.integrator, commands, loads), good

    def _numbers(
        self, columns: Sequence[np.ndarray], count: int, good: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        settings = np.broadcast_to(self.settings, (count, bb.SETTINGS)).copy()
        times = np.broadcast_to(self.times, (count, bb.TIMES)).copy()
        names = [f"ballast.{name}" for name in sorted(self.parameters.ballast)]
        varies_ballast = any(v.target.parameter.startswith("ballast.") for v in self.study.vary)
        ballast = np.broadcast_to(self.ballast, (count if varies_ballast else 1, *self.ballast.shape)).copy()
        for vary, column in zip(self.study.vary, columns, strict=True):
            parameter = vary.target.parameter
            if not is_numeric(vary) or parameter in self.reference:
                continue
            declared = parameter_named(parameter)
            above = column > declared.lower if declared.above else column >= declared.lower
            within = above & (column <= declared.upper)
            good &= within if within.ndim == 1 else within.all(axis=1)
            if parameter in TIMES:
                times[:, TIMES[parameter]] = np.maximum(1, np.rint(np.where(within, column, 1.0) * 1e9))
                continue
            if parameter in FAST:
                rows, (at, size) = settings, FAST[parameter]
            else:
                rows, at, size = ballast[:, names.index(parameter)], 0, 4
            if vary.target.path:
                rows[:, at + vary.target.path[0]] = column
            else:
                rows[:, at : at + size] = column[:, None] if column.ndim == 1 else column
            if parameter == "accuracy":
                times[:, bb.DEGREE] = [degree_for(a) if a > 0.0 else 1 for a in column.tolist()]
        return settings, times, ballast

    def _expanded(self, columns: Sequence[np.ndarray], count: int, good: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Commands and loads of scripts that are expanded row by row, padded with commands that never come."""
        scripts: list[Script | None] = []
        for i in range(count):
            try:
                commands = expand_script(self._script([c[i] for c in columns]), "script")
                script, loads = script_of(commands, self.resolver)
                checked_integrator(self.parameters, loads)
                scripts.append(script)
            except (NotBatchable, InputError, TypeError, AttributeError, KeyError):
                scripts.append(None)
                good[i] = False
        longest = max((len(s.commands) for s in scripts if s), default=0)
        commands = np.zeros((count, longest, fl.COMMAND), np.int64)
        commands[:, :] = fl.NEVER, -1, fl.CLEAR, fl.NO_SLOT
        loads = np.zeros((count, longest, ld.LOAD))
        for i, script in enumerate(scripts):
            if script:
                commands[i, : len(script.commands)] = script.commands
                loads[i, : len(script.loads)] = script.loads
        return commands, loads

    def _script(self, chosen: list) -> Any:
        script = copy.deepcopy(self.study.script)
        entries = script_entries(script)
        for vary, value in zip(self.study.vary, chosen, strict=True):
            if vary.target.entry:
                vertex = isinstance(vary.form, Draw) and vary.form.shape == VERTEX
                number = {"vertex": vertex_number(value, self.body_mesh)} if vertex else plain(value)
                vary.target.put({}, entries, number)
        return script
