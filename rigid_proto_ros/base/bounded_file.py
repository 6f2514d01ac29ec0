# SPDX-License-Identifier: MIT
"""A file's bytes, unless there are more than what it is for can need."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import InputError

CHUNK = 1 << 20
"""Bytes read at a time from what doesn't say its size, such as a pipe."""


def read_bounded(path: Path, max_bytes: int, field: str, kind: str) -> bytes:
    """The bytes of the file at ``path``; ``kind`` says in the refusal what it should be ("a URDF, SDF or MJCF file").

    Raises InputError naming ``field`` when the file can't be read or holds more than ``max_bytes``.
    """
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            parts = [stream.read(min(size, max_bytes) + 1)]
            held = len(parts[0])
            while held <= max_bytes and (part := stream.read(min(CHUNK, max_bytes + 1 - held))):
                parts.append(part)
                held += len(part)
    except OSError as error:
        raise InputError(field, str(path), f"{kind} that can be read ({error.strerror})") from None
    if held > max_bytes:
        raise InputError(field, f"{path.name} with more than {max_bytes} bytes", f"{kind} of at most {max_bytes} bytes")
    return b"".join(parts)
