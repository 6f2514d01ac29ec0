# SPDX-License-Identifier: MIT
"""Kernels kept on disk are those of the present sources."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

import rigid_proto_ros
from rigid_proto_ros.base import cache, compilation, errors, jit, library

PACKAGE = Path(rigid_proto_ros.__file__).parent
INNER = "from .compilation import njit\n\n\n@njit()\ndef inner(x):\n    return x + {}\n"
OUTER = "from .compilation import njit\nfrom .between import (\n    inner,\n)\n\n\n@njit()\ndef outer(x):\n    return inner(x)\n"
BROKEN = "numba no longer keeps kernels by Dispatcher._cache: base/jit.py needs another way"
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
        for module in (cache, compilation, errors, jit, library):
            shutil.copy(module.__file__, base)
        (base / "outer.py").write_text(OUTER)
        (base / "between.py").write_text("from .inner import inner\n")
        (base / "inner.py").write_text(INNER.format(added))
        said.append(called(base.parents[1], tmp_path, locators))
    # Value, and whether it came from the disk: a copy elsewhere finds it, and neither of two versions drives out the other.
    assert said == [["2", "0"], ["2", "1"], ["3", "0"], ["2", "1"]], BROKEN


@pytest.fixture
def adding(tmp_path, monkeypatch):
    """adding(k): a kernel x + k, kept below tmp_path."""
    file = tmp_path / "adding.py"
    file.write_text("def adding(njit, k):\n    @njit()\n    def plus(x):\n        return x + k\n\n    return plus\n")
    monkeypatch.setattr(jit, "PACKAGE", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    code = {}
    exec(compile(file.read_text(), file, "exec"), code)
    return lambda k: code["adding"](compilation.njit, k)


def test_two_kernels_of_one_function_that_two_processes_keep_at_once_stay_apart(adding, monkeypatch):
    one, two = adding(1), adding(2)
    save = IndexDataCacheFile._save_data

    def save_after_the_other(file, *data):
        monkeypatch.setattr(IndexDataCacheFile, "_save_data", save)
        assert two(1) == 3
        save(file, *data)

    with monkeypatch.context() as both:
        both.setattr(IndexDataCacheFile, "_load_index", lambda _: {})  # neither sees what the other one writes
        monkeypatch.setattr(IndexDataCacheFile, "_save_data", save_after_the_other)
        assert one(1) == 2
    assert (adding(1)(1), adding(2)(1)) == (2, 3)


@pytest.mark.parametrize(
    ("ending", "content"), [("nbi", b""), ("nbi", b"hello"), ("nbc", bytes(100)), ("nbc", b"")], ids=str
)
def test_a_damaged_kernel_on_disk_is_compiled_and_kept_anew(adding, tmp_path, ending, content):
    assert adding(1)(1) == 2
    (file,) = tmp_path.rglob(f"*.{ending}")
    file.write_bytes(content)
    again = adding(1)
    assert again(1) == 2 and not again.stats.cache_hits
    kept = adding(1)
    assert kept(1) == 2 and kept.stats.cache_hits


def test_a_kernel_that_the_disk_has_no_room_for_is_used_all_the_same(adding, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(IndexDataCacheFile, "_save_index", full)
    assert adding(1)(1) == 2


def test_without_a_folder_for_kernels_one_line_says_which_were_tried_and_what_to_set(adding, tmp_path, monkeypatch):
    (tmp_path / "__pycache__").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "adding.py"))
    with pytest.raises(OSError, match="adding.py/rigid_proto_ros/kernels or .*__pycache__.*; set XDG_CACHE_HOME"):
        adding(1)(1)


def test_without_a_home_folder_none_of_that_name_is_made_in_the_current_one(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")  # to be ignored, as its specification says
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert cache.user_cache() == ""


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
