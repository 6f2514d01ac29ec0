# SPDX-License-Identifier: MIT
"""``rigid_proto``: one console command; each of its commands is a module of this folder.

Exit status: 0 done, 1 a check failed, 2 the input was refused (one line on stderr).
"""

from __future__ import annotations

import importlib
import os
import signal
import sys

from .. import __version__
from ..command_line import Parser
from ..core.errors import InputError

COMMANDS = {
    "inspect": "mass properties of a mesh, and a verdict on it",
    "simulate": "the simulation without ROS, as fast as the machine goes",
    "sweep": "many variations of one scene into one table",
    "replay": "show, check or branch a recorded session",
    "snapshot": "a picture of a recorded session, without a display",
    "demo": "node, scripted pokes and recording in one go, ending by itself",
    "up": "node and live view, until Ctrl-C",
    "workbench": "node and interactive page, until Ctrl-C",
}


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit status."""
    argv = sys.argv[1:] if argv is None else argv
    parser = Parser(prog="rigid_proto", description="Prototype the properties of one rigid body.")
    parser.add_argument("--version", action="version", version=__version__)
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, parser_class=Parser)
    # Only the command that runs is imported, so that each starts as fast as it can.
    for name, summary in COMMANDS.items():
        if argv and argv[0] == name:
            importlib.import_module(f".{name}", __package__).add_parser(subparsers)
        else:
            subparsers.add_parser(name, help=summary)
    args = parser.parse_args(argv)
    # SIGTERM ends a command as Ctrl-C does, through every finally; so does SIGINT where the shell that started it in the
    # background had it ignored.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        return args.run(args)
    except InputError as error:
        print(f"rigid_proto {args.command}: {_one_line(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        # Asked to end, and ended: files are closed, children are gone.
        print(f"rigid_proto {args.command}: stopped", file=sys.stderr)
        return 0
    except BrokenPipeError:
        # The reader of our output went away, as `| head` does; Python would complain again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"rigid_proto {args.command}: {_one_line(error)}", file=sys.stderr)
        return 2


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


if __name__ == "__main__":
    sys.exit(main())
