# SPDX-License-Identifier: MIT
"""Wavefront .obj: vertices and faces in the file's order, polygons fanned from their first corner.

Blank or tab separated, negative indices counted back from the vertices read so far (also when v and f lines
interleave), continued lines, ``v/vt/vn`` corners. Lines that carry no geometry of the surface (vt, vn, l, p, groups,
materials) are skipped, and so is a byte order mark, which would hide the first line.
"""

from __future__ import annotations

import codecs

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import error_at, finish_numbers, is_blank, line_end, read_point, skip_blanks, token_end

_OK, _BAD_VERTEX, _BAD_INDEX, _FEW_CORNERS = 0, 1, 2, 3
_V, _F, _OTHER_LINE = 118, 102, 0
_VERTEX = "v with three numbers"


@njit(cache=True, nogil=True)
def _line_kind(buffer: np.ndarray, i: int) -> int:
    """_V or _F when the line whose first token begins at i is one of theirs."""
    if i + 1 < buffer.shape[0] and is_blank(buffer[i + 1]) and (buffer[i] == _V or buffer[i] == _F):
        return buffer[i]
    return _OTHER_LINE


@njit(cache=True, nogil=True)
def _count(buffer: np.ndarray) -> tuple[int, int, int]:
    """Numbers of v lines, f lines, and tokens on f lines: upper bounds that size the arrays."""
    vertices = faces = corners = 0
    i, end = 0, buffer.shape[0]
    while i < end:
        i = skip_blanks(buffer, i, False)
        kind = _line_kind(buffer, i)
        if kind == _V:
            vertices += 1
        elif kind == _F:
            faces += 1
            i += 1
            while i < end and buffer[i] != 10:
                i = skip_blanks(buffer, i, False)
                stop = token_end(buffer, i)
                corners += stop > i
                i = stop
        i = line_end(buffer, i) + 1
    return vertices, faces, corners


@njit(cache=True, nogil=True)
def _corner(buffer: np.ndarray, i: int, known: int) -> tuple[int | np.int64, int]:
    """(vertex from 0, position after the token) of a face's corner at i, after ``known`` vertices; −1: no such."""
    end = buffer.shape[0]
    negative = buffer[i] == 45
    if negative:
        i += 1
    index = 0
    first = i
    while i < end and 48 <= buffer[i] <= 57 and i - first < 18:
        index = index * 10 + (np.int64(buffer[i]) - 48)
        i += 1
    ends = i >= end or is_blank(buffer[i]) or buffer[i] == 10 or buffer[i] == 47
    if index == 0 or not ends:
        return -1, i
    return (known - index if negative else index - 1), token_end(buffer, i)


@njit(cache=True, nogil=True)
def _face(buffer: np.ndarray, i: int, corners: np.ndarray, corner: int, known: int) -> tuple[int, int, int]:
    """Corners from i to the line's end into corners (c,) from ``corner`` on: (status, position, corners read)."""
    end = buffer.shape[0]
    first = corner
    while True:
        i = skip_blanks(buffer, i, False)
        if i >= end or buffer[i] == 10 or buffer[i] == 35:
            break
        vertex, i = _corner(buffer, i, known)
        if vertex < 0:
            return _BAD_INDEX, i, corner
        corners[corner] = vertex
        corner += 1
    return (_OK if corner - first >= 3 else _FEW_CORNERS), i, corner


@njit(cache=True, nogil=True)
def _read(
    buffer: np.ndarray, vertices: np.ndarray, corners: np.ndarray, starts: np.ndarray, slow: np.ndarray
) -> tuple[int, int, int, int, int]:
    """Fill the arrays; slow (k, 3) as in ``read_point``.

    Returns (status, position, vertices read, polygons read, numbers noted in slow).
    """
    vertex = polygon = corner = slow_count = 0
    i = 0
    starts[0] = 0
    while i < buffer.shape[0]:
        line = i = skip_blanks(buffer, i, False)
        kind = _line_kind(buffer, i)
        if kind == _V:
            i, slow_count, whole = read_point(buffer, i + 1, vertices, vertex, slow, slow_count, False)
            if not whole:
                return _BAD_VERTEX, line, vertex, polygon, slow_count
            vertex += 1
        elif kind == _F:
            status, i, corner = _face(buffer, i + 1, corners, corner, vertex)
            if status != _OK:
                return status, line, vertex, polygon, slow_count
            polygon += 1
            starts[polygon] = corner
        i = line_end(buffer, i) + 1
    return _OK, 0, vertex, polygon, slow_count


def read_obj(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64, polygon corners (c,) int64 and their starts (p + 1,) of the file's bytes.

    Raises MeshError with the file's name and line.
    """
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\0" in data[:4096]:
        raise MeshError(name, "the content is binary; an .obj file is text")
    if b"\\\n" in data or b"\\\r\n" in data:
        data = data.replace(b"\\\r\n", b"   ").replace(b"\\\n", b"  ")
    if b"\n" not in data and b"\r" in data:
        data = data.replace(b"\r", b"\n")
    buffer = np.frombuffer(data, dtype=np.uint8)
    n, p, c = _count(buffer)
    if c - 2 * p > max_triangles:
        raise MeshError(name, f"{c - 2 * p} triangles are more than {max_triangles}; --max-triangles raises the limit")
    vertices = np.empty((n, 3))
    corners = np.empty(c, np.int64)
    starts = np.empty(p + 1, np.int64)
    slow = np.empty((3 * n, 3), np.int64)
    status, position, n, p, slow_count = _read(buffer, vertices, corners, starts, slow)
    if status != _OK:
        expected = {
            _BAD_VERTEX: "v with three coordinates",
            _BAD_INDEX: "f with nonzero integer vertex numbers, negative ones counted back from the last vertex",
            _FEW_CORNERS: "f with three or more corners",
        }[status]
        raise error_at(data, position, name, expected)
    finish_numbers(vertices, slow[:slow_count], data, name, _VERTEX)
    corners = corners[: starts[p]]
    if corners.size and int(corners.max()) >= n:
        where = int(np.argmax(corners >= n))
        face = int(np.searchsorted(starts, where, side="right"))
        raise MeshError(name, f"face {face} uses vertex {int(corners[where]) + 1}, but the file has only {n}")
    return vertices[:n], corners, starts[: p + 1]
