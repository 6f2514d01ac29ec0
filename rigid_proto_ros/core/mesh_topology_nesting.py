# SPDX-License-Identifier: MIT
"""Which closed components lie inside which others, and which cross.

Inside is decided by the winding number, the sum of the solid angles of the triangles seen from a point (Van Oosterom
and Strackee, IEEE Trans. Biomed. Eng. 30, 1983), over 4π: robust where a ray would graze an edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .compilation import njit

WORK_LIMIT = 200_000_000
"""Triangle visits after which nesting or crossing is left undecided and said to be so: some seconds of work."""
SAMPLES = 24
"""Corners of a component, evenly picked, that are asked whether they lie inside another one."""


@njit(cache=True, nogil=True)
def winding_number(point, vertices, triangles, members):
    """How often the triangles numbered ``members`` wind around ``point`` (3,); an integer when they are closed."""
    total = 0.0
    r = np.empty((3, 3))
    length = np.empty(3)
    for t in members:
        for i in range(3):
            v = triangles[t, i]
            for k in range(3):
                r[i, k] = vertices[v, k] - point[k]
            length[i] = math.sqrt(r[i, 0] ** 2 + r[i, 1] ** 2 + r[i, 2] ** 2)
        triple = (
            r[0, 0] * (r[1, 1] * r[2, 2] - r[1, 2] * r[2, 1])
            + r[0, 1] * (r[1, 2] * r[2, 0] - r[1, 0] * r[2, 2])
            + r[0, 2] * (r[1, 0] * r[2, 1] - r[1, 1] * r[2, 0])
        )
        d01 = r[0, 0] * r[1, 0] + r[0, 1] * r[1, 1] + r[0, 2] * r[1, 2]
        d12 = r[1, 0] * r[2, 0] + r[1, 1] * r[2, 1] + r[1, 2] * r[2, 2]
        d20 = r[2, 0] * r[0, 0] + r[2, 1] * r[0, 1] + r[2, 2] * r[0, 2]
        scale = length[0] * length[1] * length[2]
        total += 2.0 * math.atan2(triple, scale + d01 * length[2] + d12 * length[0] + d20 * length[1])
    return total / (4.0 * math.pi)


@njit(cache=True, nogil=True)
def _segment_crosses(p, q, a, b, c):
    """Whether segment p q passes properly through triangle a b c; touching and coplanar cases don't count."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    span = abs(ux) + abs(uy) + abs(uz) + abs(wx) + abs(wy) + abs(wz)
    margin = 1e-9 * size * span
    dp = (p[0] - a[0]) * nx + (p[1] - a[1]) * ny + (p[2] - a[2]) * nz
    dq = (q[0] - a[0]) * nx + (q[1] - a[1]) * ny + (q[2] - a[2]) * nz
    if not ((dp > margin and dq < -margin) or (dp < -margin and dq > margin)):
        return False
    s = dp / (dp - dq)
    x, y, z = p[0] + s * (q[0] - p[0]) - a[0], p[1] + s * (q[1] - p[1]) - a[1], p[2] + s * (q[2] - p[2]) - a[2]
    # Barycentric coordinates from the areas against the normal.
    n2 = size * size
    beta = ((y * wz - z * wy) * nx + (z * wx - x * wz) * ny + (x * wy - y * wx) * nz) / n2
    gamma = ((uy * z - uz * y) * nx + (uz * x - ux * z) * ny + (ux * y - uy * x) * nz) / n2
    return beta > 1e-9 and gamma > 1e-9 and beta + gamma < 1.0 - 1e-9


@njit(cache=True, nogil=True)
def _crossing_pairs(vertices, triangles, component, order, lower, upper, found, limit):
    """Mark pairs of components whose triangles cross; a sweep along x over triangles sorted by their lower bound.

    order: triangle numbers by lower[:, 0]. Returns False when ``limit`` visits didn't suffice.
    """
    visits = 0
    n = order.shape[0]
    for i in range(n):
        s = order[i]
        for j in range(i + 1, n):
            t = order[j]
            if lower[t, 0] > upper[s, 0]:
                break
            visits += 1
            if visits > limit:
                return False
            a, b = component[s], component[t]
            if a == b or found[a, b]:
                continue
            if lower[t, 1] > upper[s, 1] or lower[s, 1] > upper[t, 1]:
                continue
            if lower[t, 2] > upper[s, 2] or lower[s, 2] > upper[t, 2]:
                continue
            for k in range(3):
                ps, qs = vertices[triangles[s, k]], vertices[triangles[s, (k + 1) % 3]]
                pt, qt = vertices[triangles[t, k]], vertices[triangles[t, (k + 1) % 3]]
                if _segment_crosses(
                    ps, qs, vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
                ) or _segment_crosses(
                    pt, qt, vertices[triangles[s, 0]], vertices[triangles[s, 1]], vertices[triangles[s, 2]]
                ):
                    found[a, b] = found[b, a] = True
                    break
    return True


@dataclass(frozen=True)
class Nesting:
    """inside (k, k) bool: component i lies in component j. crossing: pairs (i, j) whose surfaces cross. complete:
    False when the work limit left something undecided."""

    inside: np.ndarray
    crossing: tuple[tuple[int, int], ...]
    complete: bool

    @property
    def depth(self) -> np.ndarray:
        """In how many other components each one lies, (k,)."""
        return np.count_nonzero(self.inside, axis=1)


def component_nesting(vertices, triangles, component, lower, upper) -> Nesting:
    """How closed components lie to each other; component (m,) numbers them, lower and upper (k, 3) are their boxes."""
    count = len(lower)
    inside = np.zeros((count, count), dtype=bool)
    overlap = np.all((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None]), axis=2)
    np.fill_diagonal(overlap, False)
    if not overlap.any():
        return Nesting(inside, (), True)
    order = np.argsort(component, kind="stable")
    starts = np.searchsorted(component[order], np.arange(count + 1))
    members = [order[starts[c] : starts[c + 1]] for c in range(count)]
    work, complete = 0, True
    found = np.zeros((count, count), dtype=bool)
    for i, j in np.argwhere(overlap):
        corners = np.unique(triangles[members[i]])
        corners = corners[:: max(1, len(corners) // SAMPLES)]
        work += len(members[j]) * len(corners)
        if work > WORK_LIMIT:
            complete = False
            break
        seen = []
        for v in corners:
            winding = abs(winding_number(vertices[v], vertices, triangles, members[j]))
            if abs(winding - round(winding)) < 0.05:  # a corner on the other surface decides nothing
                seen.append(round(winding) != 0)
        inside[i, j] = bool(seen) and all(seen)
        found[i, j] |= any(seen) and not all(seen)
    found |= found.T
    candidates = np.concatenate([members[c] for c in np.nonzero(overlap.any(axis=1))[0]])
    corners = vertices[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    sweep = candidates[np.argsort(low[candidates, 0], kind="stable")]
    complete &= bool(_crossing_pairs(vertices, triangles, component, sweep, low, high, found, WORK_LIMIT))
    inside &= ~found
    return Nesting(inside, tuple((int(i), int(j)) for i, j in np.argwhere(np.triu(found))), complete)
