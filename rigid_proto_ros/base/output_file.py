# SPDX-License-Identifier: MIT
"""Where results are written: the folder of an output file is made, as a fresh clone has no ``out/``, and a file
gets its name once it is whole.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


def output_file(option: str, file: str | Path) -> Path:
    """The path of a file that is to be written, its folder made. Raises InputError, which names ``option``."""
    path = Path(file)
    if path.is_dir():
        raise InputError(option, str(file), "the name of a file; this is a folder")
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(option, str(file), f"a file in a folder that can be made ({error.strerror})") from None
    return path


@contextmanager
def whole_file(option: str, file: str | Path) -> Iterator[Path]:
    """A path beside ``file``, with its ending, to write to: renamed to ``file`` when the block ends, and removed when
    it fails or is interrupted, so that no half of a file is left. Raises InputError, which names ``option``, for a
    place that can't be written to.
    """
    path = output_file(option, file)
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        beside.touch()
        yield beside
        os.replace(beside, path)
    except OSError as error:
        raise InputError(option, str(file), f"a file that can be written ({error.strerror or error})") from None
    finally:
        if beside.exists():
            beside.unlink()
