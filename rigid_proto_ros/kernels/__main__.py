# SPDX-License-Identifier: MIT
"""``python -m rigid_proto_ros.kernels [TARGET ...]``: build the kernels ahead of time into the user's cache.

TARGET: ``native``, this machine's processor (the default); ``wasm``; x86-64-v4, -v3, -v2 or aarch64; or ``wheel``, all
kinds of processors of this machine's architecture, into the package, for a wheel. Files that exist for the present
sources are not built again. ``--typescript FILE`` writes the page's interface to the kernels. With ``wasm`` the layouts
of records are written beside the module as ``kernels.json``.
"""

from __future__ import annotations

import argparse
import fcntl
import gc
import gzip
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..base.errors import InputError, one_of, tell
from ..base.files import whole_file
from ..base.library import KINDS, carried_folder, check_own, file_name, kernels_folder, stamp, target

UNUSED_DAYS = 30
"""Kernels of other sources are removed after this time without use."""


def main() -> int:
    """Build the requested targets. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m rigid_proto_ros.kernels", description="Build the kernels ahead.")
    parser.add_argument("targets", nargs="*", metavar="TARGET", default=["native"])
    parser.add_argument("--typescript", metavar="FILE")
    args = parser.parse_args()
    try:
        kinds = [kind for name in args.targets for kind in kinds_of(name)]
        folder = Path(carried_folder() if "wheel" in args.targets else kernels_folder()) / stamp()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        check_own(str(folder))
        with alone(folder):
            build([kind for kind in kinds if not (folder / file_name(kind)).is_file()], folder)
        if "wasm32" in kinds or args.typescript:
            describe(folder / "kernels.json", args.typescript)
        for kind in kinds:
            print(folder / file_name(kind))
    except Exception as error:
        return tell(parser.prog, error)
    return 0


def kinds_of(name: str) -> list[str]:
    """Kinds of processors that a target stands for. Raises InputError."""
    own = target()
    alike = [kind for kind in KINDS if kind.startswith("x86") == own.startswith("x86")]
    known = {"native": [own], "wasm": ["wasm32"], "wheel": alike, **{kind: [kind] for kind in KINDS}}
    if name not in known:
        raise InputError("TARGET", name, one_of(name, known))
    return known[name]


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Hold a lock on this folder; wait for other processes that build into it."""
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def build(kinds: list[str], folder: Path) -> None:
    """Build the files for these kinds of processors. Raises InputError and OSError."""
    if not kinds:
        return
    began = time.monotonic()

    def told(done: int, count: int) -> None:
        if sys.stderr.isatty():
            line = f"\r\033[Kkernels: {done} of {count}, {time.monotonic() - began:.0f} s"
            print(line, end="", file=sys.stderr, flush=True)

    # The user's settings for numba would change the code, and optimized code would contain intrinsics of this
    # processor. numba and the package's modules read these variables when they are imported.
    for name in [name for name in os.environ if name.startswith("NUMBA_")]:
        del os.environ[name]
    os.environ.update(NUMBA_OPT="0", RIGID_PROTO_KERNELS="building")
    from .lowering import lowered
    from .targets import TARGETS, linked, object_code

    gc.disable()  # it would search numba's many objects again and again
    kept = Path(kernels_folder()) / stamp()
    kept.mkdir(mode=0o700, parents=True, exist_ok=True)
    whole = lowered(kept / "kernels.bc", told)
    for kind in kinds:
        with tempfile.TemporaryDirectory(dir=folder) as work:
            made = linked(kind, object_code(whole, TARGETS[kind]), Path(work))
            os.replace(made, folder / file_name(kind))
    remove_unused(kept)
    clear = "\r\033[K" if sys.stderr.isatty() else ""
    sizes = [f"{kind} {size(folder / file_name(kind))}" for kind in kinds]
    print(f"{clear}kernels built in {time.monotonic() - began:.0f} s: {', '.join(sizes)}", file=sys.stderr, flush=True)


def remove_unused(kept: Path) -> None:
    """Remove folders beside ``kept`` whose kernels were neither read nor written for UNUSED_DAYS. Other folders
    stay.
    """
    oldest = time.time() - UNUSED_DAYS * 86_400
    for folder in kept.parent.iterdir():
        if folder == kept or not re.fullmatch(r"\d+-[0-9a-f]{20}", folder.name):
            continue
        with suppress(OSError):
            files = [file.stat() for file in folder.iterdir()]
            if all(max(file.st_atime, file.st_mtime) < oldest for file in files):
                shutil.rmtree(folder)


def describe(layouts: Path, typescript: str | None) -> None:
    """Write the layouts of records and, if requested, the page's interface. Raises InputError and OSError."""
    os.environ.setdefault("RIGID_PROTO_KERNELS", "interpreted")  # kernels need not run to be described
    from .layouts import as_json
    from .typescript import source

    with whole_file("layouts", layouts) as file:
        file.write_text(as_json())
    if typescript:
        with whole_file("--typescript", typescript) as file:
            file.write_text(source())


def size(file: Path) -> str:
    """Size of a file in kB, uncompressed and compressed."""
    content = file.read_bytes()
    return f"{len(content) / 1e3:.0f} kB ({len(gzip.compress(content)) / 1e3:.0f} gzipped)"


if __name__ == "__main__":
    sys.exit(main())
