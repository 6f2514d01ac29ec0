# SPDX-License-Identifier: MIT
"""Options of ``simulate`` and ``replay`` that write the motion for other tools."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.output_file import output_file
from ..base.progress import Progress

if TYPE_CHECKING:
    from ..export.flight_record import FlightRecord

ENDINGS = {"csv": (".csv",), "parquet": (".parquet",)}
"""Options that take a file, and how its name may end."""

HELP = {
    "csv": "write the states as a table",
    "parquet": "write the states as a table",
}


def add_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options that write the motion for other tools."""
    group = parser.add_argument_group("for other tools")
    for name, endings in ENDINGS.items():
        group.add_argument(f"--{name}", metavar=f"FILE{endings[0]}", help=HELP[name])


def asked(args: argparse.Namespace) -> dict[str, str]:
    """The files that are asked for, by option."""
    return {name: file for name in ENDINGS if (file := getattr(args, name))}


def check_exports(args: argparse.Namespace) -> None:
    """Refuse what can't be written before any work is done; raises InputError."""
    files = asked(args)
    for name, file in files.items():
        if not file.lower().endswith(ENDINGS[name]):
            raise InputError(f"--{name}", file, f"a file that ends in {' or '.join(ENDINGS[name])}")
        output_file(f"--{name}", file)
    if "parquet" in files:
        from ..export.table import check_parquet

        check_parquet()


def write_exports(args: argparse.Namespace, record: FlightRecord, say: Callable[[str], None]) -> None:
    """Write what is asked for, and ``say`` a line of each file; raises InputError."""
    from ..export import table

    for name, file in asked(args).items():
        with Progress(f"writing {file}") as progress:
            columns = table.state_columns(record)
            if name == "csv":
                table.write_csv(file, columns, progress.fraction)
            else:
                table.write_parquet(file, columns)
        say(f"{file}: {len(record.times_ns)} states")
