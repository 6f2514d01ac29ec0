# SPDX-License-Identifier: MIT
"""Triangles that pass through each other: of one surface, which then counts twice what it encloses twice, or of two.

Both ends of a pair of nodes descend a tree of boxes together (Gottschalk, Lin, Manocha, SIGGRAPH 1996).
"""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from .cells import NO_BOX, least, meet, most, triangle_boxes
from .patch_pairs import apart_patches, may_cross
from .patches import surface_patches
from .piercing import cross, on_both_sides
from .tree import along_curve

LEAF = 4
"""Triangles in a leaf."""
MAX_TRIANGLES = 20_000
"""Above this many triangles a surface isn't examined for crossing itself."""
SELF_LIMIT = 30_000_000
"""Pairs of boxes compared after which the search within surfaces ends, some tenths of a second."""
WORK_LIMIT = 100_000_000
"""Pairs of boxes after which the search between surfaces ends undecided: about a second."""

FEW_COMPONENTS = 64
"""Components up to which each triangle's box is first compared with those of the other components."""

_BATCH = 128
_PORTION = 512
"""Pairs of leaves looked at together: loops without a branch that depends on the mesh are several times faster."""

_DE_BRUIJN = 0x09AF
"""Times a power of two below 2¹⁶, its highest four of 16 bits tell which (Leiserson, Prokop, Randall 1998)."""
_PAIR_OF_MARK = np.empty(LEAF * LEAF, dtype=np.int64)
"""By these bits the pair of places in two leaves, i·2³² + j, that bit LEAF·i + j stands for."""
for _bit in range(LEAF * LEAF):
    _PAIR_OF_MARK[((_DE_BRUIJN << _bit) & 0xFFFF) >> 12] = (_bit // LEAF << 32) | _bit % LEAF


@njit(cache=True, nogil=True)
def _by_patches(order: np.ndarray, patch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangles in ``order`` (k,), those of each patch together and in leaves of their own, (leaves·LEAF,), and the
    leaves' patches (leaves,).

    patch (m,): each triangle's, −1 for none. −1 also stands for no triangle where a leaf isn't filled.
    """
    patches = 0
    for i in range(len(order)):
        patches = max(patches, patch[order[i]] + 1)
    sizes = np.zeros(patches + 1, np.int64)  # the last place, −1, is that of triangles of no patch
    for i in range(len(order)):
        sizes[patch[order[i]]] += 1
    starts = np.full(patches + 1, -1)
    leaf_patch = np.empty(len(order) // LEAF + patches + 1, np.int32)
    leaves = 0
    for i in range(len(order)):
        p = patch[order[i]]
        if starts[p] < 0:
            starts[p], first = leaves * LEAF, leaves
            leaves += (sizes[p] + LEAF - 1) // LEAF
            leaf_patch[first:leaves] = p
    grouped = np.full(leaves * LEAF, -1)
    for i in range(len(order)):
        p = patch[order[i]]
        grouped[starts[p]] = order[i]
        starts[p] += 1
    return grouped, leaf_patch[:leaves]


@njit(cache=True, nogil=True)
def _tree(
    boxes: np.ndarray, corners: np.ndarray, order: np.ndarray, leaf_patch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of the triangles in ``order``, leaf by leaf: corner numbers (n, 3), lower and upper corners (leaves·LEAF,) of
    their boxes, and the nodes above them (2·leaves − 1, 4): box, the corner that all their triangles have, or −1, and
    the patch that all are of, or −1.

    Node i has the children 2i + 1 and 2i + 2.
    """
    count = len(order)
    leaves = 1
    while leaves < len(leaf_patch):
        leaves *= 2
    numbers = np.zeros((count, 3), np.int32)
    lower, upper = np.full(leaves * LEAF, NO_BOX[0]), np.full(leaves * LEAF, NO_BOX[1])
    nodes = np.full((2 * leaves - 1, 4), -1)
    for leaf in range(leaves):
        node, first = leaves - 1 + leaf, leaf * LEAF
        nodes[node, 0], nodes[node, 1] = NO_BOX
        if leaf >= len(leaf_patch):
            continue
        nodes[node, 3] = leaf_patch[leaf]
        last = first
        while last < first + LEAF and order[last] >= 0:
            for corner in range(3):
                numbers[last, corner] = corners[order[last], corner]
            lower[last], upper[last] = boxes[order[last], 0], boxes[order[last], 1]
            nodes[node, 0], nodes[node, 1] = least(nodes[node, 0], lower[last]), most(nodes[node, 1], upper[last])
            last += 1
        for corner in range(3):
            shared = numbers[first, corner]
            all_have = True
            for i in range(first + 1, last):
                all_have &= (numbers[i, 0] == shared) | (numbers[i, 1] == shared) | (numbers[i, 2] == shared)
            if all_have:
                nodes[node, 2] = shared
    for node in range(leaves - 2, -1, -1):
        one, other = 2 * node + 1, 2 * node + 2
        nodes[node, 0], nodes[node, 1] = least(nodes[one, 0], nodes[other, 0]), most(nodes[one, 1], nodes[other, 1])
        for k in range(2, 4):
            if nodes[one, k] == nodes[other, k]:
                nodes[node, k] = nodes[one, k]
    return numbers, lower, upper, nodes


@njit(cache=True, nogil=True)
def _touch(numbers: np.ndarray, i: int, j: int) -> bool:
    """Whether triangles i and j share a corner."""
    a, b, c = numbers[i, 0], numbers[i, 1], numbers[i, 2]
    x, y, z = numbers[j, 0], numbers[j, 1], numbers[j, 2]
    first = (a == x) | (a == y) | (a == z)
    return bool(first | (b == x) | (b == y) | (b == z) | (c == x) | (c == y) | (c == z))


@njit(cache=True, nogil=True)
def _near(
    lower: np.ndarray, upper: np.ndarray, leaf_pairs: np.ndarray, count: int, inner: int, near: np.ndarray
) -> int:
    """Put the pairs of triangles, one of each leaf of the first ``count`` pairs, whose boxes meet into ``near``, as
    i·2³² + j, and return how many; ``inner`` nodes stand before the leaves.
    """
    marks = np.empty(count, np.int64)
    for pair in range(count):
        first, second = (leaf_pairs[pair, 0] - inner) * LEAF, (leaf_pairs[pair, 1] - inner) * LEAF
        marks[pair] = 0
        for i in range(LEAF):
            for j in range(LEAF):
                both = meet(lower[first + i], upper[first + i], lower[second + j], upper[second + j])
                marks[pair] |= np.int64(both) << (LEAF * i + j)
    found = 0
    for pair in range(count):
        first, second = (leaf_pairs[pair, 0] - inner) * LEAF, (leaf_pairs[pair, 1] - inner) * LEAF
        left = marks[pair]
        while left:
            lowest = left & -left
            left ^= lowest
            near[found] = ((first << 32) | second) + _PAIR_OF_MARK[((lowest * _DE_BRUIJN) & 0xFFFF) >> 12]
            found += 1
    return found


@njit(cache=True, nogil=True)
def _near_within(
    lower: np.ndarray, upper: np.ndarray, leaf_patch: np.ndarray, first: int, last: int, near: np.ndarray
) -> int:
    """The same for the pairs within each leaf from ``first`` to last − 1, but for those of one patch."""
    found = 0
    for leaf in range(first, last):
        if leaf_patch[leaf] >= 0:
            continue
        for i in range(leaf * LEAF, (leaf + 1) * LEAF):
            for j in range(i + 1, (leaf + 1) * LEAF):
                near[found] = (i << 32) | j
                found += meet(lower[i], upper[i], lower[j], upper[j])
    return found


@njit(cache=True, nogil=True)
def _count_crossings(
    vertices: np.ndarray, numbers: np.ndarray, component: np.ndarray, near: np.ndarray, count: int, between: np.ndarray
) -> int:
    """Of the first ``count`` pairs in ``near`` those that cross, as ``_crossings`` has it; uses up ``near``."""
    left = 0
    if len(between) == 0:
        for pair in range(count):
            i, j = near[pair] >> 32, near[pair] & 0xFFFFFFFF
            near[left] = near[pair]
            left += (not _touch(numbers, i, j)) & (component[i] == component[j])
    else:
        for pair in range(count):
            i, j = near[pair] >> 32, near[pair] & 0xFFFFFFFF
            near[left] = near[pair]
            left += between[component[i], component[j]]
    found = 0
    for pair in range(on_both_sides(vertices, numbers, near, left)):
        i, j = near[pair] >> 32, near[pair] & 0xFFFFFFFF
        if len(between) == 0:
            found += cross(vertices, numbers, i, j)
        elif between[component[i], component[j]] and cross(vertices, numbers, i, j):
            found += 1
            between[component[i], component[j]] = between[component[j], component[i]] = False
    return found


@njit(cache=True, nogil=True)
def _may_cross(nodes: np.ndarray, apart: np.ndarray, pairs: np.ndarray, count: int) -> int:
    """Keep those of the first ``count`` pairs of nodes in one of which something may cross something in the other;
    returns how many.
    """
    left = 0
    for pair in range(count):
        a, b = pairs[pair, 0], pairs[pair, 1]
        pairs[left, 0], pairs[left, 1] = a, b
        # Triangles around one corner all share it.
        around = (nodes[a, 2] >= 0) & (nodes[a, 2] == nodes[b, 2])
        left += not (around | apart[nodes[a, 3], nodes[b, 3]])
    return left


@njit(cache=True, nogil=True)
def _put_if_near(
    nodes: np.ndarray, a: int, b: int, stack: np.ndarray, top: int, leaf_pairs: np.ndarray, count: int
) -> tuple[int, int]:
    """Put two nodes of one depth, if their boxes meet, on the ``stack``, or, as leaves, among the leaf pairs; returns
    how many both hold.
    """
    inner = (len(nodes) + 1) // 2 - 1
    near = meet(nodes[a, 0], nodes[a, 1], nodes[b, 0], nodes[b, 1])
    stack[top, 0], stack[top, 1] = a, b
    leaf_pairs[count, 0], leaf_pairs[count, 1] = a, b
    return top + (near & (a < inner)), count + (near & (a >= inner))


@njit(cache=True, nogil=True)
def _descend(
    nodes: np.ndarray, apart: np.ndarray, stack: np.ndarray, top: int, leaf_pairs: np.ndarray, count: int
) -> tuple[int, int]:
    """Replace the last pairs of nodes on the ``stack`` by those of their children whose boxes meet, put pairs of leaves
    among the leaf pairs, and return how many both hold. Pairs are taken _BATCH at a time: one needn't wait for another.
    """
    take = min(top, _BATCH)
    top -= take
    batch = stack[top : top + take].copy()
    for pair in range(_may_cross(nodes, apart, batch, take)):
        a, b = batch[pair, 0], batch[pair, 1]
        for left in range(2 * a + 1, 2 * a + 3):
            for right in range(2 * b + 1, 2 * b + 3):
                top, count = _put_if_near(nodes, left, right, stack, top, leaf_pairs, count)
    return top, count


@njit(cache=True, nogil=True)
def _siblings(
    nodes: np.ndarray, first: int, last: int, stack: np.ndarray, leaf_pairs: np.ndarray, count: int
) -> tuple[int, int]:
    """The same for the children of each of the nodes from ``first`` to last − 1, on an empty stack."""
    top = 0
    for node in range(first, last):
        top, count = _put_if_near(nodes, 2 * node + 1, 2 * node + 2, stack, top, leaf_pairs, count)
    return top, count


@njit(cache=True, nogil=True)
def _crossings(
    vertices: np.ndarray,
    corners: np.ndarray,
    component: np.ndarray,
    boxes: np.ndarray,
    patch: np.ndarray,
    apart: np.ndarray,
    chosen: np.ndarray,
    between: np.ndarray,
    limit: int,
) -> tuple[int, bool]:
    """Pairs of the triangles numbered ``chosen`` (k,) that cross, and whether ``limit`` comparisons of boxes sufficed.

    boxes (m, 2): the triangles', in cells; patch (m,): their patches, or −1; apart (p + 1, p + 1): pairs of patches not
    to be compared, the last row and column, for −1, False. between (k, k) bool: pairs of components to look at; the
    first crossing of two clears their mark. Of shape (0, 0) it stands for triangles of one component, of which those
    that share a corner don't count.
    """
    order, leaf_patch = _by_patches(along_curve(boxes, chosen), patch)
    numbers, lower, upper, nodes = _tree(boxes, corners, order, leaf_patch)
    component = component[order]
    if len(between) > 0:
        nodes[:, 2] = -1
    leaves = (len(nodes) + 1) // 2
    near = np.empty((_PORTION + 4 * _BATCH) * LEAF * LEAF + 1, np.int64)
    found = visits = 0
    for first in range(0, len(leaf_patch), _PORTION):
        last = min(first + _PORTION, len(leaf_patch))
        visits += (last - first) * LEAF * LEAF
        hits = _near_within(lower, upper, leaf_patch, first, last, near)
        found += _count_crossings(vertices, numbers, component, near, hits, between)
    leaf_pairs, stack = np.empty((_PORTION + 4 * _BATCH + 1, 2), np.int32), np.empty((200 * _BATCH, 2), np.int32)
    top = count = node = 0
    # Pairs of different nodes: each node's children, and what lies below them.
    while True:
        if top == 0 and node < leaves - 1:
            last = min(node + _BATCH, leaves - 1)
            top, count = _siblings(nodes, node, last, stack, leaf_pairs, count)
            node = last
        done = top == 0 and node == leaves - 1
        if count >= _PORTION or done:
            count = _may_cross(nodes, apart, leaf_pairs, count)
            visits += count * LEAF * LEAF
            if visits > limit:
                return found, False
            hits = _near(lower, upper, leaf_pairs, count, leaves - 1, near)
            found += _count_crossings(vertices, numbers, component, near, hits, between)
            count = 0
        if done:
            return found, True
        visits += 4 * min(top, _BATCH)
        top, count = _descend(nodes, apart, stack, top, leaf_pairs, count)


@njit(cache=True, nogil=True)
def _self_crossings(
    vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, edges: np.ndarray, limit: int
) -> int:
    """All steps of the search in one kernel: each that Python calls takes some milliseconds to load."""
    patch = np.full(len(corners), -1, np.int32)
    if len(edges) > 0:
        patch = surface_patches(vertices, corners, edges)
    boxes = triangle_boxes(vertices, corners)
    apart = apart_patches(vertices, corners, patch)
    chosen, within = may_cross(boxes, patch, apart), np.zeros((0, 0), np.bool_)
    return _crossings(vertices, corners, component, boxes, patch, apart, chosen, within, limit)[0]


def self_crossings(
    vertices: np.ndarray, corners: np.ndarray, component: np.ndarray, edges: np.ndarray | None = None
) -> int:
    """Pairs of triangles of one component that cross without sharing a corner, as far as SELF_LIMIT comparisons tell;
    corners (m, 3) over welded vertices, component (m,); edges (e, 6), as a topology has them, make it faster.

    0 also for surfaces of more than MAX_TRIANGLES.
    """
    if len(corners) > MAX_TRIANGLES:
        return 0
    edges = np.zeros((0, 6), dtype=np.int32) if edges is None else edges
    return int(_self_crossings(vertices, corners, component, edges, SELF_LIMIT))


@njit(cache=True, nogil=True)
def _crossings_between(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    boxes: np.ndarray,
    apart: np.ndarray,
    asked: np.ndarray,
    limit: int,
) -> bool:
    """Clear those pairs of components marked in ``asked`` that cross; returns whether ``limit`` sufficed."""
    part, wanted = component.astype(np.int32), np.zeros(len(asked), np.bool_)
    for c in range(len(asked)):
        wanted[c] = asked[c].any()
    chosen = may_cross(boxes, part, apart) if len(asked) <= FEW_COMPONENTS else np.nonzero(wanted[component])[0]
    return _crossings(vertices, triangles, component, boxes, part, apart, chosen, asked, limit)[1]


def crossing_components(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, boxes: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Which of the pairs of components marked in ``asked`` (k, k) have triangles that cross, (k, k), and whether
    WORK_LIMIT comparisons sufficed; boxes (m, 2): the triangles', in cells.
    """
    count, left = len(asked), asked.copy()
    apart = np.zeros((count + 1, count + 1), dtype=bool)
    apart[:count, :count] = ~asked
    complete = _crossings_between(vertices, triangles, component, boxes, apart, left, WORK_LIMIT)
    return asked & ~left, complete
