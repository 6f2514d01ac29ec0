# SPDX-License-Identifier: MIT
"""What tests of the page's program need: Node that reads TypeScript, the kernels, and the page's data as a file."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from kernels.wasm_tools import module, node

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.page.bundle import SOURCE, installed_node

READS_TYPESCRIPT = (22, 18)
TESTS = SOURCE / "test"


@cache
def kernels() -> Path:
    """The kernels' module of the present sources, and beside the page's sources what calls them."""
    if not TESTS.is_dir():
        pytest.skip("not run from a source tree")
    of_node = subprocess.run([node(), "--version"], capture_output=True, text=True, check=True).stdout
    if tuple(map(int, of_node.strip()[1:].split(".")[:2])) < READS_TYPESCRIPT:
        pytest.skip(f"Node {of_node.strip()} doesn't read TypeScript")
    # Written beside and moved: another test may be reading it.
    target = SOURCE / "src" / "kernels.ts"
    beside = target.with_name(f".kernels.{os.getpid()}.ts")
    command = [sys.executable, "-m", "rigid_proto_ros.kernels", "wasm", "--typescript", str(beside)]
    module()
    subprocess.run(command, check=True, capture_output=True)
    if target.is_file() and target.read_bytes() == beside.read_bytes():
        beside.unlink()
    else:
        beside.replace(target)
    return module()


@cache
def packages() -> Path:
    """The folder with the packages that the page is built of; a test that asks for it skips where they can't be had."""
    kernels()
    try:
        installed_node()
    except InputError as error:
        pytest.skip(str(error))
    return SOURCE / "node_modules"


def run_node(*arguments: object, **options: Any) -> str:
    """What a program of page/test prints."""
    done = subprocess.run(list(map(str, [node(), *arguments])), capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr[-3000:] + done.stdout[-3000:]
    return done.stdout
