# SPDX-License-Identifier: MIT
"""Records of numbers by name: ``p.moments`` in Python and in compiled functions alike."""

from __future__ import annotations

from typing import Any

import numpy as np


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
