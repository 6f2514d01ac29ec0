# SPDX-License-Identifier: MIT
"""Kernels kept on disk are those of the present sources."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rigid_proto_ros
from rigid_proto_ros.base import compilation

PACKAGE = Path(rigid_proto_ros.__file__).parent
INNER = "from .compilation import njit\n\n\n@njit()\ndef inner(x):\n    return x + {}\n"
OUTER = "from .compilation import njit\nfrom .between import (\n    inner,\n)\n\n\n@njit()\ndef outer(x):\n    return inner(x)\n"
BROKEN = "numba no longer keeps kernels by Dispatcher._cache: base/compilation.py needs another way"
CALL = "from package.base.outer import outer; print(outer(1), sum(outer.stats.cache_hits.values()))"


def called(folder: Path, place: Path, locators: str) -> list[str]:
    """What the kernel says in a process of its own, with no kernel of an earlier run but those below ``place``."""
    # -B: Python takes bytecode of a source of the same length and second for this one's.
    command, places = [sys.executable, "-B", "-c", CALL], {"XDG_CACHE_HOME": str(place / "cache")}
    settings = {**os.environ, **places, "NUMBA_CACHE_LOCATOR_CLASSES": locators}
    return subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, check=True).stdout.split()


def test_a_kernel_on_disk_is_that_of_its_file_and_of_all_behind_its_imports_also_with_other_locators_named(tmp_path):
    said, other = [], "InTreeCacheLocator"
    for checkout, added, locators in (("one", 1, ""), ("two", 1, other), ("two", 2, ""), ("one", 1, other)):
        base = tmp_path / checkout / "package" / "base"
        base.mkdir(parents=True, exist_ok=True)
        shutil.copy(compilation.__file__, base)
        (base / "outer.py").write_text(OUTER)
        (base / "between.py").write_text("from .inner import inner\n")
        (base / "inner.py").write_text(INNER.format(added))
        said.append(called(base.parents[1], tmp_path, locators))
    # Value, and whether it came from the disk: a copy elsewhere finds it, and neither of two versions drives out the other.
    assert said == [["2", "0"], ["2", "1"], ["3", "0"], ["2", "1"]], BROKEN


def test_every_kernel_of_the_package_is_kept_that_way():
    direct = [
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        if file != Path(compilation.__file__)
        for line in file.read_text().splitlines()
        if line.startswith("from numba import") and "njit" in line or "numba.njit" in line
    ]
    assert direct == []


PAIR = compilation.record_type([("count", np.int32), ("numbers", np.float64, 3)])
NESTED = compilation.record_type([("inner", PAIR), ("last", np.float64)])


@compilation.njit(cache=False)
def copied_by_a_kernel(records):
    compilation.copy_record(records[0], records[1])
    compilation.copy_record(records[0].inner, records[2].inner)


def copied_in_python(records):
    compilation._assign_fields(records[0], records[1])
    compilation._assign_fields(records[0].inner, records[2].inner)


@pytest.mark.parametrize("copied", [copied_by_a_kernel, copied_in_python])
def test_a_record_and_a_record_within_one_are_copied_whole_and_nothing_beside_them(copied):
    records = np.zeros(4, NESTED)
    records[0] = ((7, (1.0, -0.0, np.inf)), 5.0)
    copied(records)
    assert records[1] == records[0] and np.signbit(records[1]["inner"]["numbers"][1])
    assert records[2]["inner"] == records[0]["inner"] and records[2]["last"] == 0.0
    assert records[3] == np.zeros(1, NESTED)[0]
