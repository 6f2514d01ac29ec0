# SPDX-License-Identifier: MIT
"""Wavefront .obj: vertices and faces in the file's order, polygons fanned from their first corner.

Supported: blanks and tabs, negative indices counted back from the vertices read so far (also when v and f lines
interleave), continued lines, ``v/vt/vn`` corners. Lines without geometry of the surface (vt, vn, l, p, groups,
materials) are skipped, and so is a byte order mark, which would hide the first line.
"""

from __future__ import annotations

import codecs
import itertools
import re

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import IntArray, Points
from .ascii_floats import as_numbers, error_at

_VERTEX = "v with three coordinates"
_FACE = "f with nonzero integer vertex numbers, negative ones counted back from the last vertex"
_BLANK = rb"[ \t\v\f]"
_CONTINUED = b" \v"  # blanks, from which the end of the line can be told
_INDENTED = re.compile(rb"\n" + _BLANK + rb"+")
_V = re.compile(rb"\nv" + _BLANK + rb"+(\S+" + _BLANK + rb"+\S+" + _BLANK + rb"+\S+)")
_F = re.compile(rb"\nf(?!\S)([^\n]*)")
_EITHER = re.compile(rb"\n([vf])(?!\S)")


def _error(text: bytes, letter: bytes, number: int, name: str, accepted: str) -> MeshError:
    """The error for a line: the one with this number, from 0 on, among those that begin with ``letter``."""
    lines = (match.start() + 1 for match in _EITHER.finditer(text) if match[1] == letter)
    place = next(itertools.islice(lines, number, None), 0)
    return error_at(text.replace(_CONTINUED, b" \n"), place, name, accepted, first_line=0)


def _vertices(text: bytes, name: str) -> Points:
    """Vertices (n, 3)."""
    found = _V.findall(text)
    lines = re.findall(rb"\nv(?!\S)[^\n]*", text)
    points, whole = as_numbers(b"\n".join(found), 3 * len(lines))
    if not whole or len(found) < len(lines):
        bad = next(k for k, line in enumerate(lines) if not as_numbers(b" ".join(line.split()[1:4]), 3)[1])
        raise _error(text, b"v", bad, name, _VERTEX)
    return points.reshape(-1, 3)


def _faces(text: bytes, name: str) -> tuple[IntArray, IntArray]:
    """Vertex numbers (c,) as written, and the number of corners of each face (p,)."""
    found = _F.findall(text)
    sizes = np.array([len(line.split()) for line in found], np.int64)
    if len(sizes) and sizes.min() < 3:
        raise _error(text, b"f", int(np.argmin(sizes)), name, "f with three or more corners")
    corners = b" ".join(found)
    if b"/" in corners:
        corners = re.sub(rb"/\S*", b"", corners)  # only the vertex of a corner v/vt/vn matters
    numbers, whole = as_numbers(corners, int(sizes.sum()), int)
    wrong = np.flatnonzero(numbers == 0)
    if not whole or len(wrong):
        first = int(wrong[0]) if len(wrong) else len(numbers)
        bad = int(np.searchsorted(np.cumsum(sizes), first, side="right"))
        raise _error(text, b"f", min(bad, len(sizes) - 1), name, _FACE)
    return numbers, sizes


def _known(text: bytes) -> IntArray:
    """Number of vertices before each face (p,)."""
    letters = np.frombuffer(b"".join(_EITHER.findall(text)), np.uint8)
    return np.asarray(np.cumsum(letters == ord("v"))[letters == ord("f")])


def read_obj(data: bytes, name: str) -> tuple[Points, IntArray, IntArray]:
    """Vertices (n, 3) float64, polygon corners (c,) int64 and their starts (p + 1,) of the file's bytes.

    Raises MeshError with the file's name and line.
    """
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\0" in data[:4096]:
        raise MeshError(name, "the content is binary; an .obj file is text")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = b"\n" + data
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    if b"\\\n" in text:  # after the comments: one that ends with a backslash, as paths do, continues nowhere
        text = text.replace(b"\\\n", _CONTINUED)
    text = _INDENTED.sub(b"\n", text)
    vertices = _vertices(text, name)
    numbers, sizes = _faces(text, name)
    starts = np.cumsum(np.concatenate([np.zeros(1, np.int64), sizes]))
    corners = numbers - 1
    if len(numbers) and numbers.min() < 0:
        known = np.repeat(_known(text), sizes)
        corners = np.where(numbers < 0, numbers + known, corners)
        if corners.min() < 0:
            bad = int(np.searchsorted(starts, np.flatnonzero(corners < 0)[0], side="right")) - 1
            raise _error(text, b"f", bad, name, _FACE)
    beyond = np.flatnonzero(corners >= len(vertices))
    if len(beyond):
        face = int(np.searchsorted(starts, beyond[0], side="right"))
        used = f"face {face} uses vertex {int(corners[beyond[0]]) + 1}"
        raise MeshError(name, f"{used}, but the file has only {len(vertices)}")
    return vertices, corners, starts
