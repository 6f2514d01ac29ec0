# SPDX-License-Identifier: MIT
"""``poke_client``: send a poke script, or one command, to a running node.

poke_client SCRIPT.yaml [--reset] [--lead S] [--node NAME]
    poke_client poke --at tip --push 5
    poke_client wrench --force 1 0 0 --for 2

Exit status: 0 all commands were sent; 1 a command was late or refused, or dropped by another client's reset; 2 the
input was refused or no node was found; 130 ended by Ctrl-C (143 by SIGTERM), and commands already sent still act.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from typing import TYPE_CHECKING, Any

from ..base import interrupts
from ..base.command_line import Parser, number_from
from ..base.errors import InputError, tell

if TYPE_CHECKING:
    from ..simulation.commands import Command

_ONE_LINE_COMMANDS = ("poke", "wrench")


def main(argv: list[str] | None = None) -> int:
    """Send the commands that the arguments give; returns the exit status."""
    own_process = argv is None
    argv = sys.argv[1:] if argv is None else argv
    own = argv[: argv.index("--ros-args")] if "--ros-args" in argv else argv
    try:
        from ..scene.script import schedules

        args = _arguments(own)
        # Read the script before waiting for a node, so that an error in it is reported at once.
        script = _script(args)
        if args.dry_run:
            print("\n".join(json.dumps(entries) for _, entries in schedules(script)), flush=True)
            return 0
        # This import takes half a second, during which there is nothing to close yet.
        importlib.import_module(".script_sender", __package__)
        if own_process:
            return interrupts.run(lambda: _send(script, args, argv), lambda error: tell("poke_client", error))
        return _send(script, args, argv)
    except (InputError, OSError) as error:
        return tell("poke_client", error)


EXAMPLES = (
    ("poke_client poke --at tip --push 0.05", "0.05 N along the inward normal at the contact tip"),
    ("poke_client poke --at vertex/7 --impulse 0.001 0 0", "0.001 N s at a vertex, at once, world axes"),
    ("poke_client wrench --torque 0 0 -2e-4 --axes body --for 3", "a torque held for 3 s, body axes"),
    ("poke_client msg_examples/flip_and_poke.yaml --reset", "a script, with times counted from the reset"),
    ("poke_client msg_examples/flip_and_poke.yaml --dry-run", "print the commands without sending them"),
)


def _arguments(argv: list[str]) -> argparse.Namespace:
    from ..scene.script import MAX_TIME_S

    parser = Parser(
        prog="poke_client",
        description="Send a poke script, or one command, to a running rigid_body node.",
        usage="poke_client (SCRIPT.yaml | poke ... | wrench ...) [--reset] [--lead S] [--node NAME]",
        examples=EXAMPLES,
    )
    parser.add_argument(
        "what", metavar="SCRIPT.yaml | poke | wrench", help="a script file, or one command given by the options below"
    )
    parser.add_argument("--node", default="/rigid_body", metavar="NAME", help="the node (default /rigid_body)")
    parser.add_argument("--reset", action="store_true", help="reset first, so that t is absolute simulated time")
    lead, timeout = number_from(0.0, 3600.0), number_from(0.0, MAX_TIME_S)
    parser.add_argument(
        "--lead", type=lead, default=0.2, metavar="S", help="without --reset: seconds from now to t = 0 (default 0.2)"
    )
    parser.add_argument("--dry-run", action="store_true", help="print what would be sent, and send nothing")
    parser.add_argument(
        "--timeout",
        type=timeout,
        default=10.0,
        metavar="S",
        help="maximum time to wait for the node (default 10; 0: no limit)",
    )
    line = parser.add_argument_group("one command from the command line")
    line.add_argument("--at", help="com (the default), origin, a contact, vertex/<i>, point/<x>,<y>,<z>, ray/...")
    line.add_argument("--force", type=float, nargs=3, metavar=("X", "Y", "Z"), help="N")
    line.add_argument("--push", type=float, metavar="N", help="N along the inward normal")
    line.add_argument("--impulse", type=float, nargs=3, metavar=("X", "Y", "Z"), help="N s, at once (poke only)")
    line.add_argument("--torque", type=float, nargs=3, metavar=("X", "Y", "Z"), help="N m")
    line.add_argument("--angular-impulse", type=float, nargs=3, metavar=("X", "Y", "Z"), help="N m s (poke only)")
    line.add_argument("--axes", choices=("world", "body"), help="axes of force and torque (default world)")
    line.add_argument("--slot", metavar="NAME", help="replace only the wrench or poke in this slot")
    line.add_argument("--for", dest="duration", type=float, metavar="S", help="duration in seconds")
    return parser.parse_args(argv)


def _script(args: argparse.Namespace) -> list[Command]:
    from ..scene.script import parse_script, read_script

    given = {
        key: value
        for key in ("at", "force", "push", "impulse", "torque", "angular_impulse", "axes", "duration", "slot")
        if (value := getattr(args, key)) is not None
    }
    if args.what not in _ONE_LINE_COMMANDS:
        for key in given:
            option = "--for" if key == "duration" else f"--{key.replace('_', '-')}"
            raise InputError(option, "an option of poke and wrench: a script has its own values")
        return read_script(args.what)
    import yaml

    given["at"] = _point(given.get("at", "com"))
    entry = {"t": 0.0, **given} if args.what == "poke" else {"t": 0.0, "wrench": given}
    return parse_script(yaml.safe_dump([entry]), args.what)


def _point(text: str) -> str | dict[str, Any]:
    """Convert a point from the notation of a frame to that of a script entry."""
    try:
        match text.split("/"):
            case ["vertex", number]:
                return {"vertex": int(number)}
            case ["point", numbers]:
                return {"point": _three(numbers)}
            case ["ray", origin, direction]:
                return {"ray": {"origin": _three(origin), "direction": _three(direction)}}
    except ValueError:
        accepted = "com, origin, a contact, vertex/<i>, point/<x>,<y>,<z>, ray/<x>,<y>,<z>/<x>,<y>,<z>"
        raise InputError("--at", text, accepted) from None
    return text


def _three(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def _send(script: list[Command], args: argparse.Namespace, argv: list[str]) -> int:
    from .script_sender import ros_context, send_script

    with ros_context(*argv):
        report = send_script(script, args.node, args.timeout, args.reset, args.lead)
    print(report.text)
    return 0 if report.all_in_time else 1
