# SPDX-License-Identifier: MIT
"""Topology of a triangle mesh: edges, holes, consistent winding, components and duplicate faces.

Vertices at bit-equal positions count as one here, so that splitting corners for textures has no effect. The volume of a
surface is the same for every origin exactly if each edge is used equally often in both directions; ``unbalanced`` holds
the edges that aren't.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit
from ..base.vectors import BoolArray, FloatArray, IntArray, Points, Triangles, Vector3


@njit(nogil=True)
def first_equal_rows(rows: IntArray) -> IntArray:
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


def weld_equal(vertices: Points) -> IntArray:
    """For each vertex (n, 3) the first one at the bit-equal position (−0 equals 0), (n,) int64."""
    return first_equal_rows((vertices + 0.0).view(np.int64))


@njit(nogil=True)
def _root(parent: IntArray, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(nogil=True)
def joined_sets(first: IntArray, second: IntArray, count: int) -> IntArray:
    """Union-find: the smallest member of the set of each of 0 to count − 1, if first[k] and second[k] share a set."""
    parent = np.arange(count)
    for k in range(first.shape[0]):
        a, b = _root(parent, first[k]), _root(parent, second[k])
        parent[max(a, b)] = min(a, b)  # a set's root is its smallest member
    for i in range(count):
        parent[i] = _root(parent, i)
    return parent


def _edges(corners: Triangles, vertex_count: int) -> tuple[IntArray, IntArray]:
    """Edges (e, 6) of ``corners`` (m, 3) as in Topology, and for each triangle (m,) the first one of its component:
    triangles that share an edge belong to one, unless more than two share it and all that meet there are balanced at it
    by themselves: bodies that touch, or overlap, along an edge stay two.
    """
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    owner = np.repeat(np.arange(len(corners)), 3)
    real = tails != heads
    tails, heads, owner = tails[real], heads[real], owner[real]
    key = np.minimum(tails, heads) * vertex_count + np.maximum(tails, heads)
    order = np.argsort(key, kind="stable")
    key, owner, upward = key[order], owner[order], (tails < heads)[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    uses = np.diff(np.append(first, len(key)))
    forward = np.add.reduceat(upward, first, dtype=np.int64)
    second = np.where(uses > 1, owner[np.minimum(first + 1, len(key) - 1)], -1)
    low, high = np.divmod(key[first], vertex_count)
    edges = np.stack([low, high, forward, uses - forward, owner[first], second], axis=1)
    start, joins = np.repeat(owner[first], uses), np.repeat(uses <= 2, uses)
    root = joined_sets(start[joins], owner[joins], len(corners))
    crowded = ~joins
    if crowded.any():
        edge = np.repeat(np.arange(len(first)), uses)[crowded]
        _, meeting = np.unique(edge * len(corners) + root[owner[crowded]], return_inverse=True)
        excess = np.bincount(meeting, np.where(upward[crowded], 1.0, -1.0))
        joins[crowded] = np.isin(edge, edge[excess[meeting] != 0.0])
        root = joined_sets(start[joins], owner[joins], len(corners))
    return edges, root


@dataclass(frozen=True)
class Topology:
    """Connectivity of the triangles of a mesh.

    corners (m, 3): triangles over welded vertices. edges (e, 6): low vertex, high vertex, uses low→high, uses high→low,
    first triangle, second triangle or −1. component (m,): number of each triangle's component, counted from 0 by first
    appearance. duplicates (m,): True for a triangle that repeats an earlier one with the same winding.
    """

    corners: Triangles
    edges: IntArray
    component: IntArray
    components: int
    duplicates: BoolArray

    @property
    def boundary(self) -> IntArray:
        """Edges (k, 6) of only one triangle."""
        return np.asarray(self.edges[self._uses == 1])

    @property
    def unbalanced(self) -> IntArray:
        """Edges (k, 6) used more often in one direction than in the other: none if the surface bounds a volume."""
        return np.asarray(self.edges[self.edges[:, 2] != self.edges[:, 3]])

    @property
    def _uses(self) -> IntArray:
        uses: IntArray = self.edges[:, 2] + self.edges[:, 3]
        return uses

    @property
    def odd(self) -> int:
        """Number of edges that an odd number of triangles share."""
        return int(np.count_nonzero(self._uses & 1))

    @property
    def flipped(self) -> int:
        """Number of unbalanced edges that an even number of triangles share."""
        return len(self.unbalanced) - self.odd


def mesh_topology(vertices: Points, triangles: Triangles) -> Topology:
    """The topology of triangles (m, 3) over vertices (n, 3)."""
    first = weld_equal(vertices)
    corners = triangles if np.array_equal(first, np.arange(len(first))) else first[triangles]
    edges, root = _edges(corners, len(vertices))
    _, component = np.unique(root, return_inverse=True)
    smallest = np.argmin(corners, axis=1)[:, None]
    turned = np.take_along_axis(corners, (smallest + np.arange(3)) % 3, axis=1)  # keeps the winding
    # A triangle with two equal corners has no effect, however often it occurs.
    real = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    duplicates = (first_equal_rows(turned) != np.arange(len(corners))) & real
    return Topology(corners, edges, component, int(component.max(initial=-1)) + 1, duplicates)


def doubled_faces(topology: Topology) -> int:
    """Number of faces that occur with one winding more often than with the other by two or more: a volume beside each
    counts more than once.
    """
    low, middle, high = np.sort(topology.corners, axis=1).T
    real = (low < middle) & (middle < high)
    rows, corners = np.stack([low, middle, high], axis=1)[real], topology.corners[real]
    after_low = np.take_along_axis(corners, (np.argmin(corners, axis=1)[:, None] + 1) % 3, axis=1)[:, 0]
    copies = np.bincount(first_equal_rows(rows), np.where(after_low == rows[:, 1], 1.0, -1.0))
    return int(np.count_nonzero(np.abs(copies) > 1.0))


def surplus_copies(topology: Topology) -> BoolArray:
    """Which of the ``duplicates`` (m,) bool are defects: those of components whose edges are balanced at least as well
    without them. The others are needed to close the surface.
    """
    rest = np.flatnonzero(~topology.duplicates)
    edges, _ = _edges(topology.corners[rest], int(topology.corners.max(initial=0)) + 1)
    excess = [
        np.bincount(topology.component[triangle], np.abs(of[:, 2] - of[:, 3]), topology.components)
        for of, triangle in ((topology.edges, topology.edges[:, 4]), (edges, rest[edges[:, 4]]))
    ]
    return topology.duplicates & (excess[1] <= excess[0])[topology.component]


@njit(nogil=True)
def _component_sums(
    vertices: Points, triangles: Triangles, component: IntArray, count: int, middle: Vector3
) -> tuple[FloatArray, Points, Points]:
    volume = np.zeros(count)
    lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for t in range(len(triangles)):
        c = component[t]
        corner, u, w = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        for k in range(3):
            lower[c, k] = min(lower[c, k], corner[k], u[k], w[k])
            upper[c, k] = max(upper[c, k], corner[k], u[k], w[k])
        ax, ay, az = corner[0] - middle[0], corner[1] - middle[1], corner[2] - middle[2]
        ux, uy, uz = (u[0] - middle[0]) - ax, (u[1] - middle[1]) - ay, (u[2] - middle[2]) - az
        wx, wy, wz = (w[0] - middle[0]) - ax, (w[1] - middle[1]) - ay, (w[2] - middle[2]) - az
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        volume[c] += (ax * nx + ay * ny + az * nz) / 6.0
    return volume, lower, upper


@dataclass(frozen=True)
class Components:
    """Per component: signed volume (k,), lower and upper corners (k, 3)."""

    volume: FloatArray
    lower: Points
    upper: Points


def component_sums(vertices: Points, topology: Topology) -> Components:
    """Volumes and boxes of the components; reference of the volumes is the middle of the triangles' first corners."""
    corners = vertices[topology.corners[:, 0]]
    middle = 0.5 * corners.min(axis=0) + 0.5 * corners.max(axis=0)
    return Components(*_component_sums(vertices, topology.corners, topology.component, topology.components, middle))


def rims(edges: IntArray) -> list[list[int]]:
    """Closed walks of three or more vertices along ``edges`` (e, 6) of a topology, against the more frequent direction.

    Each edge is used as often as one direction is used more than the other, so that polygons over all walks close the
    surface. Open walks, which a subset of a topology's edges may have, are left out.
    """
    excess = edges[:, 2] - edges[:, 3]
    tails = np.repeat(np.where(excess > 0, edges[:, 1], edges[:, 0]), np.abs(excess)).tolist()
    heads = np.repeat(np.where(excess > 0, edges[:, 0], edges[:, 1]), np.abs(excess)).tolist()
    leaving: dict[int, list[int]] = {}
    for tail, head in zip(tails, heads, strict=True):
        leaving.setdefault(tail, []).append(head)
    walks = []
    for start in tails:
        path, place = [start], {start: 0}
        while leaving.get(path[-1]):
            vertex = leaving[path[-1]].pop()
            if vertex not in place:
                place[vertex] = len(path)
                path.append(vertex)
                continue
            first = place[vertex]
            if len(path) - first >= 3:
                walks.append(path[first:])
            for passed in path[first + 1 :]:
                del place[passed]
            del path[first + 1 :]
    return walks


def fan(walk: list[int]) -> Triangles:
    """Triangles (k, 3) of a polygon, as a fan from its first corner."""
    corners = np.array(walk, dtype=np.int64)
    return np.stack([np.full(len(walk) - 2, walk[0]), corners[1:-1], corners[2:]], axis=1)
