# SPDX-License-Identifier: MIT
"""From a mesh to its moments: the verdict first, then repair or a stand-in where they are asked for."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..mesh.reading import Mesh, load_mesh
from ..mesh.solids import box_surface, convex_hull, united_surface
from .moments import referenced_vertices
from .properties import MeshMoments, Surface
from .repair import close_surface, repair_surface
from .verdict import NESTED, WARNING, Finding, Verdict, check_surface
from .verdict_cache import check_mesh

FALLBACKS = ("", "hull", "box")
"""What stands in for a surface that bounds no solid: nothing (refuse), its convex hull, or its bounding box."""


@dataclass(frozen=True)
class MeshBody:
    """A mesh, the verdict on it, and its moments; ``vertices`` and ``triangles`` are those the moments were taken of
    (repaired ones when repair was asked for and needed)."""

    mesh: Mesh
    verdict: Verdict
    moments: MeshMoments

    @property
    def vertices(self) -> np.ndarray:
        """Vertices (n, 3) in mesh coordinates; repair appends to the file's, never renumbers them."""
        return self.moments.vertices

    @property
    def triangles(self) -> np.ndarray:
        """Triangles (m, 3), turned outward when the file winds them inward throughout."""
        triangles = self.moments.triangles
        return np.ascontiguousarray(triangles[:, [0, 2, 1]]) if self.verdict.inward else triangles


def mesh_body(mesh: Mesh | str, *, repair: bool = False, fallback: str = "", accept_open: float = 0.0) -> MeshBody:
    """The moments of a mesh (or of the one that a path, URI or bundled name stands for) with its verdict.

    A surface that bounds no solid is not refused here: asking its moments for the solid, or for a mass from a density,
    raises MeshError with the reason and the flags that help. ``repair`` welds, drops duplicates, orients (cavities stay
    cavities) and caps holes first; ``accept_open`` then closes what is still open with flat caps where whatever closes
    it changes volume and tensor by less than that part of themselves; ``fallback`` "hull" or "box" lets that shape
    stand in for what is open all the same.
    """
    if fallback not in FALLBACKS:
        raise InputError("mesh_fallback", fallback, "'' (refuse), hull or box")
    if not 0.0 <= accept_open <= 1.0:
        raise InputError("--accept-open", accept_open, "a number from 0 to 1: part of volume and tensor")
    if isinstance(mesh, str):
        mesh = load_mesh(mesh)
    verdict = check_mesh(mesh)
    vertices, triangles, polygon_starts = mesh.vertices, mesh.triangles, mesh.polygon_starts
    nested = any(finding.code == NESTED for finding in verdict.findings)
    if repair and verdict.usable and (not verdict.closed or nested):
        triangles, polygon_starts, done = repair_surface(vertices, triangles, polygon_starts)
        if done:
            verdict = check_surface(vertices, triangles)
            verdict.findings.insert(0, Finding("repaired", WARNING, "repaired: " + "; ".join(done)))
    effect = verdict.hole_effect
    if not verdict.closed and effect is not None and effect <= accept_open:
        triangles, polygon_starts = close_surface(vertices, triangles, polygon_starts)
        reason = verdict.reason
        verdict = check_surface(vertices, triangles)
        message = f"closed with flat caps, on which at most {effect:.2g} of volume and tensor depend: {reason}"
        verdict.findings.insert(0, Finding("open_accepted", WARNING, message))
    stand_in: Callable[[], Surface] | None = None
    if verdict.united:
        stand_in = functools.cache(lambda: united_surface(vertices, triangles))
    elif fallback and verdict.usable and not verdict.closed:
        stand_in = functools.cache(lambda: _stand_in(vertices, triangles, fallback))
        shape = "convex hull" if fallback == "hull" else "bounding box"
        message = f"fallback: the mass properties are those of its {shape}"
        verdict.findings.append(Finding("fallback", WARNING, message))
    remedies = ("" if repair else "--repair (mesh_repair), ") + "--fallback hull|box (mesh_fallback)"
    no_solid = "" if verdict.closed else f"{verdict.reason}; use {remedies}"
    moments = MeshMoments(vertices, triangles, polygon_starts, no_solid=no_solid, name=mesh.name, stand_in=stand_in)
    return MeshBody(mesh, verdict, moments)


def _stand_in(vertices: np.ndarray, triangles: np.ndarray, fallback: str) -> tuple[np.ndarray, np.ndarray]:
    points = referenced_vertices(vertices, triangles)
    if fallback == "hull":
        return convex_hull(points)
    return box_surface(points.min(axis=0), points.max(axis=0))
