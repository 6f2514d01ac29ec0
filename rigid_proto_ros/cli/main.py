# SPDX-License-Identifier: MIT
"""``rigid_proto``: the console command. Each of its commands is a module of this folder.

Exit status: 0 success, 1 a check failed, 2 the input was refused (one line on stderr), 130 ended by Ctrl-C (143 by
SIGTERM).
"""

from __future__ import annotations

import argparse
import importlib
import io
import sys

from ..base import interrupts
from ..base.command_line import Parser
from ..base.errors import tell

COMMANDS = {
    "inspect": "mass properties of a mesh, and a check of the mesh",
    "simulate": "simulate a scene without ROS, as fast as possible",
    "sweep": "simulate many variations of a scene and write one table",
    "replay": "show, verify, convert, publish or branch a recorded session",
    "identify": "mass properties from recorded motion, and which of them the motion identifies",
    "snapshot": "write a picture of a recorded session, without a display",
    "lesson": "write the page as one file that opens in a lesson, without a server",
    "demo": "start the node, send scripted pokes, record, and exit",
    "up": "start the node with a live view, until Ctrl-C",
    "workbench": "simulate a body and serve its interactive page, until Ctrl-C; needs no ROS",
}

EXAMPLES = (
    ("rigid_proto inspect hammer", "mass, COM and inertia of a bundled mesh"),
    ("rigid_proto simulate t_handle --record out/flight.mcap", "simulate a bundled scene, and record it"),
    ("rigid_proto replay out/flight.mcap --verify", "repeat the simulation, and compare every state bit for bit"),
)


class ShowVersion(argparse.Action):
    """Option that prints the package's version, which is only then looked up."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print the version and exit."""
        from .. import __version__

        print(__version__)
        parser.exit()


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit status."""
    own_process = argv is None
    argv = sys.argv[1:] if argv is None else argv
    parser = Parser(
        prog="rigid_proto",
        description="Inspect a mesh, simulate it as a rigid body, record and replay the motion.",
        examples=EXAMPLES,
    )
    parser.add_argument("--version", action=ShowVersion, nargs=0, help="show the version and exit")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    for name, summary in COMMANDS.items():
        command = subparsers.add_parser(name, help=summary, description=f"{summary[0].upper()}{summary[1:]}.")
        # Only the command that runs is imported, so that each starts fast.
        if argv and argv[0] == name:
            module = importlib.import_module(f".{name}", __package__)
            module.add_arguments(command)
            command.show_examples(module.EXAMPLES)
            command.set_defaults(run=module.run)
    args = parser.parse_args(argv)
    program = f"rigid_proto {args.command}"
    if own_process:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")  # for characters that the terminal's encoding lacks
        # All commands need this module. It is imported here because an interrupt now finds nothing to close.
        importlib.import_module("..base.compilation", __package__)
        return interrupts.run(lambda: _run(args), lambda error: tell(program, error))
    try:
        return int(args.run(args))
    except KeyboardInterrupt:
        return 130
    except Exception as error:
        return tell(program, error)


def _run(args: argparse.Namespace) -> int:
    """Run the command."""
    status = int(args.run(args))
    print(end="", flush=True)  # inside _run, so that an output that can't be written is reported as for any file
    return status
