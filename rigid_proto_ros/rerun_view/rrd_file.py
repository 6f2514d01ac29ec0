# SPDX-License-Identifier: MIT
"""The frames of an .rrd file: how far a file is whole that was cut or never finished, and how to make it whole.

An .rrd is a 12-byte header (``RRF2``, version, options), then frames of two little-endian uint64 (kind, length) and
``length`` bytes; kind 0 ends the stream, with an index behind it.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..base.errors import InputError, is_missing
from .viewers import viewer_program

MAGIC = b"RRF2"
HEADER_BYTES = 12
FRAME_HEAD = struct.Struct("<QQ")
KINDS = (0, 1, 2, 3)
"""End, store info, data, blueprint activation."""

REPAIR_TIMEOUT_S = 600.0


def whole_bytes(path: Path) -> tuple[int, bool]:
    """How many bytes from the start hold whole frames, and whether the stream was ended.

    Raises InputError for a file that isn't an .rrd at all, or holds no whole frame.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError("session", str(path), "an .rrd or .mcap recording")
        at = HEADER_BYTES
        while at + FRAME_HEAD.size <= size:
            file.seek(at)
            kind, length = FRAME_HEAD.unpack(file.read(FRAME_HEAD.size))
            if kind == 0:
                return at, True
            if kind not in KINDS or at + FRAME_HEAD.size + length > size:
                break
            at += FRAME_HEAD.size + length
    if at == HEADER_BYTES:
        raise InputError("session", str(path), "a recording with data; this one ends before its first chunk")
    return at, False


def end_without_index(path: Path) -> None:
    """Mark a stream as ended that the library has written without an index, and so without an end."""
    with open(path, "ab") as file:
        file.write(FRAME_HEAD.pack(0, 0))


@contextmanager
def whole_part(path: Path) -> Iterator[Path]:
    """A readable file with the whole frames of ``path``: a temporary copy, removed at the end."""
    kept, _ = whole_bytes(path)
    with tempfile.TemporaryDirectory(prefix="rigid_proto_") as folder:
        copy = Path(folder) / path.name
        _copy_start(path, copy, kept)
        yield copy


def repair_rrd(path: Path, repaired: Path) -> None:
    """Write a finished recording with all that is whole in ``path``; InputError where that can't be."""
    if repaired.exists() and repaired.samefile(path):
        raise InputError("--repair", str(repaired), "another file than the one that is repaired")
    with whole_part(path) as whole:
        reason = _write_indexed(whole, repaired, REPAIR_TIMEOUT_S)
    if reason:
        raise InputError("--repair", str(repaired), f"a file that can be written from a readable recording ({reason})")


def _write_indexed(path: Path, indexed: Path, timeout_s: float) -> str:
    """The recording again, with an index; returns why it couldn't be written, or nothing."""
    program = viewer_program()
    if program is None:
        return is_missing("rerun-sdk", "rerun")
    try:
        done = subprocess.run(
            [program, "rrd", "optimize", str(path), "-o", str(indexed)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
            env={**os.environ, "RERUN_APP_ONLY": "true", "NO_COLOR": "1"},
        )
    except subprocess.TimeoutExpired:
        return f"it took longer than {timeout_s:g} s"
    return "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["unknown reason"])[-1]


def _copy_start(source: Path, target: Path, size: int) -> None:
    try:
        with open(source, "rb") as reading, open(target, "wb") as writing:
            shutil.copyfileobj(reading, writing)
            writing.truncate(size)
    except OSError as error:
        raise InputError("session", str(source), f"space for a copy in {target.parent} ({error.strerror})") from error
