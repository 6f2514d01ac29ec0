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
from .numbers_in_text import (
    EXACT,
    NEEDS_FLOAT,
    float_of,
    is_blank,
    line_of,
    read_number,
    token_end,
)

_OK, _BAD_VERTEX, _BAD_INDEX, _FEW_CORNERS = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def _count(buffer):
    """Numbers of v lines, f lines, and tokens on f lines: upper bounds that size the arrays."""
    vertices = faces = corners = 0
    i, end = 0, buffer.shape[0]
    while i < end:
        while i < end and is_blank(buffer[i]):
            i += 1
        kind = buffer[i] if i + 1 < end and is_blank(buffer[i + 1]) else 0
        if kind == 118:
            vertices += 1
        elif kind == 102:
            faces += 1
            i += 1
            while i < end and buffer[i] != 10:
                while i < end and is_blank(buffer[i]):
                    i += 1
                stop = token_end(buffer, i, end)
                corners += stop > i
                i = stop
        while i < end and buffer[i] != 10:
            i += 1
        i += 1
    return vertices, faces, corners


@njit(cache=True, nogil=True)
def _read(buffer, vertices, corners, starts, slow):
    """Fill the arrays; slow (k, 3) takes (flat coordinate index, token start, token end) of numbers left to float().

    Returns (status, position, vertices read, polygons read, slow tokens).
    """
    vertex = polygon = corner = slow_count = 0
    i, end = 0, buffer.shape[0]
    starts[0] = 0
    while i < end:
        while i < end and is_blank(buffer[i]):
            i += 1
        kind = buffer[i] if i + 1 < end and is_blank(buffer[i + 1]) else 0
        line = i
        if kind == 118:
            i += 1
            for k in range(3):
                while i < end and is_blank(buffer[i]):
                    i += 1
                first = i
                value, i, status = read_number(buffer, i, end)
                if status == EXACT:
                    vertices[vertex, k] = value
                elif status == NEEDS_FLOAT:
                    slow[slow_count, 0] = 3 * vertex + k
                    slow[slow_count, 1] = first
                    slow[slow_count, 2] = i
                    slow_count += 1
                else:
                    return _BAD_VERTEX, line, vertex, polygon, slow_count
            vertex += 1
        elif kind == 102:
            i += 1
            count = 0
            while True:
                while i < end and is_blank(buffer[i]):
                    i += 1
                if i >= end or buffer[i] == 10 or buffer[i] == 35:
                    break
                negative = buffer[i] == 45
                if negative:
                    i += 1
                index = 0
                first = i
                while i < end and 48 <= buffer[i] <= 57 and i - first < 18:
                    index = index * 10 + (buffer[i] - 48)
                    i += 1
                ends = i >= end or is_blank(buffer[i]) or buffer[i] == 10 or buffer[i] == 47
                if i == first or index == 0 or not ends:
                    return _BAD_INDEX, line, vertex, polygon, slow_count
                index = vertex - index if negative else index - 1
                if index < 0:
                    return _BAD_INDEX, line, vertex, polygon, slow_count
                corners[corner] = index
                corner += 1
                count += 1
                i = token_end(buffer, i, end)
            if count < 3:
                return _FEW_CORNERS, line, vertex, polygon, slow_count
            polygon += 1
            starts[polygon] = corner
        while i < end and buffer[i] != 10:
            i += 1
        i += 1
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
        text = data[position : position + 60].split(b"\n")[0].decode("ascii", "replace").strip()
        expected = {
            _BAD_VERTEX: "v with three coordinates",
            _BAD_INDEX: "f with nonzero integer vertex numbers, negative ones counted back from the last vertex",
            _FEW_CORNERS: "f with three or more corners",
        }[status]
        raise MeshError(f"{name} line {line_of(data, position)}", text, expected)
    flat = vertices.reshape(-1)
    for index, first, stop in slow[:slow_count].tolist():
        value = float_of(data[first:stop])
        if value is None:
            token = data[first:stop][:40].decode("ascii", "replace")
            raise MeshError(f"{name} line {line_of(data, first)}", token, "v with three numbers")
        flat[index] = value
    corners = corners[: starts[p]]
    if corners.size and int(corners.max()) >= n:
        where = int(np.argmax(corners >= n))
        face = int(np.searchsorted(starts, where, side="right"))
        raise MeshError(name, f"face {face} uses vertex {int(corners[where]) + 1}, but the file has only {n}")
    return vertices[:n], corners, starts[: p + 1]
