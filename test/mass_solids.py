# SPDX-License-Identifier: MIT
"""Closed triangle meshes of many kinds for tests: compact, concave, hollow, thin, fine."""

from __future__ import annotations

import numpy as np

from rigid_proto_ros.base.rotation import matrix_from_quaternion, normalize


def rotation(seed: int) -> np.ndarray:
    """A rotation matrix (3, 3), the same for the same seed."""
    w, x, y, z = np.random.default_rng(seed).normal(size=4)
    return matrix_from_quaternion(normalize(x, y, z, w))


def box(sides=(1.0, 1.0, 1.0), cells: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A cuboid about the origin, each face cut into cells x cells squares of two triangles."""
    u, v = (grid.ravel() for grid in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    squares = []
    for axis in range(3):
        for end in (0, cells):
            corners = np.full((len(u), 4, 3), end)
            for k, (du, dv) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
                corners[:, k, (axis + 1) % 3], corners[:, k, (axis + 2) % 3] = u + du, v + dv
            squares.append(corners if end else corners[:, ::-1])
    grid, number = np.unique(np.concatenate(squares).reshape(-1, 3), axis=0, return_inverse=True)
    quads = number.reshape(-1, 4)
    return (grid / cells - 0.5) * np.asarray(sides), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def sphere(rings: int, radii=(1.0, 1.0, 1.0)) -> tuple[np.ndarray, np.ndarray]:
    """An ellipsoid of 4·rings² or so triangles."""
    around = 2 * rings
    theta = np.arange(1, rings) * np.pi / rings
    phi = np.arange(around) * 2 * np.pi / around
    t, p = np.meshgrid(theta, phi, indexing="ij")
    shell = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    vertices = np.vstack([shell, [0, 0, 1.0], [0, 0, -1.0]]) * np.asarray(radii)
    i, j = np.meshgrid(np.arange(rings - 2), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    top, bottom = len(shell), len(shell) + 1
    j = np.arange(around)
    last = (rings - 2) * around
    triangles = [
        np.stack([a, c, b], axis=-1).reshape(-1, 3),
        np.stack([b, c, d], axis=-1).reshape(-1, 3),
        np.stack([np.full(around, top), j, (j + 1) % around], axis=-1),
        np.stack([np.full(around, bottom), last + (j + 1) % around, last + j], axis=-1),
    ]
    return vertices, np.concatenate(triangles)


def torus(m: int, n: int, major: float, minor: float) -> tuple[np.ndarray, np.ndarray]:
    """A ring torus of 2·m·n triangles."""
    u, v = np.meshgrid(np.arange(m) * 2 * np.pi / m, np.arange(n) * 2 * np.pi / n, indexing="ij")
    radius = major + minor * np.cos(v)
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), minor * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(m), np.arange(n), indexing="ij")
    a, b = i * n + j, ((i + 1) % m) * n + j
    c, d = i * n + (j + 1) % n, ((i + 1) % m) * n + (j + 1) % n
    return vertices, np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])


def prism(outline, height: float, twist: float = 0.0, layers: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A prism over a plane outline (k, 2), star-shaped about the origin; ``twist`` [rad] turns its top."""
    outline = np.asarray(outline, dtype=float)
    k = len(outline)
    rows = []
    for layer in range(layers + 1):
        a = twist * layer / layers
        turned = outline @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        rows.append(np.column_stack([turned, np.full(k, height * layer / layers)]))
    vertices = np.vstack([*rows, [0, 0, 0.0], [0, 0, height]])
    bottom, top = len(vertices) - 2, len(vertices) - 1
    triangles = []
    for j in range(k):
        following = (j + 1) % k
        triangles.append([bottom, following, j])
        triangles.append([top, layers * k + j, layers * k + following])
        for layer in range(layers):
            a, b = layer * k + j, layer * k + following
            triangles += [[a, b, b + k], [a, b + k, a + k]]
    return vertices, np.array(triangles)


def circle(corners: int, radius: float = 1.0) -> np.ndarray:
    """A regular outline (corners, 2)."""
    a = np.arange(corners) * 2 * np.pi / corners
    return radius * np.column_stack([np.cos(a), np.sin(a)])


def together(*meshes) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes as one."""
    vertices, triangles, offset = [], [], 0
    for v, t in meshes:
        vertices.append(v)
        triangles.append(t + offset)
        offset += len(v)
    return np.vstack(vertices), np.concatenate(triangles)


def inward(mesh) -> tuple[np.ndarray, np.ndarray]:
    """The mesh with all faces reversed, as a cavity has them."""
    return mesh[0], mesh[1][:, ::-1].copy()


def moved(mesh, offset, seed: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The mesh turned at random and then moved."""
    vertices = mesh[0] if seed is None else mesh[0] @ rotation(seed).T
    return vertices + np.asarray(offset, dtype=float), mesh[1]


def solids() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Solids by name, the largest of some ten thousand triangles."""
    star = circle(14) * np.where(np.arange(14) % 2, 0.35, 1.0)[:, None]
    return {
        "tetrahedron": (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])),
        "cube": box(),
        "cube of 4800 triangles": box(cells=20),
        "ellipsoid, turned": moved(sphere(50, (1.0, 0.3, 0.05)), (0, 0, 0), 2),
        "torus": torus(60, 30, 1.0, 0.25),
        "star prism": prism(star, 0.4),
        "twisted prism": prism(circle(5), 3.0, twist=2.5, layers=40),
        "hollow sphere": together(sphere(30), inward(sphere(20, (0.9, 0.9, 0.9)))),
        "box with two cavities": together(
            box((4.0, 2.0, 2.0)), inward(moved(box(), (-1.2, 0.1, 0.0), 5)), inward(moved(sphere(12), (1.0, 0, 0)))
        ),
        "two bodies far apart": together(moved(box(), (-50, 0, 0), 6), moved(sphere(12), (60, 7, 0), 7)),
        "plate 1 x 1 x 1e-6, turned": moved(box((1.0, 1.0, 1e-6)), (0, 0, 0), 10),
        "plate 1 x 1 x 1e-6 of 4800, turned": moved(box((1.0, 1.0, 1e-6), 20), (0.4, 0, 0), 11),
        "needle 1 x 1e-4 x 1e-4, turned": moved(box((1.0, 1e-4, 1e-4)), (0, 0, 0), 12),
        "round needle, turned": moved(prism(circle(24, 1e-4), 1.0, layers=60), (0, 0, 0), 14),
    }  # fmt: skip


PLACES = {
    "base": lambda v: v,
    "+1e3": lambda v: v + 1e3,
    "+1e6": lambda v: v + 1e6,
    "x 1e-3": lambda v: v * 1e-3,
    "x 1e3": lambda v: v * 1e3,
    "x 1e-6": lambda v: v * 1e-6,
}
"""What is done to the vertices before they are rounded to doubles and taken as the truth."""
