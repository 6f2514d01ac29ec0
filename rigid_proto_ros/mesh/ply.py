# SPDX-License-Identifier: MIT
"""Stanford .ply: ASCII and binary, polygons of any size, and triangle strips (−1 restarts a strip)."""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import MeshError
from .ascii_floats import as_numbers, error_at, excerpt, word_position

_NAMES = {
    "b": ("char", "int8"),
    "B": ("uchar", "uint8"),
    "h": ("short", "int16"),
    "H": ("ushort", "uint16"),
    "i": ("int", "int32"),
    "I": ("uint", "uint32"),
    "q": ("int64",),
    "Q": ("uint64",),
    "f": ("float", "float32"),
    "d": ("double", "float64"),
}
_TYPES = {name: kind for kind, names in _NAMES.items() for name in names}
"""By the header's names, those of the modules struct and numpy."""
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
SPARE = 2
"""Bytes of a line end that may follow a binary body."""
MAX_HEADER = 1_000_000
"""Bytes; a header has some lines of 20 to 60."""


@dataclass(frozen=True)
class _Property:
    """A scalar of one of _TYPES, or a list of them when ``count_type`` says how its length is written."""

    name: str
    type: str
    count_type: str = ""


@dataclass
class _Element:
    """One element of the header: ``count`` rows of the properties."""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def index_column(self) -> int:
        """Number of the list property that names vertices, or −1."""
        names = [p.name if p.count_type else "" for p in self.properties]
        return next((k for k, name in enumerate(names) if name in _INDEX_NAMES), -1)

    def least_bytes(self, text: bool) -> int:
        """Least number of bytes that a row takes."""
        if text:
            return 2 * len(self.properties)
        return sum(struct.calcsize("<" + (p.count_type or p.type)) for p in self.properties)


def _header(data: bytes, name: str) -> tuple[str, list[_Element], int]:
    """Format, elements and the position where the body begins."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0 or end > MAX_HEADER:
        raise MeshError(name, excerpt(data, 0), "a .ply file: ply, a header, end_header")
    body = data.find(b"\n", end) + 1
    if body == 0:
        raise MeshError(name, "the file ends after its header")
    layout = ""
    elements: list[_Element] = []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        words = ["".join(c if c.isprintable() else "?" for c in word) for word in line.split()]
        try:
            if words[:1] == ["format"]:
                layout = words[1]
            elif words and words[0] not in ("comment", "obj_info"):
                _header_line(words, elements)
        except (IndexError, KeyError, ValueError):
            accepted = "element, property, comment or format lines in the header"
            raise MeshError(name, excerpt(line.encode(), 0), accepted) from None
    if layout not in _FORMATS:
        raise MeshError(name, layout[:40], f"format {', '.join(_FORMATS)}")
    return layout, elements, body


def _header_line(words: list[str], elements: list[_Element]) -> None:
    """Append the element or property that a line of the header declares; raises ValueError and its like for others."""
    if words[0] == "element":
        count = int(words[2])
        if count < 0:
            raise ValueError
        elements.append(_Element(words[1], count))
    elif words[0] == "property" and words[1] == "list":
        elements[-1].properties.append(_Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
    elif words[0] == "property":
        elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
    else:
        raise ValueError


class _Body:
    """The rows behind the header. Those of a text are read as binary ones of doubles, for so its numbers are kept."""

    def __init__(self, data: bytes, position: int, layout: str, name: str) -> None:
        self.name = name
        self.text = layout == "ascii"
        self.order = ">" if layout == "binary_big_endian" else "<"
        self.data, self.position = data, position
        if self.text:
            values, whole = as_numbers(data[position:])
            if not whole:
                end = position + word_position(data[position:], len(values))
                raise error_at(data, end, name, "numbers in the body of a .ply file")
            self.data, self.position = values.astype("<f8").tobytes(), 0

    def _type(self, kind: str) -> str:
        return self.order + ("d" if self.text else kind)

    def _size(self, kind: str, at: int) -> int:
        """The length of a list, written at ``at``; −1 where there is none."""
        if at + struct.calcsize(self._type(kind)) > len(self.data):
            return -1
        size = struct.unpack_from(self._type(kind), self.data, at)[0]
        return int(size) if 0 <= size <= len(self.data) and size == int(size) else -1

    def table(self, element: _Element) -> np.ndarray | None:
        """All rows, if every list is as long as it is in the first one: fields p0, p1, …, and of lists n0, n1, …"""
        fields: list[tuple] = []
        for k, p in enumerate(element.properties):
            if p.count_type:
                before = np.dtype(fields).itemsize
                size = self._size(p.count_type, self.position + before)
                if not 0 <= size * struct.calcsize(self._type(p.type)) <= len(self.data):
                    return None
                fields += [(f"n{k}", self._type(p.count_type)), (f"p{k}", self._type(p.type), (size,))]
            else:
                fields.append((f"p{k}", self._type(p.type)))
        kind = np.dtype(fields)
        if self.position + element.count * kind.itemsize > len(self.data):
            return None
        rows = np.frombuffer(self.data, kind, count=element.count, offset=self.position)
        if any(np.any(rows[n] != rows[n][:1]) for n in kind.names or () if n.startswith("n")):
            return None
        self.position += element.count * kind.itemsize
        return rows

    def lists(self, element: _Element, wanted: int) -> tuple[np.ndarray, np.ndarray]:
        """The lists of property ``wanted``, row by row: sizes (rows,), items."""
        at, sizes, parts = self.position, [], []
        for row, (k, p) in itertools.product(range(element.count), enumerate(element.properties)):
            size = 1
            if p.count_type:
                size = self._size(p.count_type, at)
                at += struct.calcsize(self._type(p.count_type))
            width = struct.calcsize(self._type(p.type))
            if size < 0 or at + size * width > len(self.data):
                raise self.short(element, row)
            if k == wanted:
                sizes.append(size)
                parts.append(self.data[at : at + size * width])
            at += size * width
        self.position = at
        kind = self._type(element.properties[wanted].type if wanted >= 0 else "d")
        return np.array(sizes, np.int64), np.frombuffer(b"".join(parts), kind)

    def check_end(self) -> None:
        """Refuse a body that goes on behind the rows that the header announces, but for a line end."""
        beyond = len(self.data) - self.position
        if beyond > (0 if self.text else SPARE):
            received = f"{beyond // 8} numbers" if self.text else f"{beyond} bytes"
            raise MeshError(self.name, f"{received} follow what the header announces; the file may be damaged")

    def short(self, element: _Element, rows: int) -> MeshError:
        """The refusal of a body that has fewer rows than the header says."""
        announced = f"the header announces {element.count}; the file may be truncated or damaged"
        return MeshError(self.name, f"{rows} complete rows of {element.name}, but {announced}")

    def vertices(self, element: _Element) -> np.ndarray:
        """Vertices (n, 3)."""
        names = [p.name for p in element.properties]
        if not all(axis in names for axis in "xyz") or any(p.count_type for p in element.properties):
            raise MeshError(self.name, names, "an element vertex with properties x, y, z and no lists")
        rows = self.table(element)
        if rows is None:
            width = sum(struct.calcsize(self._type(p.type)) for p in element.properties)
            raise self.short(element, (len(self.data) - self.position) // width)
        return np.stack([rows[f"p{names.index(axis)}"].astype(np.float64) for axis in "xyz"], axis=1)

    def polygons(self, element: _Element) -> tuple[np.ndarray, np.ndarray]:
        """The element's lists of vertex numbers, if it has such: sizes (rows,), numbers; raises MeshError for one that
        isn't whole."""
        wanted, rows = element.index_column, None
        if element.count:
            rows = self.table(element)
        if rows is None:
            sizes, items = self.lists(element, wanted)
        elif wanted < 0:
            sizes, items = np.zeros(0, np.int64), np.zeros(0)
        else:
            sizes, items = rows[f"n{wanted}"].astype(np.int64), rows[f"p{wanted}"].reshape(-1)
        with np.errstate(invalid="ignore"):  # NaN and what an int64 can't hold are found by the comparison
            whole = items.astype(np.int64)
        wrong = whole != items
        if wrong.any():
            raise MeshError(self.name, f"a face uses vertex {items[wrong][0]:g}; accepted: whole numbers")
        return sizes, whole


def _strips(sizes: np.ndarray, items: np.ndarray) -> np.ndarray:
    """The corners of triangle strips, −1 separated; every other triangle of a strip is turned."""
    triangles = [np.empty((0, 3), np.int64)]
    for strip in np.split(items, np.cumsum(sizes)[:-1]):
        for part in np.split(strip, np.nonzero(strip == -1)[0]):
            part = part[part != -1]
            if len(part) >= 3:
                t = np.stack([part[:-2], part[1:-1], part[2:]], axis=1)
                t[1::2] = t[1::2, [1, 0, 2]]
                triangles.append(t)
    corners = np.concatenate(triangles)
    real = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    return corners[real].reshape(-1)


def _check_counts(
    data: bytes, position: int, elements: list[_Element], text: bool, max_triangles: int, name: str
) -> None:
    """Refuse a header that announces more than the file can hold, or than is wanted, before memory is taken for it."""
    for element in elements:
        if element.count * element.least_bytes(text) > len(data) - position + 2:
            rows = f"the {element.count} rows of {element.name} that the header announces; the file may be truncated"
            raise MeshError(name, f"{len(data)} bytes can't hold {rows}")
        if element.name in ("face", "tristrips") and element.count > max_triangles:
            limit = f"at most {max_triangles} triangles; --max-triangles raises the limit"
            raise MeshError(name, f"{element.count} faces", limit)


def read_ply(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming what is wrong."""
    layout, elements, position = _header(data, name)
    _check_counts(data, position, elements, layout == "ascii", max_triangles, name)
    body = _Body(data, position, layout, name)
    vertices: np.ndarray | None = None
    sizes, items = np.zeros(0, np.int64), np.empty(0, np.int64)
    for element in elements:
        if element.name == "vertex":
            vertices = body.vertices(element)
            continue
        counts, numbers = body.polygons(element)
        if element.name == "tristrips":
            numbers = _strips(counts, numbers)
            counts = np.full(len(numbers) // 3, 3)
        if element.name in ("face", "tristrips"):
            sizes, items = np.concatenate([sizes, counts]), np.concatenate([items, numbers])
    body.check_end()
    if vertices is None:
        raise MeshError(name, [e.name for e in elements], "an element vertex with properties x, y, z")
    if sizes.size and sizes.min() < 3:
        raise MeshError(name, f"face {int(np.argmin(sizes))} has {int(sizes.min())} corners; a face has three or more")
    if items.size and (items.min() < 0 or items.max() >= len(vertices)):
        wrong = int(items[(items < 0) | (items >= len(vertices))][0])
        raise MeshError(name, f"a face uses vertex {wrong}, but the vertices are numbered 0 to {len(vertices) - 1}")
    return vertices, items, np.cumsum(np.concatenate([np.zeros(1, np.int64), sizes]))
