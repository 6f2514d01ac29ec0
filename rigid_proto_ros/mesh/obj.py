# SPDX-License-Identifier: MIT
"""Wavefront .obj: vertices and faces in the file's order, polygons fanned from their first corner.

Blank or tab separated, negative indices counted back from the vertices read so far (also when v and f lines
interleave), continued lines, ``v/vt/vn`` corners. Lines that carry no geometry of the surface (vt, vn, l, p, groups,
materials) are skipped, and so is a byte order mark, which would hide the first line.
"""

from __future__ import annotations

import codecs
import re

import numpy as np

from ..base.errors import MeshError
from .ascii_floats import as_numbers, excerpt

PIECE = 4_000_000
"""Bytes of text at a time: their words take some ten times as much memory as the arrays that become of them."""
_VERTEX = "v with three coordinates"
_FACE = "f with nonzero integer vertex numbers, negative ones counted back from the last vertex"


class _Surface:
    """What has been read of the file ``name``: parts of the vertices (n, 3) and of the polygons' corners."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.points: list[np.ndarray] = []
        self.corners: list[np.ndarray] = []
        self.sizes: list[np.ndarray] = []
        self.lines = self.vertices = self.triangles = 0

    def add(self, text: bytes) -> None:
        """Read whole lines."""
        lines = text.split(b"\n")
        vertex_lines: list[int] = []
        coordinates: list[bytes] = []
        face_lines: list[int] = []
        corners: list[bytes] = []
        sizes: list[int] = []
        known: list[int] = []
        for number, line in enumerate(lines):
            words = line.split()
            if not words:
                continue
            if words[0] == b"v":
                if len(words) < 4:
                    raise self.refusal(number, line, _VERTEX)
                vertex_lines.append(number)
                coordinates += words[1:4]
            elif words[0] == b"f":
                if b"#" in line:
                    words = line.partition(b"#")[0].split()
                if len(words) < 4:
                    raise self.refusal(number, line, "f with three or more corners")
                face_lines.append(number)
                corners += words[1:]
                sizes.append(len(words) - 1)
                known.append(self.vertices + len(vertex_lines))
        points, whole = as_numbers(b" ".join(coordinates), len(coordinates))
        if not whole:
            bad = vertex_lines[len(points) // 3]
            raise self.refusal(bad, lines[bad], _VERTEX)
        text = b" ".join(corners)
        if b"/" in text:
            text = re.sub(rb"/\S*", b"", text)  # of a corner as v/vt/vn the vertex counts
        numbers, whole = as_numbers(text, len(corners), int)
        before = np.repeat(np.array(known, np.int64), sizes)[: len(numbers)]
        wrong = np.flatnonzero((numbers == 0) | (numbers < -before))
        if not whole or len(wrong):
            first = int(wrong[0]) if len(wrong) else len(numbers)
            bad = face_lines[int(np.searchsorted(np.cumsum(sizes), first, side="right"))]
            raise self.refusal(bad, lines[bad], _FACE)
        self.points.append(points.reshape(-1, 3))
        self.corners.append(np.where(numbers < 0, numbers + before, numbers - 1))
        self.sizes.append(np.array(sizes, np.int64))
        self.vertices += len(vertex_lines)
        self.triangles += len(corners) - 2 * len(sizes)
        self.lines += len(lines) - 1

    def refusal(self, line: int, text: bytes, accepted: str) -> MeshError:
        """The error about a line of the present piece."""
        return MeshError(f"{self.name} line {self.lines + line + 1}", excerpt(text.strip(), 0), accepted)


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
    surface = _Surface(name)
    start = 0
    while start < len(data):
        end = data.find(b"\n", start + PIECE) + 1 or len(data)
        surface.add(data[start:end])
        start = end
        if surface.triangles > max_triangles:
            received = f"{surface.triangles} triangles or more are more than {max_triangles}"
            raise MeshError(name, f"{received}; --max-triangles raises the limit")
    vertices = np.concatenate(surface.points or [np.empty((0, 3))])
    corners = np.concatenate(surface.corners or [np.empty(0, np.int64)])
    starts = np.cumsum(np.concatenate([np.zeros(1, np.int64), *surface.sizes]))
    beyond = np.flatnonzero(corners >= len(vertices))
    if len(beyond):
        face = int(np.searchsorted(starts, beyond[0], side="right"))
        used = f"face {face} uses vertex {int(corners[beyond[0]]) + 1}"
        raise MeshError(name, f"{used}, but the file has only {len(vertices)}")
    return vertices, corners, starts
