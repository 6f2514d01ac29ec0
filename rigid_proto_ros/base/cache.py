# SPDX-License-Identifier: MIT
"""The user's cache folder, and hashes of sources, by which what is kept there is known to be theirs."""

from __future__ import annotations

import functools
import hashlib
import os
import re

PACKAGE = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))

_RELATIVE_IMPORT = re.compile(r"^[ \t]*from[ \t]+(\.+)([\w.]*)[ \t]+import[ \t]+(?:\(([^)]*)\)|([^\n]*))", re.MULTILINE)


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
    with open(file, encoding="utf-8") as stream:
        text = stream.read()
    candidates = set()
    for dots, name, in_brackets, plain in _RELATIVE_IMPORT.findall(text):
        folder = file
        for _ in dots:
            folder = os.path.dirname(folder)
        module = os.path.join(folder, *filter(None, name.split(".")))
        # An imported name is defined in a module, or is a module of a package.
        candidates |= {f"{module}.py", os.path.join(module, "__init__.py")}
        candidates |= {os.path.join(module, f"{name}.py") for name in re.findall(r"\w+", in_brackets or plain)}
    return hashlib.sha256(text.encode()).digest(), [file for file in candidates if _exists(file)]


_exists = functools.cache(os.path.isfile)


def user_cache() -> str:
    """This package's part of the user's cache folder; empty where there is no home folder."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    base = base if os.path.isabs(base) else os.path.expanduser(os.path.join("~", ".cache"))
    return os.path.join(base, "rigid_proto_ros") if os.path.isabs(base) else ""
