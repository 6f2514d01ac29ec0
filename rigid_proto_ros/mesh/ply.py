# SPDX-License-Identifier: MIT
"""Stanford .ply: ASCII and binary, polygons of any size, and triangle strips (−1 restarts a strip)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import error_at, excerpt, read_numbers

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "float32": "f4",
    "float64": "f8",
    **{f"{sign}int{bits}": f"{kind}{bits // 8}" for sign, kind in (("", "i"), ("u", "u")) for bits in (8, 16, 32, 64)},
}
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
MAX_HEADER = 1_000_000
"""Bytes; a header has some lines of 20 to 60."""

_Lists = dict[str, tuple[np.ndarray, np.ndarray]]  # an element's list of vertex numbers: starts (rows + 1,), items


@dataclass(frozen=True)
class _Property:
    """A scalar of NumPy type ``type``, or a list of them when ``count_type`` says how its length is written."""

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
    def lists(self) -> list[int]:
        """Numbers of the properties that are lists."""
        return [k for k, p in enumerate(self.properties) if p.count_type]

    @property
    def index_column(self) -> int:
        """Number of the list property that names vertices, or −1."""
        return next((k for k in self.lists if self.properties[k].name in _INDEX_NAMES), -1)

    def least_bytes(self, text: bool) -> int:
        """Least number of bytes that a row takes."""
        if text:
            return 2 * len(self.properties)
        return sum(np.dtype(p.count_type or p.type).itemsize for p in self.properties)


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


@njit(cache=True, nogil=True)
def _walk_text(
    values: np.ndarray, i: int, rows: int, kinds: np.ndarray, wanted: int, starts: np.ndarray, items: np.ndarray
) -> tuple[int, int, int]:
    """Read rows of scalars (kind 0) and lists (kind 1) from numbers; keep the list property ``wanted``.

    Returns (rows read, position, items kept).
    """
    kept = 0
    n = values.shape[0]
    for row in range(rows):
        for p in range(kinds.shape[0]):
            if i >= n:
                return row, i, kept
            if kinds[p] == 0:
                i += 1
                continue
            size = int(values[i])
            if size != values[i] or size < 0 or i + 1 + size > n:
                return row, i, kept
            if p == wanted:
                items[kept : kept + size] = values[i + 1 : i + 1 + size]
                kept += size
            i += 1 + size
        starts[row + 1] = kept
    return rows, i, kept


@njit(cache=True, nogil=True)
def _unsigned(buffer: np.ndarray, i: int, size: int, big: bool) -> np.int64:
    """The unsigned integer of ``size`` bytes at i, the most significant one first when ``big``."""
    value = np.int64(0)
    for k in range(size):
        value |= np.int64(buffer[i + k]) << (8 * (size - 1 - k if big else k))
    return value


@njit(cache=True, nogil=True)
def _walk_bytes(
    buffer: np.ndarray, i: int, widths: np.ndarray, wanted: int, big: bool, offsets: np.ndarray, counts: np.ndarray
) -> tuple[int, int]:
    """Offsets and lengths of the list property ``wanted`` in each row, offsets and counts (rows,).

    widths (p, 2): the bytes of each property's count, 0 for a scalar, and of one item. Returns (rows read, position).
    """
    n = buffer.shape[0]
    for row in range(offsets.shape[0]):
        for p in range(widths.shape[0]):
            size = 1
            if widths[p, 0]:
                if i + widths[p, 0] > n:
                    return row, i
                size = _unsigned(buffer, i, widths[p, 0], big)
                i += widths[p, 0]
            if size < 0 or size > n or i + size * widths[p, 1] > n:
                return row, i
            if p == wanted:
                offsets[row], counts[row] = i, size
            i += size * widths[p, 1]
    return offsets.shape[0], i


@njit(cache=True, nogil=True)
def _gather(buffer: np.ndarray, offsets: np.ndarray, counts: np.ndarray, item_size: int, out: np.ndarray) -> None:
    """Copy the lists' bytes one after the other."""
    o = 0
    for row in range(offsets.shape[0]):
        for k in range(counts[row] * item_size):
            out[o] = buffer[offsets[row] + k]
            o += 1


def _short(name: str, element: _Element, rows: int) -> MeshError:
    announced = f"the header announces {element.count}; the file may be truncated or damaged"
    return MeshError(name, f"{rows} complete rows of {element.name}, but {announced}")


def _strips(starts: np.ndarray, items: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangle strips, −1 separated, as corners and starts; every other triangle of a strip is turned."""
    triangles = []
    for row in range(len(starts) - 1):
        strip = items[starts[row] : starts[row + 1]]
        for part in np.split(strip, np.nonzero(strip == -1)[0]):
            part = part[part != -1]
            if len(part) >= 3:
                t = np.stack([part[:-2], part[1:-1], part[2:]], axis=1)
                t[1::2] = t[1::2, [1, 0, 2]]
                triangles.append(t)
    corners = np.concatenate(triangles) if triangles else np.empty((0, 3), np.int64)
    real = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[real].reshape(-1)
    return corners, np.arange(0, len(corners) + 1, 3)


def read_ply(data: bytes, name: str, max_triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming what is wrong."""
    layout, elements, position = _header(data, name)
    text = layout == "ascii"
    _check_counts(data, position, elements, text, max_triangles, name)
    if text:
        values, bad = read_numbers(data, position, len(data))
        if bad is not None:
            raise error_at(data, bad, name, "numbers in the body of a .ply file")
        vertices, lists = _text_body(values, elements, name)
    else:
        vertices, lists = _binary_body(data, position, elements, layout == "binary_big_endian", name)
    if vertices is None:
        raise MeshError(name, [e.name for e in elements], "an element vertex with properties x, y, z")
    starts, items = lists.get("face", (np.zeros(1, np.int64), np.empty(0, np.int64)))
    if "tristrips" in lists:
        corners, strip_starts = _strips(*lists["tristrips"])
        items = np.concatenate([items, corners])
        starts = np.concatenate([starts, starts[-1] + strip_starts[1:]])
    sizes = np.diff(starts)
    if sizes.size and sizes.min() < 3:
        raise MeshError(name, f"face {int(np.argmin(sizes))} has {int(sizes.min())} corners; a face has three or more")
    if items.size and (items.min() < 0 or items.max() >= len(vertices)):
        wrong = int(items[(items < 0) | (items >= len(vertices))][0])
        raise MeshError(name, f"a face uses vertex {wrong}, but the vertices are numbered 0 to {len(vertices) - 1}")
    return vertices, items, starts


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


def _vertex_columns(element: _Element, name: str) -> list[int]:
    names = [p.name for p in element.properties]
    if not all(axis in names for axis in "xyz") or element.lists:
        raise MeshError(name, names, "an element vertex with properties x, y, z and no lists")
    return [names.index(axis) for axis in "xyz"]


def _vertex_numbers(items: np.ndarray, name: str) -> np.ndarray:
    """The items of a list of vertex numbers as int64; raises MeshError for one that isn't whole."""
    with np.errstate(invalid="ignore"):  # NaN and what an int64 can't hold are found by the comparison
        whole = items.astype(np.int64)
    wrong = whole != items
    if wrong.any():
        raise MeshError(name, f"a face uses vertex {items[wrong][0]:g}; accepted: whole numbers")
    return whole


def _text_body(values: np.ndarray, elements: list[_Element], name: str) -> tuple[np.ndarray | None, _Lists]:
    vertices: np.ndarray | None = None
    lists: _Lists = {}
    i = 0
    for element in elements:
        width = len(element.properties)
        if element.name == "vertex":
            columns = _vertex_columns(element, name)
            if i + width * element.count > len(values):
                raise _short(name, element, (len(values) - i) // width)
            rows = values[i : i + width * element.count].reshape(-1, width)
            vertices = np.ascontiguousarray(rows[:, columns])
            i += width * element.count
            continue
        kinds = np.array([bool(p.count_type) for p in element.properties], np.int64)
        starts = np.zeros(element.count + 1, np.int64)
        items = np.empty(len(values) - i)
        count, i, kept = _walk_text(values, i, element.count, kinds, element.index_column, starts, items)
        if count < element.count:
            raise _short(name, element, count)
        lists[element.name] = starts, _vertex_numbers(items[:kept], name)
    return vertices, lists


def _binary_body(
    data: bytes, position: int, elements: list[_Element], big: bool, name: str
) -> tuple[np.ndarray | None, _Lists]:
    order = ">" if big else "<"
    buffer = np.frombuffer(data, np.uint8)
    vertices: np.ndarray | None = None
    lists: _Lists = {}
    for element in elements:
        if not element.lists:
            dtype = np.dtype([(f"p{k}", order + p.type) for k, p in enumerate(element.properties)])
            if position + element.count * dtype.itemsize > len(data):
                raise _short(name, element, (len(data) - position) // max(1, dtype.itemsize))
            if element.name == "vertex":
                table = np.frombuffer(data, dtype, count=element.count, offset=position)
                wanted = _vertex_columns(element, name)
                vertices = np.stack([table[f"p{k}"].astype(np.float64) for k in wanted], axis=1)
            position += element.count * dtype.itemsize
            continue
        if element.name == "vertex":
            _vertex_columns(element, name)  # refuses its list
        item = np.dtype(order + element.properties[element.index_column].type)
        sizes = [(np.dtype(p.count_type).itemsize if p.count_type else 0) for p in element.properties]
        widths = np.array([sizes, [np.dtype(p.type).itemsize for p in element.properties]]).T
        offsets, counts = np.zeros(element.count, np.int64), np.zeros(element.count, np.int64)
        rows, position = _walk_bytes(buffer, position, widths, element.index_column, big, offsets, counts)
        if rows < element.count:
            raise _short(name, element, rows)
        if element.index_column >= 0:
            raw = np.empty(int(counts.sum()) * item.itemsize, np.uint8)
            _gather(buffer, offsets, counts, item.itemsize, raw)
            numbers = _vertex_numbers(raw.view(item), name)
            lists[element.name] = np.concatenate([[0], np.cumsum(counts)]), numbers
    return vertices, lists
