# SPDX-License-Identifier: MIT
"""Object File Format (.off) as Geomview defines it, ASCII: polygons of any size, colours and normals skipped."""

from __future__ import annotations

import re

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import (
    EXACT,
    NEEDS_FLOAT,
    excerpt,
    float_of,
    is_blank,
    line_of,
    read_number,
)

_OK, _ENDED, _BAD_VERTEX, _BAD_FACE = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def _next_line(buffer, i):
    """Start of the next line's first token, past blank lines and comments."""
    end = buffer.shape[0]
    while i < end:
        if is_blank(buffer[i]) or buffer[i] == 10:
            i += 1
        elif buffer[i] == 35:
            while i < end and buffer[i] != 10:
                i += 1
        else:
            break
    return i


@njit(cache=True, nogil=True)
def _skip_line(buffer, i):
    while i < buffer.shape[0] and buffer[i] != 10:
        i += 1
    return i


@njit(cache=True, nogil=True)
def _skip_blank(buffer, i):
    while i < buffer.shape[0] and is_blank(buffer[i]):
        i += 1
    return i


@njit(cache=True, nogil=True)
def _read(buffer, i, vertices, starts, corners, slow):
    """Returns (status, position, slow tokens, corners read)."""
    end = buffer.shape[0]
    slow_count = 0
    for v in range(vertices.shape[0]):
        i = _next_line(buffer, i)
        if i >= end:
            return _ENDED, v, slow_count, 0
        line = i
        for k in range(3):
            i = _skip_blank(buffer, i)
            first = i
            value, i, status = read_number(buffer, i, end)
            if status == EXACT:
                vertices[v, k] = value
            elif status == NEEDS_FLOAT:
                slow[slow_count, 0] = 3 * v + k
                slow[slow_count, 1] = first
                slow[slow_count, 2] = i
                slow_count += 1
            else:
                return _BAD_VERTEX, line, slow_count, 0
        i = _skip_line(buffer, i)
    corner = 0
    starts[0] = 0
    for f in range(starts.shape[0] - 1):
        i = _next_line(buffer, i)
        if i >= end:
            return _ENDED, vertices.shape[0] + f, slow_count, corner
        line = i
        value, i, status = read_number(buffer, i, end)
        size = int(value)
        if status != EXACT or size != value or size < 3 or size > end:
            return _BAD_FACE, line, slow_count, corner
        for _ in range(size):
            i = _skip_blank(buffer, i)
            value, i, status = read_number(buffer, i, end)
            if status != EXACT or value != int(value) or not 0 <= value < vertices.shape[0]:
                return _BAD_FACE, line, slow_count, corner
            corners[corner] = int(value)
            corner += 1
        starts[f + 1] = corner
        i = _skip_line(buffer, i)
    return _OK, 0, slow_count, corner


def read_off(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming file and line."""
    header = re.match(rb"\s*(ST)?C?N?(4)?(n)?OFF\b[ \t]*(BINARY)?", data)
    if header is None:
        raise MeshError(name, excerpt(data, 0), "an .off file: its first line is OFF")
    if header.group(2) or header.group(3) or header.group(4):
        raise MeshError(name, excerpt(data, 0), "ASCII OFF in three dimensions")
    counts = re.match(rb"(?:\s|#[^\n]*\n)*(\d+)[ \t]+(\d+)(?:[ \t]+-?\d+)?[^\n]*", data[header.end() :])
    if counts is None:
        raise MeshError(name, excerpt(data, header.end()), "numbers of vertices, faces and edges after OFF")
    n, p = int(counts.group(1)), int(counts.group(2))
    start = header.end() + counts.end()
    # A vertex takes six bytes or more ("0 0 0\n"), a triangle eight.
    if 6 * n + 8 * p > len(data) - start + 8:
        raise MeshError(
            name,
            f"{len(data)} bytes can't hold the {n} vertices and {p} faces that the header announces; the file may be truncated",
        )
    if p > max_triangles:
        raise MeshError(name, f"{p} faces are more than {max_triangles}; --max-triangles raises the limit")
    buffer = np.frombuffer(data, np.uint8)
    vertices, starts = np.empty((n, 3)), np.empty(p + 1, np.int64)
    corners = np.empty((len(data) - start) // 2 + 1, np.int64)
    slow = np.empty((3 * n, 3), np.int64)
    status, position, slow_count, used = _read(buffer, start, vertices, starts, corners, slow)
    if status == _ENDED:
        received = f"{min(position, n)} vertices and {max(0, position - n)} faces"
        raise MeshError(
            name, f"{received}, but the header announces {n} vertices and {p} faces; the file may be truncated"
        )
    if status != _OK:
        expected = {
            _BAD_VERTEX: "a vertex: three numbers",
            _BAD_FACE: f"a face: its number of corners (3 or more), then vertex numbers from 0 to {n - 1}",
        }[status]
        raise MeshError(f"{name} line {line_of(data, position)}", excerpt(data, position), expected)
    flat = vertices.reshape(-1)
    for index, first, stop in slow[:slow_count].tolist():
        value = float_of(data[first:stop])
        if value is None:
            raise MeshError(f"{name} line {line_of(data, first)}", excerpt(data, first), "a vertex: three numbers")
        flat[index] = value
    return vertices, corners[:used].copy(), starts
