# SPDX-License-Identifier: MIT
"""Compares test/golden_hashes.json under other processors, compilers, C libraries and versions, and prints a table.

    python tools/bits_elsewhere.py                    # what this machine can do by itself
    python tools/bits_elsewhere.py generic-cpu 3.13-newest
    ROOT=/var/tmp/fresh_machine/base-trixie python tools/bits_elsewhere.py root   # as root: another Linux, by chroot

Conditions with another Python are made with uv (from `make setup`) in WORK (default: a temporary folder, removed after).
Each compiles all kernels anew, some minutes a condition. Exit status 1 when a hash differs somewhere.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
SCRIPT = "test/simulation/test_golden_hashes.py"
UV = HERE / ".venv/bin/uv"

NO_WIDE_REGISTERS = "AVX2,FMA3,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL,AVX512_SPR"
GLIBC = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL,-AVX512DQ,-AVX512BW,-AVX_Fast_Unaligned_Load"
CONDITIONS: dict[str, dict[str, str]] = {
    "as-it-is": {},
    "generic-cpu": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
    "opt-1": {"NUMBA_OPT": "1"},
    "libc-masked": {"GLIBC_TUNABLES": GLIBC},
    "numpy-masked": {"NPY_DISABLE_CPU_FEATURES": NO_WIDE_REGISTERS},
    "threads-1": {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    "threads-2": {"NUMBA_NUM_THREADS": "2", "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"},
}
"""By name, what is added to the environment."""

NEEDS = ("trimesh", "PyYAML", "scipy")
PYTHONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "3.11-oldest": ("3.11", ("numba==0.62.0", "numpy==1.26.0", *NEEDS)),
    "3.11-newest": ("3.11", ("numba", "numpy", *NEEDS)),
    "3.13-oldest": ("3.13", ("numba==0.62.0", "numpy==2.1.0", *NEEDS)),
    "3.13-newest": ("3.13", ("numba", "numpy", *NEEDS)),
}
"""By name, Python and packages: the oldest and newest of the range that setup.py states."""


def compare(command: list[str], more: dict[str, str], work: Path) -> tuple[bool, str]:
    """Whether the comparison's process found all hashes equal, and its last line."""
    with tempfile.TemporaryDirectory(dir=work, prefix="kernels-") as kernels:
        own = {"NUMBA_CACHE_DIR": kernels, "PYTHONPATH": f"{HERE}:{HERE / 'test'}", "PYTHONDONTWRITEBYTECODE": "1"}
        environment = {**os.environ, **own, "RIGID_PROTO_CACHE": "off", **more}
        done = subprocess.run(
            [*command, SCRIPT], cwd=HERE, env=environment, capture_output=True, text=True, check=False
        )
    lines = (done.stdout + done.stderr).strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else "no output"


def python_with(name: str, work: Path) -> list[str]:
    """The interpreter of an environment made for a condition."""
    version, packages = PYTHONS[name]
    folder = work / f"venv-{name}"
    if not (folder / "bin/python").exists():
        subprocess.run([UV, "venv", "--quiet", "--python", version, folder], check=True)
        install = [UV, "pip", "install", "--quiet", "--only-binary", ":all:", "--python", folder / "bin/python"]
        subprocess.run([*install, *packages], check=True)
    return [str(folder / "bin/python")]


def in_root(work: Path) -> tuple[bool, str]:
    """The comparison inside another Linux's root, whose Python gets an environment with the newest packages."""
    root = Path(os.environ["ROOT"])
    place = root / "opt/bits"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for part in ("rigid_proto_ros", "test", "config"):
        shutil.copytree(HERE / part, place / part, ignore=shutil.ignore_patterns("__pycache__"))
    packages = " ".join(("numba", "numpy", *NEEDS))
    inside = (
        f"cd /opt/bits && python3 -m venv venv && venv/bin/pip install -q {packages} && "
        f"PYTHONPATH=/opt/bits:/opt/bits/test venv/bin/python {SCRIPT}"
    )
    done = subprocess.run(["chroot", root, "sh", "-c", inside], capture_output=True, text=True, check=False)
    lines = (done.stdout + done.stderr).strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else "no output"


def main() -> int:
    """Try what is named on the command line, or all that needs no root."""
    names = sys.argv[1:] or [*CONDITIONS, *PYTHONS]
    if unknown := [name for name in names if name not in (*CONDITIONS, *PYTHONS, "root")]:
        print(f"{', '.join(unknown)}: conditions are {', '.join((*CONDITIONS, *PYTHONS, 'root'))}", file=sys.stderr)
        return 2
    work = Path(os.environ.get("WORK") or tempfile.mkdtemp(prefix="bits-"))
    work.mkdir(parents=True, exist_ok=True)
    same = True
    try:
        for name in names:
            began = time.monotonic()
            try:
                if name == "root":
                    equal, said = in_root(work)
                else:
                    command = [sys.executable] if name in CONDITIONS else python_with(name, work)
                    equal, said = compare(command, CONDITIONS.get(name, {}), work)
            except (subprocess.CalledProcessError, KeyError, OSError) as error:
                equal, said = False, f"not run: {error}"
            same = same and equal
            word = "equal" if equal else "not run" if said.startswith("not run") else "DIFFERS"
            print(f"{name:14s} {word:7s} {time.monotonic() - began:6.0f} s  {said}", flush=True)
    finally:
        if "WORK" not in os.environ:
            shutil.rmtree(work, ignore_errors=True)
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
