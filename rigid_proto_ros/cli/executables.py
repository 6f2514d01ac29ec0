# SPDX-License-Identifier: MIT
"""What the installed executables start: where a package is missing that each of them needs, one line says what to
install.

Nothing of ours but this is imported before that is known, and before a signal ends the process quietly.
`python -m rigid_proto_ros.cli.executables PROGRAM ...` starts them, too.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import sys

from ..base import interrupts

NUMERICS = {"numpy": "numpy", "yaml": "PyYAML"}
"""Packages without which nothing runs, by the names that they are imported by."""


def rigid_proto() -> int:
    """The command line."""
    return _start("rigid_proto", "cli.main")


def rigid_body_node() -> int:
    """The node, which ends when it is asked to: launch reports any other status than 0 as a death."""
    return _start("rigid_body_node", "ros.main", needs_ros=True, interrupted=0)


def poke_client() -> int:
    """The client that sends scripts and single commands."""
    return _start("poke_client", "ros.poke_client", needs_ros=True)


def _start(program: str, module: str, needs_ros: bool = False, interrupted: int | None = None) -> int:
    """Import and run a program. interrupted: its exit status after a signal; None: 128 + the signal's number."""
    interrupts.end_at_once(interrupted)
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # closed, as by 2>&-: the next file that is opened would get its number
            stream = open(os.devnull, "r" if name == "stdin" else "w")  # noqa: SIM115 (until the end)
            os.set_inheritable(stream.fileno(), True)
            setattr(sys, name, stream)
    remedy = _remedy(needs_ros)
    if remedy:
        print(f"{program}: {remedy}", file=sys.stderr)
        return 2
    package = __package__.rpartition(".")[0]
    try:
        status = importlib.import_module(f"{package}.{module}").main()
    except MemoryError:  # while modules are imported; what a program runs says so itself
        print(f"{program}: out of memory", file=sys.stderr)
        return 2
    interrupts.done()
    return interrupts.leave(status)


def _remedy(needs_ros: bool) -> str:
    """What is missing and how it comes, in one line; empty when all is there."""
    missing = [name for module, name in NUMERICS.items() if importlib.util.find_spec(module) is None]
    if missing:
        return (
            f"{' and '.join(missing)} not found by {sys.executable}; run `make setup` in the repository and "
            f"`colcon build` again, or install into an active virtual environment: pip install {' '.join(missing)}"
        )
    if needs_ros and importlib.util.find_spec("rclpy") is None:
        return (
            f"rclpy not found by {sys.executable}; source the setup.bash of a ROS installation, such as "
            "/opt/ros/jazzy/setup.bash, or without one: pip install 'rigid_proto_ros[ros]'"
        )
    return ""


def check_rclpy(field: str) -> None:
    """Raise InputError where rclpy isn't found."""
    from ..base.errors import InputError, is_missing

    if importlib.util.find_spec("rclpy") is None:
        source = "; or source the setup.bash of a ROS installation"
        raise InputError(field, is_missing("rclpy", "ros") + source)


def own_executable(name: str) -> list[str]:
    """How to start one of this package's executables with the interpreter and packages of this process. Raises
    InputError where they lack ROS.
    """
    check_rclpy(name)
    return [sys.executable, "-P", "-m", "rigid_proto_ros.cli.executables", name]


def as_typed(name: str) -> str:
    """What starts an executable of this environment in the user's shell: its name, or its path where PATH doesn't have
    it.
    """
    import shutil
    from pathlib import Path

    beside = Path(sys.executable).with_name(name)
    if shutil.which(name) or not beside.is_file():
        return name
    return str(beside.relative_to(Path.cwd()) if beside.is_relative_to(Path.cwd()) else beside)


def text_parameter(name: str, text: str) -> list[str]:
    """ROS arguments that give the node a text. Quoted: they are read as YAML, where ``part #2.obj`` is ``part``."""
    return ["-p", f"{name}:={json.dumps(text, ensure_ascii=False)}"]


if __name__ == "__main__":
    PROGRAMS = {program.__name__: program for program in (rigid_proto, rigid_body_node, poke_client)}
    sys.exit(PROGRAMS[sys.argv.pop(1)]())
