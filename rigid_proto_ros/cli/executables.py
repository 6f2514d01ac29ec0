# SPDX-License-Identifier: MIT
"""What the installed executables start: where a package is missing that each of them needs, one line says what to
install.

Nothing of ours but this is imported before that is known.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys

from ..base import interrupts

NUMERICS = {"numba": "numba", "numpy": "numpy", "yaml": "PyYAML"}
"""Packages without which nothing runs, by the names that they are imported by."""


def rigid_proto() -> int:
    """The command line."""
    return _start("rigid_proto", "cli.main")


def rigid_body_node() -> int:
    """The node."""
    return _start("rigid_body_node", "ros.main", needs_ros=True)


def poke_client() -> int:
    """The client that sends scripts and single commands."""
    return _start("poke_client", "ros.poke_client", needs_ros=True)


def _start(program: str, module: str, needs_ros: bool = False) -> int:
    interrupts.end_at_once()
    remedy = _remedy(needs_ros)
    if remedy:
        print(f"{program}: {remedy}", file=sys.stderr)
        return 2
    package = __package__.rpartition(".")[0]
    return importlib.import_module(f"{package}.{module}").main()


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
