# SPDX-License-Identifier: MIT
"""``rigid_proto sweep``: many variations of one scene into one table."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.bundled import study_names
from ..base.command_line import completes
from ..base.errors import InputError
from .options import add_json

if TYPE_CHECKING:
    from ..sweep.study import Study
    from ..sweep.variation import Variation

EXAMPLES = (
    ("rigid_proto sweep box_tensor -o out/box_tensor.parquet", "a bundled study, on all cores"),
    ("rigid_proto sweep box_tensor -o out/box_tensor.parquet --resume", "continue after it was stopped"),
    ("rigid_proto sweep box_tensor --row 7 --record out/row.rrd", "one row of it, recorded for Rerun"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    study = parser.add_argument("study", metavar="STUDY.yaml", help="a study file, or the name of a bundled study")
    completes(study, lambda _: study_names())
    parser.add_argument("-o", "--output", metavar="FILE.parquet", help="the table (default: the study's name.parquet)")
    parser.add_argument(
        "--threads", type=int, default=0, metavar="N", help="threads on this machine (default: one per core)"
    )
    parser.add_argument("--resume", action="store_true", help="continue a run that was stopped or killed")
    parser.add_argument("--yes", action="store_true", help="allow more than ten million rows")
    parser.add_argument("--row", type=int, metavar="N", help="simulate one row only")
    parser.add_argument("--record", metavar="FILE.rrd", help="with --row: record it for Rerun")
    parser.add_argument(
        "--as-scene", metavar="FILE.yaml", help="with --row: write it as a scene, and its script beside"
    )
    parser.add_argument("--plot", metavar="x=..,y=..", help="plot the table: x, y, color, to=FILE.svg")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Fly the study, or one row of it."""
    from ..sweep.study import read_study

    if args.threads < 0 or args.threads > 1024:
        raise InputError("--threads", args.threads, "1 to 1024, or 0 for one per core")
    for option in ("record", "as_scene"):
        if getattr(args, option) and args.row is None:
            raise InputError(f"--{option.replace('_', '-')}", "needs --row")
    for option in ("output", "resume", "plot"):
        if getattr(args, option) and args.row is not None:
            raise InputError(f"--{option}", "can't be combined with --row, which writes no table")
    study = read_study(args.study, args.yes)
    if args.row is not None:
        return _one_row(study, args)
    return _whole(study, args)


def _whole(study: Study, args: argparse.Namespace) -> int:
    from ..base.compilation import notify_when_compiling
    from ..sweep.chunk import run_chunk
    from ..sweep.plot import check_plot, plot_table, read_plot
    from ..sweep.run import Interrupted, run_study
    from ..sweep.table import arrow

    arrow()  # a table that can't be written isn't flown either
    file = Path(args.output or Path(study.name).stem + ".parquet")
    if file.suffix != ".parquet":
        raise InputError("--output", str(file), "a file that ends in .parquet")
    plot = read_plot(args.plot, file) if args.plot else None
    try:
        with notify_when_compiling(lambda: _print("kernels are being compiled, which takes a while the first time")):
            if plot:
                check_plot(plot, run_chunk(study, 0, 0).columns)
            metadata = run_study(study, file, workers=args.threads, resume=args.resume)
    except Interrupted as stopped:
        done = stopped.metadata["rows_done"]
        if done:
            _print(f"{done} of {study.rows} rows are in {file}; continue with --resume")
        raise
    if plot:
        plot_table(plot, file)
    if args.json:
        print(json.dumps({"table": str(file), **metadata, **({"plot": str(plot.file)} if plot else {})}))
    else:
        print(f"{metadata['rows']} rows in {file}")
        if metadata["rows_by_simulation"]:
            print(f"{metadata['rows_by_simulation']} of them were simulated or refused one by one")
        if metadata.get("rows_failed"):  # a table of an earlier version doesn't say
            print(f"{metadata['rows_failed']} of them failed; the column failure says why")
        if plot:
            print(f"picture in {plot.file}")
    return 0


def _row_number(text: str | int, study: Study) -> int:
    try:
        row = int(text)
    except ValueError:
        row = -1
    if not 0 <= row < study.rows:
        raise InputError("row", text, f"0 to {study.rows - 1}")
    return row


def _one_row(study: Study, args: argparse.Namespace) -> int:
    from ..sweep.chunk import row_summary
    from ..sweep.variation import variation, write_scene

    row = _row_number(args.row, study)
    summary = row_summary(study, row)
    if args.as_scene:
        summary.update(write_scene(study, variation(study, row), Path(args.as_scene), summary["time"]))
    if args.record:
        _record_row(study, variation(study, row), args.record)
        summary["recorded"] = args.record
    if args.json:
        print(json.dumps(summary))
    else:
        for name, value in summary.items():
            print(f"{name:<32} {value}")
    return 1 if summary["failure"] else 0


def _record_row(study: Study, row: Variation, file: str) -> None:
    """Fly the row once more with a recorder that sees everything."""
    from ..rerun_view.session_files import recording
    from ..scene.offline import OfflineRun

    OfflineRun(row.scenario, row.commands)  # a row that is refused overwrites no recording
    with recording(file, parameters=row.parameters) as observer:
        OfflineRun(row.scenario, row.commands, observer).advance(study.duration_ns)


def _print(message: str) -> None:
    print(f"rigid_proto sweep: {message}", file=sys.stderr)
