# SPDX-License-Identifier: MIT
"""Arguments that several commands have, declared once."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def add_scene(parser: argparse.ArgumentParser, help: str, nargs: str | None = None, default: str | None = None) -> None:
    """SCENE.yaml: a scene by path or bundled name."""
    parser.add_argument("scene", nargs=nargs, default=default, metavar="SCENE.yaml", help=help)


def add_mesh(parser: argparse.ArgumentParser, help: str = "simulate this mesh") -> None:
    """--mesh: instead of the scene's."""
    parser.add_argument("--mesh", metavar="PATH", help=help)


def add_session(parser: argparse.ArgumentParser, node: str) -> None:
    """SESSION, and what a bag of it may lack: --scene and --node, of which ``node`` is the help."""
    parser.add_argument(
        "session", metavar="SESSION", help="an .rrd or .mcap recording, or a bag of ros2 bag record (file or folder)"
    )
    parser.add_argument("--scene", metavar="FILE", help="the scene, for a bag without one")
    parser.add_argument("--node", metavar="NAME", default="", help=node)


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json: for other programs."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def number_from(lower: float, upper: float) -> Callable[[str], float]:
    """The type of an option that takes a number within these bounds."""

    def number(text: str) -> float:
        if not lower <= (value := float(text)) <= upper:
            raise argparse.ArgumentTypeError(f"got {text}; accepted: a number from {lower:g} to {upper:g}")
        return value

    return number
