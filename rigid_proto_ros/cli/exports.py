# SPDX-License-Identifier: MIT
"""Options of ``simulate`` and ``replay`` that write the motion for other tools."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import InputError, one_of
from ..base.output_file import output_file
from ..base.progress import Progress

if TYPE_CHECKING:
    from ..export.flight_record import FlightRecord
    from ..export.looks import Looks

ENDINGS = {"csv": (".csv",), "parquet": (".parquet",), "gltf": (".glb",), "usd": (".usda", ".usdc")}
"""Options that take a file, and how its name may end."""

HELP = {
    "csv": "write the states as a table",
    "parquet": "write the states as a table",
    "gltf": "write the motion for Blender, Unreal, three.js and others that read glTF",
    "usd": "write the motion, with mass properties, for Omniverse, Houdini and others that read USD",
}

PARTS = ("ghost", "trail")


def add_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options that write the motion for other tools."""
    group = parser.add_argument_group("for other tools")
    for name, endings in ENDINGS.items():
        group.add_argument(f"--{name}", metavar=f"FILE{endings[0]}", help=HELP[name])
    group.add_argument(
        "--tolerance",
        type=float,
        metavar="T",
        help="of --gltf and --usd: keys err by at most T body sizes and 100 T degrees (default 1e-3)",
    )
    group.add_argument(
        "--fps", type=float, metavar="N", help="of --gltf and --usd: N evenly spaced keys a second instead"
    )
    group.add_argument(
        "--with", dest="parts", metavar="PART,..", help=f"of --gltf and --usd: draw {', '.join(PARTS)} too"
    )


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
    _check_numbers(args, files)
    if "parquet" in files:
        from ..export.table import check_parquet

        check_parquet()
    if "gltf" in files:
        from ..export.gltf import check_gltf

        check_gltf()
    if "usd" in files:
        from ..export.usd import check_usd

        check_usd()


def _check_numbers(args: argparse.Namespace, files: dict[str, str]) -> None:
    for option in ("tolerance", "fps", "parts"):
        given = getattr(args, option)
        if given is not None and not {"gltf", "usd"} & set(files):
            raise InputError(
                "--with" if option == "parts" else f"--{option}", given, "it together with --gltf or --usd"
            )
    if args.tolerance is not None and not (math.isfinite(args.tolerance) and 1e-9 <= args.tolerance <= 0.5):
        raise InputError("--tolerance", args.tolerance, "a share of the body's size from 1e-9 to 0.5")
    if args.fps is not None and not (math.isfinite(args.fps) and 1e-3 <= args.fps <= 1e5):
        raise InputError("--fps", args.fps, "keys a second, from 1e-3 to 1e5")
    if args.fps is not None and args.tolerance is not None:
        raise InputError("--tolerance", args.tolerance, "either it or --fps")
    for part in _parts(args):
        if part not in PARTS:
            raise InputError("--with", part, one_of(part, PARTS))


def _parts(args: argparse.Namespace) -> list[str]:
    return args.parts.split(",") if args.parts is not None else []


def write_exports(
    args: argparse.Namespace, record: FlightRecord, looks: Looks | None, say: Callable[[str], None]
) -> None:
    """Write what is asked for, and ``say`` a line of each file; raises InputError."""
    files = asked(args)
    if "csv" in files or "parquet" in files:
        from ..export import table

        columns = table.state_columns(record)
        for name in ("csv", "parquet"):
            if name in files:
                with Progress(f"writing {files[name]}") as progress:
                    if name == "csv":
                        table.write_csv(files[name], columns, progress.fraction)
                    else:
                        table.write_parquet(files[name], columns)
                say(f"{files[name]}: {len(record.times_ns)} states")
    if "gltf" in files or "usd" in files:
        _write_animations(args, files, record, looks, say)


def _write_animations(
    args: argparse.Namespace,
    files: dict[str, str],
    record: FlightRecord,
    looks: Looks | None,
    say: Callable[[str], None],
) -> None:
    from ..export.animation import animate
    from ..export.gltf import write_gltf
    from ..export.sampling import body_size
    from ..export.usd import write_usd

    parts = _parts(args)
    with Progress("choosing keys") as progress:
        made = animate(record, looks, args.tolerance or 1e-3, args.fps, "ghost" in parts, progress.fraction)
    for name in ("gltf", "usd"):
        if name not in files:
            continue
        with Progress(f"writing {files[name]}"):
            if name == "gltf":
                write_gltf(files[name], record, made.motion, made.keys, "trail" in parts)
            else:
                trail = body_size(record) if "trail" in parts else 0.0
                write_usd(files[name], record, made.motion, made.keys, args.fps, trail)
        for line in made.report:
            say(f"{files[name]}: {line}")
