# SPDX-License-Identifier: MIT
"""Mesh files written for tests, whole ones and broken ones."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile

import numpy as np

CUBE_VERTICES = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
CUBE_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CUBE_TRIANGLES = np.array([[q[0], q[i], q[i + 1]] for q in CUBE_QUADS for i in (1, 2)])


def obj(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES) -> bytes:
    """Wavefront .obj."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += ["f " + " ".join(str(int(i) + 1) for i in face) for face in faces]
    return "\n".join([*lines, ""]).encode()


def off(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES) -> bytes:
    """Object File Format."""
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += [" ".join(str(int(i)) for i in (len(face), *face)) for face in faces]
    return "\n".join([*lines, ""]).encode()


def stl(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES, count: int | None = None) -> bytes:
    """Binary STL; ``count`` is what its header announces."""
    data = b"test".ljust(80) + struct.pack("<I", len(faces) if count is None else count)
    for face in faces:
        data += struct.pack("<12fH", 0, 0, 0, *np.asarray(vertices)[list(face)].ravel(), 0)
    return data


def stl_text(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES) -> bytes:
    """ASCII STL."""
    lines = ["solid test"]
    for face in faces:
        lines += ["  facet normal 0 0 0", "    outer loop"]
        lines += ["      vertex {!r} {!r} {!r}".format(*np.asarray(vertices)[int(i)].tolist()) for i in face]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid test", ""]).encode()


def ply(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES, announced: int | None = None) -> bytes:
    """ASCII .ply."""
    header = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    header += ["property double x", "property double y", "property double z"]
    header += [f"element face {len(faces) if announced is None else announced}"]
    header += ["property list uchar int vertex_indices", "end_header"]
    lines = [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
    lines += [" ".join(str(int(i)) for i in (len(face), *face)) for face in faces]
    return "\n".join([*header, *lines, ""]).encode()


def ply_binary(vertices=CUBE_VERTICES, faces=CUBE_TRIANGLES, big: bool = False) -> bytes:
    """Binary .ply with doubles; ``big`` for big-endian."""
    order, name = (">", "big") if big else ("<", "little")
    header = f"ply\nformat binary_{name}_endian 1.0\ncomment made by a test\nelement vertex {len(vertices)}\n"
    header += "property double x\nproperty double y\nproperty double z\nproperty uchar red\n"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nproperty float quality\nend_header\n"
    data = header.encode()
    for v in np.asarray(vertices, dtype=float):
        data += struct.pack(order + "3dB", *v, 7)
    for face in faces:
        data += struct.pack(f"{order}B{len(face)}if", len(face), *(int(i) for i in face), 0.5)
    return data


KINDS = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123, "<u4": 5125, "<f4": 5126}


class Gltf:
    """A glTF file of a cube, in parts that a test changes."""

    def __init__(self, vertices=CUBE_VERTICES, kind: str = "<f4", triangles=CUBE_TRIANGLES) -> None:
        self.bytes = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
        self.json |= {"accessors": [], "bufferViews": []}
        self.primitive = {"attributes": {"POSITION": self.add(vertices, kind)}, "indices": self.add(triangles, "<u2")}
        self.json["meshes"] = [{"primitives": [self.primitive]}]

    def view(self, values, kind: str) -> int:
        data = np.asarray(values).astype(kind).tobytes()
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes += data + b"\0" * (-len(data) % 4)
        return len(self.json["bufferViews"]) - 1

    def add(self, values, kind: str) -> int:
        values = np.asarray(values)
        scalar = values.ndim == 1 or np.issubdtype(values.dtype, np.integer) and kind == "<u2"
        width = "SCALAR" if scalar else f"VEC{values.shape[1]}"
        count = values.size if scalar else len(values)
        accessor = {"bufferView": self.view(values, kind), "componentType": KINDS[kind], "count": count, "type": width}
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    @property
    def node(self) -> dict:
        return self.json["nodes"][0]

    def gltf(self) -> bytes:
        """The file with its numbers in itself."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        return json.dumps({**self.json, "buffers": [{"uri": uri, "byteLength": len(self.bytes)}]}).encode()

    def glb(self, **buffer: str) -> bytes:
        """The file as a binary one. buffer: what it says of its numbers."""
        text = json.dumps({**self.json, "buffers": [{"byteLength": len(self.bytes), **buffer}]}).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.bytes), b"BIN\0") + self.bytes
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def cube_object(number: int, attributes: str = "", triangles=CUBE_TRIANGLES) -> str:
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CUBE_VERTICES)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>"
    return f'<object id="{number}" {attributes}>{mesh}</object>'


def components(number: int, *references: str) -> str:
    inside = "".join(f"<component {reference}/>" for reference in references)
    return f'<object id="{number}"><components>{inside}</components></object>'


def model(objects: str, *items: str, attributes: str = "") -> str:
    build = "".join(f"<item {item}/>" for item in items)
    names = f'xmlns="{CORE}" xmlns:p="{PRODUCTION}"'
    return f'<model unit="meter" {names} {attributes}><resources>{objects}</resources><build>{build}</build></model>'


def threemf(root: str, method: int = zipfile.ZIP_DEFLATED, **others: str) -> bytes:
    """A .3mf archive with the model to be built, and others by their names."""
    relation = '<Relationship Target="/3D/root.model" Id="r" Type="http://x/3dmodel"/>'
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr("_rels/.rels", f"<Relationships>{relation}</Relationships>")
        archive.writestr("3D/root.model", root)
        for name, text in others.items():
            archive.writestr(f"3D/{name}.model", text)
    return packed.getvalue()


GEOMETRY = (
    '<geometry id="cube"><mesh><source id="s"><float_array id="f" count="24">'
    + " ".join(str(x) for x in CUBE_VERTICES.ravel())
    + '</float_array><technique_common><accessor source="#f" count="8" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices><triangles count="12" material="m">'
    '<input semantic="VERTEX" source="#v" offset="0"/><p>'
    + " ".join(str(i) for i in CUBE_TRIANGLES.ravel())
    + "</p></triangles></mesh></geometry>"
)


def collada(nodes: str, geometry: str = GEOMETRY, libraries: str = "") -> bytes:
    """A .dae file whose scene has these nodes."""
    return (
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
        f'<unit meter="1"/></asset>{libraries}<library_geometries>{geometry}</library_geometries>'
        f'<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#scene"/></scene></COLLADA>'
    ).encode()


def moebius(segments: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A Möbius strip's vertices and triangles."""
    a = np.arange(segments) * 2 * np.pi / segments
    rim = [
        np.column_stack([np.cos(a) * (1 + s * np.cos(a / 2)), np.sin(a) * (1 + s * np.cos(a / 2)), s * np.sin(a / 2)])
        for s in (0.3, -0.3)
    ]
    triangles = []
    for i in range(segments):
        p, q = i, i + segments
        r, s = (i + 1, i + 1 + segments) if i + 1 < segments else (segments, 0)
        triangles += [[p, q, r], [q, s, r]]
    return np.vstack(rim), np.array(triangles)
