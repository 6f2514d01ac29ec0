# SPDX-License-Identifier: MIT
"""The frames of an .rrd file: how far a file is whole that was cut or never finished, and how to make it whole.

An .rrd is a 12-byte header (``RRF2``, version, options), then frames of two little-endian uint64 (kind, length) and
``length`` bytes; kind 0 ends the stream, an index may stand behind it. Rerun's own reader and ``rerun rrd optimize``
refuse most files that were cut.
"""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..base.errors import InputError

MAGIC = b"RRF2"
HEADER_BYTES = 12
FRAME_HEAD = struct.Struct("<QQ")
KINDS = (0, 1, 2, 3)
"""End, store info, data, blueprint activation."""


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


def mark_end(path: Path) -> None:
    """Mark a stream as ended: the library doesn't, where it writes no index."""
    with open(path, "ab") as file:
        file.write(FRAME_HEAD.pack(0, 0))


def copy_whole(path: Path, copy: Path) -> None:
    """Write a finished file with the whole frames of ``path``; raises OSError."""
    kept, _ = whole_bytes(path)
    with open(path, "rb") as reading, open(copy, "wb") as writing:
        shutil.copyfileobj(reading, writing)
        writing.truncate(kept)
    mark_end(copy)


@contextmanager
def whole_part(path: Path) -> Iterator[Path]:
    """A readable file with the whole frames of ``path``: a temporary copy, removed at the end."""
    with tempfile.TemporaryDirectory(prefix="rigid_proto_") as folder:
        copy = Path(folder) / path.name
        try:
            copy_whole(path, copy)
        except OSError as error:
            raise InputError("session", str(path), f"space for a copy in {folder} ({error.strerror})") from error
        yield copy
