# SPDX-License-Identifier: MIT
"""Object File Format (.off) as Geomview defines it, ASCII: polygons of any size, colours and normals skipped."""

from __future__ import annotations

import re

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import EXACT, error_at, excerpt, finish_numbers, line_end, read_number, read_point, skip_blanks

_OK, _ENDED, _BAD_VERTEX, _BAD_FACE = 0, 1, 2, 3
_VERTEX = "a vertex: three numbers"


@njit(cache=True, nogil=True)
def _next_line(buffer: np.ndarray, i: int) -> int:
    """Start of the next line's first token, past blank lines and comments."""
    i = skip_blanks(buffer, i, True)
    while i < buffer.shape[0] and buffer[i] == 35:
        i = skip_blanks(buffer, line_end(buffer, i), True)
    return i


@njit(cache=True, nogil=True)
def _read(
    buffer: np.ndarray, i: int, vertices: np.ndarray, starts: np.ndarray, corners: np.ndarray, slow: np.ndarray
) -> tuple[int, int, int, int]:
    """Fill the arrays from i on; slow (k, 3) as in ``read_point``.

    Returns (status, position or rows read when the file ended, numbers noted in slow, corners read).
    """
    end = buffer.shape[0]
    slow_count = 0
    for v in range(vertices.shape[0]):
        line = i = _next_line(buffer, i)
        if i >= end:
            return _ENDED, v, slow_count, 0
        i, slow_count, whole = read_point(buffer, i, vertices, v, slow, slow_count, False)
        if not whole:
            return _BAD_VERTEX, line, slow_count, 0
        i = line_end(buffer, i)
    corner = 0
    starts[0] = 0
    for f in range(starts.shape[0] - 1):
        line = i = _next_line(buffer, i)
        if i >= end:
            return _ENDED, vertices.shape[0] + f, slow_count, corner
        value, i, status = read_number(buffer, i)
        size = int(value)
        if status != EXACT or size != value or size < 3 or size > end:
            return _BAD_FACE, line, slow_count, corner
        for _ in range(size):
            value, i, status = read_number(buffer, skip_blanks(buffer, i, False))
            if status != EXACT or value != int(value) or not 0 <= value < vertices.shape[0]:
                return _BAD_FACE, line, slow_count, corner
            corners[corner] = int(value)
            corner += 1
        starts[f + 1] = corner
        i = line_end(buffer, i)
    return _OK, 0, slow_count, corner


def _announced(data: bytes, name: str) -> tuple[int, int, int]:
    """(vertices, faces, position of the body) from the header."""
    header = re.match(rb"\s*(ST)?C?N?(4)?(n)?OFF\b[ \t]*(BINARY)?", data)
    if header is None:
        raise MeshError(name, excerpt(data, 0), "an .off file: its first line is OFF")
    if header.group(2) or header.group(3) or header.group(4):
        raise MeshError(name, excerpt(data, 0), "ASCII OFF in three dimensions")
    body = re.compile(rb"(?:\s|#[^\n]*\n)*").match(data, header.end())
    start = header.end() if body is None else body.end()
    counts = re.compile(rb"(\d{1,18})[ \t]+(\d{1,18})(?:[ \t]+-?\d+)?[^\n]*").match(data, start)
    if counts is None:
        raise MeshError(name, excerpt(data, start), "numbers of vertices, faces and edges after OFF")
    return int(counts.group(1)), int(counts.group(2)), counts.end()


def read_off(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming file and line."""
    n, p, start = _announced(data, name)
    # A vertex takes six bytes or more ("0 0 0\n"), a triangle eight.
    if 6 * n + 8 * p > len(data) - start + 8:
        announced = f"the {n} vertices and {p} faces that the header announces; the file may be truncated"
        raise MeshError(name, f"{len(data)} bytes can't hold {announced}")
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
        face = f"a face: its number of corners (3 or more), then vertex numbers from 0 to {n - 1}"
        raise error_at(data, position, name, _VERTEX if status == _BAD_VERTEX else face)
    finish_numbers(vertices, slow[:slow_count], data, name, _VERTEX)
    return vertices, corners[:used].copy(), starts
