# SPDX-License-Identifier: MIT
"""Ctrl-C at any moment ends a command quietly with 130, and a second one changes nothing."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import pytest

AT_AN_IMPORT = """
import importlib.abc, os, signal, sys
MODULE = sys.argv[1]

class Interrupter(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == MODULE:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupter())
from rigid_proto_ros.cli import executables
program, sys.argv = sys.argv[2], sys.argv[2:]
sys.exit(getattr(executables, program)())
"""

AT_THE_END = """
import os, signal, sys
from rigid_proto_ros.cli import main

class Module:
    EXAMPLES = ()
    add_arguments = staticmethod(lambda parser: None)

    @staticmethod
    def run(args):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            while True:
                pass
        finally:
            os.kill(os.getpid(), signal.SIGINT)
            sum(range(1000))
            print("closed")

sys.modules["rigid_proto_ros.cli.inspect"] = Module
sys.argv = ["rigid_proto", "inspect"]
sys.exit(main.main())
"""


def ended(code: str, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=180, check=False
    )


@pytest.mark.parametrize(
    ("module", "command"),
    [
        ("rigid_proto_ros.base.command_line", "rigid_proto simulate t_handle"),
        ("numba", "rigid_proto simulate t_handle"),
        ("rigid_proto_ros.simulation.flight", "rigid_proto replay session.rrd"),
        ("numpy", "rigid_proto inspect hammer"),
        ("yaml", "poke_client poke --force 0 0 1"),
        ("rclpy", "poke_client poke --force 0 0 1"),
        ("std_msgs", "poke_client poke --force 0 0 1"),
    ],
)
def test_during_imports(module, command) -> None:
    if importlib.util.find_spec(module.partition(".")[0]) is None:
        pytest.skip(f"{module} is not installed")
    done = ended(AT_AN_IMPORT, module, *command.split())
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_while_it_works_and_again_while_it_closes() -> None:
    done = ended(AT_THE_END)
    assert (done.returncode, done.stdout, done.stderr) == (130, "closed\n", "")
