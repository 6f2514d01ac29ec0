# SPDX-License-Identifier: MIT
"""Kernels come from a library that was built for the present sources, and from nowhere else."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rigid_proto_ros
from rigid_proto_ros.base import compilation, library
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.problem import PROBLEM

PACKAGE = Path(rigid_proto_ros.__file__).parent


def said(code: str, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_every_module_that_exports_a_kernel_is_on_the_list() -> None:
    declaring = {
        ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        for path in PACKAGE.rglob("*.py")
        if "\n@exported(" in path.read_text("utf-8")
    }
    assert declaring == set(library.MODULES)


def test_a_change_of_any_source_behind_the_kernels_asks_for_another_library(tmp_path: Path) -> None:
    stamp = "from rigid_proto_ros.base.library import stamp; print(stamp())"
    copy = tmp_path / "rigid_proto_ros"
    subprocess.run(["cp", "-r", str(PACKAGE), str(copy)], check=True)
    stamps = {said(stamp, tmp_path).stdout}
    for name in ("motion/integrators/series.py", "base/arithmetic.py", "simulation/record.py"):
        with open(copy / name, "a") as stream:
            stream.write("\n# another source\n")
        stamps.add(said(stamp, tmp_path).stdout)
    assert len(stamps) == 4


def test_a_folder_that_others_may_write_to_is_refused_in_one_line(tmp_path: Path) -> None:
    folder = tmp_path / library.stamp()
    folder.mkdir(mode=0o777)
    os.chmod(folder, 0o777)
    name = library.file_name(library.target())
    (folder / name).write_bytes((Path(library.kernels_folder()) / library.stamp() / name).read_bytes())
    code = "from rigid_proto_ros.cli.main import main; import sys; sys.exit(main(['simulate', 't_handle', '--json']))"
    done = said(code, RIGID_PROTO_KERNELS_FOLDER=str(tmp_path))
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "chmod 700" in done.stderr


def test_a_file_that_is_no_library_is_refused_in_one_line(tmp_path: Path) -> None:
    folder = tmp_path / library.stamp()
    folder.mkdir(mode=0o700)
    (folder / library.file_name(library.target())).write_bytes(b"no library")
    code = "from rigid_proto_ros.cli.main import main; import sys; sys.exit(main(['simulate', 't_handle', '--json']))"
    done = said(code, RIGID_PROTO_KERNELS_FOLDER=str(tmp_path))
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and "kernels" in done.stderr


def test_a_folder_that_cannot_be_made_is_told_with_what_names_another(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    code = "from rigid_proto_ros.cli.main import main; import sys; sys.exit(main(['simulate', 't_handle', '--json']))"
    done = said(code, RIGID_PROTO_KERNELS_FOLDER=str(tmp_path / "file"))
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "RIGID_PROTO_KERNELS_FOLDER names another folder" in done.stderr


@pytest.mark.parametrize(
    ("machine", "flags", "best"),
    [
        ("x86_64", "sse2", "x86-64-v2"),
        ("AMD64", "sse2 avx2 fma", "x86-64-v2"),
        ("x86_64", "sse2 avx2 fma bmi2", "x86-64-v3"),
        ("x86_64", "avx2 fma bmi2 avx512f avx512bw avx512cd avx512dq avx512vl", "x86-64-v4"),
        ("aarch64", "fp asimd", "aarch64"),
    ],
)
def test_the_library_is_for_the_best_that_the_processor_is(
    monkeypatch: pytest.MonkeyPatch, machine: str, flags: str, best: str
) -> None:
    monkeypatch.delenv("RIGID_PROTO_PROCESSOR", raising=False)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(library, "_cpu_flags", lambda: set(flags.split()))
    assert library.target() == best
    # What it isn't would end the process at its first instruction.
    monkeypatch.setenv("RIGID_PROTO_PROCESSOR", "aarch64" if machine != "aarch64" else "x86-64-v2")
    with pytest.raises(InputError, match=f"accepted: what this processor is: .*{best}"):
        library.target()


def test_on_another_machine_one_line_says_what_runs_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(InputError, match="RIGID_PROTO_KERNELS=interpreted runs anywhere, slowly"):
        library.target()


@pytest.mark.parametrize("most_kb", [400_000, 150_000])
def test_with_little_memory_it_works_or_says_so_in_one_line(most_kb: int) -> None:
    pytest.importorskip("resource")
    code = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({most_kb} * 1024,) * 2); "
    code += (
        "import sys; from rigid_proto_ros.cli.executables import rigid_proto; sys.argv[1:] = ['inspect', 'hammer']; "
    )
    done = said(code + "sys.exit(rigid_proto())")
    told = done.stderr.splitlines()
    assert (done.returncode, told) == (0, []) or (done.returncode, len(told)) == (2, 1), done.stderr


def test_an_unknown_way_to_run_kernels_is_refused_with_those_that_there_are() -> None:
    done = said("import rigid_proto_ros.base.compilation", RIGID_PROTO_KERNELS="fast")
    assert done.returncode != 0 and "accepted: library, interpreted, building" in done.stderr


def test_what_a_kernel_is_given_is_never_copied_or_taken_for_something_else() -> None:
    kernel = library.KERNELS["shift_com"]
    row = np.zeros(13)
    row[6] = 1.0
    for wrong in (row.astype(np.float32), np.zeros(26)[::2], row.reshape(1, 13), row.tolist()):
        with pytest.raises(TypeError, match="shift_com"):
            kernel(wrong, 0.0, 0.0, 0.0)
    with pytest.raises(TypeError):
        kernel(row, 0.0, 0.0, "one")


def test_a_record_and_a_record_within_one_are_copied_whole_and_nothing_beside_them() -> None:
    assert compilation.WAY == "library"
    given = compilation.new_record(PROBLEM)
    given.moments[:] = 1.0, 2.0, 3.0
    given.has_string = True
    copied = compilation.copy_of(given)
    assert copied.tobytes() == given.tobytes() and copied.dtype is given.dtype
    copied.moments[0] = 7.0
    assert given.moments[0] == 1.0


def test_without_a_home_folder_one_line_says_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RIGID_PROTO_KERNELS_FOLDER", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    with pytest.raises(InputError, match="set RIGID_PROTO_KERNELS_FOLDER"):
        library.kernels_folder()
