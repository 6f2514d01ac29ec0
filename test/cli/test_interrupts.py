# SPDX-License-Identifier: MIT
"""Ctrl-C at any moment ends a command quietly with 130, and a second one changes nothing."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats
from ros_process import from_source

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

AT_A_CALL = """
import os, signal, sys
from rigid_proto_ros.cli import executables

left = int(sys.argv[1])

def count(*_):
    global left
    left -= 1
    if left == 0:
        sys.setprofile(None)
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

program, sys.argv = sys.argv[2], sys.argv[2:]
sys.setprofile(count)
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
        ("numpy", "rigid_proto inspect hammer"),
        ("yaml", "poke_client poke --force 0 0 1"),
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


ENDLESS = (
    "rigid_proto simulate t_handle --duration 1e9 --record session.mcap",
    "poke_client poke --at vertex/0 --push 1 --timeout 0",
)


@pytest.mark.parametrize("command", ENDLESS)
@given(exponent=floats(2.0, 6.0))  # the first calls set the handler
@settings(max_examples=3)
def test_at_a_call(command, exponent, ros_environment, tmp_path_factory) -> None:
    """At one call of a Python function, or return from it: the same one on a busy machine."""
    done = subprocess.run(
        [sys.executable, "-c", AT_A_CALL, str(round(10.0**exponent)), *command.split()],
        env=from_source(ros_environment),
        cwd=tmp_path_factory.getbasetemp(),
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
