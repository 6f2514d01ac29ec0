# SPDX-License-Identifier: MIT
"""A verdict on a surface before any number is taken from it: what is wrong, how much, and what can be done."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import MeshError
from ..mesh.intersection import Nesting, component_nesting, self_crossings
from ..mesh.topology import (
    Components,
    Topology,
    component_sums,
    fan,
    mesh_topology,
    referenced_extent,
    rims,
    surplus_copies,
)
from ..mesh.union import can_unite, counted_once, united_volume
from .moments import solid_moments

INFO, WARNING, ERROR = "info", "warning", "error"
UNREFERENCED = "unreferenced_vertices"
OVERLAPPING, NESTED, SELF_CROSSING = "overlapping_components", "nested_components", "self_crossing"
NO_OVERLAP = 1e-6
"""Part of the volume below which an overlap is a remark, no warning."""
MAX_NESTED_COMPONENTS = 2000
"""Above this many components their mutual position isn't examined: the tables grow with the square."""
THIN = 1e-6
"""V/diagonal³ below which a body is called thin: a 1 x 1 x 1e-5 plate has 4e-6, a needle less."""
NO_VOLUME = 1e-14
"""V/(area·diagonal) below which the surface encloses nothing: both sides coincide to rounding."""
SIZE_RANGE = 1e-60, 1e60
"""Longest sides of surfaces that are judged: moments grow with the fifth power, and doubles end at 1e308."""
SMALL_HOLES = 0.1
"""Largest effect of holes that is said together with the option that accepts it."""
MAX_RIM = 20_000
"""Unbalanced edges up to which caps are tried; walking along more takes long."""
LARGE_M, SMALL_M = 5.0, 1e-3
"""Longest sides [m] outside which another unit is suspected: few bodies that one pokes are longer, and every part of
5 mm to 5 m drawn in millimetres is."""


@dataclass(frozen=True)
class Finding:
    """One remark: ``code`` for scripts, ``severity`` info, warning or error (refuses the solid), ``message``."""

    code: str
    severity: str
    message: str

    def as_dict(self) -> dict[str, str]:
        """The finding as a JSON object."""
        return {"code": self.code, "severity": self.severity, "message": self.message}


@dataclass
class Verdict:
    """What was found. ``usable``: coordinates are finite, so that the other models have a meaning; ``closed``: the
    surface bounds a solid; ``reason``: why not; ``inward``: it is wound inward throughout and is to be turned.
    ``hole_effect``: by what part of itself the volume, or the tensor by that of its largest entry, changes at most by
    what closes an open surface, None where that isn't known; ``united``: components overlap, and the solid is their
    union."""

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

    def add(self, code: str, severity: str, message: str, remedy: str = "") -> None:
        """Append a finding; an error also closes the way to the solid, the first one giving the reason."""
        self.findings.append(Finding(code, severity, f"{message}; {remedy}" if remedy else message))
        if severity == ERROR:
            self.closed = False
            self.reason = self.reason or message


def unit_suspicion(longest_side: float) -> Finding | None:
    """A remark when a body of ``longest_side`` [m] looks as if its file weren't in metres."""
    if longest_side > LARGE_M:
        units = f"{longest_side:.4g} mm if the file is in millimetres (--scale 0.001)"
        message = f"the body is {longest_side:.4g} m across; it would be {units} (scale)"
        return Finding("unit_suspicion", WARNING, message)
    if longest_side < SMALL_M:
        larger = f"it would be {1000.0 * longest_side:.4g} m if its lengths were divided by 1000 once too often"
        message = f"the body is {longest_side:.4g} m across; {larger} (--scale 1000) (scale)"
        return Finding("unit_suspicion", WARNING, message)
    return None


def stated_unit(unit: float) -> Finding | None:
    """A remark when a mesh's file says that its unit is ``unit`` metres."""
    if unit == 1.0:
        return None
    message = f"the file says that its unit is {unit:g} m: coordinates have been converted to metres"
    return Finding("stated_unit", INFO, message)


def counted(number: int, noun: str) -> str:
    """``number`` and the noun, in the plural but for one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _check_edges(
    verdict: Verdict, topology: Topology, sums: Components, vertices: np.ndarray, half: np.ndarray
) -> None:
    """Open, inconsistently wound, duplicated: each with what is known of the volume."""
    verdict.watertight = topology.watertight
    verdict.winding_consistent = topology.flipped == 0
    surplus = int(np.count_nonzero(surplus_copies(topology)))
    if surplus:
        message = f"{counted(surplus, 'duplicate face')}, which would count twice"
        verdict.add("duplicate_faces", ERROR, message, "--repair (mesh_repair) removes the copies")
    if topology.duplicates.any() and not surplus:
        message = f"{counted(int(np.count_nonzero(topology.duplicates)), 'duplicate face')} that close the surface"
        verdict.add("duplicate_faces", INFO, message)
    caps = _caps(topology)
    accepting = ""
    if caps is not None:
        verdict.hole_effect = _hole_effect(topology, vertices, caps)
        if verdict.hole_effect is not None and verdict.hole_effect < SMALL_HOLES:
            known_to = f"whatever closes it changes volume and tensor by at most {100.0 * verdict.hole_effect:.2g} %"
            accepting = f"; {known_to}, which --accept-open {_rounded_up(verdict.hole_effect)} accepts"
    if topology.unbalanced and not topology.watertight:
        rim = len(topology.boundary)
        edges = counted(rim, "boundary edge")
        if topology.odd > rim:
            edges += f" and {counted(topology.odd - rim, 'edge')} of 3 or more faces"
        known = _known_volume(sums, half, "how holes are closed")
        if caps is not None:
            known += f"; flat caps over the holes give {_capped_volume(sums, vertices, caps):.3g}"
        remedy = "--repair (mesh_repair) welds edges and caps holes"
        verdict.add("open", ERROR, f"open surface with {edges}; {known}{accepting}", remedy)
        accepting = ""
    if topology.flipped:
        edges = f"{counted(topology.flipped, 'edge')} used twice in the same direction"
        known = _known_volume(sums, half, "how faces are turned")
        remedy = "--repair (mesh_repair) turns faces"
        verdict.add("inconsistent_winding", ERROR, f"inconsistent winding: {edges}; {known}{accepting}", remedy)
    if topology.nonmanifold and not topology.unbalanced and not surplus:
        message = f"{counted(topology.nonmanifold, 'edge')} shared by more than two faces, which are wound consistently"
        verdict.add("non_manifold", INFO, message)
    if topology.opposites:
        message = f"{counted(topology.opposites, 'face')} coinciding with another one that is wound the other way"
        verdict.add("opposite_faces", WARNING, message)
    if topology.degenerate:
        message = f"{counted(topology.degenerate, 'triangle')} without area, which have no effect"
        verdict.add("degenerate_faces", INFO, message)


def _known_volume(sums: Components, half: np.ndarray, choice: str) -> str:
    """What can be said of the volume of a surface that bounds none: half (3,) is half its box.

    The faces' sum moves with the origin by a third of the surface's vector area times the distance.
    """
    volume = float(np.sum(sums.volume))
    swing = float(np.sum(np.abs(sums.area.sum(axis=0)) * half)) / 3.0
    low, high = f"{volume - swing:.3g}", f"{volume + swing:.3g}"
    if low == high:
        return f"volume unknown: it depends on {choice}, and the faces' own sum of {low} leaves that out"
    return f"volume ambiguous: {low} to {high}, depending on {choice}"


def _caps(topology: Topology) -> np.ndarray | None:
    """Triangles (k, 3) over welded vertices that close the surface; None where it is closed or its rims are long."""
    unbalanced = topology.edges[topology.edges[:, 2] != topology.edges[:, 3]]
    if not 0 < len(unbalanced) <= MAX_RIM:
        return None
    return np.concatenate([fan(walk) for walk in rims(unbalanced)])


def _capped_volume(sums: Components, vertices: np.ndarray, caps: np.ndarray) -> float:
    a, b, c = (vertices[caps[:, k]] - sums.middle for k in range(3))
    return float(np.sum(sums.volume) + np.sum(np.einsum("ij,ij->i", a, np.cross(b, c))) / 6.0)


def _hole_effect(topology: Topology, vertices: np.ndarray, caps: np.ndarray) -> float | None:
    """As ``Verdict.hole_effect``, of a surface that ``caps`` (k, 3) close: the largest that any surface over the holes
    can do that has the caps' area and lies no farther from the centre of mass. None for one without a volume.

    Seen from there, an element dA at the distance r adds at most r dA/3 to the volume, r² dA/4 to the first and r³ dA/5
    to the second moments.
    """
    try:
        moments = solid_moments(vertices, np.concatenate([topology.corners, caps]))
    except MeshError:
        return None
    a, b, c = (vertices[caps[:, k]] - moments.centroid for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    reach = np.sqrt(np.max([np.sum(corner**2, axis=1) for corner in (a, b, c)], axis=0))
    volume = abs(moments.measure)
    added, first, second = (float(np.sum(areas * reach**k)) / (k + 2) for k in (1, 2, 3))
    if not added < volume:
        return None
    xx, _, _, yy, _, zz = np.abs(moments.second)
    shifted = first * first / (volume - added)
    return max(added / volume, (second + shifted) / max(yy + zz, xx + zz, xx + yy))


def _rounded_up(value: float) -> str:
    """Two digits that are no less than ``value``."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0.0 else 1e-12
    return f"{step * math.ceil(value / step + 1e-9):.2g}"


def _check_components(
    verdict: Verdict, topology: Topology, sums: Components, vertices: np.ndarray, triangles: np.ndarray
) -> None:
    """Outward or inward, cavities, parts that count twice; for a surface whose edges are balanced."""
    count, volume = topology.components, sums.volume
    if count == 1:
        verdict.inward = bool(volume[0] < 0.0)
    elif count > MAX_NESTED_COMPONENTS:
        verdict.inward = bool(np.sum(volume) < 0.0)
        message = f"{count} components are too many to check whether some overlap or lie inside others"
        verdict.add("components_unchecked", WARNING, message)
    else:
        nesting = component_nesting(vertices, triangles, topology.component, sums.lower, sums.upper)
        _check_nesting(verdict, nesting, volume)
        if nesting.crossing:
            closed = verdict.closed and not verdict.inward
            lie = topology.corners, topology.component, volume, nesting.depth
            whole = united_volume(vertices, *lie) if closed else None
            verdict.united = whole is not None and abs(float(np.sum(volume))) > (1.0 + NO_OVERLAP) * whole > 0.0
            _check_overlap(verdict, len(nesting.crossing), float(np.sum(volume)), whole)
    if verdict.inward:
        verdict.add("inward", WARNING, "all faces were wound inward and have been turned outward")


def _check_nesting(verdict: Verdict, nesting: Nesting, volume: np.ndarray) -> None:
    """Which of the components, of signed volume (k,), count with the wrong sign, and which overlap."""
    count = len(volume)
    expected = np.where(nesting.depth % 2 == 0, 1.0, -1.0)
    # What is undecided accuses no component.
    matters = (volume != 0.0) & nesting.decided
    wrong = matters & (np.sign(volume) != expected)
    verdict.inward = bool(np.all(wrong[matters]) and matters.any() and nesting.decided.all())
    cavities = int(np.count_nonzero((expected < 0.0) & (~wrong | verdict.inward)))
    if not verdict.inward:
        disjoint = int(np.count_nonzero(wrong & (expected > 0.0)))
        nested = int(np.count_nonzero(wrong & (expected < 0.0)))
        if disjoint:
            verdict.winding_consistent = False
            subtract = f"{disjoint} of {count} components wound inward, so that they would subtract"
            message = f"inconsistent winding: {subtract}"
            verdict.add("component_inward", ERROR, message, "--repair (mesh_repair) turns them")
        if nested:
            message = f"{counted(nested, 'component')} inside another and wound outward: their volume counts twice"
            if not nesting.crossing:
                hollow = float(np.sum(expected * np.abs(volume)))
                once = float(np.sum(counted_once(volume, nesting.inside) * np.abs(volume)))
                message += (
                    f"; the volume is {np.sum(volume):.4g} so, {hollow:.4g} with cavities, {once:.4g} as one solid"
                )
            remedy = "--repair (mesh_repair) makes cavities of them, --repair union one solid"
            verdict.add(NESTED, WARNING, message, remedy)
    if cavities:
        verdict.add("cavities", INFO, f"{counted(cavities, 'closed inner surface')} wound inward, taken as cavities")
    if not nesting.complete:
        verdict.add("components_unchecked", WARNING, "too many faces to check whether components overlap")


def _check_overlap(verdict: Verdict, pairs: int, volume: float, whole: float | None) -> None:
    """Components that cross: by how much their volumes' sum exceeds that of the union, ``whole``, where it is known."""
    overlap = f"{counted(pairs, 'pair')} of components overlap"
    if whole is None or not whole > 0.0:
        measure = "" if can_unite() else " (the extra [meshes] measures by how much)"
        verdict.add(OVERLAPPING, WARNING, f"{overlap}; the volume that they share counts twice{measure}")
        return
    over = abs(volume) / whole - 1.0
    if over <= NO_OVERLAP:
        verdict.add(OVERLAPPING, INFO, f"{overlap}, by less than {NO_OVERLAP:g} of the volume")
        return
    sum_of_parts = f"their volumes' sum of {abs(volume):.4g} would overcount {100.0 * over:.3g} %"
    remedy = "--repair union (mesh_repair) makes one surface of them, too"
    verdict.add(OVERLAPPING, WARNING, f"{overlap}; the solid is their union of {whole:.4g}: {sum_of_parts}", remedy)


def _check_size(verdict: Verdict, side: float) -> None:
    """Nothing can be computed of a surface whose longest side is zero, or so large or small that moments overflow."""
    verdict.usable = SIZE_RANGE[0] <= side <= SIZE_RANGE[1]
    if side == 0.0:
        verdict.add("zero_volume", ERROR, "all vertices lie in one point")
    elif not verdict.usable:
        sizes = "from {:g} to {:g}".format(*SIZE_RANGE)
        verdict.add("size", ERROR, f"the mesh is {side:.3g} across; moments are finite for sizes {sizes}")


def check_surface(vertices: np.ndarray, triangles: np.ndarray) -> tuple[Verdict, Topology | None]:
    """The verdict on triangles (m, 3) over vertices (n, 3), and the topology it rests on (None when unusable)."""
    verdict = Verdict()
    extent = referenced_extent(vertices, triangles)
    if len(triangles) == 0 or extent.not_finite:
        verdict.usable = verdict.watertight = verdict.winding_consistent = False
        if extent.not_finite:
            rows = f"{extent.not_finite} of {len(vertices)} vertices are not finite"
            verdict.add("nonfinite", ERROR, f"{rows}; the first is vertex {extent.first_not_finite}")
        else:
            verdict.add("no_faces", ERROR, "the mesh has no faces")
        return verdict, None
    topology = mesh_topology(vertices, triangles)
    verdict.components = topology.components
    half = 0.5 * extent.upper - 0.5 * extent.lower
    if extent.unused:
        message = f"vertices that belong to no face carry no mass: {extent.unused}"
        if not np.isfinite(vertices).all():
            message += "; what is not finite is taken to lie at the first face's first corner"
        verdict.add(UNREFERENCED, INFO, message)
    _check_size(verdict, 2.0 * float(half.max()))
    if not verdict.usable:
        return verdict, topology
    diagonal = 2.0 * float(np.linalg.norm(half))
    sums = component_sums(vertices, triangles, topology)
    _check_edges(verdict, topology, sums, vertices, half)
    if topology.unbalanced == 0:
        volume = float(np.sum(sums.volume))
        empty = abs(volume) <= NO_VOLUME * diagonal**3 and _no_volume(vertices, triangles, diagonal)
        if topology.components > 1 or not empty:
            _check_components(verdict, topology, sums, vertices, triangles)
        if empty and verdict.closed:
            verdict.add("zero_volume", ERROR, "the surface encloses no volume: it is flat, or folded onto itself")
        elif not empty and abs(volume) < THIN * diagonal**3:
            verdict.add("thin", INFO, f"thin body: its volume is {abs(volume) / diagonal**3:.1e} of its diagonal cubed")
        crossings = self_crossings(vertices, topology.corners, topology.component)
        if crossings:
            message = f"the surface passes through itself ({counted(crossings, 'pair')} of triangles)"
            verdict.add(SELF_CROSSING, WARNING, f"{message}; what it encloses twice counts twice")
    return verdict, topology


def _no_volume(vertices: np.ndarray, triangles: np.ndarray, diagonal: float) -> bool:
    """Whether the volume, taken in pair arithmetic, is below rounding of area × diagonal."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
    try:
        volume = solid_moments(vertices, triangles, path="compensated").measure
    except MeshError:
        return True
    return abs(volume) <= NO_VOLUME * 1e-2 * area * diagonal
