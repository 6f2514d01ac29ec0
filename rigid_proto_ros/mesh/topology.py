# SPDX-License-Identifier: MIT
"""Topology of a triangle mesh: edges, holes, consistent winding, components and duplicate faces.

Vertices at bit-equal positions count as one here, so that splitting corners for textures has no effect, and so do those
of open edges that differ by rounding alone. The volume of a
surface is the same for every origin exactly if each edge is used equally often in both directions; ``unbalanced`` holds
the edges that aren't.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.arithmetic import bits_of
from ..base.compilation import exported, njit
from ..base.errors import MeshError
from ..base.vectors import BoolArray, FloatArray, IntArray, Points, Triangles

JOINED = 1e-6
"""Part of the box's diagonal up to which corners at open edges count as one: what exporters leave between patches."""
ROUNDING = 2.0**-22
"""Part of the largest coordinate up to which they do: two units in the last place of a file's float32."""


@njit(error_model="numpy", allocates=False)
def _table_size(count: int) -> int:
    """Slots of the table in which ``count`` rows are found: a power of two."""
    size = 16
    while size < 2 * count:
        size *= 2
    return size


@exported("i8", "i8", returns="i8")
def topology_room(vertices: int, triangles: int) -> int:
    """Integers of workspace that the kernels here need for so many vertices and triangles."""
    return 8 * max(vertices, triangles) + 16


@exported("i8[:]", "i8[:]", "i8[:]", nogil=True)
def first_equal_rows(rows: IntArray, first: IntArray, room: IntArray) -> None:
    """Fill ``first`` (n,) with the index of the first row equal to each of ``rows`` (3 n,), three numbers each, by open
    addressing; room: workspace for 4 n + 16 integers.
    """
    count = first.shape[0]
    size = _table_size(count)
    for slot in range(size):
        room[slot] = -1
    for i in range(count):
        a, b, c = np.uint64(rows[3 * i]), np.uint64(rows[3 * i + 1]), np.uint64(rows[3 * i + 2])
        h = a * np.uint64(0x9E3779B97F4A7C15)
        h = ((h ^ (h >> np.uint64(32))) + b) * np.uint64(0xBF58476D1CE4E5B9)
        h = ((h ^ (h >> np.uint64(29))) + c) * np.uint64(0x94D049BB133111EB)
        slot = np.int64((h ^ (h >> np.uint64(32))) & np.uint64(size - 1))
        while True:
            j = room[slot]
            if j < 0:
                room[slot] = i
                first[i] = i
                break
            if rows[3 * j] == rows[3 * i] and rows[3 * j + 1] == rows[3 * i + 1] and rows[3 * j + 2] == rows[3 * i + 2]:
                first[i] = j
                break
            slot = (slot + 1) & (size - 1)


@exported("f8[:,:]", "i8[:,:]", "i8[:]", "i8[:,:]", returns="i8", nogil=True)
def weld_triangles(vertices: Points, triangles: Triangles, room: IntArray, corners: Triangles) -> int:
    """Fill ``corners`` (m, 3) with triangles (m, 3) over the first of the vertices (n, 3) at each bit-equal position
    (−0 equals 0). Returns 1; 0 and leaves ``corners`` as they are if all positions differ; −1 if a triangle uses a
    vertex outside 0 to n − 1. room: workspace, see ``topology_room``.
    """
    count = vertices.shape[0]
    for t in range(triangles.shape[0]):
        for k in range(3):
            if triangles[t, k] < 0 or triangles[t, k] >= count:
                return -1
    rows, first = room[: 3 * count], room[3 * count : 4 * count]
    for i in range(count):
        for k in range(3):
            rows[3 * i + k] = bits_of(vertices[i, k] + 0.0)
    first_equal_rows(rows, first, room[4 * count :])
    welds = False
    for i in range(count):
        welds = welds or first[i] != i
    if welds:
        for t in range(triangles.shape[0]):
            for k in range(3):
                corners[t, k] = first[triangles[t, k]]
    return 1 if welds else 0


@njit(error_model="numpy", allocates=False)
def _root(parent: IntArray, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(error_model="numpy", allocates=False)
def _join(parent: IntArray, i: int, j: int) -> None:
    a, b = _root(parent, i), _root(parent, j)
    parent[max(a, b)] = min(a, b)  # a set's root is its smallest member


@exported("i8[:]", "i8[:]", "i8[:]", nogil=True)
def joined_sets(first: IntArray, second: IntArray, smallest: IntArray) -> None:
    """Union-find: fill ``smallest`` (n,) with the smallest member of the set of each of 0 to n − 1, if first[k] and
    second[k] share a set.
    """
    for i in range(smallest.shape[0]):
        smallest[i] = i
    for k in range(first.shape[0]):
        _join(smallest, first[k], second[k])
    for i in range(smallest.shape[0]):
        smallest[i] = _root(smallest, i)


@njit(error_model="numpy", allocates=False)
def _side(corners: Triangles, side: int) -> tuple[int, int]:
    """Tail and head of a triangle's side; side 3 t + k goes from corner k of triangle t to its next one."""
    t = side // 3
    k = side - 3 * t
    return corners[t, k], corners[t, k + 1 if k < 2 else 0]


@exported("i8[:,:]", "i8", "i8[:]", returns="i8", nogil=True)
def sort_edges(corners: Triangles, vertex_count: int, room: IntArray) -> int:
    """Sort the sides of triangles (m, 3) by low vertex, high vertex and number into the first 3 m of ``room``, those
    between different vertices; −1 follows the last one. Returns the number of edges. room: see ``topology_room``.
    """
    count = corners.shape[0]
    by_edge, by_high, place = room[: 3 * count], room[3 * count : 6 * count], room[6 * count : 6 * count + vertex_count]
    for i in range(vertex_count):
        place[i] = 0
    for side in range(3 * count):
        tail, head = _side(corners, side)
        if tail != head:
            place[max(tail, head)] += 1
    total = _as_begins(place)
    for side in range(3 * count):
        tail, head = _side(corners, side)
        if tail != head:
            high = max(tail, head)
            by_high[place[high]] = side
            place[high] += 1
    for i in range(vertex_count):
        place[i] = 0
    for s in range(total):
        tail, head = _side(corners, by_high[s])
        place[min(tail, head)] += 1
    _as_begins(place)
    for s in range(total):
        tail, head = _side(corners, by_high[s])
        low = min(tail, head)
        by_edge[place[low]] = by_high[s]
        place[low] += 1
    if total < 3 * count:
        by_edge[total] = -1
    edges, low, high = 0, -1, -1
    for s in range(total):
        tail, head = _side(corners, by_edge[s])
        if min(tail, head) != low or max(tail, head) != high:
            edges, low, high = edges + 1, min(tail, head), max(tail, head)
    return edges


@njit(error_model="numpy", allocates=False)
def _as_begins(counts: IntArray) -> int:
    """Turn counts (n,) of sorted elements of each kind into the places where they begin; returns the number of all."""
    total = 0
    for i in range(counts.shape[0]):
        total, counts[i] = total + counts[i], total
    return total


@exported("i8[:,:]", "i8[:]", "i8[:,:]", "i8[:]", returns="i8", nogil=True)
def fill_edges(corners: Triangles, room: IntArray, edges: IntArray, component: IntArray) -> int:
    """Fill ``edges`` (e, 6) and ``component`` (m,) of triangles (m, 3), as in Topology, after ``sort_edges``; returns
    the number of components.

    Triangles that share an edge belong to one component, unless more than two share it and all that meet there are
    balanced at it by themselves: bodies that touch, or overlap, along an edge stay two.
    """
    count = corners.shape[0]
    by_edge, excess, joined = room[: 3 * count], room[3 * count : 4 * count], room[4 * count : 6 * count]
    for t in range(count):
        component[t] = t
    s, crowded = 0, 0
    for e in range(edges.shape[0]):
        first, begin, forward = by_edge[s] // 3, s, 0
        one, other = _side(corners, by_edge[s])
        low, high = min(one, other), max(one, other)
        while s < 3 * count and by_edge[s] >= 0:
            tail, head = _side(corners, by_edge[s])
            if min(tail, head) != low or max(tail, head) != high:
                break
            forward += tail < head
            s += 1
        uses = s - begin
        edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3] = low, high, forward, uses - forward
        edges[e, 4], edges[e, 5] = first, by_edge[begin + 1] // 3 if uses > 1 else -1
        if uses == 2:
            _join(component, first, edges[e, 5])
        crowded += uses > 2
    if crowded:
        _join_crowded(corners, by_edge, edges, component, excess, joined)
    for t in range(count):
        component[t] = _root(component, t)
    components = 0
    for t in range(count):
        if component[t] == t:
            component[t] = components
            components += 1
        else:
            component[t] = component[component[t]]
    return components


@njit(error_model="numpy", allocates=False)
def _join_crowded(
    corners: Triangles, by_edge: IntArray, edges: IntArray, parent: IntArray, excess: IntArray, joined: IntArray
) -> None:
    """Join in ``parent`` (m,) the triangles at edges of more than two, where a set of those that meet there isn't
    balanced. excess (m,) and joined (2 m,): workspace.
    """
    for t in range(excess.shape[0]):
        excess[t] = 0
    s, found = 0, 0
    for e in range(edges.shape[0]):
        uses = edges[e, 2] + edges[e, 3]
        if uses > 2:
            for side in by_edge[s : s + uses]:
                tail, head = _side(corners, side)
                excess[_root(parent, side // 3)] += 1 if tail < head else -1
            is_unbalanced = False
            for side in by_edge[s : s + uses]:
                t = _root(parent, side // 3)
                is_unbalanced = is_unbalanced or excess[t] != 0
            for side in by_edge[s : s + uses]:
                excess[_root(parent, side // 3)] = 0
            if is_unbalanced:
                # Not yet: what meets at the other edges is what common edges of two have joined.
                joined[2 * found], joined[2 * found + 1] = s, uses
                found += 1
        s += uses
    for k in range(found):
        s, uses = joined[2 * k], joined[2 * k + 1]
        for side in by_edge[s + 1 : s + uses]:
            _join(parent, by_edge[s] // 3, side // 3)


@exported("i8[:,:]", "i8[:]", "b1[:]", nogil=True)
def mark_duplicates(corners: Triangles, room: IntArray, duplicates: BoolArray) -> None:
    """Fill the ``duplicates`` (m,) of triangles (m, 3), as in Topology; room: see ``topology_room``."""
    count = corners.shape[0]
    rows, first = room[: 3 * count], room[3 * count : 4 * count]
    for t in range(count):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        # From the smallest corner on, which keeps the winding.
        if b < a and b <= c:
            a, b, c = b, c, a
        elif c < a and c < b:
            a, b, c = c, a, b
        rows[3 * t], rows[3 * t + 1], rows[3 * t + 2] = a, b, c
    first_equal_rows(rows, first, room[4 * count :])
    for t in range(count):
        # A triangle with two equal corners has no effect, however often it occurs.
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        duplicates[t] = first[t] != t and a != b and b != c and c != a


@exported("i8[:,:]", returns="i8 i8", nogil=True)
def edge_defects(edges: IntArray) -> tuple[int, int]:
    """Of edges (e, 6): how many an odd number of triangles share, and how many of the others are unbalanced. A surface
    without either is closed and wound alike.
    """
    odd = flipped = 0
    for e in range(edges.shape[0]):
        if (edges[e, 2] + edges[e, 3]) & 1:
            odd += 1
        elif edges[e, 2] != edges[e, 3]:
            flipped += 1
    return odd, flipped


@njit(error_model="numpy", allocates=False)
def _joining_distance(vertices: Points, corners: Triangles, part: float) -> float:
    """``part`` of the diagonal of the box around triangles (m, 3), or ROUNDING of the largest coordinate."""
    largest, squares = 0.0, 0.0
    for k in range(3):
        low, high = np.inf, -np.inf
        for t in range(corners.shape[0]):
            for c in range(3):
                x = vertices[corners[t, c], k]
                low, high = min(low, x), max(high, x)
        largest = max(largest, abs(low), abs(high))
        squares += (high - low) * (high - low)
    return max(part * math.sqrt(squares), ROUNDING * largest)


@njit(error_model="numpy", allocates=False)
def _cell_slot(a: int, b: int, c: int, size: int) -> int:
    """The slot for a cell of three whole numbers among ``size``, a power of two."""
    h = np.uint64(np.int64(a)) * np.uint64(0x9E3779B97F4A7C15)
    h = ((h ^ (h >> np.uint64(32))) + np.uint64(np.int64(b))) * np.uint64(0xBF58476D1CE4E5B9)
    h = ((h ^ (h >> np.uint64(29))) + np.uint64(np.int64(c))) * np.uint64(0x94D049BB133111EB)
    return int(np.int64((h ^ (h >> np.uint64(32))) & np.uint64(size - 1)))


@njit(error_model="numpy", allocates=False)
def _distance(vertices: Points, i: int, j: int) -> float:
    x, y, z = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2]
    return math.sqrt(x * x + y * y + z * z)


@njit(error_model="numpy", allocates=False)
def _nearest_kept(vertices: Points, i: int, limit: float, table: IntArray, following: IntArray) -> int:
    """The vertex in the table that lies nearest to vertex i, the first of several; −1 for none within ``limit``, and
    then i is put into it. table: first vertex in each slot of cells as large as the limit; following: the next ones.
    """
    a, b, c = (math.floor(vertices[i, 0] / limit), math.floor(vertices[i, 1] / limit),
               math.floor(vertices[i, 2] / limit))  # fmt: skip
    best, nearest = -1, limit
    for cell in range(27):
        j = table[_cell_slot(a + (cell // 9 - 1), b + (cell // 3 % 3 - 1), c + (cell % 3 - 1), table.shape[0])]
        while j >= 0:
            distance = _distance(vertices, i, j)
            if distance < nearest or (distance == nearest and (best < 0 or j < best)):
                best, nearest = j, distance
            j = following[j]
    if best < 0:
        slot = _cell_slot(a, b, c, table.shape[0])
        following[i], table[slot] = table[slot], i
    return best


@exported("f8[:,:]", "i8[:,:]", "i8[:,:]", "f8", "i8[:]", "i8[:,:]", returns="i8 f8", nogil=True)
def join_open_edges(
    vertices: Points, corners: Triangles, edges: IntArray, part: float, room: IntArray, joined: Triangles
) -> tuple[int, float]:
    """Fill ``joined`` (m, 3) with corners (m, 3) over fewer vertices: those of open edges, of which ``edges`` (e, 6)
    has an odd number of triangles, that lie within ``part`` of the box's diagonal, or ROUNDING of the largest
    coordinate, of one with a smaller number that stays. Returns how many don't stay, and the largest distance; room:
    see ``topology_room``.

    None is joined to one that is joined itself, so that no chain of near ones becomes one.
    """
    count, rim = vertices.shape[0], 0
    target, following = room[:count], room[count : 2 * count]
    for i in range(count):
        target[i] = -1
    for e in range(edges.shape[0]):
        if (edges[e, 2] + edges[e, 3]) & 1:
            rim += 2
            target[edges[e, 0]], target[edges[e, 1]] = edges[e, 0], edges[e, 1]
    table = room[2 * count : 2 * count + _table_size(min(rim, count))]
    for slot in range(table.shape[0]):
        table[slot] = -1
    limit = _joining_distance(vertices, corners, part)
    found, farthest = 0, 0.0
    for i in range(count if 0.0 < limit < np.inf else 0):
        if target[i] >= 0:
            kept = _nearest_kept(vertices, i, limit, table, following)
            if kept >= 0:
                target[i] = kept
                found, farthest = found + 1, max(farthest, _distance(vertices, i, kept))
    for t in range(corners.shape[0]):
        for k in range(3):
            joined[t, k] = target[corners[t, k]] if target[corners[t, k]] >= 0 else corners[t, k]
    return found, farthest


@exported("i8[:,:]", "i8[:,:]", nogil=True)
def turn_triangles(triangles: Triangles, turned: Triangles) -> None:
    """Fill ``turned`` (m, 3) with triangles (m, 3) wound the other way."""
    for t in range(triangles.shape[0]):
        turned[t, 0], turned[t, 1], turned[t, 2] = triangles[t, 0], triangles[t, 2], triangles[t, 1]


@dataclass(frozen=True)
class Topology:
    """Connectivity of the triangles of a mesh.

    corners (m, 3): triangles over welded vertices. edges (e, 6): low vertex, high vertex, uses low→high, uses high→low,
    first triangle, second triangle or −1. component (m,): number of each triangle's component, counted from 0 by first
    appearance. duplicates (m,): True for a triangle that repeats an earlier one with the same winding. joined: number
    of vertices of open edges that count as others, up to ``farthest`` away; seam (k, 6): the open edges before that.
    """

    corners: Triangles
    edges: IntArray
    component: IntArray
    components: int
    duplicates: BoolArray
    joined: int
    farthest: float
    seam: IntArray

    @property
    def boundary(self) -> IntArray:
        """Edges (k, 6) of only one triangle."""
        return np.asarray(self.edges[self.edges[:, 2] + self.edges[:, 3] == 1])

    @property
    def unbalanced(self) -> IntArray:
        """Edges (k, 6) used more often in one direction than in the other: none if the surface bounds a volume."""
        return np.asarray(self.edges[self.edges[:, 2] != self.edges[:, 3]])

    @property
    def odd(self) -> int:
        """Number of edges that an odd number of triangles share."""
        return edge_defects(self.edges)[0]

    @property
    def flipped(self) -> int:
        """Number of unbalanced edges that an even number of triangles share."""
        return edge_defects(self.edges)[1]


def equal_rows(rows: IntArray) -> IntArray:
    """For each row of ``rows`` (n, 3) int64 the index of the first row equal to it, (n,)."""
    first = np.empty(len(rows), np.int64)
    first_equal_rows(rows.ravel(), first, np.empty(topology_room(0, len(rows)), np.int64))
    return first


def _edges(corners: Triangles, vertex_count: int, room: IntArray) -> tuple[IntArray, IntArray, int]:
    """Edges (e, 6) of ``corners`` (m, 3), components (m,) and their number, as in Topology."""
    edges = np.empty((sort_edges(corners, vertex_count, room), 6), np.int64)
    component = np.empty(len(corners), np.int64)
    return edges, component, fill_edges(corners, room, edges, component)


def mesh_topology(vertices: Points, triangles: Triangles, part: float = JOINED) -> Topology:
    """The topology of triangles (m, 3) over vertices (n, 3), those of open edges joined up to ``part`` of the box's
    diagonal where that leaves fewer of them open; raises MeshError for a vertex number out of range.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    room = np.empty(topology_room(len(vertices), len(triangles)), np.int64)
    corners, duplicates = np.empty_like(triangles), np.empty(len(triangles), np.bool_)
    welded = weld_triangles(vertices, triangles, room, corners)
    if welded < 0:
        raise MeshError("mesh", f"a face uses a vertex outside 0 to {len(vertices) - 1}")
    corners = corners if welded else triangles
    edges, component, components = _edges(corners, len(vertices), room)
    count, farthest, seam = 0, 0.0, edges[:0]
    odd = edge_defects(edges)[0]
    if odd:
        joined = np.empty_like(corners)
        found, far = join_open_edges(vertices, corners, edges, part, room, joined)
        again = _edges(joined, len(vertices), room) if found else (edges, component, components)
        if edge_defects(again[0])[0] < odd:
            count, farthest, seam = found, far, edges[(edges[:, 2] + edges[:, 3]) % 2 == 1]
            corners, (edges, component, components) = joined, again
    mark_duplicates(corners, room, duplicates)
    return Topology(corners, edges, component, components, duplicates, count, farthest, seam)


def turned_triangles(triangles: Triangles) -> Triangles:
    """The triangles (m, 3), wound the other way."""
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    turned = np.empty_like(triangles)
    turn_triangles(triangles, turned)
    return turned


def doubled_faces(topology: Topology) -> int:
    """Number of faces that occur with one winding more often than with the other by two or more: a volume beside each
    counts more than once.
    """
    low, middle, high = np.sort(topology.corners, axis=1).T
    real = (low < middle) & (middle < high)
    rows, corners = np.stack([low, middle, high], axis=1)[real], topology.corners[real]
    after_low = np.take_along_axis(corners, (np.argmin(corners, axis=1)[:, None] + 1) % 3, axis=1)[:, 0]
    copies = np.bincount(equal_rows(rows), np.where(after_low == rows[:, 1], 1.0, -1.0))
    return int(np.count_nonzero(np.abs(copies) > 1.0))


def surplus_copies(topology: Topology) -> BoolArray:
    """Which of the ``duplicates`` (m,) bool are defects: those of components whose edges are balanced at least as well
    without them. The others are needed to close the surface.
    """
    if not topology.duplicates.any():
        return topology.duplicates
    rest = np.flatnonzero(~topology.duplicates)
    vertex_count = int(topology.corners.max(initial=0)) + 1
    room = np.empty(topology_room(vertex_count, len(rest)), np.int64)
    edges, _, _ = _edges(topology.corners[rest], vertex_count, room)
    excess = [
        np.bincount(topology.component[triangle], np.abs(of[:, 2] - of[:, 3]), topology.components)
        for of, triangle in ((topology.edges, topology.edges[:, 4]), (edges, rest[edges[:, 4]]))
    ]
    return topology.duplicates & (excess[1] <= excess[0])[topology.component]


@exported("f8[:,:]", "i8[:,:]", "i8[:]", "f8[:]", "f8[:,:]", "f8[:,:]", returns="f8", nogil=True)
def signed_volumes(
    vertices: Points, triangles: Triangles, component: IntArray, volume: FloatArray, lower: Points, upper: Points
) -> float:
    """Fill signed ``volume`` (k,), ``lower`` and ``upper`` corners (k, 3) of each component of triangles (m, 3), whose
    numbers are ``component`` (m,); the sum of the volumes, which is negative for a surface wound inward.

    Reference of the volumes is the middle of the triangles' first corners.
    """
    x0 = y0 = z0 = np.inf
    x1 = y1 = z1 = -np.inf
    for t in range(triangles.shape[0]):
        corner = vertices[triangles[t, 0]]
        x0, y0, z0 = min(x0, corner[0]), min(y0, corner[1]), min(z0, corner[2])
        x1, y1, z1 = max(x1, corner[0]), max(y1, corner[1]), max(z1, corner[2])
    mx, my, mz = 0.5 * x0 + 0.5 * x1, 0.5 * y0 + 0.5 * y1, 0.5 * z0 + 0.5 * z1
    for c in range(volume.shape[0]):
        volume[c] = 0.0
        for k in range(3):
            lower[c, k], upper[c, k] = np.inf, -np.inf
    for t in range(triangles.shape[0]):
        c = component[t]
        corner, u, w = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        for k in range(3):
            lower[c, k] = min(lower[c, k], corner[k], u[k], w[k])
            upper[c, k] = max(upper[c, k], corner[k], u[k], w[k])
        ax, ay, az = corner[0] - mx, corner[1] - my, corner[2] - mz
        ux, uy, uz = (u[0] - mx) - ax, (u[1] - my) - ay, (u[2] - mz) - az
        wx, wy, wz = (w[0] - mx) - ax, (w[1] - my) - ay, (w[2] - mz) - az
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        volume[c] += (ax * nx + ay * ny + az * nz) / 6.0
    whole = 0.0
    for c in range(volume.shape[0]):
        whole += volume[c]
    return whole


@dataclass(frozen=True)
class Components:
    """Per component: signed volume (k,), lower and upper corners (k, 3)."""

    volume: FloatArray
    lower: Points
    upper: Points


def component_sums(vertices: Points, topology: Topology) -> Components:
    """Volumes and boxes of the components."""
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    count = topology.components
    volume, lower, upper = np.empty(count), np.empty((count, 3)), np.empty((count, 3))
    signed_volumes(vertices, topology.corners, topology.component, volume, lower, upper)
    return Components(volume, lower, upper)


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
