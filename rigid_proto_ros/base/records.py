# SPDX-License-Identifier: MIT
"""Records of numbers by name: ``p.moments`` in Python and in compiled functions alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from .compilation import njit


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """The type of records with these fields (name, type) or (name, type, length), each where the processor likes it."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


def new_record(kind: np.dtype[Any]) -> np.record:
    """A record of zeros."""
    record: np.record = np.zeros(1, kind)[0]
    return record


def place_of(kind: np.dtype[Any], name: str) -> int:
    """Where a field begins [bytes]."""
    fields = kind.fields
    assert fields is not None
    return int(fields[name][1])


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def copy_numbers(of: np.ndarray, to: np.ndarray) -> None:
    """The first numbers of one array to all of another, one by one: numba's own way with slices looks first whether the
    two share memory, and makes room for a copy if they do.
    """
    for k in range(to.shape[0]):
        to[k] = of[k]
