# SPDX-License-Identifier: MIT
"""Real processes of this package for tests: started, awaited, signalled and ended by their own process id."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rigid_proto_ros.base.interrupts import end_with_this_thread

SOURCE = Path(__file__).resolve().parent.parent
READY_S = 180.0
"""Longer than a first start that builds the kernels takes on a loaded machine; every wait's end."""


def command(name: str, *arguments: object) -> list[str]:
    """How to start one of the package's executables with this interpreter."""
    own = ("often_reporting_node", "plain_callbacks_node")
    module = [name] if name in own else ["rigid_proto_ros.cli.executables", name]
    return [sys.executable, "-m", *module, *map(str, arguments)]


def from_source(environment: dict[str, str]) -> dict[str, str]:
    """The environment with this source tree first on the path, and what tests start themselves last."""
    rest = filter(None, [environment.get("PYTHONPATH", "")])
    path = os.pathsep.join([str(SOURCE), *rest, str(SOURCE / "test")])
    return {**environment, "PYTHONPATH": path, "PYTHONFAULTHANDLER": "1"}


def run(name: str, *arguments: object, environment: dict[str, str], cwd: Path | None = None, timeout: float = READY_S):
    """Run an executable to its end; returns the CompletedProcess with text."""
    return subprocess.run(
        command(name, *arguments),
        env=from_source(environment),
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


class RosProcess:
    """A process with its output in files ``<log>.out`` and ``<log>.err``."""

    def __init__(self, name: str, *arguments: object, environment: dict[str, str], log: Path) -> None:
        self._out, self._err = log.with_suffix(".out"), log.with_suffix(".err")
        with open(self._out, "w") as out, open(self._err, "w") as err:
            self.process = subprocess.Popen(
                command(name, *arguments),
                env=from_source(environment),
                cwd=log.parent,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                # A test that fails before it ends its process leaves none behind.
                preexec_fn=end_with_this_thread(),
            )

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def output(self) -> str:
        return self._out.read_text()

    @property
    def errors(self) -> str:
        return self._err.read_text()

    def wait_for(self, text: str) -> None:
        """Wait until ``text`` stands in the output or the errors."""
        deadline = time.monotonic() + READY_S
        while text not in self.output + self.errors:
            ended = self.process.poll()
            assert ended is None, f"ended with {ended}: {self.output}{self.errors}"
            assert time.monotonic() < deadline, f"no {text!r} within {READY_S} s: {self.output}{self.errors}"
            time.sleep(0.02)

    def end(self, number: int = signal.SIGINT, within_s: float = READY_S) -> int:
        """Send a signal, wait for the end and return the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
            try:
                self.process.wait(within_s)
            except subprocess.TimeoutExpired:
                # Python's fault handler writes every thread's stack to the log before the process dies of it.
                self.process.send_signal(signal.SIGABRT)
                self.process.wait()
                raise AssertionError(f"still there {within_s} s after signal {number}: {self.errors}") from None
        return self.process.returncode


def start_node(
    environment: dict[str, str],
    log: Path,
    values: dict | None = None,
    *arguments: object,
    name: str = "rigid_body_node",
) -> RosProcess:
    """A node with these ROS arguments, a parameter file's for example, and then these parameters."""
    given = [word for key, value in (values or {}).items() for word in ("-p", f"{key}:={json.dumps(value)}")]
    return RosProcess(name, "--ros-args", *arguments, *given, environment=environment, log=log)


@contextmanager
def running_node(
    environment: dict[str, str], log: Path, values: dict | None = None, *arguments: object
) -> Iterator[RosProcess]:
    """A node that flies; ended by SIGINT, with status 0, at the end."""
    node = start_node(environment, log, values, *arguments)
    try:
        node.wait_for("is simulating")
        yield node
    finally:
        status = node.end()
    assert status == 0, node.errors


def descendants(pid: int) -> set[int]:
    """Process ids of all children, and theirs."""
    found: set[int] = set()
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = {int(child) for child in task.read_text().split()}
        except OSError:
            continue
        for child in children:
            found |= {child} | descendants(child)
    return found


def alive(pid: int) -> bool:
    """Whether a process runs (one that ended and waits for its parent doesn't)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def catches(pid: int, number: int) -> bool:
    """Whether a process has a handler of its own for a signal and for SIGTERM, which no interpreter starts with."""
    status = Path(f"/proc/{pid}/status").read_text()
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    return all(caught >> (each - 1) & 1 for each in (number, signal.SIGTERM))
