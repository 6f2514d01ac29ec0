# SPDX-License-Identifier: MIT
"""STL, binary and ASCII: corners that are bit-equal become one vertex, numbered by first appearance."""

from __future__ import annotations

import codecs
import itertools
import re
import struct

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import error_at, finish_numbers, read_point, skip_blanks, token_end
from .topology import first_equal_rows

_HEAD = 100
"""Words, however many blanks stand between them, within which an ASCII file names its first facet."""
_SPARE = 2
"""Bytes that may follow the last facet: a line end, or one more attribute count."""
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _merge(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of corner points (3m, 3)."""
    first = first_equal_rows(np.ascontiguousarray(points).view(np.int64))
    new = first == np.arange(len(first))
    return points[new], (np.cumsum(new) - 1)[first].reshape(-1, 3)


def is_ascii_stl(data: bytes) -> bool:
    """Whether the bytes read as ASCII STL: binary files, too, may begin with the word solid."""
    if len(data) >= 84 and len(data) == 84 + 50 * struct.unpack_from("<I", data, 80)[0]:
        return False
    words = itertools.islice(re.finditer(rb"\S{1,80}", data), _HEAD)
    head = b" ".join(word.group() for word in words).removeprefix(codecs.BOM_UTF8).lstrip().lower()
    return head.startswith(b"solid") and (b"facet" in head or b"endsolid" in head) and b"\0" not in head


def read_stl(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64; raises MeshError for a file cut short or not STL."""
    if is_ascii_stl(data):
        return _merge(_ascii_points(data.removeprefix(codecs.BOM_UTF8), name))
    if len(data) < 84:
        raise MeshError(
            name, f"{len(data)} bytes are no STL file: neither ASCII, nor a binary header of 84 bytes and facets"
        )
    (count,) = struct.unpack_from("<I", data, 80)
    held, beyond = divmod(len(data) - 84, _FACET.itemsize)
    if count == 0 and beyond <= _SPARE:  # left for later by some that write facets as they come
        count = held
    if count > held:
        raise MeshError(
            name, f"the file has room for {held} facets, but its header announces {count}; the file may be truncated"
        )
    extra = len(data) - 84 - _FACET.itemsize * count
    if extra > _SPARE:
        raise MeshError(
            name, f"{extra} bytes follow the {count} facets that the header announces; the file may be damaged"
        )
    if count > max_triangles:
        raise MeshError(name, f"{count} triangles are more than {max_triangles}; --max-triangles raises the limit")
    facets = np.frombuffer(data, _FACET, count=count, offset=84)
    return _merge(facets["corners"].reshape(-1, 3).astype(np.float64))


_OTHER, _SOLID, _END_SOLID, _FACET_WORD, _END_FACET, _VERTEX = range(6)
_WORDS = tuple(word.encode() for word in ("", "solid", "endsolid", "facet", "endfacet", "vertex"))
_OK, _BAD_NUMBER, _NOT_THREE = 0, 1, 2


@njit(cache=True, nogil=True)
def _word(buffer: np.ndarray, i: int, stop: int) -> int:
    """Which of the words that matter the token from i to stop is, in capitals or not."""
    length = stop - i
    for kind in range(1, len(_WORDS)):
        word = _WORDS[kind]
        if len(word) != length:
            continue
        same = True
        for k in range(length):
            same = same and (buffer[i + k] | 32) == word[k]
        if same:
            return kind
    return _OTHER


@njit(cache=True, nogil=True)
def _facets(buffer: np.ndarray, points: np.ndarray, slow: np.ndarray) -> tuple[int, int, int, int, int]:
    """Corner points into points (n, 3), token by token: line ends count as blanks; slow (k, 3) as in ``read_point``.

    Returns (status, position, points, whole facets, numbers noted in slow).
    """
    i, end = 0, buffer.shape[0]
    count = facets = in_facet = slow_count = 0
    named = False  # within the name of a solid, which may hold any word
    while True:
        first = i = skip_blanks(buffer, i, True)
        if i >= end:
            return _OK, i, count, facets, slow_count
        i = token_end(buffer, i)
        kind = _word(buffer, first, i)
        if kind in (_SOLID, _END_SOLID):
            named = True
        elif kind == _FACET_WORD:
            named, in_facet = False, 0
        elif kind == _END_FACET and not named:
            if in_facet != 3:
                return _NOT_THREE, first, count, facets, slow_count
            facets += 1
        elif kind == _VERTEX and not named:
            if in_facet == 3 or count == points.shape[0]:
                return _NOT_THREE, first, count, facets, slow_count
            i, slow_count, whole = read_point(buffer, i, points, count, slow, slow_count, True)
            if not whole:
                return _BAD_NUMBER, first, count, facets, slow_count
            in_facet += 1
            count += 1


def _ascii_points(data: bytes, name: str) -> np.ndarray:
    """Corner points (3m, 3) in file order."""
    accepted = "vertex with three numbers"
    # A corner takes 12 bytes or more ("vertex 0 0 0"), and never more numbers than that are left to float().
    room = len(data) // 12 + 1
    points, slow = np.empty((room, 3)), np.empty((3 * room, 3), np.int64)
    status, position, count, facets, slow_count = _facets(np.frombuffer(data, np.uint8), points, slow)
    finish_numbers(points, slow[:slow_count], data, name, accepted)
    if status == _BAD_NUMBER:
        raise error_at(data, position, name, accepted)
    if status == _NOT_THREE or count != 3 * facets:
        received = f"{count} vertices in {facets} whole facets"
        raise MeshError(name, f"{received}, which is not three a facet; the file may be truncated")
    return points[:count]
