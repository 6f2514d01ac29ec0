# SPDX-License-Identifier: MIT
"""Which triangles meet at which edges: closed or open, wound alike or not, how many components, what lies twice.

Vertices at bit-equal places count as one here, so that a mesh whose corners are split for textures is taken by its
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
def _root(parent: np.ndarray, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def _join(parent: np.ndarray, s: int, t: int) -> None:
    """Put s and t into one set, whose root is its smallest member."""
    a, b = _root(parent, s), _root(parent, t)
    if a < b:
        parent[b] = a
    elif b < a:
        parent[a] = b


@njit(cache=True, nogil=True)
def joined_sets(first: np.ndarray, second: np.ndarray, count: int) -> np.ndarray:
    """The smallest member of the set that each of 0 to count − 1 is in, when first[k] and second[k] are in one set."""
    parent = np.arange(count)
    for k in range(first.shape[0]):
        _join(parent, first[k], second[k])
    for i in range(count):
        parent[i] = _root(parent, i)
    return parent


@njit(cache=True, nogil=True)
def _half_edges(corners: np.ndarray, vertex_count: int) -> tuple[np.ndarray, np.ndarray]:
    """The triangles' sides by their lower vertex: those of vertex v are keys[starts[v]:starts[v + 1]].

    A key is (higher vertex, triangle, 1 when it runs from high to low), from the highest bits on: sorted keys of one
    vertex stand edge by edge. Sides from a vertex to itself are left out.
    """
    starts = np.zeros(vertex_count + 1, np.int64)
    for t in range(corners.shape[0]):
        for k in range(3):
            u, v = corners[t, k], corners[t, (k + 1) % 3]
            if u != v:
                starts[min(u, v) + 1] += 1
    for i in range(vertex_count):
        starts[i + 1] += starts[i]
    fill = starts[:-1].copy()
    keys = np.empty(starts[vertex_count], np.int64)
    for t in range(corners.shape[0]):
        for k in range(3):
            u, v = np.int64(corners[t, k]), np.int64(corners[t, (k + 1) % 3])
            if u != v:
                low = min(u, v)
                keys[fill[low]] = (max(u, v) << 32) | (t << 1) | (u > v)
                fill[low] += 1
    return starts, keys


@njit(cache=True, nogil=True)
def _sort(keys: np.ndarray, first: int, last: int) -> None:
    """Sort keys[first:last], mostly some six of them, in place."""
    if last - first > 24:
        keys[first:last] = np.sort(keys[first:last])
        return
    for i in range(first + 1, last):
        key = keys[i]
        j = i
        while j > first and keys[j - 1] > key:
            keys[j] = keys[j - 1]
            j -= 1
        keys[j] = key


@njit(cache=True, nogil=True)
def _edges(corners: np.ndarray, vertex_count: int) -> tuple[np.ndarray, np.ndarray, int, bool]:
    """Match the sides of ``corners`` (m, 3) edge by edge, and join triangles that share one.

    Returns edge arrays (low vertex, high vertex, uses low→high, uses high→low, first and second triangle), each
    triangle's component (m,), their number, and whether a triangle may repeat another one: two at one edge then have
    the same third corner.
    """
    starts, keys = _half_edges(corners, vertex_count)
    parent = np.arange(corners.shape[0])
    table = np.empty((len(keys), 6), np.int32)
    count = 0
    repeats = False
    for low in range(vertex_count):
        last = starts[low + 1]
        _sort(keys, starts[low], last)
        i = starts[low]
        while i < last:
            high = keys[i] >> 32
            t = (keys[i] & 0xFFFFFFFF) >> 1
            table[count, 0], table[count, 1], table[count, 2], table[count, 3] = low, high, 0, 0
            table[count, 4], table[count, 5] = t, -1
            third = corners[t, 0] + corners[t, 1] + corners[t, 2]
            first = i
            while i < last and keys[i] >> 32 == high:
                table[count, 2 + (keys[i] & 1)] += 1
                other = (keys[i] & 0xFFFFFFFF) >> 1
                if i == first + 1:
                    table[count, 5] = other
                if i > first:
                    _join(parent, t, other)
                    # Of more than two triangles only some pairs are compared.
                    same = corners[other, 0] + corners[other, 1] + corners[other, 2] == third
                    repeats = repeats or i > first + 1 or same
                i += 1
            count += 1
    component = np.empty(len(parent), np.int64)
    components = 0
    for t in range(len(parent)):
        root = _root(parent, t)
        if root == t:  # it stands before the others of its component
            component[t] = components
            components += 1
        else:
            component[t] = component[root]
    return table[:count], component, components, repeats


@dataclass(frozen=True)
class Topology:
    """How the triangles of a mesh hang together.

    corners (m, 3): triangles over welded vertices. edges (e, 6) int32: low vertex, high vertex, uses low→high, uses
    high→low, first triangle, second triangle or −1. component (m,): number of each triangle's component, counted from
    0 by first appearance. duplicates (m,): True for a triangle that repeats an earlier one with the same winding.
    opposites: triangles that repeat an earlier one with the opposite winding. degenerate: triangles without area.

    odd: edges that an odd number of triangles share. unbalanced: edges used more often in one direction than in the
    other; 0 says that the surface bounds a volume. flipped: the even ones among those. nonmanifold: edges of more than
    two triangles.
    """

    corners: np.ndarray
    edges: np.ndarray
    component: np.ndarray
    components: int
    duplicates: np.ndarray
    opposites: int
    degenerate: int
    odd: int
    unbalanced: int
    flipped: int
    nonmanifold: int

    @property
    def boundary(self) -> np.ndarray:
        """Edges (k, 6) that one triangle alone uses."""
        return self.edges[self.edges[:, 2] + self.edges[:, 3] == 1]

    @property
    def watertight(self) -> bool:
        """No edge is used an odd number of times."""
        return self.odd == 0


@njit(cache=True, nogil=True)
def _without_area(vertices: np.ndarray, triangles: np.ndarray) -> int:
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
    first = weld_equal(vertices)
    corners = triangles if np.array_equal(first, np.arange(len(first))) else first[triangles]
    edges, component, components, repeats = _edges(corners, len(vertices))
    duplicates, opposites = _repeated(corners) if repeats else (np.zeros(len(corners), dtype=bool), 0)
    degenerate = int(_without_area(vertices, triangles))
    uses, unequal = edges[:, 2] + edges[:, 3], edges[:, 2] != edges[:, 3]
    return Topology(
        corners,
        edges,
        component,
        components,
        duplicates,
        opposites,
        degenerate,
        odd=int(np.count_nonzero(uses & 1)),
        unbalanced=int(np.count_nonzero(unequal)),
        flipped=int(np.count_nonzero(unequal & (uses & 1 == 0))),
        nonmanifold=int(np.count_nonzero(uses > 2)),
    )


def _repeated(corners: np.ndarray) -> tuple[np.ndarray, int]:
    """Whether each of ``corners`` (m, 3) repeats an earlier one with the same winding, (m,), and the number that repeat
    one with the opposite winding."""
    ordered = np.sort(corners, axis=1)
    first = first_equal_rows(ordered)
    # A triangle with two corners in one place adds nothing, however often it is there.
    real = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    again = np.nonzero((first != np.arange(len(first))) & real)[0]
    same = _even_permutation(corners[again]) == _even_permutation(corners[first[again]])
    duplicates = np.zeros(len(first), dtype=bool)
    duplicates[again[same]] = True
    return duplicates, int(np.count_nonzero(~same))


def _even_permutation(corners: np.ndarray) -> np.ndarray:
    """Whether each row's three numbers are a cyclic shift of their ascending order, (k,) bool."""
    a, b, c = corners.T
    return ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))


def surplus_copies(topology: Topology) -> np.ndarray:
    """Which of the ``duplicates`` (m,) bool spoil the surface: without them its edges are balanced better, or what they
    close by themselves is counted twice. The others it needs to be closed.

    Copies that share an edge are taken or left together.
    """
    surplus = topology.duplicates.copy()
    copies = np.nonzero(surplus)[0]
    sides = topology.corners[copies][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(copies)), 3)
    # The topology's edges are in the order of their lower, then their higher vertex.
    span = int(topology.corners.max(initial=0)) + 1
    known = topology.edges[:, 0].astype(np.int64) * span + topology.edges[:, 1]
    edge = np.searchsorted(known, sides.min(axis=1) * span + sides.max(axis=1))
    first = np.full(len(known), -1)
    first[edge[::-1]] = owner[::-1]
    patch = joined_sets(first[edge], owner, len(copies))
    excess = topology.edges[:, 2].astype(np.int64) - topology.edges[:, 3]
    pairs, number = np.unique(patch[owner] * len(known) + edge, return_inverse=True)
    taken = np.bincount(number, np.where(sides[:, 0] < sides[:, 1], 1, -1), len(pairs))
    of, excess = pairs // len(known), excess[pairs % len(known)]
    change = np.bincount(of, np.abs(excess - taken) - np.abs(excess), len(copies))
    loose = np.bincount(of, taken != 0, len(copies))
    surplus[copies] = (change[patch] < 0) | (loose[patch] == 0)
    return surplus


@njit(cache=True, nogil=True)
def _component_sums(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, count: int, middle: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    volume, area = np.zeros(count), np.zeros((count, 3))
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
        area[c, 0] += 0.5 * nx
        area[c, 1] += 0.5 * ny
        area[c, 2] += 0.5 * nz
    return volume, area, lower, upper


@dataclass(frozen=True)
class Extent:
    """The box of the vertices that triangles use, lower and upper (3,); how many vertices are used by none, how many of
    the used ones aren't finite, and the first of those or −1."""

    lower: np.ndarray
    upper: np.ndarray
    unused: int
    not_finite: int
    first_not_finite: int


def referenced_extent(vertices: np.ndarray, triangles: np.ndarray) -> Extent:
    """The extent of the vertices (n, 3) that triangles (m, 3) use; its box means nothing where one isn't finite."""
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles.ravel()] = True
    points = vertices if used.all() else vertices[used]
    lower, upper = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    bad = np.empty(0, np.int64)
    if not np.isfinite(points).all():
        bad = np.flatnonzero(used & ~np.isfinite(vertices).all(axis=1))
    return Extent(lower, upper, len(vertices) - len(points), len(bad), int(bad[0]) if len(bad) else -1)


@dataclass(frozen=True)
class Components:
    """Per component: signed volume (k,) from ``middle`` (3,), vector area (k, 3), lower and upper corners (k, 3)."""

    middle: np.ndarray
    volume: np.ndarray
    area: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def component_sums(vertices: np.ndarray, triangles: np.ndarray, topology: Topology) -> Components:
    """The components' volumes and boxes, from the middle of their triangles' first corners."""
    corners = vertices[triangles[:, 0]]
    middle = 0.5 * corners.min(axis=0) + 0.5 * corners.max(axis=0)
    return Components(middle, *_component_sums(vertices, triangles, topology.component, topology.components, middle))


def rims(edges: np.ndarray) -> list[list[int]]:
    """Closed walks of three or more vertices along ``edges`` (e, 6) of a topology, against the more frequent direction.

    Each edge is walked as often as one direction is used more than the other, so that polygons over all walks close the
    surface. Walks that end nowhere, of edges chosen from a topology's, are left out.
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


def fan(walk: list[int]) -> np.ndarray:
    """Triangles (k, 3) of a polygon, from its first corner."""
    corners = np.array(walk, dtype=np.int64)
    return np.stack([np.full(len(walk) - 2, walk[0]), corners[1:-1], corners[2:]], axis=1)
