# SPDX-License-Identifier: MIT
"""``rigid_proto sweep``: simulate many variations of one scene and write one table."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.files import is_same_file

if TYPE_CHECKING:
    from ..sweep.study import Study

EXAMPLES = (
    ("rigid_proto sweep box_tensor -o out/box_tensor.parquet", "a bundled study, on all cores"),
    ("rigid_proto sweep box_tensor --row 7 --as-scene out/row.yaml", "one row of this study, as a scene to simulate"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("study", metavar="STUDY.yaml", help="a study file, or the name of a bundled study")
    parser.add_argument("-o", "--output", metavar="FILE.parquet", help="the table (default: the study's name.parquet)")
    parser.add_argument("--row", type=int, metavar="N", help="simulate one row only")
    parser.add_argument("--as-scene", metavar="FILE.yaml", help="with --row: write the row as a scene, and its script")
    parser.add_argument("--resume", action="store_true", help="go on behind the rows that the table has")
    parser.add_argument("--dask", metavar="ADDRESS", default="", help="the workers of this Dask scheduler simulate")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(args: argparse.Namespace) -> int:
    """Simulate the study, or one row of it."""
    from ..sweep.study import read_study
    from ..sweep.table import arrow

    if args.as_scene and args.row is None:
        raise InputError("--as-scene", "needs --row")
    if args.as_scene and is_same_file(args.as_scene, args.study):
        raise InputError("--as-scene", args.as_scene, "another file than the study")
    for option in ("output", "resume", "dask"):
        if getattr(args, option) and args.row is not None:
            raise InputError(f"--{option}", "can't be combined with --row, which writes no table")
    if args.row is None:
        arrow()  # before anything is compiled
    study = read_study(args.study)
    return _whole(study, args) if args.row is None else _one_row(study, args)


def _whole(study: Study, args: argparse.Namespace) -> int:
    from ..sweep.table import SweepInterrupted, run_study

    file = Path(args.output or Path(study.name).stem + ".parquet")
    if file.suffix != ".parquet":
        raise InputError("--output", str(file), "a file that ends in .parquet")
    try:
        metadata = run_study(study, file, dask=args.dask, resume=args.resume)
    except SweepInterrupted as stopped:
        if stopped.rows_done:
            _print(f"{stopped.rows_done} of {study.rows} rows are in {file}; --resume goes on behind them")
        raise
    if args.json:
        print(json.dumps({"table": str(file), **metadata}))
    else:
        print(f"{metadata['rows']} rows in {file}")
        if metadata["rows_by_simulation"]:
            print(f"{metadata['rows_by_simulation']} of them were simulated or refused one by one")
        if metadata["rows_failed"]:
            print(f"{metadata['rows_failed']} of them failed; the column failure says why")
    return 0


def _one_row(study: Study, args: argparse.Namespace) -> int:
    from ..sweep.rows import row_summary, write_scene

    if not 0 <= args.row < study.rows:
        raise InputError("row", args.row, f"0 to {study.rows - 1}")
    summary = row_summary(study, args.row)
    if args.as_scene:
        summary.update(write_scene(study, args.row, Path(args.as_scene)))
    if args.json:
        print(json.dumps(summary))
    else:
        for name, value in summary.items():
            print(f"{name:<32} {value}")
    return 1 if summary["failure"] else 0


def _print(message: str) -> None:
    print(f"rigid_proto sweep: {message}", file=sys.stderr)
