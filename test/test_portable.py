# SPDX-License-Identifier: MIT
"""Nothing of POSIX alone, ROS or Rerun is needed to inspect, simulate, record, replay and serve the page, as on macOS and Windows."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parent.parent

HIDDEN = """
import builtins, os, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # also where these tests run in a background that ignores it

MODULES = {"fcntl", "resource", "termios", "tty", "pty", "pwd", "grp", "syslog", "posix", "rclpy", "rerun"}
NAMES = {
    "signal": {"SIGUSR1", "SIGUSR2", "SIGHUP", "SIGALRM", "SIGQUIT", "SIGKILL", "SIGCHLD", "pthread_sigmask", "setitimer"},
    "os": {"sched_getaffinity", "getuid", "geteuid", "getpgid", "setsid", "killpg", "fork", "uname", "mkfifo", "confstr"},
}
import_module = builtins.__import__

class Seen:
    def __init__(self, module):
        self.__dict__.update({k: v for k, v in vars(module).items() if k not in NAMES[module.__name__]})

SEEN = {module.__name__: Seen(module) for module in (os, signal)}

def as_elsewhere(name, globals=None, *rest, **named):
    # Libraries have ways of their own for each system; what is asked here is what this package needs.
    if not (globals or {}).get("__name__", "").startswith("rigid_proto_ros"):
        return import_module(name, globals, *rest, **named)
    if name.partition(".")[0] in MODULES:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return SEEN.get(name) or import_module(name, globals, *rest, **named)

builtins.__import__ = as_elsewhere
from rigid_proto_ros.base.interrupts import leave
from rigid_proto_ros.cli.main import main
for command in sys.argv[1:]:
    status = main(command.split())
    if status:
        leave(status)  # as the installed command ends
"""


def test_a_mesh_is_inspected_a_simulation_recorded_replayed_and_verified_and_the_page_served(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    pytest.importorskip("websockets")
    commands = (
        *("inspect hammer", "simulate t_handle --duration 0.5 --bag flight.mcap"),
        *("replay flight.mcap --verify --csv flight.csv", "workbench hammer --no-browser"),
    )
    process = subprocess.Popen(
        [sys.executable, "-c", HIDDEN, *commands],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(SOURCE), *filter(None, sys.path)])},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        said = []
        ready = any((said.append(line), "The workbench is at" in line)[1] for line in process.stdout)
        assert ready, "".join(said)
        assert (tmp_path / "flight.csv").exists()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=180.0) == 130  # by Ctrl-C
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
