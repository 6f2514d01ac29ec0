# SPDX-License-Identifier: MIT
"""Common parts of the readers of text files: parsing of numbers, and errors that name a line."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import MeshError


def as_numbers(text: bytes, count: int = -1, kind: type[float] = float) -> tuple[NDArray[Any], bool]:
    """The whitespace separated numbers (k,) at the beginning of a text, up to the first word that isn't a number, and
    whether they are all of it, and ``count`` numbers unless that is −1.

    Doubles are the nearest to the decimals; nan and inf count as numbers here and are refused by the verdict.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # older versions of NumPy only warn
            numbers: NDArray[Any] = np.fromstring(text, kind, sep=" ")
            if count in (-1, len(numbers)) and b"\0" not in text:  # NumPy stops at NUL
                return numbers, True
    except (DeprecationWarning, ValueError):
        pass
    values = []
    for word in text.split():
        try:
            values.append(float(kind(word.replace(b"_", b"?"))))  # Python allows _ in numbers
        except (ValueError, OverflowError):
            break
    return np.array(values), False


def error_at(data: bytes, position: int, name: str, accepted: str, first_line: int = 1) -> MeshError:
    """The error for the text at byte ``position``: file, line, the text there, and what is accepted."""
    line = data.count(b"\n", 0, position) + first_line
    return MeshError(f"{name} line {line}", excerpt(data, position), accepted)


def excerpt(data: bytes, position: int) -> str:
    """The rest of the line at ``position`` for a message: at most 40 printable characters."""
    text = data[position : position + 40].split(b"\n")[0].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "?" for c in text)
