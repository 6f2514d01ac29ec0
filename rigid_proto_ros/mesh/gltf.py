# SPDX-License-Identifier: MIT
"""glTF 2.0 (.gltf, .glb) according to the Khronos specification: the triangles of the default scene.

Strips, fans, normalized integers, sparse accessors, instances and Draco compression are refused by name.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import MeshError
from ..base.vectors import FloatArray, Triangles
from .assembly import Assembly, multiply_matrices, node_matrix

TRIANGLES = 4
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}
_READ = "KHR_mesh_quantization"
_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_xmp", "KHR_animation_")
"""Prefixes of the names of extensions that change no triangle."""


def _chunks(data: bytes, name: str) -> tuple[dict[str, Any], bytes]:
    """The JSON object and the binary buffer of a file, .glb or .gltf."""
    if data[:4] != b"glTF":
        return json.loads(data), b""
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MeshError(name, f"version {version} of glTF", "version 2")
    if length > len(data):
        raise MeshError(name, f"{len(data)} bytes, but the header announces {length}; the file may be truncated")
    found: dict[bytes, bytes] = {}
    position = 12
    while position + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, position)
        found.setdefault(kind, data[position + 8 : position + 8 + size])
        position += 8 + size
    return json.loads(found[b"JSON"]), found.get(b"BIN\0", b"")


class _Document:
    """The JSON object of a file, and the numbers in its accessors."""

    def __init__(self, data: bytes, name: str, beside: Callable[[str], bytes]) -> None:
        self.name = name
        self.json, self._blob = _chunks(data, name)
        self._beside = beside
        self._buffers: dict[int, bytes] = {}

    def item(self, kind: str, number: int) -> Any:
        """Entry ``number`` of the file's list ``kind``."""
        entries = self.json.get(kind, [])
        if not 0 <= number < len(entries):
            raise MeshError(self.name, f"it refers to {kind} {number}, but has only {len(entries)}")
        return entries[number]

    def view(self, number: int) -> bytes:
        """The bytes of a buffer view."""
        view = self.item("bufferViews", number)
        index, start = view["buffer"], view.get("byteOffset", 0)
        if index not in self._buffers:
            buffer = self.item("buffers", index)
            uri = buffer.get("uri")
            if uri is None:
                self._buffers[index] = self._blob
            elif uri.startswith("data:"):
                self._buffers[index] = base64.b64decode(uri.partition(",")[2])
            else:
                self._buffers[index] = self._beside(uri)
        content = self._buffers[index]
        if start < 0 or view["byteLength"] < 0 or start + view["byteLength"] > len(content):
            raise MeshError(self.name, f"buffer {index} ends before bufferView {number}; the file may be truncated")
        return content[start : start + view["byteLength"]]

    def numbers(self, accessor_number: int, kind: str) -> NDArray[Any]:
        """The rows (n, k) of an accessor of this kind, by its name in the specification."""
        accessor = self.item("accessors", accessor_number)
        for key, told in (("sparse", "is sparse"), ("normalized", "is of normalized integers")):
            if accessor.get(key):
                raise MeshError(self.name, f"accessor {accessor_number} {told}", "a file exported without compression")
        if accessor["type"] != kind:
            raise MeshError(self.name, f"accessor {accessor_number} is {accessor['type']}, where {kind} belongs")
        dtype, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[kind]
        count, start = accessor["count"], accessor.get("byteOffset", 0)
        content = self.view(accessor["bufferView"])
        stride = self.item("bufferViews", accessor["bufferView"]).get("byteStride") or dtype.itemsize * width
        if count < 0 or count and (start < 0 or start + stride * (count - 1) + dtype.itemsize * width > len(content)):
            raise MeshError(self.name, f"an accessor reads beyond bufferView {accessor['bufferView']}")
        return np.ndarray((count, width), dtype, content if count else None, start, (stride, dtype.itemsize))


def _node_matrix(node: dict[str, Any]) -> FloatArray:
    """The matrix (4, 4) of a node: scale, then rotation, then translation; or the given matrix."""
    numbers, matrix = np.empty(16 if "matrix" in node else 10), np.empty((4, 4))
    if "matrix" in node:
        numbers[:] = np.reshape(node["matrix"], 16)
    else:
        numbers[:3] = np.reshape(node.get("translation", (0, 0, 0)), 3)
        numbers[3:7] = np.reshape(node.get("rotation", (0, 0, 0, 1)), 4)
        numbers[7:] = np.reshape(node.get("scale", (1, 1, 1)), 3)
    node_matrix(numbers, matrix)
    return matrix


def _triangles(document: _Document, primitive: dict[str, Any]) -> tuple[NDArray[Any], Triangles]:
    """Vertices (n, 3) and triangles (m, 3) of a primitive; empty for points and lines."""
    mode = primitive.get("mode", TRIANGLES)
    if mode < TRIANGLES:
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise MeshError(document.name, "its meshes are compressed with Draco", "a file exported without compression")
    vertices = document.numbers(primitive["attributes"]["POSITION"], "VEC3")
    if "indices" in primitive:
        corners = document.numbers(primitive["indices"], "SCALAR")[:, 0].astype(np.int64)
    else:
        corners = np.arange(len(vertices))
    if mode != TRIANGLES:
        raise MeshError(document.name, "it has triangle strips or fans", "a file exported as triangles")
    if len(corners) % 3:
        raise MeshError(document.name, f"{len(corners)} corners of triangles, which isn't a multiple of 3")
    return vertices, corners.reshape(-1, 3)


def _add_node(document: _Document, number: int, above: FloatArray, seen: set[int], assembly: Assembly) -> None:
    """Add the meshes of a node and of its descendants."""
    if number in seen:
        raise MeshError(document.name, f"node {number} occurs twice in the scene; its nodes must be a tree")
    seen.add(number)
    node = document.item("nodes", number)
    matrix = np.empty((4, 4))
    multiply_matrices(above, _node_matrix(node), matrix)
    if "mesh" in node:
        mesh = document.item("meshes", node["mesh"])
        if "skin" in node:
            raise MeshError(document.name, f"mesh {node['mesh']} is deformed by a skin; apply it before the export")
        if any(node.get("weights", mesh.get("weights", []))):
            raise MeshError(document.name, f"mesh {node['mesh']} is morphed; apply the targets before the export")
        if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
            raise MeshError(document.name, f"node {number} uses EXT_mesh_gpu_instancing; apply it before the export")
        for k, primitive in enumerate(mesh["primitives"]):
            assembly.add(*_triangles(document, primitive), matrix, f"primitive {k} of mesh {node['mesh']}")
    for child in node.get("children", []):
        _add_node(document, child, matrix, seen, assembly)


def add_gltf(data: bytes, beside: Callable[[str], bytes], assembly: Assembly) -> None:
    """Add the meshes in the default scene of a file's bytes, or of all its nodes if it has no scene.

    ``beside`` returns the bytes of the file that a buffer's URI names. Raises MeshError, or other errors if the file
    doesn't follow the specification.
    """
    document = _Document(data, assembly.name, beside)
    for extension in document.json.get("extensionsRequired", []):
        if extension != _READ and not extension.startswith(_LOOKS):
            raise MeshError(document.name, f"it requires the extension {extension}", f"no other than {_READ}")
    if document.json.get("scenes"):
        roots = document.item("scenes", document.json.get("scene", 0)).get("nodes", [])
    else:
        nodes = document.json.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [number for number in range(len(nodes)) if number not in children]
    seen: set[int] = set()
    for root in roots:
        _add_node(document, root, np.eye(4), seen, assembly)
