# SPDX-License-Identifier: MIT
"""One row of a study by itself: its values and measures, its scene and script as files."""

from __future__ import annotations

import shlex
from pathlib import Path

from ..base.errors import InputError
from ..base.output_file import output_file
from .chunk import run_chunk
from .study import Study
from .variation import Variation


def row_summary(study: Study, row: int) -> dict:
    """The row of the table by column, as JSON has it."""
    columns = run_chunk(study, row, row + 1).columns
    found = {}
    for name, column in columns.items():
        value = column[0] if column.dtype == object else column[0].item()
        found[name] = None if value != value else value
    return found


def write_scene(study: Study, row: Variation, file: Path, time: float | None) -> dict:
    """Write the row as a scene, its script beside it as NAME_script.yaml; returns the files and the
    command that flies them.
    """
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
