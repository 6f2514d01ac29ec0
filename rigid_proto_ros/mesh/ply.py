# SPDX-License-Identifier: MIT
"""Stanford .ply: ASCII and binary, polygons of any size, and triangle strips (−1 restarts a strip)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from .numbers_in_text import excerpt, line_of, read_numbers

_TYPES = dict(
    pair.split(":")
    for pair in [
        "char:i1",
        "uchar:u1",
        "short:i2",
        "ushort:u2",
        "int:i4",
        "uint:u4",
        "float:f4",
        "double:f8",
        "int8:i1",
        "uint8:u1",
        "int16:i2",
        "uint16:u2",
        "int32:i4",
        "uint32:u4",
        "float32:f4",
        "float64:f8",
        "int64:i8",
        "uint64:u8",
    ]
)
_INDEX_NAMES = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """One element of the header; a property is (name, type) or, for a list, (name, type, count type)."""

    name: str
    count: int
    properties: list[tuple] = field(default_factory=list)


def _header(data: bytes, name: str) -> tuple[str, list[_Element], int]:
    """Format, elements and the position where the body begins."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0 or end > 1_000_000:
        raise MeshError(name, excerpt(data, 0), "a .ply file: ply, a header, end_header")
    body = data.find(b"\n", end) + 1
    if body == 0:
        raise MeshError(name, "the file ends after its header")
    layout, elements = "", []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                layout = words[1]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2])))
                if elements[-1].count < 0:
                    raise ValueError
            elif words[0] == "property" and words[1] == "list":
                elements[-1].properties.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[0] == "property":
                elements[-1].properties.append((words[2], _TYPES[words[1]]))
            else:
                raise ValueError
        except (IndexError, KeyError, ValueError):
            raise MeshError(
                name, line.strip()[:60], "element, property, comment or format lines in the header"
            ) from None
    if layout not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise MeshError(name, layout, "format ascii, binary_little_endian or binary_big_endian")
    return layout, elements, body


@njit(cache=True, nogil=True)
def _walk_text(values, i, rows, kinds, wanted, starts, items):
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
            if size < 0 or i + 1 + size > n:
                return row, i, kept
            if p == wanted:
                for k in range(size):
                    items[kept] = int(values[i + 1 + k])
                    kept += 1
            i += 1 + size
        starts[row + 1] = kept
    return rows, i, kept


@njit(cache=True, nogil=True)
def _walk_bytes(buffer, i, rows, before, count_size, item_size, after, offsets, counts):
    """Offsets and lengths of one list a row: ``before`` bytes, an unsigned little-endian count, items, ``after`` bytes.

    Returns (rows read, position).
    """
    n = buffer.shape[0]
    for row in range(rows):
        i += before
        if i + count_size > n:
            return row, i
        size = 0
        for k in range(count_size):
            size |= np.int64(buffer[i + k]) << (8 * k)
        i += count_size
        if size < 0 or size > n or i + size * item_size + after > n:
            return row, i
        offsets[row] = i
        counts[row] = size
        i += size * item_size + after
    return rows, i


@njit(cache=True, nogil=True)
def _gather(buffer, offsets, counts, item_size, out):
    """Copy the lists' bytes one after the other."""
    o = 0
    for row in range(offsets.shape[0]):
        for k in range(counts[row] * item_size):
            out[o] = buffer[offsets[row] + k]
            o += 1


def _short(name: str, element: _Element, rows: int) -> MeshError:
    return MeshError(
        name,
        f"{rows} complete rows of {element.name}, but the header announces {element.count}; the file may be truncated or damaged",
    )


def _minimum_row(element: _Element, text: bool) -> int:
    """Least number of bytes that a row takes."""
    if text:
        return 2 * len(element.properties)
    return sum(np.dtype(p[2] if len(p) == 3 else p[1]).itemsize for p in element.properties)


def _strips(starts, items) -> tuple[np.ndarray, np.ndarray]:
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
    for element in elements:
        if element.count * _minimum_row(element, text) > len(data) - position + 2:
            raise MeshError(
                name,
                f"{len(data)} bytes can't hold the {element.count} rows of {element.name} that the header announces; the file may be truncated",
            )
        if element.name in ("face", "tristrips") and element.count > max_triangles:
            limit = f"at most {max_triangles} triangles; --max-triangles raises the limit"
            raise MeshError(name, f"{element.count} faces", limit)
    if text:
        values, bad = read_numbers(data, position, len(data))
        if bad is not None:
            raise MeshError(
                f"{name} line {line_of(data, bad)}", excerpt(data, bad), "numbers in the body of a .ply file"
            )
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


def _vertex_columns(element: _Element, name: str) -> list[int]:
    names = [p[0] for p in element.properties]
    if not all(axis in names for axis in "xyz") or any(len(p) == 3 for p in element.properties):
        raise MeshError(name, names, "an element vertex with properties x, y, z and no lists")
    return [names.index(axis) for axis in "xyz"]


def _list_column(element: _Element) -> int:
    for k, p in enumerate(element.properties):
        if len(p) == 3 and p[0] in _INDEX_NAMES:
            return k
    return -1


def _text_body(values: np.ndarray, elements: list[_Element], name: str):
    vertices, lists, i = None, {}, 0
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
        kinds = np.array([len(p) == 3 for p in element.properties], np.int64)
        starts = np.zeros(element.count + 1, np.int64)
        items = np.empty(len(values) - i, np.int64)
        rows, i, kept = _walk_text(values, i, element.count, kinds, _list_column(element), starts, items)
        if rows < element.count:
            raise _short(name, element, rows)
        lists[element.name] = starts, items[:kept]
    return vertices, lists


def _binary_body(data: bytes, position: int, elements: list[_Element], big: bool, name: str):
    order = ">" if big else "<"
    buffer = np.frombuffer(data, np.uint8)
    vertices, lists = None, {}
    for element in elements:
        columns = [k for k, p in enumerate(element.properties) if len(p) == 3]
        if not columns:
            dtype = np.dtype([(f"p{k}", order + p[1]) for k, p in enumerate(element.properties)])
            if position + element.count * dtype.itemsize > len(data):
                raise _short(name, element, (len(data) - position) // max(1, dtype.itemsize))
            if element.name == "vertex":
                table = np.frombuffer(data, dtype, count=element.count, offset=position)
                wanted = _vertex_columns(element, name)
                vertices = np.stack([table[f"p{k}"].astype(np.float64) for k in wanted], axis=1)
            position += element.count * dtype.itemsize
            continue
        if len(columns) > 1 or (big and np.dtype(element.properties[columns[0]][2]).itemsize > 1):
            accepted = "binary rows with one list each, its count little-endian or one byte; save as ASCII .ply or .obj"
            raise MeshError(name, f"element {element.name}", accepted)
        column = columns[0]
        _, item_type, count_type = element.properties[column]
        item = np.dtype(order + item_type)
        before = sum(np.dtype(p[1]).itemsize for p in element.properties[:column])
        after = sum(np.dtype(p[1]).itemsize for p in element.properties[column + 1 :])
        offsets, counts = np.empty(element.count, np.int64), np.empty(element.count, np.int64)
        widths = before, np.dtype(count_type).itemsize, item.itemsize, after
        rows, position = _walk_bytes(buffer, position, element.count, *widths, offsets, counts)
        if rows < element.count:
            raise _short(name, element, rows)
        if element.properties[column][0] in _INDEX_NAMES and item.kind in "iu":
            raw = np.empty(int(counts.sum()) * item.itemsize, np.uint8)
            _gather(buffer, offsets, counts, item.itemsize, raw)
            lists[element.name] = np.concatenate([[0], np.cumsum(counts)]), raw.view(item).astype(np.int64)
    return vertices, lists
