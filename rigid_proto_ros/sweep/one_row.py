# SPDX-License-Identifier: MIT
"""One row of a study by itself: its values and measures, its scene and script as files, its flight recorded."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..core.errors import InputError
from ..offline import OfflineRun
from ..output_file import output_file
from ..scenario import publication_ns
from ..session_recorder import make_recorder
from .chunk import run_chunk
from .study import Study
from .variation import Variation, variation

MAX_GHOSTS = 12
"""Side by side: more can't be told apart."""
MAX_STATES = 20_000
"""Of one ghost; a longer flight is drawn with fewer a second."""


def row_summary(study: Study, row: int) -> dict:
    """The row of the table by column, as JSON has it."""
    columns = run_chunk(study, row, row + 1).columns
    found = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def write_scene(study: Study, row: Variation, file: Path, time: float | None) -> dict:
    """Write the row as a scene, its script beside it as NAME_script.yaml; returns the files and the command that flies them."""
    duration = time if time is not None else study.duration_ns / 1e9
    scenario, commands = row.scenario, row.commands
    output_file("--as-scene", file)
    try:
        file.write_text(scenario.text, encoding="utf-8")
        words = ["rigid_proto", "simulate", str(file), "--duration", repr(duration)]
        if commands:
            script = file.with_name(f"{file.stem}_script.yaml")
            script.write_text(row.script_text, encoding="utf-8")
            words += ["--script", str(script)]
    except OSError as error:
        raise InputError("--as-scene", str(file), f"a file that can be written ({error.strerror})") from None
    return {"scene": str(file), "fly": shlex.join(words)}


def record_row(study: Study, row: Variation, file: str, tell: Callable[[str], None]) -> None:
    """Fly the row once more with a recorder that sees everything."""
    scenario, commands = row.scenario, row.commands
    OfflineRun(scenario, commands)  # a row that is refused overwrites no recording
    observer = make_recorder(file, values=row.values, on_error=tell, simulated_log=True)
    try:
        OfflineRun(scenario, commands, observer).advance(study.duration_ns)
    finally:
        observer.close()


def record_ghosts(study: Study, rows: list[int], file: str) -> None:
    """Fly these rows and record them side by side, as ghosts of one another."""
    from ..rerun_view.ensemble import record_ensemble

    record_ensemble(file, [_flight(study, row) for row in rows], study.name)


def _flight(study: Study, number: int):
    from ..rerun_view.ensemble import Flight

    row = variation(study, number)
    scenario = row.scenario
    simulation = OfflineRun(scenario, row.commands).simulation
    rate = min(float(scenario.values["publish_rate"]), MAX_STATES / (study.duration_ns * 1e-9))
    times_ns, states = [], []
    while (time_ns := publication_ns(len(times_ns), rate)) <= study.duration_ns:
        state = simulation.advance(time_ns)
        if simulation.failure:
            raise InputError(f"row {number}", simulation.failure, "a row that can be simulated to its end")
        times_ns.append(time_ns)
        states.append(state.row)
    body, surface = scenario.setup.body, scenario.setup.surface
    return Flight(
        label=f"row_{number}",
        vertices=surface.vertices if surface else None,
        triangles=surface.triangles if surface else None,
        scale=body.scale,
        center_of_mass=body.center_of_mass,
        times_ns=np.array(times_ns, np.int64),
        states=np.array(states),
    )
