# SPDX-License-Identifier: MIT
"""Kernels kept on disk are those of the present sources."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import rigid_proto_ros
from rigid_proto_ros.core import compilation

PACKAGE = Path(rigid_proto_ros.__file__).parent
INNER = "from .compilation import njit\n\n\n@njit(cache=True)\ndef inner(x):\n    return x + {}\n"
OUTER = "from .compilation import njit\nfrom .between import (\n    inner,\n)\n\n\n@njit(cache=True)\ndef outer(x):\n    return inner(x)\n"
CALL = "from package.core.outer import outer; print(outer(1), sum(outer.stats.cache_hits.values()))"


def test_a_kernel_is_compiled_anew_when_a_file_behind_its_imports_has_changed(tmp_path):
    core = tmp_path / "package" / "core"
    core.mkdir(parents=True)
    shutil.copy(compilation.__file__, core)
    (core / "outer.py").write_text(OUTER)
    (core / "between.py").write_text("from .inner import inner\n")
    said = []
    for added in (1, 1, 2):
        (core / "inner.py").write_text(INNER.format(added))
        ran = subprocess.run([sys.executable, "-c", CALL], cwd=tmp_path, capture_output=True, text=True, check=True)
        said.append(ran.stdout.split())
    # Value, and whether it came from the disk.
    assert said == [["2", "0"], ["2", "1"], ["3", "0"]]


SUMS = """
import numpy as np
from package.core.moments_solid import joined_sums as kernel
sums = [np.zeros(11) for _ in range(4)]
kernel(*sums)
print(sums[0][1], sum(kernel.stats.cache_hits.values()))
"""


def test_the_sums_over_a_mesh_are_compiled_anew_when_the_arithmetic_under_them_has_changed(tmp_path):
    core = tmp_path / "package" / "core"
    core.mkdir(parents=True)
    for name in ("compilation", "exact_arithmetic", "moments_solid"):
        shutil.copy(PACKAGE / "core" / f"{name}.py", core)
    arithmetic = (core / "exact_arithmetic.py").read_text()
    head = "def two_sum(a: float, b: float) -> tuple[float, float]:\n"
    changed = arithmetic.replace(head, f"{head}    return 42.0, 0.0\n", 1)
    assert changed != arithmetic
    said = []
    for text in (arithmetic, arithmetic, changed):
        (core / "exact_arithmetic.py").write_text(text)
        ran = subprocess.run([sys.executable, "-c", SUMS], cwd=tmp_path, capture_output=True, text=True, check=True)
        said.append(ran.stdout.split())
    assert said == [["0.0", "0"], ["0.0", "1"], ["42.0", "0"]]


def test_the_package_imports_itself_relatively_as_the_stamp_of_a_kernel_follows_imports():
    absolute = [
        f"{file.relative_to(PACKAGE)}:{node.lineno}"
        for file in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if (isinstance(node, ast.ImportFrom) and not node.level and node.module.split(".")[0] == PACKAGE.name)
        or (isinstance(node, ast.Import) and any(a.name.split(".")[0] == PACKAGE.name for a in node.names))
    ]
    assert absolute == []


def test_every_kernel_of_the_package_is_kept_that_way():
    direct = [
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        if file != Path(compilation.__file__)
        for line in file.read_text().splitlines()
        if line.startswith("from numba import") and "njit" in line or "numba.njit" in line
    ]
    assert direct == []
