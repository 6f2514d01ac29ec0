# SPDX-License-Identifier: MIT
"""Options of ``simulate`` and ``replay`` that write the motion for other tools."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import InputError, one_of
from ..base.files import output_file
from ..base.progress import Progress

if TYPE_CHECKING:
    from ..export.flight_record import FlightRecord, Source

ENDINGS = {
    "csv": (".csv",),
    "parquet": (".parquet",),
    "gltf": (".glb",),
    "usd": (".usda", ".usdc"),
}
"""Options that take a file, and how its name may end."""

HELP = {
    "csv": "write the states as a table",
    "parquet": "write the states as a table",
    "gltf": "write the motion for Blender, Unreal, three.js and others that read glTF",
    "usd": "write the motion, with mass properties, for Omniverse, Houdini and others that read USD",
}

ANIMATIONS = ("gltf", "usd")
"""Files that ``--fps`` and ``--with`` are of."""

PARTS = ("ghost", "string", "trail")

DEFAULT_FPS = 30.0


def add_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options that write the motion for other tools."""
    group = parser.add_argument_group("for other tools")
    for name, endings in ENDINGS.items():
        group.add_argument(f"--{name}", metavar=f"FILE{endings[0]}", help=HELP[name])
    group.add_argument(
        "--fps", type=float, metavar="N", help=f"with --gltf or --usd: frames a second (default {DEFAULT_FPS:g})"
    )
    group.add_argument("--with", metavar="PART,..", help=f"with --gltf or --usd: draw {', '.join(PARTS)} too")


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
    for option in ("fps", "with"):
        if getattr(args, option) is not None and not set(ANIMATIONS) & set(files):
            raise InputError(f"--{option}", "needs --gltf or --usd")
    if args.fps is not None and not (math.isfinite(args.fps) and 1e-3 <= args.fps <= 1e5):
        raise InputError("--fps", args.fps, "frames a second, from 1e-3 to 1e5")
    for part in _parts(args):
        if part not in PARTS:
            raise InputError("--with", part, one_of(part, PARTS))
    for name in files:
        _check_library(name)


def _check_library(name: str) -> None:
    """Raise InputError where what writes such a file isn't installed."""
    if name == "parquet":
        from ..export.table import check_parquet

        check_parquet()
    elif name == "gltf":
        from ..export.gltf import check_gltf

        check_gltf()
    elif name == "usd":
        from ..export.usd import check_usd

        check_usd()


def _parts(args: argparse.Namespace) -> list[str]:
    parts = getattr(args, "with")
    return [part.strip() for part in parts.split(",")] if parts is not None else []


def write_exports(
    args: argparse.Namespace, record: FlightRecord, source: Source | None, say: Callable[[str], None]
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
        _write_animations(args, files, record, source, say)


def _write_animations(
    args: argparse.Namespace,
    files: dict[str, str],
    record: FlightRecord,
    source: Source | None,
    say: Callable[[str], None],
) -> None:
    from ..export.flight_record import frames
    from ..export.tracks import tracks_of

    fps = args.fps or DEFAULT_FPS
    made, report = frames(record, source, fps)
    tracks = tracks_of(made, _parts(args))
    for name in ANIMATIONS:
        if name not in files:
            continue
        lines = [report]
        with Progress(f"writing {files[name]}"):
            if name == "gltf":
                from ..export.gltf import write_gltf

                write_gltf(files[name], made, tracks)
            else:
                from ..export.usd import write_usd

                lines += write_usd(files[name], made, tracks, fps)
        for line in lines:
            say(f"{files[name]}: {line}")
