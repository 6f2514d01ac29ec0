# SPDX-License-Identifier: MIT
"""Object File Format (.off) as Geomview defines it, ASCII: polygons of any size, colours and normals skipped."""

from __future__ import annotations

import re

import numpy as np

from ..base.errors import MeshError
from .ascii_floats import as_numbers, excerpt

_HEADER = re.compile(rb"\s*(ST)?C?N?(4)?(n)?OFF\b[ \t]*(BINARY)?")


def _rows(text: bytes) -> list[bytes]:
    """The lines that aren't blank, without comments."""
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    return [line for line in text.split(b"\n") if line and not line.isspace()]


def read_off(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming what is wrong."""
    header = _HEADER.match(data)
    if header is None:
        raise MeshError(name, excerpt(data, 0), "an .off file: its first line is OFF")
    if header.group(2) or header.group(3) or header.group(4):
        raise MeshError(name, excerpt(data, 0), "ASCII OFF in three dimensions")
    rows = _rows(data[header.end() :])
    counts = [int(word) for word in (rows[0].split()[:2] if rows else ()) if word.isdigit() and len(word) <= 18]
    if len(counts) < 2:
        raise MeshError(name, excerpt(rows[0], 0) if rows else "", "numbers of vertices, faces and edges after OFF")
    n, p = counts
    if p > max_triangles:
        raise MeshError(name, f"{p} faces are more than {max_triangles}; --max-triangles raises the limit")
    if n + p != len(rows) - 1:
        announced = f"the header announces {n} vertices and {p} faces"
        raise MeshError(name, f"{len(rows) - 1} lines, but {announced}; the file may be truncated or damaged")
    places = [row.split()[:3] for row in rows[1 : n + 1]]
    points, whole = as_numbers(b" ".join([word for row in places for word in row]), 3 * n)
    short = next((k for k, row in enumerate(places) if len(row) < 3), n)
    if short < n or not whole:
        raise MeshError(name, excerpt(rows[1 + min(short, len(points) // 3)], 0), "a vertex: three numbers")
    face = f"a face: its number of corners (3 or more), then vertex numbers from 0 to {n - 1}"
    corners: list[bytes] = []
    sizes = np.zeros(p, np.int64)
    for k, row in enumerate(rows[n + 1 : n + p + 1]):
        words = row.split()
        size = int(words[0]) if words[0].isdigit() and len(words[0]) < 10 else 0
        if size < 3 or size >= len(words):
            raise MeshError(name, excerpt(row, 0), face)
        corners += words[1 : size + 1]
        sizes[k] = size
    starts = np.cumsum(np.concatenate([np.zeros(1, np.int64), sizes]))
    numbers, whole = as_numbers(b" ".join(corners), len(corners), int)
    wrong = np.flatnonzero((numbers < 0) | (numbers >= n))
    if len(wrong) or not whole:
        first = int(wrong[0]) if len(wrong) else len(numbers)
        raise MeshError(name, excerpt(rows[n + int(np.searchsorted(starts, first, side="right"))], 0), face)
    return points.reshape(-1, 3), numbers, starts
