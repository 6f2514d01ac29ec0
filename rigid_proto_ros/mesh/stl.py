# SPDX-License-Identifier: MIT
"""STL, binary and ASCII: corners that are bit-equal become one vertex, numbered by first appearance."""

from __future__ import annotations

import codecs
import itertools
import re
import struct

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import IntArray, Points
from .ascii_floats import as_numbers, error_at
from .topology import equal_rows

_HEAD = 100
"""Words, with any number of blanks in between, within which an ASCII file must begin its first facet."""
_SPARE = 2
"""Bytes that may follow the last facet: a line end, or one more attribute count."""
_CORNER = rb"\s+vertex\s+(\S+\s+\S+\s+\S+)"
_FACET_TEXT = re.compile(
    rb"\bfacet\s+normal(?:\s+\S+){3}\s+outer\s+loop" + 3 * _CORNER + rb"\s+endloop\s+endfacet(?!\S)"
)
_FACET_PART = re.compile(rb"\bfacet\s+normal|\bouter\s+loop|\bvertex(?:\s+[-+.\d]\S*){3}|\bendloop")
"""Parts of a facet, which don't occur in the name of a solid."""
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _merge(points: Points) -> tuple[Points, IntArray, IntArray]:
    """Vertices (n, 3), corners (3m,) and their starts (m + 1,) of corner points (3m, 3)."""
    first = equal_rows(np.ascontiguousarray(points).view(np.int64))
    new = first == np.arange(len(first))
    return points[new], (np.cumsum(new) - 1)[first], np.arange(0, len(first) + 1, 3)


def is_ascii_stl(data: bytes) -> bool:
    """Whether the bytes are ASCII STL; binary files, too, may begin with the word solid."""
    if len(data) >= 84 and len(data) == 84 + 50 * struct.unpack_from("<I", data, 80)[0]:
        return False
    words = itertools.islice(re.finditer(rb"\S{1,80}", data), _HEAD)
    head = b" ".join(word.group() for word in words).removeprefix(codecs.BOM_UTF8).lstrip().lower()
    return head.startswith(b"solid") and (b"facet" in head or b"endsolid" in head) and b"\0" not in head


def read_stl(data: bytes, name: str) -> tuple[Points, IntArray, IntArray]:
    """Vertices (n, 3), triangles' corners (c,) and their starts (m + 1,); raises MeshError for a file cut short or not
    STL.
    """
    if is_ascii_stl(data):
        return _merge(_ascii_points(data.removeprefix(codecs.BOM_UTF8), name))
    if len(data) < 84:
        raise MeshError(name, f"{len(data)} bytes, no STL file", "ASCII, or a binary header of 84 bytes and facets")
    (count,) = struct.unpack_from("<I", data, 80)
    held, beyond = divmod(len(data) - 84, _FACET.itemsize)
    if count == 0 and beyond <= _SPARE:  # some programs that stream facets leave it at 0
        count = held
    if count > held:
        raise MeshError(name, f"the header announces {count} facets, but it holds {held}; the file may be truncated")
    extra = len(data) - 84 - _FACET.itemsize * count
    if extra > _SPARE:
        raise MeshError(name, f"{extra} bytes follow the {count} facets that the header announces")
    facets = np.frombuffer(data, _FACET, count=count, offset=84)
    return _merge(facets["corners"].reshape(-1, 3).astype(np.float64))


def _ascii_points(data: bytes, name: str) -> Points:
    """Corner points (3m, 3) in file order; line ends count as blanks. Only the names of solids may stand beside whole
    facets, so that no part of a damaged file is silently left out.
    """
    text = data.lower()
    parts = _FACET_TEXT.split(text)  # alternately the text before a facet and its three corners
    rest = b" ".join(parts[::4])
    facets = len(parts) // 4
    if not rest.lstrip().startswith(b"solid") or _FACET_PART.search(rest):
        received = f"{text.count(b'vertex')} vertices in {facets} whole facets"
        raise MeshError(name, f"{received}, which is not three a facet; the file may be truncated")
    points, whole = as_numbers(b" ".join(part for k, part in enumerate(parts) if k % 4), 9 * facets)
    if not whole:
        facet, corner = divmod(len(points) // 3, 3)
        match = next(itertools.islice(_FACET_TEXT.finditer(text), facet, None))
        raise error_at(data, match.start(corner + 1), name, "vertex with three numbers")
    return points.reshape(-1, 3)
