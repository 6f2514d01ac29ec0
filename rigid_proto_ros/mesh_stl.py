# SPDX-License-Identifier: MIT
"""STL, binary and ASCII: corners that are bit-equal become one vertex, numbered by first appearance."""

from __future__ import annotations

import re
import struct

import numpy as np

from .core.errors import MeshError
from .core.mesh_topology import first_equal_rows
from .mesh_text import excerpt, line_of, read_numbers

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _merge(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of corner points (3m, 3)."""
    first = first_equal_rows(np.ascontiguousarray(points).view(np.int64))
    new = first == np.arange(len(first))
    return points[new], (np.cumsum(new) - 1)[first].reshape(-1, 3)


def is_ascii_stl(data: bytes) -> bool:
    """Whether the bytes read as ASCII STL: binary files, too, may begin with the word solid."""
    head = data[:512].lstrip().lower()
    return head.startswith(b"solid") and (b"facet" in head or b"endsolid" in data[:4096].lower()) and b"\0" not in head


def read_stl(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64; raises MeshError for a file cut short or not STL."""
    if is_ascii_stl(data):
        return _merge(_ascii_points(data, name))
    if len(data) < 84:
        raise MeshError(name, f"{len(data)} bytes", "an STL file: ASCII, or a binary header of 84 bytes and facets")
    (count,) = struct.unpack_from("<I", data, 80)
    held = (len(data) - 84) // 50
    if count > held:
        raise MeshError(name, f"room for {held} facets", f"the {count} facets that its header announces; cut short?")
    if len(data) != 84 + 50 * count:
        extra = len(data) - 84 - 50 * count
        raise MeshError(name, f"{extra} bytes beyond the {count} facets its header announces", "a whole STL file")
    if count > max_triangles:
        raise MeshError(name, f"{count} triangles", f"at most {max_triangles}; --max-triangles raises the limit")
    facets = np.frombuffer(data, _FACET, count=count, offset=84)
    return _merge(facets["corners"].reshape(-1, 3).astype(np.float64))


def _ascii_points(data: bytes, name: str) -> np.ndarray:
    """Corner points (3m, 3) in file order."""
    text = data.lower()
    places = [m.end() for m in re.finditer(rb"\bvertex\b", text)]
    ends = len(re.findall(rb"\bendfacet\b", text))
    if len(places) != 3 * ends:
        received = f"{len(places)} vertices in {ends} whole facets"
        raise MeshError(name, received, "three vertices a facet; the file may be cut short")
    points = np.empty((len(places), 3))
    # Blanking all words leaves the numbers alone; facet normals go with their words.
    numbers = re.sub(rb"facet\s+normal[^\n]*|^\s*(end)?solid[^\n]*|\b(end)?(facet|loop)\b|\bouter\b|\bvertex\b",
                     lambda m: b" " * len(m.group()), text, flags=re.MULTILINE)  # fmt: skip
    values, bad = read_numbers(numbers, 0, 3 * len(places) + 1)
    if bad is not None:
        raise MeshError(f"{name} line {line_of(data, bad)}", excerpt(data, bad), "vertex with three numbers")
    if len(values) != 3 * len(places):
        raise MeshError(name, f"{len(values)} coordinates for {len(places)} vertices", "three numbers a vertex")
    points[:] = values.reshape(-1, 3)
    return points
