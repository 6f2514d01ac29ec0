# SPDX-License-Identifier: MIT
"""Closed triangle surfaces by lofting, and their boolean union and difference.

A surface is a pair ``(vertices (n, 3) float64 in metres, triangles (m, 3) int64)``, wound outward. Lofts and boxes are
made directly, so that their triangles follow the shape; only joining and drilling use manifold3d, which is imported there.
"""

from collections.abc import Sequence

import numpy as np

Surface = tuple[np.ndarray, np.ndarray]


def loft(rings: np.ndarray, closed: bool = False) -> Surface:
    """Skin over rings of points; each ring runs counter-clockwise seen from the side the rings advance to.

    rings: (k, n, 3). An open loft is capped by a fan about each end ring's centre; a ring whose points all coincide is
    a pole. ``closed`` joins the last ring to the first instead.
    """
    rings = np.asarray(rings, dtype=float)
    count, sides = rings.shape[:2]
    vertices = [rings.reshape(-1, 3)]
    triangles = []
    column = np.arange(sides)
    after = (column + 1) % sides
    for row in range(count if closed else count - 1):
        low, high = row * sides, (row + 1) % count * sides
        triangles.append(np.stack([low + column, low + after, high + after], axis=1))
        triangles.append(np.stack([low + column, high + after, high + column], axis=1))
    if not closed:
        first, last = count * sides, count * sides + 1
        vertices.append(np.stack([rings[0].mean(axis=0), rings[-1].mean(axis=0)]))
        top = (count - 1) * sides
        triangles.append(np.stack([np.full(sides, first), after, column], axis=1))
        triangles.append(np.stack([np.full(sides, last), top + column, top + after], axis=1))
    return weld(np.concatenate(vertices), np.concatenate(triangles))


def lathe(profile: np.ndarray, sides: int) -> Surface:
    """Solid of revolution about z. profile: (k, 2) radius and height in m, from the bottom to the top."""
    profile = np.asarray(profile, dtype=float)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    rings = profile[:, 0, None, None] * circle
    rings[:, :, 2] = profile[:, 1, None]
    return loft(rings)


def tube(
    path: np.ndarray, half_axes: np.ndarray, up: np.ndarray, sides: int, power: float = 2.0, closed=False
) -> Surface:
    """Sweep a superellipse |a/A|^p + |b/B|^p = 1 along a path that lies in a plane.

    path: (k, 3) m. half_axes: (k, 2) or (2,) m, A in the path's plane and B along ``up``, the plane's unit normal.
    """
    path = np.asarray(path, dtype=float)
    half_axes = np.broadcast_to(half_axes, (len(path), 2))
    ahead, behind = np.roll(path, -1, axis=0), np.roll(path, 1, axis=0)
    if not closed:
        ahead[-1], behind[0] = path[-1], path[0]
    tangent = ahead - behind
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(up, tangent)
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    cosine, sine = np.cos(angle), np.sin(angle)
    radius = (np.abs(cosine) ** power + np.abs(sine) ** power) ** (-1.0 / power)
    a = half_axes[:, :1] * (radius * cosine)
    b = half_axes[:, 1:] * (radius * sine)
    # (across, up, tangent) is right-handed or left-handed alike for a whole path; signed_volume decides which.
    rings = path[:, None] + a[:, :, None] * across[:, None] + b[:, :, None] * np.asarray(up, dtype=float)
    surface = loft(rings, closed)
    return surface if signed_volume(surface) > 0.0 else reverse(surface)


def rounded_box(size: Sequence[float], edge_radius: float, arc: int = 3, spans: int = 1) -> Surface:
    """Box about the origin with rounded edges. size: 3 x m; ``arc`` facets per quarter edge, ``spans`` per flat side."""
    half = np.asarray(size, dtype=float) / 2.0 - edge_radius
    slope = np.tan(np.linspace(0.0, np.pi / 4.0, arc + 1))
    lean = np.concatenate([-slope[::-1], np.zeros(spans - 1), slope])
    centre = np.concatenate([-np.ones(arc), np.linspace(-1.0, 1.0, spans + 1), np.ones(arc)])
    n = len(lean)
    vertices, triangles = [], []
    grid = np.arange(n * n).reshape(n, n)
    corner = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    quads = np.stack([c.ravel() for c in corner], axis=1)
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.empty((n, n, 3))
            place = np.empty((n, n, 3))
            for k, value in ((axis, None), ((axis + 1) % 3, 0), ((axis + 2) % 3, 1)):
                shape = (n, 1) if value == 0 else (1, n)
                normal[:, :, k] = sign if value is None else lean.reshape(shape)
                place[:, :, k] = half[k] * (sign if value is None else centre.reshape(shape))
            normal /= np.linalg.norm(normal, axis=2, keepdims=True)
            face = quads if sign > 0.0 else quads[:, ::-1]
            offset = sum(len(v) for v in vertices)
            vertices.append((place + edge_radius * normal).reshape(-1, 3))
            triangles.append(offset + np.concatenate([face[:, [0, 1, 2]], face[:, [0, 2, 3]]]))
    return weld(np.concatenate(vertices), np.concatenate(triangles))


def extrude(outline: np.ndarray, height: float) -> Surface:
    """Prism over a simple polygon. outline: (n, 2) m, counter-clockwise, at z = 0; top at z = height."""
    from manifold3d import CrossSection, Manifold

    return _surface(Manifold.extrude(CrossSection([np.asarray(outline, dtype=float)]), height))


def move(surface: Surface, offset: Sequence[float] = (0.0, 0.0, 0.0), axes: str = "xyz") -> Surface:
    """Send x, y, z to the named axes (a cyclic order, so that it stays a rotation), then shift by ``offset`` metres."""
    if axes not in ("xyz", "yzx", "zxy"):
        raise ValueError(f"axes: got {axes!r}; accepted: xyz, yzx, zxy")
    moved = np.empty_like(surface[0])
    moved[:, ["xyz".index(name) for name in axes]] = surface[0]
    return moved + np.asarray(offset, dtype=float), surface[1]


def union(*surfaces: Surface) -> Surface:
    """One surface of everything that lies in any of the solids."""
    from manifold3d import Manifold, OpType

    return _surface(Manifold.batch_boolean([_manifold(s) for s in surfaces], OpType.Add))


def difference(solid: Surface, *cutters: Surface) -> Surface:
    """The solid without what lies in the cutters."""
    from manifold3d import Manifold, OpType

    return _surface(Manifold.batch_boolean([_manifold(s) for s in (solid, *cutters)], OpType.Subtract))


def refine(surface: Surface, longest: float) -> Surface:
    """Split triangles until no edge is much longer than ``longest`` metres; the shape stays."""
    return _surface(_manifold(surface).refine_to_length(longest), simplify=False)


def with_cavity(outer: Surface, inner: Surface) -> Surface:
    """A solid with an inner void: the inner surface is wound inward, so that its volume counts negatively."""
    return np.concatenate([outer[0], inner[0]]), np.concatenate([outer[1], inner[1][:, ::-1] + len(outer[0])])


def reverse(surface: Surface) -> Surface:
    """The same surface, wound the other way."""
    return surface[0], surface[1][:, ::-1].copy()


def signed_volume(surface: Surface) -> float:
    """Enclosed volume in m³; negative when the surface is wound inward."""
    a, b, c = np.swapaxes(surface[0][surface[1]], 0, 1)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def smooth_curve(points: np.ndarray, samples: int) -> np.ndarray:
    """Catmull-Rom spline through points (k, d), as ``samples`` rows; equal shares of the parameter for each span."""
    points = np.asarray(points, dtype=float)
    ends = [2.0 * points[0] - points[1], 2.0 * points[-1] - points[-2]]
    padded = np.concatenate([ends[:1], points, ends[1:]])
    position = np.linspace(0.0, len(points) - 1.0, samples)
    span = np.minimum(position.astype(int), len(points) - 2)
    t = (position - span)[:, None]
    a, b, c, d = (padded[span + k] for k in range(4))
    return b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))


def weld(vertices: np.ndarray, triangles: np.ndarray, grid: float = 1e-8) -> Surface:
    """Merge vertices of one grid cell (10 nm), drop triangles that collapse and vertices that nothing uses."""
    key = np.round(np.asarray(vertices, dtype=float) / grid).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    faces = first[inverse.reshape(-1)][np.asarray(triangles, dtype=np.int64)]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    used, renumbered = np.unique(faces, return_inverse=True)
    return key[used] * grid, renumbered.reshape(-1, 3)


def _manifold(surface: Surface):
    from manifold3d import Error, Manifold, Mesh64

    solid = Manifold(Mesh64(np.ascontiguousarray(surface[0]), np.ascontiguousarray(surface[1].astype(np.uint64))))
    if solid.status() != Error.NoError:
        raise ValueError(
            f"surface: got one that is not a closed manifold ({solid.status()}); accepted: closed surfaces"
        )
    return solid


def _surface(solid, simplify: bool = True) -> Surface:
    # Booleans leave triangles far below what a viewer or a finger can tell; 2 µm is below any machined tolerance here.
    mesh = (solid.simplify(2e-6) if simplify else solid).to_mesh64()
    return weld(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
