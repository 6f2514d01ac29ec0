# SPDX-License-Identifier: MIT
"""The solid of a body of parts: the sum of theirs, each about its own centre and moved by the parallel-axis theorem, in
rational numbers, so that only the parts' own moments round; and where parts overlap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.vectors import IntArray, Points, Triangles
from ..mesh.intersection import nesting_of
from ..mesh.parts import DENSITY
from ..mesh.solids import MAX_UNITED, can_unite, shared_volume
from .moments import Moments, extent, solid_moments
from .properties import MeshMoments
from .verdict import INFO, NO_OVERLAP, WARNING, Finding

MAX_FACES = 2_000_000
"""Faces of all parts up to which it is examined whether some overlap: some seconds."""


@dataclass(frozen=True)
class SolidPart:
    """surface: vertices (n, 3) in the body's coordinates, and outward triangles (m, 3), of its solid. mass [kg]; where
    it is 0 the density [kg/m³] decides. wall_thickness [m]: of a printed part, and 0 of a solid one; infill: its own.
    """

    name: str
    surface: Callable[[], tuple[Points, Triangles]]
    density: float
    mass: float = 0.0
    wall_thickness: float = 0.0
    infill: float = 0.0

    @cached_property
    def solid(self) -> Moments:
        """Moments at unit density; raises MeshError where the surface encloses no volume."""
        return solid_moments(*self.surface())

    @cached_property
    def printed(self) -> tuple[Moments, float]:
        """Moments at unit density, and their error relative to mass or tensor: of walls and infill, or of the solid.
        Raises MeshError, also for walls that are too thick.
        """
        if self.wall_thickness == 0.0:
            return self.solid, 0.0
        try:
            return MeshMoments(*self.surface()).printed(1.0, self.wall_thickness, self.infill)
        except InputError as error:
            raise MeshError(f"part {self.name}, {error.field}", error.received, error.accepted) from None

    @property
    def volume(self) -> float:
        """[m³]"""
        return self.solid.measure

    @property
    def own_mass(self) -> Fraction:
        """[kg]"""
        return Fraction(self.mass) if self.mass > 0.0 else Fraction(self.density) * Fraction(self.printed[0].measure)


SLOTS = tuple((i, j) for i in range(3) for j in range(i, 3))
"""Of second moments, in their order."""


def sum_of_parts(parts: Sequence[SolidPart]) -> Moments:
    """The parts as one solid whose density is 1 where it is DENSITY in truth: its measure is their mass in units of
    DENSITY, so that their own masses are what this density gives.
    """
    masses, moments = [part.own_mass for part in parts], [part.printed[0] for part in parts]
    centers = [[sum(map(Fraction, at)) for at in zip(*_center_of(own), strict=True)] for own in moments]
    whole = sum(masses, Fraction(0))
    middle = [sum((m * c[k] for m, c in zip(masses, centers, strict=True)), Fraction(0)) / whole for k in range(3)]
    second = np.empty(6)
    for slot, (i, j) in enumerate(SLOTS):
        total = Fraction(0)
        for one, mass, center in zip(moments, masses, centers, strict=True):
            own = Fraction(float(one.second[slot])) / Fraction(one.measure)
            total += mass * (own + (center[i] - middle[i]) * (center[j] - middle[j]))
        second[slot] = float(total / Fraction(DENSITY))
    reference = np.array([float(x) for x in middle])
    low = np.array([float(x - Fraction(float(r))) for x, r in zip(middle, reference, strict=True)])
    return Moments(float(whole / Fraction(DENSITY)), reference, np.zeros(3), low, second)


def _center_of(moments: Moments) -> tuple[list[float], list[float], list[float]]:
    return moments.reference.tolist(), moments.center.tolist(), moments.center_low.tolist()


def overlaps_of(parts: Sequence[SolidPart]) -> list[Finding]:
    """Which parts overlap, and by how much where manifold3d is installed. Raises MeshError for one that is no solid."""
    surfaces = [part.surface() for part in parts]
    boxes = [extent(*surface)[:2] for surface in surfaces]
    lower, upper = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
    near = np.all((lower[:, None] < upper[None]) & (lower[None] < upper[:, None]), axis=2)
    np.fill_diagonal(near, False)
    if not near.any():
        return []
    asked = np.flatnonzero(near.any(axis=1))
    counts = [len(surfaces[k][1]) for k in asked]
    if sum(counts) > MAX_FACES:
        return [Finding("parts_unchecked", INFO, f"{sum(counts)} faces are too many to check whether parts overlap")]
    starts = np.cumsum([0, *(len(surfaces[k][0]) for k in asked)])
    vertices = np.concatenate([surfaces[k][0] for k in asked])
    faces: IntArray = np.concatenate([surfaces[k][1] + start for k, start in zip(asked, starts[:-1], strict=True)])
    component = np.repeat(np.arange(len(asked)), counts)
    nesting = nesting_of(vertices, faces, component, lower[asked], upper[asked])
    found = []
    for one, other in zip(*np.nonzero(np.triu(nesting.crossing | nesting.inside | nesting.inside.T)), strict=True):
        a, b = int(asked[one]), int(asked[other])
        contained = bool(nesting.inside[one, other] or nesting.inside[other, one])
        finding = _overlap(parts[a], parts[b], contained)
        if finding is not None:
            found.append(finding)
    if not nesting.complete:
        found.append(Finding("parts_unchecked", INFO, "there are too many faces to check whether all parts overlap"))
    return found


def _overlap(one: SolidPart, other: SolidPart, contained: bool) -> Finding | None:
    """What there is to say of two parts whose surfaces cross, or one of which lies in the other."""
    small, large = sorted((one, other), key=lambda part: part.solid.measure)
    twice = "what they share counts with both densities"
    if contained:
        return Finding("parts_overlap", WARNING, f"part {small.name} lies within part {large.name}: {twice}")
    volume = None
    faces = len(one.surface()[1]) + len(other.surface()[1])
    if can_unite() and faces <= MAX_UNITED:
        try:
            volume = shared_volume(one.surface(), other.surface())
        except MeshError:
            volume = None
    if volume is None:
        by = "" if can_unite() else " (the extra [meshes] measures by how much)"
        return Finding("parts_overlap", WARNING, f"parts {one.name} and {other.name} overlap: {twice}{by}")
    share = volume / small.solid.measure
    if share <= NO_OVERLAP:
        return None
    told = f"parts {one.name} and {other.name} overlap, by {100.0 * share:.3g} % of {small.name}: {twice}"
    return Finding("parts_overlap", WARNING, told)
