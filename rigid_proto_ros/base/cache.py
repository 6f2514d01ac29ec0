# SPDX-License-Identifier: MIT
"""The user's cache folder, and hashes of sources, by which what is kept there is known to be theirs."""

from __future__ import annotations

import functools
import hashlib
import os

PACKAGE = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))


@functools.cache
def source_stamp(*files: str) -> bytes:
    """SHA-256 of files and of all that they import relatively, directly or not."""
    hashes: dict[str, bytes] = {}
    waiting = list(files)
    while waiting:
        file = waiting.pop()
        if file not in hashes:
            hashes[file], imported = _source(file)
            waiting += imported
    return hashlib.sha256(b"".join(hashes[file] for file in sorted(hashes))).digest()


@functools.cache
def _source(file: str) -> tuple[bytes, list[str]]:
    """Hash of a file, and the files that it imports."""
    with open(file, "rb") as stream:
        content = stream.read()
    imported = []
    # By hand: regular expressions took five times as long, at every start.
    parts = content.decode().split("from .")
    for before, after in zip(parts, parts[1:], strict=False):
        if before.rpartition("\n")[2].strip():
            continue  # within a line
        origin, _, names = after.partition(" import ")
        names = names[1 : names.index(")")] if names.startswith("(") else names.partition("\n")[0]
        module = origin.lstrip(".")
        folder = file
        for _ in range(1 + len(origin) - len(module)):
            folder = os.path.dirname(folder)
        *outer, last = module.split(".")
        folder = os.path.join(folder, *outer)
        within = os.path.join(folder, last) if last else folder
        # An imported name is defined in a module, or is a module of a package.
        candidates = [(folder, f"{last}.py"), (within, "__init__.py")]
        candidates += [(within, f"{name.split()[0]}.py") for name in names.split(",") if name.strip()]
        imported += [os.path.join(place, name) for place, name in candidates if name in _names(place)]
    return hashlib.sha256(content).digest(), imported


@functools.cache
def _names(folder: str) -> set[str]:
    try:
        return set(os.listdir(folder))
    except OSError:
        return set()


def user_cache() -> str:
    """This package's part of the user's cache folder; empty where there is no home folder."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    base = base if os.path.isabs(base) else os.path.expanduser(os.path.join("~", ".cache"))
    return os.path.join(base, "rigid_proto_ros") if os.path.isabs(base) else ""
