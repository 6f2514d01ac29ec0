# SPDX-License-Identifier: MIT
"""Checks of a surface before its moments are computed: what is wrong, how large the effect is, and what can be done."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import MeshError
from ..base.vectors import BoolArray, FloatArray, Points, Triangles
from ..mesh.intersection import MAX_SELF_CROSSING, Nesting, component_nesting
from ..mesh.solids import can_unite, united_surface
from ..mesh.topology import (
    Components,
    Topology,
    component_sums,
    doubled_faces,
    fan,
    mesh_topology,
    rims,
    surplus_copies,
    turned_triangles,
)
from .moments import effect_of_strips, extent, largest_effect, solid_moments

INFO, WARNING, ERROR = "info", "warning", "error"
NESTED = "nested_components"
NO_OVERLAP = 1e-6
"""Fraction of the volume below which an overlap is a remark, not a warning."""
MAX_NESTED_COMPONENTS = 2000
"""Number of components above which their nesting isn't examined: the tables grow with its square."""
NO_VOLUME = 1e-14
"""V/diagonal³ below which the volume is recomputed in pairs; it is none if V/(area·diagonal) is below 1e-2 of this."""
SIZE_RANGE = 1e-60, 1e60
"""Smallest and largest longest side of a surface: moments grow with the fifth power, and doubles end at 1e308."""
SMALL_HOLES = 0.1
"""Largest effect of holes for which the message includes the option that accepts it."""
WELD = 1e-5
"""Part of the diagonal up to which repair joins corners at open edges: the rounding of files with six digits."""
GAP = 5e-3
"""Part of the diagonal up to which what keeps a surface open is called a gap, not a hole."""
MAX_RIM = 20_000
"""Unbalanced edges up to which caps are tried; following more takes too long."""


@dataclass(frozen=True)
class Finding:
    """One remark: ``code`` for scripts, ``severity`` info, warning or error (refuses the solid), ``message``."""

    code: str
    severity: str
    message: str


@dataclass
class Verdict:
    """Result of the checks. ``usable``: there are faces, coordinates are finite, and the longest side is in SIZE_RANGE,
    so that other models can be computed; ``closed``: the surface bounds a solid; ``reason``: why not; ``inward``: it is
    wound inward throughout and must be reversed. ``hole_effect``: the largest change of volume, relative to itself, or
    of the tensor, relative to its largest entry, that closing an open surface can cause; None if unknown; ``united``:
    components overlap, and the solid is their union; ``joined``: number of corners at open edges that count as others.
    """

    findings: list[Finding] = field(default_factory=list)
    usable: bool = True
    closed: bool = True
    reason: str = ""
    watertight: bool = True
    winding_consistent: bool = True
    inward: bool = False
    components: int = 0
    hole_effect: float | None = None
    united: bool = False
    joined: int = 0

    def add(self, code: str, severity: str, message: str, remedy: str = "") -> None:
        """Append a finding. An error also rules out the solid; the first error is the reason."""
        self.findings.append(Finding(code, severity, f"{message}; {remedy}" if remedy else message))
        if severity == ERROR:
            self.closed = False
            self.reason = self.reason or message


def counted(number: int, noun: str) -> str:
    """``number`` and the noun, in the plural unless it is 1."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _check_edges(verdict: Verdict, topology: Topology, vertices: Points, size: float) -> None:
    """Check for open edges, inconsistent winding and duplicate faces, and for the effect of closing holes; ``size``:
    the box's diagonal.
    """
    verdict.watertight = topology.odd == 0
    verdict.winding_consistent = topology.flipped == 0
    surplus = int(np.count_nonzero(surplus_copies(topology)))
    if surplus:
        message = f"{counted(surplus, 'duplicate face')}, which would count twice"
        verdict.add("duplicate_faces", ERROR, message, "--repair (mesh_repair) removes the copies")
    elif topology.duplicates.any():
        message = f"{counted(int(np.count_nonzero(topology.duplicates)), 'duplicate face')} that close the surface"
        if doubled_faces(topology):
            verdict.add("duplicate_faces", WARNING, f"{message}; a volume beside them counts twice")
        else:
            verdict.add("duplicate_faces", INFO, message)
    if topology.joined:
        _tell_joined(verdict, topology, vertices)
    verdict.hole_effect = _hole_effect(topology, vertices)
    known = ""
    if verdict.hole_effect is not None and verdict.hole_effect < SMALL_HOLES:
        known = f"; any way to close it changes volume and tensor by at most {100.0 * verdict.hole_effect:.2g} %"
        known += f", which --accept-open {_rounded_up(verdict.hole_effect)} accepts"
    if topology.odd:
        rim = len(topology.boundary)
        edges = counted(rim, "boundary edge")
        wide = mesh_topology(vertices, topology.corners, GAP)
        if topology.odd > rim:
            edges += f" and {counted(topology.odd - rim, 'edge')} of 3 or more faces"
        remedy = "--repair (mesh_repair) welds edges and caps holes"
        if not wide.odd:
            edges += f" at gaps up to {wide.farthest:.2g} wide, {wide.farthest / size:.2g} of the size"
            edges += f" (--repair welds up to {WELD:g} of it, and caps what is wider as holes)"
        verdict.add("open", ERROR, f"open surface with {edges}{known}", remedy)
        known = ""
    if topology.flipped:
        edges = f"{counted(topology.flipped, 'edge')} used twice in the same direction"
        remedy = "--repair (mesh_repair) turns faces"
        verdict.add("inconsistent_winding", ERROR, f"inconsistent winding: {edges}{known}", remedy)


def _tell_joined(verdict: Verdict, topology: Topology, vertices: Points) -> None:
    """Say that corners at open edges count as one, and what may depend on it."""
    verdict.joined = topology.joined
    effect = _joined_effect(topology, vertices)
    most = "" if effect is None else f"at most {_rounded_up(100.0 * effect)} %"
    depends = f"; volume and tensor depend on it by {most}" if most else ""
    corners = f"{counted(topology.joined, 'corner')} at open edges"
    verdict.add("joined_corners", INFO, f"{corners} joined to others up to {topology.farthest:.2g} away{depends}")


def _joined_effect(topology: Topology, vertices: Points) -> float | None:
    """See ``effect_of_strips``; None for a surface without a volume."""
    try:
        moments = solid_moments(vertices, topology.corners)
    except MeshError:
        return None
    effect = effect_of_strips(vertices, topology.seam, topology.farthest, moments.record)
    return effect if effect >= 0.0 else None


def _hole_effect(topology: Topology, vertices: Points) -> float | None:
    """``Verdict.hole_effect`` of a surface that flat caps close: the largest effect of any surface over the holes that
    has the caps' area and lies no farther from the centre of mass. None for one without a volume.

    Relative to the centre of mass, an element dA at the distance r adds at most r dA/3 to the volume, r² dA/4 to the
    first and r³ dA/5 to the second moments.
    """
    if not 0 < len(topology.unbalanced) <= MAX_RIM:
        return None
    caps = np.concatenate([fan(walk) for walk in rims(topology.unbalanced)])
    try:
        moments = solid_moments(vertices, np.concatenate([topology.corners, caps]))
    except MeshError:
        return None
    a, b, c = (vertices[caps[:, k]] - moments.centroid for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    reach = np.sqrt(np.max([np.sum(corner**2, axis=1) for corner in (a, b, c)], axis=0))
    effect = largest_effect(moments.record, *(float(np.sum(areas * reach**k)) / (k + 2) for k in (1, 2, 3)))
    return effect if effect >= 0.0 else None


def _rounded_up(value: float) -> str:
    """``value`` rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0.0 else 1e-12
    return f"{step * math.ceil(value / step + 1e-9):.2g}"


def _check_components(verdict: Verdict, topology: Topology, sums: Components, vertices: Points) -> None:
    """Check balanced surfaces for orientation, cavities, parts that count twice, and self-intersection."""
    count, volume = topology.components, sums.volume
    whole, is_large = float(np.sum(volume)), len(topology.corners) > MAX_SELF_CROSSING
    verdict.inward = whole < 0.0
    if is_large:
        message = f"whether the surface passes through itself isn't examined beyond {MAX_SELF_CROSSING} triangles"
        verdict.add("self_crossing_unchecked", INFO, message)
    if count > MAX_NESTED_COMPONENTS:
        message = f"{count} components are too many to check whether some overlap or lie inside others"
        verdict.add("components_unchecked", WARNING, message)
    elif count > 1 or not is_large:
        nesting = component_nesting(vertices, topology, sums)
        if nesting.complete:
            _check_winding(verdict, nesting, volume)
        else:
            verdict.add("components_unchecked", WARNING, "too many faces to check whether components overlap")
        if nesting.crossing.any():
            _check_overlap(verdict, nesting, whole, vertices, topology.corners)
        if nesting.complete and not verdict.inward and not verdict.united:
            _check_nesting(verdict, nesting, volume)
        if nesting.within:
            message = f"the surface passes through itself ({counted(nesting.within, 'pair')} of triangles)"
            verdict.add("self_crossing", WARNING, f"{message}; a volume that it encloses twice counts twice")
    if verdict.inward:
        verdict.add("inward", WARNING, "all faces were wound inward and have been turned outward")


def wound_wrong(nesting: Nesting, volume: FloatArray) -> BoolArray:
    """Which components (k,), of signed volume (k,), count with the wrong sign: inward in no solid, or outward in one.

    Outermost first, so that those around a component count as they should. One wound outward that crosses others is a
    part that overlaps them, also where it lies inside another one: a pin that enters the walls around a cavity.
    """
    sign, crosses = np.sign(volume), nesting.crosses
    for c in np.argsort(nesting.depth, kind="stable").tolist():
        if sign[c] != 0.0 and not (sign[c] > 0.0 and crosses[c]):
            sign[c] = -1.0 if np.sum(sign[nesting.inside[c]]) > 0.0 else 1.0
    wrong: BoolArray = sign != np.sign(volume)
    return wrong


def _check_winding(verdict: Verdict, nesting: Nesting, volume: FloatArray) -> None:
    """Find components, of signed volume (k,), that subtract: cavities, and those that are no cavities."""
    verdict.inward = bool(volume.any() and not wound_wrong(nesting, -volume).any())
    if verdict.inward:
        volume = -volume
    subtracts = volume < 0.0
    wrong = subtracts & wound_wrong(nesting, volume)
    if wrong.any():
        verdict.winding_consistent = False
        subtract = f"{np.count_nonzero(wrong)} of {len(volume)} components wound inward, so that they would subtract"
        message = f"inconsistent winding: {subtract}"
        remedy = "--repair (mesh_repair) turns them"
        if (wrong & nesting.crosses).any():
            remedy += (
                ", which makes a part of a cavity that reaches out of its own: cut that out where the mesh is made"
            )
        verdict.add("component_inward", ERROR, message, remedy)
    cavities = int(np.count_nonzero(subtracts & ~wrong))
    if cavities:
        verdict.add("cavities", INFO, f"{counted(cavities, 'closed inner surface')} wound inward, taken as cavities")


def _check_nesting(verdict: Verdict, nesting: Nesting, volume: FloatArray) -> None:
    """Find components, of signed volume (k,), that lie inside others and add to them in the sum of all."""
    nested = int(np.count_nonzero(wound_wrong(nesting, volume) & (volume > 0.0)))
    if nested:
        message = f"{counted(nested, 'component')} inside another and wound outward: their volume counts twice"
        verdict.add(NESTED, WARNING, message, "--repair (mesh_repair) makes cavities of them")
    around = nesting.inside @ np.sign(volume)
    parts = int(np.count_nonzero(nesting.crosses & (volume > 0.0) & (around > 0.0)))
    if parts:  # repair would be wrong: they are parts
        inside = f"{counted(parts, 'component')} inside another, wound outward and crossing others"
        verdict.add(NESTED, WARNING, f"{inside}: what they share counts twice")


def _check_overlap(verdict: Verdict, nesting: Nesting, volume: float, vertices: Points, triangles: Triangles) -> None:
    """For components that intersect: how much the sum of volumes differs from that of the union, if it can be computed.

    Parts that overlap count twice in the sum, what cavities share is missing in it: the two may cancel in the volume
    and not in the tensor.
    """
    pairs = int(np.count_nonzero(np.triu(nesting.crossing)))
    overlap, whole, parts = f"{counted(pairs, 'pair')} of components overlap", 0.0, 0.0
    if verdict.inward:
        volume, triangles = -volume, turned_triangles(triangles)
    if verdict.closed:
        with contextlib.suppress(MeshError):
            points, faces, parts = united_surface(vertices, triangles, nesting)
            whole = solid_moments(points, faces).measure
    if not whole > 0.0:
        measure = "" if can_unite() else " (the extra [meshes] measures by how much)"
        verdict.add("overlapping_components", WARNING, f"{overlap}; what they share counts twice{measure}")
        return
    differences = {"overcount": (parts - whole) / whole, "undercount": (parts - volume) / whole}
    told = [f"{what} {100.0 * part:.3g} %" for what, part in differences.items() if part > NO_OVERLAP]
    verdict.united = bool(told)
    if not verdict.united:
        verdict.add("overlapping_components", INFO, f"{overlap}, by less than {NO_OVERLAP:g} of the volume")
        return
    sum_of_parts = f"their volumes' sum of {volume:.4g} would {' and '.join(told)}"
    message = f"{overlap}; the solid is their union of {whole:.4g}: {sum_of_parts}"
    verdict.add("overlapping_components", WARNING, message)


def _check_size(verdict: Verdict, side: float) -> None:
    """Refuse a surface whose longest side is zero, or so large or small that moments overflow or underflow."""
    verdict.usable = SIZE_RANGE[0] <= side <= SIZE_RANGE[1]
    if side == 0.0:
        verdict.add("zero_volume", ERROR, "all vertices lie in one point")
    elif not verdict.usable:
        sizes = "from {:g} to {:g}".format(*SIZE_RANGE)
        verdict.add("size", ERROR, f"the mesh is {side:.3g} across; moments are finite for sizes {sizes}")


def check_surface(vertices: Points, triangles: Triangles) -> Verdict:
    """The verdict on triangles (m, 3) over vertices (n, 3)."""
    verdict = Verdict()
    finite = np.isfinite(vertices)
    bad = np.zeros(0, np.int64) if finite.all() else np.flatnonzero(~finite.all(axis=1))
    if len(triangles) == 0 or len(bad):
        verdict.usable = verdict.watertight = verdict.winding_consistent = False
        if len(bad):
            rows = f"{len(bad)} of {len(vertices)} vertices are not finite"
            verdict.add("nonfinite", ERROR, f"{rows}; the first is vertex {bad[0]}")
        else:
            verdict.add("no_faces", ERROR, "the mesh has no faces")
        return verdict
    lower, upper, used = extent(vertices, triangles)
    if used < len(vertices):
        message = f"vertices that belong to no face carry no mass: {len(vertices) - used}"
        verdict.add("unreferenced_vertices", INFO, message)
    sides = upper - lower
    topology = mesh_topology(vertices, triangles)
    verdict.components = topology.components
    _check_size(verdict, float(sides.max()))
    if not verdict.usable:
        return verdict
    diagonal = float(np.linalg.norm(sides))
    sums = component_sums(vertices, topology)
    _check_edges(verdict, topology, vertices, diagonal)
    if not len(topology.unbalanced):
        empty = abs(float(np.sum(sums.volume))) <= NO_VOLUME * diagonal**3 and _no_volume(vertices, triangles, diagonal)
        if topology.components > 1 or not empty:
            _check_components(verdict, topology, sums, vertices)
        if empty and verdict.closed:
            verdict.add("zero_volume", ERROR, "the surface encloses no volume: it is flat, or folded onto itself")
    return verdict


def _no_volume(vertices: Points, triangles: Triangles, diagonal: float) -> bool:
    """Whether the volume, computed in pairs of doubles, is below the rounding of area × diagonal."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
    try:
        volume = solid_moments(vertices, triangles, compensated=True).measure
    except MeshError:
        return True
    return abs(volume) <= NO_VOLUME * 1e-2 * area * diagonal
