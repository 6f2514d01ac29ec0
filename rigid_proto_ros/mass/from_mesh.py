# SPDX-License-Identifier: MIT
"""From a mesh to its moments: the verdict first, then repair or a stand-in where they are asked for."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import InputError
from ..mesh import cache as mesh_cache
from ..mesh.hull import box_surface, convex_hull
from ..mesh.reading import Mesh, load_mesh
from ..mesh.union import can_unite
from .moments import referenced_vertices
from .properties import MeshMoments, Surface
from .repair import CRACK, close_surface, repair_surface, unite_components, weld_cracks
from .verdict import INFO, NESTED, OVERLAPPING, UNREFERENCED, WARNING, Finding, Verdict, check_surface

UNION = "union"
"""The repair that makes one solid of components that overlap or lie inside others."""
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


def mesh_body(
    mesh: Mesh | str, *, repair: bool | str = False, fallback: str = "", accept_open: float = 0.0
) -> MeshBody:
    """The moments of a mesh (or of the one that a path, URI or bundled name stands for) with its verdict.

    A surface that bounds no solid is not refused here: asking its moments for the solid, or for a mass from a density,
    raises MeshError with the reason and the flags that help. ``repair`` welds, drops duplicates, orients (cavities stay
    cavities) and caps holes first; "union" then makes one solid of components that overlap or lie inside others;
    ``accept_open`` then closes what is still open with flat caps where whatever closes it changes volume and tensor by
    less than that part of themselves; ``fallback`` "hull" or "box" lets that shape stand in for what is open all the
    same.
    """
    _check_options(repair, fallback, accept_open)
    if isinstance(mesh, str):
        mesh = load_mesh(mesh)
    checked = _checked(mesh)
    # What is found of a repair or a stand-in is of this call, and no part of what is kept of the surface.
    verdict = replace(checked.verdict, findings=list(checked.verdict.findings))
    vertices, triangles, polygon_starts = mesh.vertices, checked.triangles, checked.polygon_starts
    if verdict.usable and not np.isfinite(vertices).all():  # vertices that no face uses
        vertices = np.where(np.isfinite(vertices).all(axis=1)[:, None], vertices, vertices[triangles[0, 0]])
    if repair and verdict.usable and _wants_repair(verdict):
        done: tuple[str, ...] = ()
        if repair != UNION or not verdict.closed:
            cavities = repair != UNION
            triangles, polygon_starts, done = repair_surface(vertices, triangles, polygon_starts, cavities=cavities)
        if repair == UNION:
            vertices, triangles, polygon_starts, joined = unite_components(vertices, triangles, polygon_starts)
            done = (*done, joined) if joined else done
        if done:
            verdict, _ = check_surface(vertices, triangles)
            verdict.findings.insert(0, Finding("repaired", WARNING, "repaired: " + "; ".join(done)))
    effect = verdict.hole_effect
    if not verdict.closed and effect is not None and effect <= accept_open:
        triangles, polygon_starts = close_surface(vertices, triangles, polygon_starts)
        reason = verdict.reason
        verdict, _ = check_surface(vertices, triangles)
        message = f"closed with flat caps, on which at most {effect:.2g} of volume and tensor depend: {reason}"
        verdict.findings.insert(0, Finding("open_accepted", WARNING, message))
    stand_in: Callable[[], Surface] | None = None
    if verdict.united:
        stand_in = functools.cache(lambda: unite_components(vertices, triangles, None)[:2])
    elif fallback and verdict.usable and not verdict.closed:
        stand_in = functools.cache(lambda: _stand_in(vertices, triangles, fallback))
        shape = "convex hull" if fallback == "hull" else "bounding box"
        message = f"fallback: the mass properties are those of its {shape}"
        verdict.findings.append(Finding("fallback", WARNING, message))
    remedies = ("" if repair else "--repair (mesh_repair), ") + "--fallback hull|box (mesh_fallback)"
    no_solid = "" if verdict.closed else f"{verdict.reason}; use {remedies}"
    moments = MeshMoments(
        vertices,
        triangles,
        polygon_starts,
        no_solid=no_solid,
        name=mesh.name,
        stand_in=stand_in,
    )
    return MeshBody(mesh, verdict, moments)


def _check_options(repair: bool | str, fallback: str, accept_open: float) -> None:
    if repair not in (False, True, UNION):
        raise InputError("mesh_repair", repair, f"true, false, or {UNION}")
    if fallback not in FALLBACKS:
        raise InputError("mesh_fallback", fallback, "'' (refuse), hull or box")
    if not 0.0 <= accept_open <= 1.0:
        raise InputError("--accept-open", accept_open, "a number from 0 to 1: part of volume and tensor")


def _wants_repair(verdict: Verdict) -> bool:
    return not verdict.closed or any(finding.code in (NESTED, OVERLAPPING) for finding in verdict.findings)


def _stand_in(vertices: np.ndarray, triangles: np.ndarray, fallback: str) -> tuple[np.ndarray, np.ndarray]:
    points = referenced_vertices(vertices, triangles)
    if fallback == "hull":
        return points, convex_hull(points)
    return box_surface(points.min(axis=0), points.max(axis=0))


def _key(mesh: Mesh) -> str:
    measured = "united" if can_unite() else "body"  # whether overlaps could be measured
    return f"{mesh.sha256}-{mesh.path.rpartition('.')[2].lower()}-{measured}"


@dataclass(frozen=True)
class _Checked:
    """The verdict on a mesh, and the triangles that it holds for; ``welded``: without cracks of rounding's size."""

    verdict: Verdict
    triangles: np.ndarray
    polygon_starts: np.ndarray | None
    welded: bool


def _checked(mesh: Mesh) -> _Checked:
    """The verdict on the mesh, from the cache or anew."""
    kept = mesh_cache.load_json(_key(mesh))
    if kept is not None:
        try:
            findings = [Finding(**finding) for finding in kept["verdict"].pop("findings")]
            triangles, starts = mesh.triangles, mesh.polygon_starts
            if kept["welded"]:
                triangles, starts, _ = weld_cracks(mesh.vertices, triangles, starts)
            return _Checked(Verdict(findings=findings, **kept["verdict"]), triangles, starts, kept["welded"])
        except (KeyError, TypeError, ValueError, AttributeError):
            pass
    checked = _checked_anew(mesh)
    if not mesh_cache.is_passing(mesh.path):
        entry = {"verdict": dataclasses.asdict(checked.verdict), "welded": checked.welded}
        mesh_cache.store_json(_key(mesh), entry)
    return checked


def _checked_anew(mesh: Mesh) -> _Checked:
    verdict, topology = check_surface(mesh.vertices, mesh.triangles)
    if topology is not None and verdict.usable and len(topology.boundary):
        triangles, starts, done = weld_cracks(mesh.vertices, mesh.triangles, mesh.polygon_starts)
        if done:
            # Vertices that others now stand for belong to faces all the same.
            spare = [finding for finding in verdict.findings if finding.code == UNREFERENCED]
            verdict, _ = check_surface(mesh.vertices, triangles)
            verdict.findings[:] = spare + [finding for finding in verdict.findings if finding.code != UNREFERENCED]
            verdict.findings.insert(0, Finding("welded", INFO, f"{done}, less than {CRACK:g} of the diagonal"))
            return _Checked(verdict, triangles, starts, True)
    return _Checked(verdict, mesh.triangles, mesh.polygon_starts, False)
