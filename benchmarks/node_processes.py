# SPDX-License-Identifier: MIT
"""Real processes for the node's benchmark: the node, its subscribers, and what the operating system says of them."""

from __future__ import annotations

import functools
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER.parent), str(FOLDER.parent / "test")]

from rigid_proto_ros.rerun_view.viewers import viewer_program
from rigid_proto_ros.ros.domain import hold_domain

_held: list[socket.socket] = []


@functools.cache
def domain() -> str:
    """A ROS domain that no other benchmark or test session on this machine holds."""
    held = hold_domain(range(1, 102))
    assert held is not None, "all ROS domains 1..101 are held by others"
    number, lock = held
    _held.append(lock)
    return str(number)


def environment() -> dict[str, str]:
    """A private domain on this machine."""
    return {**os.environ, "ROS_DOMAIN_ID": domain(), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


class Process:
    """A child process; leaving the context ends it."""

    def __init__(self, *command: str) -> None:
        self.popen = subprocess.Popen(
            [sys.executable, *command],
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.errors: list[str] = []
        self._flying = threading.Event()
        threading.Thread(target=self._read_errors, daemon=True).start()
        self.system = psutil.Process(self.popen.pid)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_) -> None:
        self.end()

    def _read_errors(self) -> None:
        for line in self.popen.stderr:
            self.errors.append(line)
            if "is simulating" in line:
                self._flying.set()

    def wait_until_flying(self) -> None:
        """Until the node says that it flies."""
        if not self._flying.wait(300):
            raise RuntimeError("".join(self.errors))

    def end(self) -> str:
        """SIGINT, and what it printed."""
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGINT)
        try:
            self.popen.wait(60)
        except subprocess.TimeoutExpired:
            self.popen.kill()
        return self.popen.stdout.read()

    def cpu_seconds(self) -> float:
        """User and system time so far."""
        times = self.system.cpu_times()
        return times.user + times.system

    def cpu_share(self, seconds: float) -> float:
        """Share of one core in per cent over the next ``seconds``."""
        before, start = self.cpu_seconds(), time.monotonic()
        time.sleep(seconds)
        return 100.0 * (self.cpu_seconds() - before) / (time.monotonic() - start)

    def memory_mb(self) -> float:
        """Resident memory."""
        return self.system.memory_info().rss / 2**20


def node(*parameters: str, wait_s: float = 1.0) -> Process:
    """Our node on the T-handle with ``name:=value`` parameters, running."""
    arguments = [word for parameter in parameters for word in ("-p", parameter)]
    process = Process(
        "-m", "rigid_proto_ros.cli.executables", "rigid_body_node", "--ros-args", "-p", "mesh:=t_handle", *arguments
    )
    try:
        process.wait_until_flying()
    except RuntimeError:
        process.end()
        raise
    time.sleep(wait_s)
    return process


def viewer(flying: Process) -> subprocess.Popen:
    """A viewer without a window that watches the node's live stream."""
    address = next(word for line in flying.errors for word in line.split() if word.startswith("rerun+http"))
    return subprocess.Popen(
        # The program itself: the script of that name would be killed and leave it alive.
        [str(viewer_program()), "--port", "auto", "--connect", address, "--headless"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment(),
    )


def client(name: str, *arguments: str) -> Process:
    """One of the clients of node_clients.py."""
    return Process(str(FOLDER / "node_clients.py"), name, *arguments)
