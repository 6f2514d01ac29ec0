# SPDX-License-Identifier: MIT
"""Which patches of a surface may cross each other, or components, and which of their triangles."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from .cells import NO_BOX, extents, least, meet, most

GROUPS = 64
"""Groups that triangles of no patch are taken by."""


@njit(cache=True, nogil=True)
def apart_patches(vertices: np.ndarray, corners: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Which patches' triangles can't cross each other, (p + 1, p + 1): those of one patch, and of two whose boxes have
    no inside in common. The last row and column, for −1, are False.

    patch (m,): the patch of each of the triangles ``corners`` (m, 3), or −1.
    """
    count = 0
    for t in range(len(patch)):
        count = max(count, patch[t] + 1)
    boxes = extents(vertices, corners, patch, count)
    apart = np.zeros((count + 1, count + 1), np.bool_)
    for p in range(count):
        for q in range(p):
            # Where one is flat, the other one has to lie on both sides of it.
            inside = (boxes[p, 0] < boxes[q, 3]) & (boxes[q, 0] < boxes[p, 3])
            inside &= (boxes[p, 1] < boxes[q, 4]) & (boxes[q, 1] < boxes[p, 4])
            inside &= (boxes[p, 2] < boxes[q, 5]) & (boxes[q, 2] < boxes[p, 5])
            apart[p, q] = apart[q, p] = not inside
        apart[p, p] = True
    return apart


@njit(cache=True, nogil=True)
def _cover(boxes: np.ndarray, number: np.ndarray, count: int) -> np.ndarray:
    """Box (count, 2) around those of ``boxes`` (m, 2) of each ``number`` (m,) ≥ 0."""
    covers = np.empty((count, 2), np.int64)
    covers[:, 0], covers[:, 1] = NO_BOX
    for t in range(len(number)):
        n = number[t]
        if n >= 0:
            covers[n, 0], covers[n, 1] = least(covers[n, 0], boxes[t, 0]), most(covers[n, 1], boxes[t, 1])
    return covers


@njit(cache=True, nogil=True)
def may_cross(boxes: np.ndarray, patch: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """The numbers (k,) of those triangles that may cross one of another patch, or of none.

    boxes (m, 2): of the triangles, in cells; patch (m,); apart (p + 1, p + 1) as from ``apart_patches``.
    """
    patches = len(apart) - 1
    outside = 0
    for t in range(len(patch)):
        outside += patch[t] < 0
    # Triangles of no patch by groups of those that follow each other, which mostly lie together.
    group = np.full(len(patch), -1)
    size = max(1, (outside + GROUPS - 1) // GROUPS)
    outside = 0
    for t in range(len(patch)):
        if patch[t] < 0:
            group[t] = outside // size
            outside += 1
    covers, groups = _cover(boxes, patch, patches), _cover(boxes, group, (outside + size - 1) // size)
    starts = np.zeros(patches + 1, np.int64)
    together = patches * patches - np.count_nonzero(apart[:patches, :patches])
    others = np.empty((together + patches * len(groups) + 1, 2), np.int64)
    count = 0
    for p in range(patches):
        for q in range(patches):
            others[count, 0], others[count, 1] = covers[q, 0], covers[q, 1]
            count += not apart[p, q]
        for g in range(len(groups)):
            others[count, 0], others[count, 1] = groups[g, 0], groups[g, 1]
            count += meet(covers[p, 0], covers[p, 1], groups[g, 0], groups[g, 1])
        starts[p + 1] = count
    chosen = np.empty(len(patch), np.int64)
    found = 0
    for t in range(len(patch)):
        near = patch[t] < 0
        if not near:
            low, high = boxes[t, 0], boxes[t, 1]
            for i in range(starts[patch[t]], starts[patch[t] + 1]):
                if meet(low, high, others[i, 0], others[i, 1]):
                    near = True
                    break
        chosen[found] = t
        found += near
    return chosen[:found]
