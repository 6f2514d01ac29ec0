# SPDX-License-Identifier: MIT
"""A verdict on a surface before any number is taken from it: what is wrong, how much, and what can be done."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..base.compilation import njit
from ..mesh.nesting import component_nesting
from ..mesh.topology import Topology, component_volumes, mesh_topology

INFO, WARNING, ERROR = "info", "warning", "error"
MAX_NESTED_COMPONENTS = 2000
"""Above this many components their mutual position isn't examined: the tables grow with the square."""
THIN = 1e-6
"""V/diagonal³ below which a body is called thin: a 1 x 1 x 1e-5 plate has 4e-6, a needle less."""
NO_VOLUME = 1e-14
"""V/(area·diagonal) below which the surface encloses nothing: both sides coincide to rounding."""
NONPLANAR = 1e-9
"""Largest distance of a corner from its polygon's plane, over the mesh's diagonal, that counts as planar."""
LARGE_M, SMALL_M = 50.0, 1e-3
"""Longest sides [m] outside which millimetres taken for metres, or the reverse, are suspected."""


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
    surface bounds a solid; ``reason``: why not; ``inward``: it is wound inward throughout and is to be turned."""

    findings: list[Finding] = field(default_factory=list)
    usable: bool = True
    closed: bool = True
    reason: str = ""
    watertight: bool = True
    winding_consistent: bool = True
    inward: bool = False
    components: int = 0

    def add(self, code: str, severity: str, message: str, remedy: str = "") -> None:
        """Append a finding; an error also closes the way to the solid, the first one giving the reason."""
        self.findings.append(Finding(code, severity, f"{message}; {remedy}" if remedy else message))
        if severity == ERROR:
            self.closed = False
            self.reason = self.reason or message


def unit_suspicion(longest_side: float) -> Finding | None:
    """A remark when a body of ``longest_side`` [m] looks as if its file weren't in metres."""
    if longest_side > LARGE_M:
        message = f"the body is {longest_side:.4g} m across; if the file is in millimetres, use --scale 0.001 (scale)"
        return Finding("unit_suspicion", WARNING, message)
    if longest_side < SMALL_M:
        message = (
            f"the body is {longest_side:.4g} m across; if the file isn't in metres, set the unit with --scale (scale)"
        )
        return Finding("unit_suspicion", WARNING, message)
    return None


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


@njit(cache=True, nogil=True)
def _polygon_planarity(vertices, triangles, starts, reference):
    """(non-planar polygons' largest distance from the Newell plane, spread of the volume over their fans).

    The spread sums, over polygons of up to 64 corners, the range of the signed volume between the fans from each of
    its corners; larger polygons are compared from the first and the middle corner.
    """
    deviation = 0.0
    spread = 0.0
    for polygon in range(starts.shape[0] - 1):
        first, last = starts[polygon], starts[polygon + 1]
        n = last - first + 2
        if n < 4:
            continue
        p = np.empty((n, 3))
        for k in range(n):
            if k == 0:
                v = triangles[first, 0]
            elif k == 1:
                v = triangles[first, 1]
            else:
                v = triangles[first + k - 2, 2]
            for a in range(3):
                p[k, a] = vertices[v, a] - reference[a]
        center = np.zeros(3)
        normal = np.zeros(3)
        for k in range(n):
            m = (k + 1) % n
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                center[a] += p[k, a] / n
                normal[a] += (p[k, b] - p[0, b]) * (p[m, c] - p[0, c]) - (p[k, c] - p[0, c]) * (p[m, b] - p[0, b])
        size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        if size > 0.0:
            for k in range(n):
                height = 0.0
                for a in range(3):
                    height += (p[k, a] - center[a]) * normal[a] / size
                deviation = max(deviation, abs(height))
        low, high = np.inf, -np.inf
        step = 1 if n <= 64 else n // 2
        for base in range(0, n, step):
            volume = 0.0
            for k in range(1, n - 1):
                i, j = (base + k) % n, (base + k + 1) % n
                for a in range(3):
                    b, c = (a + 1) % 3, (a + 2) % 3
                    cross = (p[i, b] - p[base, b]) * (p[j, c] - p[base, c]) - (p[i, c] - p[base, c]) * (
                        p[j, b] - p[base, b]
                    )
                    volume += (p[base, a] - center[a]) * cross / 6.0
            low, high = min(low, volume), max(high, volume)
        spread += high - low
    return deviation, spread


def _judge_edges(verdict: Verdict, topology: Topology, vertices, triangles, half: np.ndarray) -> None:
    """Open, inconsistently wound, duplicated: each with how much the volume would depend on the origin."""
    verdict.watertight = topology.watertight
    verdict.winding_consistent = topology.flipped == 0
    copies = int(np.count_nonzero(topology.duplicates))
    if copies:
        verdict.add(
            "duplicate_faces",
            ERROR,
            f"{_count(copies, 'duplicate face')}, which would count twice",
            "--repair (mesh_repair) removes the copies",
        )
    if topology.unbalanced:
        volume, area, _, _ = component_volumes(vertices, triangles, np.zeros(len(triangles), np.int64), 1)
        swing = float(np.sum(np.abs(area[0]) * half)) / 3.0
        ambiguous = f"volume ambiguous: {volume[0] - swing:.3g} to {volume[0] + swing:.3g}, depending on how"
        if not topology.watertight:
            uses = topology.edges[:, 2] + topology.edges[:, 3]
            odd = int(np.count_nonzero(uses % 2))
            edges = _count(len(topology.boundary), "boundary edge")
            if odd > len(topology.boundary):
                edges += f" and {_count(odd - len(topology.boundary), 'edge')} of 3 or more faces"
            verdict.add(
                "open",
                ERROR,
                f"open surface with {edges}; {ambiguous} holes are closed",
                "--repair (mesh_repair) welds edges and caps holes",
            )
        if topology.flipped:
            verdict.add(
                "inconsistent_winding",
                ERROR,
                f"inconsistent winding: {_count(topology.flipped, 'edge')} used twice in the same direction; {ambiguous} faces are turned",
                "--repair (mesh_repair) turns faces",
            )
    if topology.nonmanifold and not topology.unbalanced and not copies:
        verdict.add(
            "non_manifold",
            INFO,
            f"{_count(topology.nonmanifold, 'edge')} shared by more than two faces, which are wound consistently",
        )
    if topology.opposites:
        verdict.add(
            "opposite_faces",
            WARNING,
            f"{_count(topology.opposites, 'face')} coinciding with another one that is wound the other way",
        )
    if topology.degenerate:
        verdict.add(
            "degenerate_faces", INFO, f"{_count(topology.degenerate, 'triangle')} without area, which have no effect"
        )


def _judge_components(verdict: Verdict, topology: Topology, vertices, triangles) -> None:
    """Outward or inward, cavities, parts that count twice; for a surface whose edges are balanced."""
    count = topology.components
    volume, _, lower, upper = component_volumes(vertices, triangles, topology.component, count)
    if count == 1:
        verdict.inward = bool(volume[0] < 0.0)
    elif count > MAX_NESTED_COMPONENTS:
        verdict.inward = bool(np.sum(volume) < 0.0)
        verdict.add(
            "components_unchecked",
            WARNING,
            f"{count} components are too many to check whether some overlap or lie inside others",
        )
        inward = int(np.count_nonzero(volume < 0.0))
        if 0 < inward < count:
            verdict.add("component_inward", WARNING, f"{inward} of {count} components subtract from the volume")
    else:
        nesting = component_nesting(vertices, triangles, topology.component, lower, upper)
        expected = np.where(nesting.depth % 2 == 0, 1.0, -1.0)
        # What is undecided accuses no component.
        matters = (volume != 0.0) & nesting.decided
        wrong = matters & (np.sign(volume) != expected)
        verdict.inward = bool(np.all(wrong[matters]) and matters.any() and nesting.decided.all())
        if not verdict.inward:
            disjoint = int(np.count_nonzero(wrong & (expected > 0.0)))
            nested = int(np.count_nonzero(wrong & (expected < 0.0)))
            if disjoint:
                verdict.winding_consistent = False
                verdict.add(
                    "component_inward",
                    ERROR,
                    f"inconsistent winding: {disjoint} of {count} components wound inward, so that they would subtract",
                    "--repair (mesh_repair) turns them",
                )
            if nested:
                verdict.add(
                    "nested_components",
                    WARNING,
                    f"{_count(nested, 'component')} inside another and wound outward, so that their volume counts twice; "
                    "--repair (mesh_repair) makes cavities of them",
                )
        cavities = int(np.count_nonzero((expected < 0.0) & ~wrong)) if not verdict.inward else 0
        if verdict.inward:
            cavities = int(np.count_nonzero(expected < 0.0))
        if cavities:
            verdict.add("cavities", INFO, f"{_count(cavities, 'closed inner surface')} wound inward, taken as cavities")
        if nesting.crossing:
            verdict.add(
                "overlapping_components",
                WARNING,
                f"{_count(len(nesting.crossing), 'pair')} of components overlap; the volume that they share counts twice",
            )
        if not nesting.complete:
            verdict.add("components_unchecked", WARNING, "too many faces to check whether components overlap")
    if verdict.inward:
        verdict.add("inward", WARNING, "all faces were wound inward and have been turned outward")


def judge_surface(
    vertices: np.ndarray, triangles: np.ndarray, polygon_starts: np.ndarray | None = None
) -> tuple[Verdict, Topology | None]:
    """The verdict on triangles (m, 3) over vertices (n, 3), and the topology it rests on (None when unusable).

    polygon_starts (p + 1,) as in a mesh: which fan triangles make up a polygon; None when each is its own.
    """
    verdict = Verdict()
    bad = ~np.isfinite(vertices)
    if bad.any():
        rows = int(np.count_nonzero(bad.any(axis=1)))
        where = int(np.argmax(bad.any(axis=1)))
        verdict.usable = verdict.watertight = verdict.winding_consistent = False
        verdict.add(
            "nonfinite", ERROR, f"{rows} of {len(vertices)} vertices are not finite; the first is vertex {where}"
        )
        return verdict, None
    if len(triangles) == 0:
        verdict.usable = verdict.watertight = verdict.winding_consistent = False
        verdict.add("no_faces", ERROR, "the mesh has no faces")
        return verdict, None
    topology = mesh_topology(vertices, triangles)
    verdict.components = topology.components
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles.ravel()] = True
    points = vertices[used]
    lower, upper = points.min(axis=0), points.max(axis=0)
    half = 0.5 * upper - 0.5 * lower
    diagonal = 2.0 * float(np.linalg.norm(half))
    if not used.all():
        spare = int(len(used) - np.count_nonzero(used))
        verdict.add("unreferenced_vertices", INFO, f"{spare} vertices belong to no face; they carry no mass")
    if diagonal == 0.0:
        verdict.usable = False
        verdict.add("zero_volume", ERROR, "all vertices lie in one point")
        return verdict, topology
    _judge_edges(verdict, topology, vertices, triangles, half)
    if topology.unbalanced == 0:
        volume = component_volumes(vertices, triangles, np.zeros(len(triangles), np.int64), 1)[0][0]
        empty = abs(volume) <= NO_VOLUME * diagonal**3 and _no_volume(vertices, triangles, diagonal)
        if topology.components > 1 or not empty:
            _judge_components(verdict, topology, vertices, triangles)
        if empty and verdict.closed:
            verdict.add("zero_volume", ERROR, "the surface encloses no volume: it is flat, or folded onto itself")
        elif not empty and abs(volume) < THIN * diagonal**3:
            verdict.add("thin", INFO, f"thin body: its volume is {abs(volume) / diagonal**3:.1e} of its diagonal cubed")
    if polygon_starts is not None:
        deviation, spread = _polygon_planarity(vertices, triangles, polygon_starts, 0.5 * lower + 0.5 * upper)
        if deviation > NONPLANAR * diagonal:
            verdict.add(
                "nonplanar_polygons",
                INFO,
                f"non-planar polygons, triangulated from their first corner: corners lie up to {deviation:.2g} off the plane; "
                f"other triangulations would change the volume by up to {spread:.2g}",
            )
    return verdict, topology


def _no_volume(vertices, triangles, diagonal: float) -> bool:
    """Whether the volume, taken in pair arithmetic, is below rounding of area × diagonal."""
    from ..base.errors import MeshError
    from .moments import solid_moments

    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
    try:
        volume = solid_moments(vertices, triangles, path="compensated").measure
    except MeshError:
        return True
    return abs(volume) <= NO_VOLUME * 1e-2 * area * diagonal
