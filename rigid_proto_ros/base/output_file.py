# SPDX-License-Identifier: MIT
"""Where results are written: the folder of an output file is made, as a fresh clone has no ``out/``."""

from __future__ import annotations

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
