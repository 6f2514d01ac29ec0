# SPDX-License-Identifier: MIT
"""Stanford .ply, ASCII and binary, with the same number of corners in all faces: every element is then a table.

Not read by trimesh, which renumbers textured vertices and assumes the first face's number of corners for all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import IntArray, Points, Records
from .ascii_floats import as_numbers, excerpt

_KINDS = {"i1": "char int8", "u1": "uchar uint8", "i2": "short int16", "u2": "ushort uint16", "i4": "int int32"}
_KINDS |= {"u4": "uint uint32", "i8": "int64", "u8": "uint64", "f4": "float float32", "f8": "double float64"}
_TYPES = {name: kind for kind, names in _KINDS.items() for name in names.split()}
"""NumPy's type codes by the names of types in a header."""
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_REMEDY = "faces that all have the same number of corners; save the mesh as .obj or .stl"
SPARE = 2
"""Bytes of a line end that may follow a binary body."""
MAX_HEADER = 1_000_000
"""Bytes; a header has some lines of 20 to 60 bytes."""

_Property = tuple[str, str, str]  # name, type, and the type of a list's length or ""
_Element = tuple[str, int, list[_Property]]  # name, rows, properties


def _header(data: bytes, name: str) -> tuple[str, list[_Element], int]:
    """Format, elements and the position where the body begins."""
    end = data.find(b"end_header")
    body = data.find(b"\n", end) + 1
    if not data.startswith(b"ply") or end < 0 or end > MAX_HEADER or body == 0:
        raise MeshError(name, excerpt(data, 0), "a .ply file: ply, a header, end_header, a body")
    layout = ""
    elements: list[_Element] = []
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        try:
            match line.split():
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case ["format", layout, _]:
                    pass
                case ["element", element, count] if count.isdecimal() and len(count) < 18:
                    elements.append((element, int(count), []))
                case ["property", "list", length, kind, column]:
                    elements[-1][2].append((column, _TYPES[kind], _TYPES[length]))
                case ["property", kind, column]:
                    elements[-1][2].append((column, _TYPES[kind], ""))
                case _:
                    raise ValueError
        except (IndexError, KeyError, ValueError):
            accepted = "element, property, comment or format lines in the header"
            raise MeshError(name, excerpt(line.encode(), 0), accepted) from None
    if layout not in _FORMATS:
        raise MeshError(name, excerpt(layout.encode(), 0), f"format {', '.join(_FORMATS)}")
    return layout, elements, body


def _rows(data: bytes, position: int, element: _Element, order: str, text: bool, name: str) -> Records:
    """The element's rows from ``position`` on: fields p0, p1, … and, for lists, which must all be as long as in the
    first row, their lengths n0, n1, …. ``text``: all numbers are doubles."""
    label, count, properties = element
    label = excerpt(label.encode(), 0)
    short = MeshError(name, f"it can't hold the {count} rows of {label} that it announces; the file may be truncated")
    fields: list[tuple[Any, ...]] = []
    for k, (_, kind, length) in enumerate(properties):
        kind = order + ("f8" if text else kind)
        if not length:
            fields.append((f"p{k}", kind))
            continue
        length, at, size = order + ("f8" if text else length), position + np.dtype(fields).itemsize, 0.0
        if count:
            if at + np.dtype(length).itemsize > len(data):
                raise short
            size = float(np.frombuffer(data, length, 1, at)[0])
        if not 0.0 <= size * np.dtype(kind).itemsize <= len(data) or size != int(size):
            raise short
        fields += [(f"n{k}", length), (f"p{k}", kind, (int(size),))]
    record = np.dtype(fields)
    if position + count * record.itemsize > len(data):
        raise short
    rows = np.frombuffer(data, record, count, position) if record.itemsize else np.zeros(0, record)
    for field in record.names or ():
        if field.startswith("n") and np.any(rows[field] != rows[field][:1]):
            raise MeshError(name, f"lists of different lengths in the rows of {label}", _REMEDY)
    return rows


def read_ply(data: bytes, name: str) -> tuple[Points, IntArray, IntArray]:
    """Vertices (n, 3), polygon corners (c,) and their starts (p + 1,); raises MeshError naming what is wrong."""
    layout, elements, position = _header(data, name)
    text, order = layout == "ascii", ">" if layout == "binary_big_endian" else "<"
    if text:
        values, whole = as_numbers(data[position:])
        if not whole:
            word = next(iter(data[position:].split()[len(values) :]), b"")
            raise MeshError(name, excerpt(word, 0), "numbers in the body of a .ply file")
        data, position = values.astype("<f8").tobytes(), 0
    declared = {label: {column for column, _, length in columns if not length} for label, _, columns in elements}
    if len(declared) < len(elements):
        raise MeshError(name, "its header declares an element twice", "each element once")
    if not {"x", "y", "z"} <= declared.get("vertex", set()):
        raise MeshError(name, "its header declares no vertices", "an element vertex with properties x, y, z")
    vertices, corners = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    for element in elements:
        label, count, properties = element
        rows = _rows(data, position, element, order, text, name)
        position += count * rows.dtype.itemsize
        scalars = {column: f"p{k}" for k, (column, _, length) in enumerate(properties) if not length}
        lists = [f"p{k}" for k, (column, _, length) in enumerate(properties) if length and column in _INDEX_NAMES]
        if label == "vertex":
            with np.errstate(invalid="ignore"):  # the verdict refuses numbers that aren't finite
                vertices = np.stack([rows[scalars[axis]].astype(np.float64) for axis in "xyz"], axis=1)
        elif label == "face" and lists and count:
            corners = rows[lists[0]]
        elif label == "tristrips" and count:
            raise MeshError(name, "it has triangle strips", _REMEDY)
    beyond = len(data) - position
    if beyond > (0 if text else SPARE):
        unit = f"{beyond // 8} numbers" if text else f"{beyond} bytes"
        raise MeshError(name, f"{unit} follow what the header announces; the file may be damaged")
    size = corners.shape[1]
    if size < 3:
        raise MeshError(name, f"its faces have {size} corners; a face has three or more")
    with np.errstate(invalid="ignore"):
        polygons = corners.astype(np.int64)
    wrong = corners[(polygons != corners) | (polygons < 0) | (polygons >= len(vertices))]
    if len(wrong):
        raise MeshError(name, f"a face uses vertex {wrong[0]:g}", f"vertices numbered 0 to {len(vertices) - 1}")
    return vertices, polygons.reshape(-1), size * np.arange(len(polygons) + 1)
