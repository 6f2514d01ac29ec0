# SPDX-License-Identifier: MIT
"""Which closed components lie inside which others, and which cross.

A point lies inside a closed component when a ray from it leaves the component more often than it enters it. The ray's
hits are found with the watertight test of Woop, Benthin and Wald (Journal of Computer Graphics Techniques 2, 2013); one
that comes too near an edge to be sure is shot again in another direction, and a point on the other surface decides
nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit
from .bvh import LEAF, hierarchy
from .crossing import crossing_components

WORK_LIMIT = 100_000_000
"""Boxes and triangles visited after which nesting is left undecided and said to be so: about a second of work."""
SAMPLES = 24
"""Points of a component, inside evenly picked triangles, of which it is asked whether they lie inside another one."""
NEAR = 1e-9
"""Part of a triangle's size, or of the mesh's, within which a hit on an edge, or on the surface itself,
isn't trusted.
"""

# Directions that no mesh is aligned with; the first alone is used unless a ray meets an edge.
_DIRECTIONS = np.array([(0.8163, 0.3719, 0.4421), (-0.2917, 0.9013, -0.3204), (0.1373, -0.5381, 0.8316)])
# Barycentric coordinates of the sample in its triangle: not on any of its symmetry lines.
_SAMPLE = np.array([0.4479, 0.3413, 0.2108])


@njit(cache=True, nogil=True)
def _hit(
    vertices: np.ndarray,
    triangle: np.ndarray,
    origin: np.ndarray,
    direction: np.ndarray,
    kx: int,
    ky: int,
    kz: int,
    reach: float,
) -> tuple[int, bool]:
    """(sign, sure): +1 where the ray leaves through the triangle, −1 where it enters, 0 for a miss; sure: not near an
    edge or within ``reach`` of the origin.
    """
    sx, sy = direction[kx] / direction[kz], direction[ky] / direction[kz]
    a, b, c = vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]
    az, bz, cz = a[kz] - origin[kz], b[kz] - origin[kz], c[kz] - origin[kz]
    ax, ay = a[kx] - origin[kx] - sx * az, a[ky] - origin[ky] - sy * az
    bx, by = b[kx] - origin[kx] - sx * bz, b[ky] - origin[ky] - sy * bz
    cx, cy = c[kx] - origin[kx] - sx * cz, c[ky] - origin[ky] - sy * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    edges = max(abs(bx - ax), abs(cx - ax), abs(cx - bx)) * max(abs(by - ay), abs(cy - ay), abs(cy - by))
    corners = max(abs(ax), abs(bx), abs(cx)) * max(abs(ay), abs(by), abs(cy))
    margin = NEAR * edges + 1e-15 * corners
    if (u < -margin or v < -margin or w < -margin) and (u > margin or v > margin or w > margin):
        return 0, True
    total = u + v + w
    if abs(u) <= margin or abs(v) <= margin or abs(w) <= margin:
        return 0, False
    distance = (u * az + v * bz + w * cz) / total / direction[kz]
    if abs(distance) <= reach:
        return 0, False
    if distance < 0.0:
        return 0, True
    # The projected triangle runs one way round seen from behind, the other way seen from in front.
    front = total * direction[kz] > 0.0
    return (-1 if front else 1), True


@njit(cache=True, nogil=True)
def _shoot(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    order: np.ndarray,
    boxes: np.ndarray,
    own: int,
    origin: np.ndarray,
    direction: np.ndarray,
    reach: float,
    winding: np.ndarray,
    sure: np.ndarray,
) -> int:
    """Put the signed hits of all components but ``own`` into winding (k,), and into sure (k,) whether they are certain;
    returns the boxes visited.
    """
    kz = int(np.argmax(np.abs(direction)))
    kx, ky = (kz + 1) % 3, (kz + 2) % 3
    winding[:] = 0
    sure[:] = True
    inner = (len(boxes) - 1) // 2
    stack = np.zeros(64, np.int64)
    top, visits = 1, 0
    while top > 0:
        top -= 1
        node = stack[top]
        visits += 1
        near, far = 0.0, math.inf
        for k in range(3):  # widened, so that no hit is lost that isn't sure
            a = (boxes[node, k] - reach - origin[k]) / direction[k]
            b = (boxes[node, 3 + k] + reach - origin[k]) / direction[k]
            near, far = max(near, min(a, b)), min(far, max(a, b))
        if near > far:
            continue
        if node < inner:
            stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
            top += 2
            continue
        for i in range((node - inner) * LEAF, min((node - inner + 1) * LEAF, len(order))):
            other = component[order[i]]
            if other != own:
                sign, certain = _hit(vertices, triangles[order[i]], origin, direction, kx, ky, kz, reach)
                winding[other] += sign
                sure[other] &= certain
    return visits


@njit(cache=True, nogil=True)
def _sides(
    vertices: np.ndarray,
    triangles: np.ndarray,
    component: np.ndarray,
    chosen: np.ndarray,
    samples: np.ndarray,
    near: np.ndarray,
    reach: float,
    limit: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many of each component's samples are outside and inside each other one, (k, k) each, and the components left
    undecided (k,) when ``limit`` visits didn't suffice.

    chosen (c,): triangles of the components in question; samples (s,): those in whose middle a ray begins; near (k, k):
    pairs whose boxes overlap.
    """
    order, _, boxes = hierarchy(vertices, triangles, chosen)
    count = near.shape[0]
    outside, inside = np.zeros((count, count), np.int32), np.zeros((count, count), np.int32)
    undecided = np.zeros(count, np.bool_)
    winding, sure = np.zeros(count, np.int64), np.ones(count, np.bool_)
    origin = np.empty(3)
    visits = 0
    for sample in samples:
        own = component[sample]
        for k in range(3):
            origin[k] = 0.0
            for corner in range(3):
                origin[k] += _SAMPLE[corner] * vertices[triangles[sample, corner], k]
        asked = near[own].copy()
        for attempt in range(len(_DIRECTIONS)):
            if visits >= limit:
                undecided[own] = True
                break
            direction = _DIRECTIONS[attempt]
            visits += _shoot(vertices, triangles, component, order, boxes, own, origin, direction, reach, winding, sure)
            for other in range(count):
                if asked[other] and sure[other]:
                    asked[other] = False
                    inside[own, other] += winding[other] != 0
                    outside[own, other] += winding[other] == 0
            if not asked.any():
                break
    return outside, inside, undecided


def _samples(component: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Up to SAMPLES triangles (s,), evenly picked, of each of the components marked in ``wanted`` (k,)."""
    of_each = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
    return np.concatenate(
        [
            own[np.arange(min(SAMPLES, len(own))) * len(own) // min(SAMPLES, len(own))]
            for own, asked in zip(of_each, wanted, strict=True)
            if asked
        ]
    )


@dataclass(frozen=True)
class Nesting:
    """inside (k, k) bool: component i lies in component j. crossing: pairs (i, j) whose surfaces cross. decided (k,)
    bool: False for a component of which the work limit left open where it lies. complete: False when anything was left
    open.
    """

    inside: np.ndarray
    crossing: tuple[tuple[int, int], ...]
    decided: np.ndarray
    complete: bool

    @property
    def depth(self) -> np.ndarray:
        """In how many other components each one lies, (k,)."""
        return np.count_nonzero(self.inside, axis=1)


def component_nesting(
    vertices: np.ndarray, triangles: np.ndarray, component: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> Nesting:
    """How closed components lie to each other; component (m,) numbers them, lower and upper (k, 3) are their boxes."""
    count = len(lower)
    near = np.all((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None]), axis=2)
    np.fill_diagonal(near, False)
    if not near.any():
        return Nesting(np.zeros((count, count), dtype=bool), (), np.ones(count, dtype=bool), True)
    wanted = near.any(axis=1)
    chosen, samples = np.nonzero(wanted[component])[0], _samples(component, wanted)
    reach = NEAR * float(np.linalg.norm(upper.max(axis=0) - lower.min(axis=0)))
    outside, within, undecided = _sides(vertices, triangles, component, chosen, samples, near, reach, WORK_LIMIT)
    found = (outside > 0) & (within > 0)
    found |= found.T
    crossing, complete = crossing_components(vertices, triangles, component, near & ~found)
    found |= crossing
    inside = (within > 0) & (outside == 0) & ~found & ~undecided[:, None]
    pairs = tuple((int(i), int(j)) for i, j in np.argwhere(np.triu(found)))
    return Nesting(inside, pairs, ~undecided, bool(complete and not undecided.any()))
