# SPDX-License-Identifier: MIT
"""Child processes that never outlive their parent's command."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys

from ..base.child_processes import end_with_this_thread, with_this_package
from ..base.errors import InputError, is_missing

GRACE_S = 5.0
"""A process that doesn't end within this time of SIGTERM is killed."""


def check_rclpy(field: str) -> None:
    """Raise InputError where rclpy isn't found."""
    if importlib.util.find_spec("rclpy") is None:
        source = "; or source the setup.bash of a ROS installation"
        raise InputError(field, is_missing("rclpy", "ros") + source)


def own_executable(name: str) -> list[str]:
    """How to start one of this package's executables with the interpreter and packages of this process. Raises
    InputError where they lack ROS.
    """
    check_rclpy(name)
    return [sys.executable, "-m", "rigid_proto_ros.cli.executables", name]


def text_parameter(name: str, text: str) -> list[str]:
    """ROS arguments that give the node a text. Quoted: they are read as YAML, where ``part #2.obj`` is ``part``."""
    return ["-p", f"{name}:={json.dumps(text, ensure_ascii=False)}"]


class Processes:
    """Starts processes and ends them all on leaving, also when the command itself is ended by a signal."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._running):
            self.end(process)

    def start(self, command: list[str]) -> subprocess.Popen:
        """Start a process in a session of its own: a Ctrl-C at the terminal reaches this command alone,
        which ends them.
        """
        process = subprocess.Popen(
            command, start_new_session=True, preexec_fn=end_with_this_thread(), env=with_this_package()
        )
        self._running.append(process)
        return process

    def end(self, process: subprocess.Popen) -> int:
        """SIGTERM, of which Python dies quietly where it has no handler yet, then after a while SIGKILL; returns the
        status.
        """
        if process in self._running:
            self._running.remove(process)
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
        return process.wait()
