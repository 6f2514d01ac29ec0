# SPDX-License-Identifier: MIT
"""Rims of a surface's holes, and the flat caps that close them."""

from __future__ import annotations

import numpy as np


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
