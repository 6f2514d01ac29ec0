# SPDX-License-Identifier: MIT
"""Rows of a study recorded for Rerun: one by itself, or several side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..rerun_view.session_files import make_recorder
from ..scene.offline import OfflineRun
from ..scene.scenario import publication_ns
from ..sweep.study import Study
from ..sweep.variation import Variation, variation

if TYPE_CHECKING:
    from ..rerun_view.ensemble import EnsembleMember

MAX_GHOSTS = 12
"""Side by side: more can't be told apart."""
MAX_STATES = 20_000
"""Of one ghost; a longer flight is drawn with fewer a second."""


def record_row(study: Study, row: Variation, file: str, tell: Callable[[str], None]) -> None:
    """Fly the row once more with a recorder that sees everything."""
    scenario, commands = row.scenario, row.commands
    OfflineRun(scenario, commands)  # a row that is refused overwrites no recording
    observer = make_recorder(file, parameters=row.parameters, on_error=tell, simulated_log=True)
    try:
        OfflineRun(scenario, commands, observer).advance(study.duration_ns)
    finally:
        observer.close()


def record_ghosts(study: Study, rows: list[int], file: str) -> None:
    """Fly these rows and record them side by side, as ghosts of one another."""
    from ..rerun_view.ensemble import record_ensemble

    record_ensemble(file, [_flight(study, row) for row in rows], study.name)


def _flight(study: Study, number: int) -> EnsembleMember:
    from ..rerun_view.ensemble import EnsembleMember

    row = variation(study, number)
    scenario = row.scenario
    simulation = OfflineRun(scenario, row.commands).simulation
    rate = min(scenario.parameters.publish_rate, MAX_STATES / (study.duration_ns * 1e-9))
    times_ns: list[int] = []
    states: list[np.ndarray] = []
    while (time_ns := publication_ns(len(times_ns), rate)) <= study.duration_ns:
        state = simulation.advance(time_ns)
        if simulation.failure:
            raise InputError(f"row {number}", simulation.failure, "a row that can be simulated to its end")
        times_ns.append(time_ns)
        states.append(state.row)
    body, surface = scenario.setup.body, scenario.setup.surface
    return EnsembleMember(
        label=f"row_{number}",
        vertices=surface.vertices if surface else None,
        triangles=surface.triangles if surface else None,
        scale=body.scale,
        center_of_mass=body.center_of_mass,
        times_ns=np.array(times_ns, np.int64),
        states=np.array(states),
    )
