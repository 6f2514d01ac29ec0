# SPDX-License-Identifier: MIT
"""Kernels kept on disk are those of the present sources."""

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


def test_every_kernel_of_the_package_is_kept_that_way():
    direct = [
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        if file != Path(compilation.__file__)
        for line in file.read_text().splitlines()
        if line.startswith("from numba import") and "njit" in line or "numba.njit" in line
    ]
    assert direct == []
