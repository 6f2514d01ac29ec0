# SPDX-License-Identifier: MIT
"""Object File Format (.off) as Geomview defines it, ASCII: polygons of any size, colours skipped."""

from __future__ import annotations

import re

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import IntArray, Points
from .ascii_floats import as_numbers, excerpt

_HEADER = re.compile(rb"\s*C?OFF\b(?![ \t]*BINARY)")


def read_off(data: bytes, name: str) -> tuple[Points, IntArray, IntArray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming what is wrong."""
    header = _HEADER.match(data)
    if header is None:
        raise MeshError(name, excerpt(data, 0), "OFF or COFF in its first line, ASCII, without normals")
    rows = [line.split() for line in re.sub(rb"#[^\n]*", b"", data[header.end() :]).split(b"\n") if line.strip()]
    counts = [int(word) for word in (rows[0][:2] if rows else ()) if word.isdigit() and len(word) < 18]
    if len(counts) < 2:
        raise MeshError(name, excerpt(b" ".join(rows[0]), 0) if rows else "", "numbers of vertices and faces after OFF")
    n, p = counts
    if n + p != len(rows) - 1:
        announced = f"the header announces {n} vertices and {p} faces"
        raise MeshError(name, f"{len(rows) - 1} lines, but {announced}; the file may be truncated or damaged")
    places, faces = [row[:3] for row in rows[1 : n + 1]], rows[n + 1 :]
    points, whole = as_numbers(b" ".join([word for row in places for word in row]), 3 * n)
    if not whole or any(len(row) < 3 for row in places):
        wrong = next(row for row in places if len(row) < 3 or not as_numbers(b" ".join(row), 3)[1])
        raise MeshError(name, excerpt(b" ".join(wrong), 0), "a vertex: three numbers")
    sizes = np.zeros(p, np.int64)
    for k, row in enumerate(faces):
        size = int(row[0]) if row[0].isdigit() and len(row[0]) < 10 else 0
        if not 3 <= size < len(row) or not all(
            word.isdigit() and len(word) < 18 and int(word) < n for word in row[1 : size + 1]
        ):
            accepted = f"a face: its number of corners (3 or more), then vertex numbers from 0 to {n - 1}"
            raise MeshError(name, excerpt(b" ".join(row), 0), accepted)
        sizes[k] = size
    corners = [int(word) for row, size in zip(faces, sizes.tolist(), strict=True) for word in row[1 : size + 1]]
    starts = np.cumsum(np.concatenate([np.zeros(1, np.int64), sizes]))
    return points.reshape(-1, 3), np.array(corners, np.int64), starts
