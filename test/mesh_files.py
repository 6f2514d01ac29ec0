# SPDX-License-Identifier: MIT
"""Mesh files written for tests, whole ones and broken ones."""

from __future__ import annotations

import struct

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
