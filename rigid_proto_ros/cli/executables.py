# SPDX-License-Identifier: MIT
"""Entry points of the installed executables. If a required package is missing, they print one line that says what to
install.

Until that is checked and signals end the process quietly, no other module of this package but base/interrupts.py is
imported. `python -m rigid_proto_ros.cli.executables PROGRAM ...` starts the executables, too.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import sys

from ..base import interrupts

NUMERICS = {"numpy": "numpy", "yaml": "PyYAML"}
"""Required packages by import name."""


def rigid_proto() -> int:
    """Run the command line."""
    return _start("rigid_proto", "cli.main")


def rigid_body_node() -> int:
    """Run the node. After a signal its exit status is 0: launch reports any other status as a crash."""
    return _start("rigid_body_node", "ros.main", needs_ros=True, interrupted=0)


def poke_client() -> int:
    """Run the client that sends scripts and single commands."""
    return _start("poke_client", "ros.poke_client", needs_ros=True)


def _start(program: str, module: str, needs_ros: bool = False, interrupted: int | None = None) -> int:
    """Import and run a program. interrupted: its exit status after a signal; None for 128 + the signal's number."""
    interrupts.end_at_once(interrupted)
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # closed, as by 2>&-: the next file opened would get its descriptor
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
    except MemoryError:  # during imports; the program itself reports it later
        print(f"{program}: out of memory", file=sys.stderr)
        return 2
    interrupts.done()
    return interrupts.leave(status)


def _remedy(needs_ros: bool) -> str:
    """One line that says what is missing and how to install it; empty if nothing is."""
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
    """Raises InputError if rclpy isn't installed."""
    from ..base.errors import InputError, is_missing

    if importlib.util.find_spec("rclpy") is None:
        source = "; or source the setup.bash of a ROS installation"
        raise InputError(field, is_missing("rclpy", "ros") + source)


def own_executable(name: str) -> list[str]:
    """Command that starts an executable of this package with the interpreter and packages of this process. Raises
    InputError if ROS isn't among them.
    """
    check_rclpy(name)
    return [sys.executable, "-P", "-m", "rigid_proto_ros.cli.executables", name]


def as_typed(name: str) -> str:
    """What a user types to start an executable of this environment: its name, or its path if it isn't on PATH."""
    import shutil
    from pathlib import Path

    beside = Path(sys.executable).with_name(name)
    if shutil.which(name) or not beside.is_file():
        return name
    return str(beside.relative_to(Path.cwd()) if beside.is_relative_to(Path.cwd()) else beside)


def text_parameter(name: str, text: str) -> list[str]:
    """ROS arguments that set a text parameter of the node. Quoted, because values are parsed as YAML, where ``part
    #2.obj`` is ``part``.
    """
    return ["-p", f"{name}:={json.dumps(text, ensure_ascii=False)}"]


if __name__ == "__main__":
    PROGRAMS = {program.__name__: program for program in (rigid_proto, rigid_body_node, poke_client)}
    sys.exit(PROGRAMS[sys.argv.pop(1)]())
