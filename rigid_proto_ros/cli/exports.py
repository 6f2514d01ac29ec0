# SPDX-License-Identifier: MIT
"""The options of ``simulate`` and ``replay`` that write the motion for other tools."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

from ..base.command_line import Progress, number_from
from ..base.errors import InputError, is_missing
from ..base.files import check_whole_file

if TYPE_CHECKING:
    from ..export.flight_record import FlightRecord, Source


class Export(NamedTuple):
    """An export. endings: its file extensions. needs: a module that its writer imports, and the package to install."""

    endings: tuple[str, ...]
    help: str
    needs: tuple[str, str] = ("", "")


EXPORTS = {
    "csv": Export((".csv",), "write the states as a CSV table"),
    "parquet": Export((".parquet",), "write the states as a Parquet table", ("pyarrow.parquet", "pyarrow")),
    "gltf": Export((".glb",), "write the motion for Blender, Unreal, three.js and others that read glTF"),
    "usd": Export(
        (".usda", ".usdc"),
        "write the motion, with mass properties, for Omniverse, Houdini and others",
        ("pxr", "usd-core"),
    ),
}
"""Exports by option; ``write_exports`` calls the writers."""

TABLES = ("csv", "parquet")
ANIMATIONS = ("gltf", "usd")
"""Options to which ``--fps`` applies. Tables have the states of publications."""

DEFAULT_FPS = 30.0


def add_exports(parser: argparse.ArgumentParser) -> None:
    """Declare the options that write the motion for other tools."""
    group = parser.add_argument_group("for other tools")
    for name, export in EXPORTS.items():
        group.add_argument(f"--{name}", metavar=f"FILE{export.endings[0]}", help=export.help)
    group.add_argument(
        "--fps",
        type=number_from(1e-3, 1e5),
        metavar="N",
        help=f"with --gltf or --usd: frames per second (default {DEFAULT_FPS:g})",
    )


def asked(args: argparse.Namespace) -> dict[str, str]:
    """The requested files, by option."""
    return {name: file for name in EXPORTS if (file := getattr(args, name))}


def check_exports(args: argparse.Namespace) -> None:
    """Check before any work that the files can be written. Raises InputError."""
    files = asked(args)
    for name, file in files.items():
        endings, _, (module, package) = EXPORTS[name]
        if not file.lower().endswith(endings):
            raise InputError(f"--{name}", file, f"a file that ends in {' or '.join(endings)}")
        check_whole_file(f"--{name}", file)
        if module and (find_spec(module.partition(".")[0]) is None or find_spec(module) is None):
            raise InputError(f"--{name}", is_missing(package, "export"))
    if args.fps is not None and not set(ANIMATIONS) & set(files):
        raise InputError("--fps", "needs --gltf or --usd")


def write_exports(
    args: argparse.Namespace, record: FlightRecord, source: Source | None, say: Callable[[str], None]
) -> None:
    """Write the requested files and ``say`` one line for each. Raises InputError."""
    files = asked(args)
    if set(TABLES) & set(files):
        from ..export import table

        columns = table.state_columns(record)
        for name, write in (("csv", table.write_csv), ("parquet", table.write_parquet)):
            if name in files:
                with Progress(f"writing {files[name]}"):
                    write(files[name], columns)
                say(f"{files[name]}: {len(record.times_ns)} states")
    if not set(ANIMATIONS) & set(files):
        return
    from ..export.flight_record import frames
    from ..export.tracks import tracks_of

    fps = args.fps or DEFAULT_FPS
    made, report = frames(record, source, fps)
    tracks = tracks_of(made)
    if "gltf" in files:
        from ..export.gltf import write_gltf

        write_gltf(files["gltf"], made, tracks)
        say(f"{files['gltf']}: {report}")
    if "usd" in files:
        from ..export.usd import write_usd

        changed = write_usd(files["usd"], made, tracks, fps)
        for line in (report, *changed):
            say(f"{files['usd']}: {line}")
