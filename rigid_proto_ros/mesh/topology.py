# SPDX-License-Identifier: MIT
"""Which triangles meet at which edges: closed or open, wound alike or not, how many components, what lies twice.

Vertices at bit-equal places count as one here, so that a mesh whose corners are split for textures is judged by its
shape. The volume of a surface is the same from every origin exactly when each edge is used as often in one direction
as in the other; that is what ``balanced`` counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit


@njit(cache=True, nogil=True)
def first_equal_rows(rows: np.ndarray) -> np.ndarray:
    """For each row of ``rows`` (n, 3) int64 the index of the first row equal to it, (n,), by open addressing."""
    n = rows.shape[0]
    size = 16
    while size < 2 * n:
        size *= 2
    table = np.full(size, -1, np.int64)
    first = np.empty(n, np.int64)
    for i in range(n):
        a, b, c = np.uint64(rows[i, 0]), np.uint64(rows[i, 1]), np.uint64(rows[i, 2])
        h = a * np.uint64(0x9E3779B97F4A7C15)
        h = ((h ^ (h >> np.uint64(32))) + b) * np.uint64(0xBF58476D1CE4E5B9)
        h = ((h ^ (h >> np.uint64(29))) + c) * np.uint64(0x94D049BB133111EB)
        slot = np.int64((h ^ (h >> np.uint64(32))) & np.uint64(size - 1))
        while True:
            j = table[slot]
            if j < 0:
                table[slot] = i
                first[i] = i
                break
            if rows[j, 0] == rows[i, 0] and rows[j, 1] == rows[i, 1] and rows[j, 2] == rows[i, 2]:
                first[i] = j
                break
            slot = (slot + 1) & (size - 1)
    return first


def weld_equal(vertices: np.ndarray) -> np.ndarray:
    """For each vertex (n, 3) the first one at the bit-equal place (−0 is 0), (n,) int64."""
    return first_equal_rows((vertices + 0.0).view(np.int64))


@njit(cache=True, nogil=True)
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def _edges(corners, vertex_count):
    """Group the directed edges of ``corners`` (m, 3) by undirected edge, and join triangles that share one.

    Returns edge arrays (low vertex, high vertex, uses low→high, uses high→low, first and second triangle) and each
    triangle's representative in its component. Edges from a vertex to itself are no edges.
    """
    m = corners.shape[0]
    starts = np.zeros(vertex_count + 1, np.int64)
    for t in range(m):
        for k in range(3):
            u, v = corners[t, k], corners[t, (k + 1) % 3]
            if u != v:
                starts[min(u, v) + 1] += 1
    for i in range(vertex_count):
        starts[i + 1] += starts[i]
    fill = starts[:-1].copy()
    other = np.empty(starts[vertex_count], np.int32)
    user = np.empty(starts[vertex_count], np.int32)  # triangle, or ~triangle when it runs high to low
    for t in range(m):
        for k in range(3):
            u, v = corners[t, k], corners[t, (k + 1) % 3]
            if u != v:
                low = min(u, v)
                other[fill[low]] = max(u, v)
                user[fill[low]] = t if u < v else ~t
                fill[low] += 1
    parent = np.arange(m)
    table = np.empty((starts[vertex_count], 6), np.int32)
    count = 0
    for low in range(vertex_count):
        first, last = starts[low], starts[low + 1]
        if last - first > 24:
            order = np.argsort(other[first:last], kind="mergesort")
            other[first:last] = other[first:last][order]
            user[first:last] = user[first:last][order]
        else:
            for i in range(first + 1, last):
                o, s = other[i], user[i]
                j = i
                while j > first and other[j - 1] > o:
                    other[j] = other[j - 1]
                    user[j] = user[j - 1]
                    j -= 1
                other[j] = o
                user[j] = s
        i = first
        while i < last:
            j = i
            table[count, 0] = low
            table[count, 1] = other[i]
            table[count, 2] = table[count, 3] = 0
            table[count, 4] = user[i] if user[i] >= 0 else ~user[i]
            table[count, 5] = -1
            while j < last and other[j] == other[i]:
                t = user[j] if user[j] >= 0 else ~user[j]
                if user[j] >= 0:
                    table[count, 2] += 1
                else:
                    table[count, 3] += 1
                if j == i + 1:
                    table[count, 5] = t
                a, b = _root(parent, table[count, 4]), _root(parent, t)
                if a < b:
                    parent[b] = a
                elif b < a:
                    parent[a] = b
                j += 1
            count += 1
            i = j
    for t in range(m):
        parent[t] = _root(parent, t)
    return table[:count], parent


@dataclass(frozen=True)
class Topology:
    """How the triangles of a mesh hang together.

    corners (m, 3): triangles over welded vertices. edges (e, 6) int32: low vertex, high vertex, uses low→high, uses
    high→low, first triangle, second triangle or −1. component (m,): number of each triangle's component, counted from
    0 by first appearance. duplicates (m,): True for a triangle that repeats an earlier one with the same winding.
    opposites: triangles that repeat an earlier one with the opposite winding. degenerate: triangles without area.
    """

    corners: np.ndarray
    edges: np.ndarray
    component: np.ndarray
    components: int
    duplicates: np.ndarray
    opposites: int
    degenerate: int

    @property
    def boundary(self) -> np.ndarray:
        """Edges (k, 6) that one triangle alone uses."""
        return self.edges[self.edges[:, 2] + self.edges[:, 3] == 1]

    @property
    def unbalanced(self) -> int:
        """Edges used more often in one direction than in the other; 0 says that the surface bounds a volume."""
        return int(np.count_nonzero(self.edges[:, 2] != self.edges[:, 3]))

    @property
    def flipped(self) -> int:
        """Edges that an even number of triangles share, but not half of them in each direction."""
        uses = self.edges[:, 2] + self.edges[:, 3]
        return int(np.count_nonzero((uses % 2 == 0) & (self.edges[:, 2] != self.edges[:, 3])))

    @property
    def nonmanifold(self) -> int:
        """Edges that more than two triangles share."""
        return int(np.count_nonzero(self.edges[:, 2] + self.edges[:, 3] > 2))

    @property
    def watertight(self) -> bool:
        """No edge is used an odd number of times."""
        return not np.any((self.edges[:, 2] + self.edges[:, 3]) & 1)


@njit(cache=True, nogil=True)
def _without_area(vertices, triangles):
    """Number of triangles whose area is zero to rounding."""
    count = 0
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ux, uy, uz = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2]
        wx, wy, wz = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        size = max(ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz)
        if nx * nx + ny * ny + nz * nz <= (4e-16 * size) ** 2:
            count += 1
    return count


def mesh_topology(vertices: np.ndarray, triangles: np.ndarray) -> Topology:
    """The topology of triangles (m, 3) over vertices (n, 3)."""
    corners = weld_equal(vertices)[triangles]
    edges, parent = _edges(corners, len(vertices))
    roots, component = np.unique(parent, return_inverse=True)
    ordered = np.sort(corners, axis=1)
    first = first_equal_rows(ordered)
    # A triangle with two corners in one place adds nothing, however often it is there.
    real = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    repeated = (first != np.arange(len(first))) & real
    duplicates = np.zeros(len(first), dtype=bool)
    opposites = 0
    if repeated.any():
        again = np.nonzero(repeated)[0]
        same = _even_permutation(corners[again]) == _even_permutation(corners[first[again]])
        duplicates[again[same]] = True
        opposites = int(np.count_nonzero(~same))
    return Topology(
        corners, edges, component, len(roots), duplicates, opposites, int(_without_area(vertices, triangles))
    )


def _even_permutation(corners: np.ndarray) -> np.ndarray:
    """Whether each row's three numbers are a cyclic shift of their ascending order, (k,) bool."""
    a, b, c = corners.T
    return ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))


@njit(cache=True, nogil=True)
def _component_sums(vertices, triangles, component, count, reference):
    volume = np.zeros(count)
    area = np.zeros((count, 3))
    lower = np.full((count, 3), np.inf)
    upper = np.full((count, 3), -np.inf)
    p = np.empty((3, 3))
    for t in range(triangles.shape[0]):
        c = component[t]
        for i in range(3):
            for k in range(3):
                value = vertices[triangles[t, i], k]
                lower[c, k] = min(lower[c, k], value)
                upper[c, k] = max(upper[c, k], value)
                p[i, k] = value - reference[k]
        ux, uy, uz = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
        wx, wy, wz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        volume[c] += (p[0, 0] * nx + p[0, 1] * ny + p[0, 2] * nz) / 6.0
        area[c, 0] += 0.5 * nx
        area[c, 1] += 0.5 * ny
        area[c, 2] += 0.5 * nz
    return volume, area, lower, upper


def component_volumes(vertices, triangles, component, count):
    """Per component: signed volume (k,) from the mesh's centre, vector area (k, 3), lower and upper corners (k, 3)."""
    used = vertices[triangles.ravel()]
    reference = 0.5 * used.min(axis=0) + 0.5 * used.max(axis=0)
    return _component_sums(vertices, triangles, component, count, reference)
