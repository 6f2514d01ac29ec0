# SPDX-License-Identifier: MIT
"""From a mesh to its moments: first the verdict, then repair or a substitute shape if requested.

Verdicts on files are cached in the user's cache folder under a hash of the file's bytes and of the code, so that a
newer version never uses verdicts of an older one. A cache that can't be written or read is no error: the verdict is
then computed again. ``RIGID_PROTO_CACHE=off`` disables the cache.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base.cache import source_stamp, user_cache
from ..base.compilation import INTERPRETED
from ..base.errors import InputError
from ..base.files import whole_file
from ..base.vectors import Points, Triangles
from ..mesh.assembly import Assembly
from ..mesh.parts import Part
from ..mesh.reading import Mesh, load_mesh
from ..mesh.solids import box_surface, can_unite, convex_hull, united_surface
from ..mesh.topology import mesh_topology, turned_triangles
from .moments import extent, referenced_vertices, solid_moments
from .parts import SolidPart, overlaps_of, sum_of_parts
from .properties import MeshMoments, Surface, scale_vector
from .repair import close_surface, repair_surface
from .verdict import INFO, NESTED, WARNING, Finding, Verdict, check_surface

FALLBACKS = ("", "hull", "box")
"""Substitute for a surface that bounds no solid: none (refuse), its convex hull, or its bounding box."""
PASSING = "rigid_proto_upload_"
"""Part of the paths of temporary files, whose verdicts aren't cached."""


@dataclass(frozen=True)
class MeshBody:
    """A mesh, the verdict on it, and its moments; ``vertices`` and ``triangles`` are those used for the moments
    (repaired ones if repair was requested and needed). parts: the solids whose sum it is, of a body of parts."""

    mesh: Mesh
    verdict: Verdict
    moments: MeshMoments
    parts: tuple[SolidPart, ...] = ()

    @property
    def vertices(self) -> Points:
        """Vertices (n, 3) in mesh coordinates; repair keeps their numbers and positions."""
        return self.moments.vertices

    @property
    def triangles(self) -> Triangles:
        """Triangles (m, 3), reversed if the file winds them inward throughout."""
        triangles = self.moments.triangles
        return turned_triangles(triangles) if self.verdict.inward else triangles

    def volume(self, scale: ArrayLike = (1.0, 1.0, 1.0)) -> float:
        """Volume [m³] of the solid, of parts the sum of theirs; raises MeshError where there is none."""
        solid = self.moments.moments("solid")
        own = math.fsum(part.volume for part in self.parts) if self.parts else solid.measure
        x, y, z = scale_vector(scale).tolist()
        return float(own * abs(x * y * z))


def mesh_body(mesh: Mesh | str, *, repair: bool = False, fallback: str = "", accept_open: float = 0.0) -> MeshBody:
    """The moments of a mesh (or of the mesh with a path, URI or bundled name) with its verdict.

    A surface that bounds no solid is not refused here: the moments of the solid, or a mass from a density, then raise
    MeshError with the reason and the flags that help. ``repair`` welds, drops duplicates, orients (cavities stay
    cavities) and caps holes first. ``accept_open`` then closes a surface that is still open with flat caps, if no way
    of closing it changes volume and tensor by more than this fraction. ``fallback`` "hull" or "box" uses that shape for
    a surface that is open nevertheless.
    """
    if fallback not in FALLBACKS:
        raise InputError("mesh_fallback", fallback, "'' (refuse), hull or box")
    if not 0.0 <= accept_open <= 1.0:
        raise InputError("--accept-open", accept_open, "a number from 0 to 1: part of volume and tensor")
    if isinstance(mesh, str):
        mesh = load_mesh(mesh)
    if mesh.parts:
        return _body_of_parts(mesh, repair, fallback, accept_open)
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
        outward = turned_triangles(triangles) if verdict.inward else triangles
        stand_in = functools.cache(lambda: united_surface(vertices, outward)[:2])
    elif verdict.joined and verdict.closed:
        stand_in = functools.cache(lambda: (vertices, mesh_topology(vertices, triangles).corners))
    elif fallback and verdict.usable and not verdict.closed:
        points = referenced_vertices(vertices, triangles)
        shape, made = ("convex hull", convex_hull) if fallback == "hull" else ("bounding box", box_surface)
        stand_in = functools.cache(lambda: made(points))
        message = f"fallback: the mass properties are those of its {shape}"
        verdict.findings.append(Finding("fallback", WARNING, message))
    remedies = ("" if repair else "--repair (mesh_repair), ") + "--fallback hull|box (mesh_fallback)"
    if verdict.usable and not verdict.closed and np.subtract(*extent(vertices, triangles)[:2]).max() == 0.0:
        remedies = "a mesh that isn't flat"
    repaired = "".join(f"{one.message}, and then: " for one in verdict.findings if one.code == "repaired")
    no_solid = "" if verdict.closed else f"{repaired}{verdict.reason}; use {remedies}"
    moments = MeshMoments(vertices, triangles, polygon_starts, no_solid=no_solid, name=mesh.name, stand_in=stand_in)
    return MeshBody(mesh, verdict, moments)


def _body_of_parts(mesh: Mesh, repair: bool, fallback: str, accept_open: float) -> MeshBody:
    """The body that is the sum of a mesh's parts, each judged, repaired or replaced by itself."""
    told, solids, assembly = Verdict(), [], Assembly(mesh.name)
    starts, count = [], 0
    for part in mesh.parts:
        body = mesh_body(part.mesh, repair=repair, fallback=fallback, accept_open=accept_open)
        one = body.verdict
        if part.mesh.unit != 1.0:
            unit = (
                f"part {part.name}: its file's unit is {part.mesh.unit:g} m, from which it has been converted to metres"
            )
            told.findings.append(Finding("stated_unit", INFO, unit))
        told.findings += [replace(each, message=f"part {part.name}: {each.message}") for each in one.findings]
        told.usable, told.closed = told.usable and one.usable, told.closed and one.closed
        told.watertight = told.watertight and one.watertight
        told.winding_consistent = told.winding_consistent and one.winding_consistent
        told.components += one.components
        lacking = one.reason if not one.usable else body.moments.no_solid if body.moments.stand_in is None else ""
        told.reason = told.reason or (f"part {part.name}: {lacking}" if lacking else "")
        assembly.add(body.vertices, body.triangles, part.matrix, f"part {part.name}")
        own = body.moments.polygon_starts
        starts.append((np.arange(len(body.triangles) + 1) if own is None else own)[:-1] + count)
        count += len(body.triangles)
        surface = _surface_of(part, body)
        solids.append(SolidPart(part.name, surface, part.density, part.mass, part.wall_thickness, part.infill))
    vertices, triangles = assembly.surface()
    polygon_starts = None if mesh.polygon_starts is None else np.concatenate([*starts, [count]])
    if told.usable and not told.reason:
        told.findings += overlaps_of(solids)
    summed = functools.partial(sum_of_parts, solids)
    moments = MeshMoments(vertices, triangles, polygon_starts, no_solid=told.reason, name=mesh.name, summed=summed)
    return MeshBody(mesh, told, moments, tuple(solids))


def _surface_of(part: Part, body: MeshBody) -> Callable[[], Surface]:
    """The outward surface of a part's solid in the whole body's coordinates, once it is needed."""

    @functools.cache
    def surface() -> Surface:
        placed = Assembly(body.mesh.name)
        placed.add(*body.moments.solid_surface(), part.matrix, part.name)
        vertices, triangles = placed.surface()
        return vertices, turned_triangles(triangles) if solid_moments(vertices, triangles).measure < 0.0 else triangles

    return surface


def folder() -> Path | None:
    """The cache folder, or None if it is disabled or there is no home directory."""
    if os.environ.get("RIGID_PROTO_CACHE", "").lower() in ("off", "0", "no"):
        return None
    base = user_cache()
    return Path(base) / "meshes" if base else None


def check_mesh(mesh: Mesh) -> Verdict:
    """The verdict on a mesh, cached or computed."""
    base = None if PASSING in mesh.path else folder()
    if base is None:
        return check_surface(mesh.vertices, mesh.triangles)
    # Sums may round differently when they aren't compiled.
    ways = mesh.path.rpartition(".")[2].lower(), "united" if can_unite() else "body", str(INTERPRETED)
    path = base / f"{mesh.sha256}-{'-'.join(ways)}-{source_stamp(__file__).hex()[:16]}.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        kept = json.loads(path.read_bytes())
        return Verdict(findings=[Finding(**finding) for finding in kept.pop("findings")], **kept)
    verdict = check_surface(mesh.vertices, mesh.triangles)
    with contextlib.suppress(OSError, InputError):
        base.mkdir(parents=True, exist_ok=True)
        with whole_file("cache", path) as entry:
            entry.write_text(json.dumps(dataclasses.asdict(verdict)))
    return verdict
