# SPDX-License-Identifier: MIT
"""Reading of files up to a size limit, and atomic writing of files."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import InputError, did_you_mean

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]  # on Windows, where writers don't exclude each other

CHUNK = 1 << 20
"""Bytes read at a time from a file of unknown size, such as a pipe."""


def read_bounded(path: Path, max_bytes: int, field: str, kind: str, *, ordinary: bool = False) -> bytes:
    """The content of the file at ``path``. kind: what it should be, for error messages ("a URDF, SDF or MJCF file").
    ordinary: refuse pipes and devices, which may never end; for paths that come from another file.

    Raises InputError naming ``field`` if the file can't be read or has more than ``max_bytes``.
    """
    try:
        if ordinary and path.exists() and not path.is_file():
            raise InputError(field, str(path), f"{kind}; this is a folder, a device or a pipe")
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            parts = [stream.read(min(size, max_bytes) + 1)]
            held = len(parts[0])
            while held <= max_bytes and (part := stream.read(min(CHUNK, max_bytes + 1 - held))):
                parts.append(part)
                held += len(part)
    except FileNotFoundError:
        beside = path.parent.glob(f"*{path.suffix}")
        hint = did_you_mean(str(path), map(str, beside)) if path.suffix else ""
        nearest = ", ".join(filter(None, [kind, hint]))
        raise InputError(field, f"there is no file {str(path)!r}; accepted: {nearest}") from None
    except OSError as error:
        raise InputError(field, str(path), f"{kind} that can be read ({error.strerror})") from None
    if held > max_bytes:
        raise InputError(field, f"{path.name} with more than {max_bytes} bytes", f"{kind} of at most {max_bytes} bytes")
    return b"".join(parts)


def output_file(option: str, file: str | Path) -> Path:
    """The path of a file to be written. Creates its folder, but no folders above, since a path with several unknown
    folders is probably a mistake. Raises InputError naming ``option``.
    """
    path = Path(file)
    try:
        if path.is_dir():
            raise InputError(option, str(file), "the name of a file; this is a folder")
        path.absolute().parent.mkdir(exist_ok=True)
    except FileNotFoundError:
        raise InputError(option, str(file), f"a folder that exists: {path.parent.parent} doesn't") from None
    except OSError as error:
        raise InputError(option, str(file), f"a file in a folder that can be made ({error.strerror})") from None
    return path


def file_for_one_writer(option: str, file: str | Path) -> BinaryIO:
    """Open an empty file for writing, and lock it: until it is closed, this function refuses it, in this process and in
    others. Raises InputError naming ``option``, and OSError.
    """
    # Truncated only when locked, because another writer may have it.
    number = os.open(output_file(option, file), os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
    stream = os.fdopen(number, "wb")
    try:
        if fcntl is not None:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        stream.close()
        raise InputError(option, str(file), "another file than the one that is being recorded") from None
    except OSError:
        pass  # a file system without locks
    with suppress(OSError):  # a device or a pipe
        stream.truncate()
    return stream


def is_same_file(one: str | Path, other: str | Path) -> bool:
    """Whether both paths lead to the same existing file."""
    return Path(one).exists() and Path(other).exists() and Path(one).samefile(other)


def check_writable(option: str, file: str | Path) -> None:
    """Check, before long work, that ``file`` can be written; an existing file is unchanged. Raises InputError naming
    ``option``.
    """
    path = output_file(option, file).resolve()
    try:
        if not path.exists():
            path.touch()
            path.unlink()
        elif not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise InputError(option, str(file), f"a file that can be written ({error.strerror})") from None


def check_whole_file(option: str, file: str | Path) -> None:
    """Check, before long work, that ``whole_file`` can write ``file``. Raises InputError naming ``option``."""
    with _beside(option, file):
        pass


@contextmanager
def whole_file(option: str, file: str | Path) -> Iterator[Path]:
    """Context of writing a file atomically: yields a temporary path in the same folder, with the same suffix. It is
    renamed to ``file``, or to the target of that link, when the block ends, and removed if the block fails or is
    interrupted. Raises InputError naming ``option`` if the file can't be written.
    """
    with _beside(option, file) as (beside, path):
        yield beside
        os.replace(beside, path)


@contextmanager
def _beside(option: str, file: str | Path) -> Iterator[tuple[Path, Path]]:
    """Context of a temporary file beside ``file``, removed at the end if it still exists; yields it and the resolved
    path.
    """
    path = output_file(option, file).resolve()
    if path.exists() and not path.is_file():
        raise InputError(option, str(file), "the name of a file; this is a device or a pipe")
    # An unpredictable name, and exclusive creation, so that a planted link isn't followed.
    beside = path.with_name(f".{path.stem}.{secrets.token_hex(8)}{Path(file).suffix}")
    try:
        beside.open("xb").close()
        yield beside, path
    except OSError as error:
        raise InputError(option, str(file), f"a file that can be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):  # renamed, or never created
            beside.unlink()
