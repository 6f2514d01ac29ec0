# SPDX-License-Identifier: MIT
"""Repair of a surface: drop duplicates, weld rims, orient (cavities stay cavities), cap holes. Each step reports what
it did.

Vertices keep their numbers and positions. A vertex on a rim (boundary of a hole) is welded by using another's number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.compilation import exported
from ..base.rotation import length, times
from ..base.vectors import BoolArray, IntArray, Points, Triangles
from ..mesh.intersection import component_nesting
from ..mesh.topology import Topology, component_sums, fan, joined_sets, mesh_topology, rims, surplus_copies
from .verdict import MAX_NESTED_COMPONENTS, WELD, counted, wound_wrong


@dataclass
class RepairedSurface:
    """Triangles (m, 3) over vertices (n, 3) with polygon_starts (p + 1,) or None, modified step by step."""

    vertices: Points
    triangles: Triangles
    polygon_starts: IntArray | None

    def drop(self, triangles: BoolArray) -> None:
        """Remove the triangles marked True in ``triangles`` (m,)."""
        if self.polygon_starts is not None:
            kept = np.concatenate([[0], np.cumsum(~triangles)])
            self.polygon_starts = kept[self.polygon_starts]
        self.triangles = self.triangles[~triangles]

    def turn(self, triangles: BoolArray) -> None:
        """Reverse the triangles marked True in ``triangles`` (m,)."""
        self.triangles = np.where(triangles[:, None], self.triangles[:, [0, 2, 1]], self.triangles)

    def add_polygon(self, ring: list[int]) -> None:
        """Append a polygon as a fan of triangles from its first corner."""
        if self.polygon_starts is None:
            self.polygon_starts = np.arange(len(self.triangles) + 1)
        self.triangles = np.concatenate([self.triangles, fan(ring)])
        self.polygon_starts = np.append(self.polygon_starts, len(self.triangles))

    def topology(self) -> Topology:
        """The current topology."""
        return mesh_topology(self.vertices, self.triangles)


def repair_surface(
    vertices: Points, triangles: Triangles, polygon_starts: IntArray | None = None
) -> tuple[Triangles, IntArray | None, tuple[str, ...]]:
    """Repaired triangles (k, 3), their polygon starts, and what was done, one phrase per step; empty if nothing was."""
    surface = RepairedSurface(vertices, triangles, polygon_starts)
    done = [*_drop_copies(surface), *_weld_rims(surface), *_orient(surface), *_cap_holes(surface)]
    done += _turn_outward(surface)
    return surface.triangles, surface.polygon_starts, tuple(done)


def _drop_copies(surface: RepairedSurface) -> list[str]:
    surplus = surplus_copies(surface.topology())
    if not surplus.any():
        return []
    surface.drop(surplus)
    return [f"removed {counted(int(np.count_nonzero(surplus)), 'duplicate face')}"]


_SWEEP = (0.8163, 0.3719, 0.4421)  # oblique, so that few points project to the same place


@exported("f8[:,:]", "i8[:]", "f8", "i8[:]", nogil=True)
def near_pairs(points: Points, order: IntArray, tolerance: float, target: IntArray) -> None:
    """Set target (k,), each its own number, of points (k, 3) to the first point within ``tolerance``, in their order
    along _SWEEP.
    """
    rounding = 0.0
    for i in range(points.shape[0]):
        for k in range(3):
            rounding = max(rounding, 1e-14 * abs(points[i, k]))
    for i in range(order.shape[0]):
        a = order[i]
        if target[a] != a:
            continue
        for j in range(i + 1, order.shape[0]):
            b = order[j]
            dx, dy, dz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
            if dx * _SWEEP[0] + dy * _SWEEP[1] + dz * _SWEEP[2] > 1.01 * tolerance + rounding:
                break
            if target[b] == b and dx * dx + dy * dy + dz * dz <= tolerance * tolerance:
                target[b] = a


def _weld_rims(surface: RepairedSurface) -> list[str]:
    """Use one number for rim vertices closer than WELD of the diagonal."""
    topology = surface.topology()
    rim = np.unique(topology.boundary[:, :2])
    if not len(rim):
        return []
    points = surface.vertices[rim]
    used = surface.vertices[surface.triangles.ravel()]
    tolerance = WELD * length(used.max(axis=0) - used.min(axis=0))
    target = np.arange(len(rim))
    near_pairs(points, np.argsort(times(points, _SWEEP), kind="stable"), tolerance, target)
    moved = int(np.count_nonzero(target != np.arange(len(rim))))
    if not moved:
        return []
    far = float(np.max(np.linalg.norm(points - points[target], axis=1)))
    number = np.arange(len(surface.vertices))
    number[rim] = rim[target]
    # Corners that aren't welded keep their own numbers, even where several have the same position.
    moves = number[topology.corners] != topology.corners
    surface.triangles = np.where(moves, number[topology.corners], surface.triangles)
    flat = np.where(moves, surface.triangles, topology.corners)
    surface.drop((flat[:, 0] == flat[:, 1]) | (flat[:, 1] == flat[:, 2]) | (flat[:, 2] == flat[:, 0]))
    return [f"welded {moved} rim vertices, the farthest by {far:.2g}"]


def _turns(edges: IntArray, count: int) -> tuple[BoolArray, IntArray, bool]:
    """Whether to reverse each triangle (m,) so that it agrees with the first one of its patch, that first one (m,), and
    whether all can agree; edges (e, 6) as in Topology, of which only those of two triangles matter.

    Union-find with two elements per triangle, as it is and reversed; those that agree across an edge are joined.
    """
    edges = edges[(edges[:, 2] + edges[:, 3] == 2) & (edges[:, 4] != edges[:, 5])]
    one, other = edges[:, 4].astype(np.int64), edges[:, 5].astype(np.int64)
    agrees = edges[:, 2] == 1
    first = np.concatenate([one, one + count])
    second = np.concatenate([np.where(agrees, other, other + count), np.where(agrees, other + count, other)])
    smallest = np.empty(2 * count, np.int64)
    joined_sets(first, second, smallest)
    sets = smallest.reshape(2, count)
    patch = sets.min(axis=0)
    return sets[0] != patch, patch, bool(np.all(sets[0] != sets[1]))


def _orient(surface: RepairedSurface) -> list[str]:
    topology = surface.topology()
    if topology.flipped == 0:
        return []
    turn, patch, possible = _turns(topology.edges, len(surface.triangles))
    if not possible:
        return ["could not orient it: it has only one side, as a Moebius strip"]
    turned = np.bincount(patch, weights=turn, minlength=len(turn))
    size = np.bincount(patch, minlength=len(turn))
    turn ^= (turned > 0.5 * size)[patch]  # keep the winding of most of a patch
    surface.turn(turn)
    return [f"turned {counted(int(np.count_nonzero(turn)), 'face')} to agree with the neighbours"]


def close_surface(
    vertices: Points, triangles: Triangles, polygon_starts: IntArray | None
) -> tuple[Triangles, IntArray | None]:
    """Triangles and polygon starts with caps added where the surface is open or its edges are unbalanced."""
    surface = RepairedSurface(vertices, triangles, polygon_starts)
    for walk in rims(surface.topology().unbalanced):
        surface.add_polygon(walk)
    return surface.triangles, surface.polygon_starts


def _cap_holes(surface: RepairedSurface) -> list[str]:
    """Close each rim with one polygon; rims that meet in a vertex are followed one after the other."""
    topology = surface.topology()
    rim = topology.boundary
    if not len(rim):
        return []
    walks = rims(rim)
    for walk in walks:
        surface.add_polygon(walk)
    edges = "edge" if len(rim) == 1 else "edges"
    return [f"capped {counted(len(walks), 'hole')} with {len(rim)} {edges}"] if walks else []


def _turn_outward(surface: RepairedSurface) -> list[str]:
    """Orient outermost components outward, those inside one of them inward, and so on; parts that cross stay parts."""
    topology = surface.topology()
    if len(topology.unbalanced) or not 0 < topology.components <= MAX_NESTED_COMPONENTS:
        return []
    sums = component_sums(surface.vertices, topology)
    wrong = sums.volume < 0.0
    if topology.components > 1:
        nesting = component_nesting(surface.vertices, topology, sums)
        # Components stay as they are if their nesting is unknown.
        wrong = wound_wrong(nesting, sums.volume) & nesting.complete
    if not wrong.any():
        return []
    surface.turn(wrong[topology.component])
    return [f"turned {int(np.count_nonzero(wrong))} of {topology.components} components"]
