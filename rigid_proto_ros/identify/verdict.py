# SPDX-License-Identifier: MIT
"""What a motion identifies of a body: the directions in which its Fisher information vanishes, in physical words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..mass.tensor import principal_axes
from .fitting import Estimate
from .unknowns import STEP, Unknowns, Values

MOST_RELATIVE = 0.5
"""A standard deviation of more than half of the quantity itself says nothing: neither the number nor its
error is printed.
"""
LEAST_SHARE = 1e-3
"""A quantity that changes by more than this part of itself along a direction that isn't identified isn't
identified either.
"""
ROUNDING = 0.5
"""Where longer difference quotients leave less than this part of the information, by its root, it is rounding."""
NAMED = 0.98
"""Part of a named direction's square that must lie among those that aren't identified."""

DOUBTED = 0.01
"""Standard deviations above this are tried out: a spin whose wobble is only noise seems to identify too much."""
TRIED = 4.0
"""So many standard deviations away the fit is tried again, with other starts."""
LEAST_RISE = 4.0
"""Of the sum of squares there, where sixteen is expected."""

POKE = "one poke of a known force beside the centre of mass"
TUMBLE = "a motion that tumbles about several axes"
_REMEDIES = {
    "mass": "one poke of a known force, or --mass",
    "size of the tensor": f"{POKE}, or a known torque",
    "mass, tensor and damping by one factor": f"{POKE}, or --mass",
}
COORDINATES = {
    "mass": ("mass",),
    "inertia": (
        *("size of the tensor", "ratio of the largest moment to the others", "ratio of the two smaller moments"),
        *("turn of axes 2 and 3", "turn of axes 1 and 3", "turn of axes 1 and 2"),
    ),
    "com": ("centre of mass along x", "centre of mass along y", "centre of mass along z"),
}
"""Axes 1, 2, 3 are those of the moments, ascending; x, y, z those of the tracked frame."""
UNITS = {"damping": 1.0, "gravity": 1.0, "offset": 0.01, "gyro_bias": 0.1, "accel_bias": 1.0, "imu_place": 0.1}
"""Of what a standard deviation is to be small for it to be identified: N s/m and N m s by the body's own, m/s²,
s, rad/s, m/s², m.
"""


@dataclass(frozen=True)
class Unidentified:
    """A direction that isn't identified: what it is, and what would identify it."""

    what: str
    remedy: str


@dataclass(frozen=True)
class Quantity:
    """A number with its standard deviation; both None where it isn't identified."""

    value: float | None
    sd: float | None


class Identifiability:
    """Which directions of the unknowns the flights identify, in coordinates in which 1 is a large change."""

    def __init__(self, estimate: Estimate, length: float) -> None:
        """length: by which an error of the centre of mass is called large [m]."""
        self.unknowns, self.values = estimate.unknowns, estimate.values
        self.names, self._units = _coordinates(estimate.unknowns, estimate.values, length)
        root = estimate.root * self._units
        # Fewer rows than columns: the rest of the directions has no information at all.
        short = root.shape[1] - root.shape[0]
        root = np.vstack([root, np.zeros((max(short, 0), root.shape[1]))])
        _, self.roots, directions = np.linalg.svd(root, full_matrices=False)
        self._directions = directions.T
        wide = np.linalg.norm((estimate.root_wide * self._units) @ self._directions, axis=0)
        self._unidentified = (self.roots < 1.0 / MOST_RELATIVE) | (wide < ROUNDING * self.roots)
        for k in np.flatnonzero(~self._unidentified & (self.sds > DOUBTED)):
            far = min(TRIED * float(self.sds[k]), MOST_RELATIVE) * self._units * self._directions[:, k]
            self._unidentified[k] = min(estimate.rise(far), estimate.rise(-far)) < LEAST_RISE

    @property
    def sds(self) -> np.ndarray:
        """Standard deviations along all directions, ascending."""
        return 1.0 / np.maximum(self.roots, 1e-300)

    @cached_property
    def unidentified(self) -> list[Unidentified]:
        """The directions that aren't identified, named."""
        space = self._directions[:, self._unidentified]
        found: list[Unidentified] = []
        for what, vector in self._named():
            if space.shape[1] and np.sum((space.T @ vector) ** 2) > NAMED:
                found.append(Unidentified(what, self._remedy(what)))
                # What is left of the space is at right angles to it.
                space = space - np.outer(vector, vector @ space)
                space = _orthonormal(space)
        for direction in space.T:
            largest = [self.names[k] for k in np.argsort(-np.abs(direction))[:3] if abs(direction[k]) > 0.2]
            found.append(Unidentified(f"a mixture of {', '.join(largest)}", f"{TUMBLE}, {POKE}"))
        return found

    def _named(self) -> list[tuple[str, np.ndarray]]:
        unit = np.eye(len(self.names))
        named = [(name, unit[k]) for k, name in enumerate(self.names)]
        named += self._com_along_axes()
        factor = [k for k, name in enumerate(self.names) if name in ("mass", "size of the tensor") or "damping" in name]
        if len(factor) > 1:
            vector = unit[factor].sum(axis=0)
            named.append(("mass, tensor and damping by one factor", vector / np.linalg.norm(vector)))
        return named

    def _com_along_axes(self) -> list[tuple[str, np.ndarray]]:
        if "com" not in self.unknowns:
            return []
        first = self.names.index(COORDINATES["com"][0])
        _, axes = principal_axes(self.values.inertia)
        named = []
        for k in range(3):
            vector = np.zeros(len(self.names))
            vector[first : first + 3] = axes[:, k]
            named.append((f"centre of mass along principal axis {k + 1}", vector))
        return named

    def _remedy(self, what: str) -> str:
        if what in _REMEDIES:
            return _REMEDIES[what]
        if what.startswith("centre of mass"):
            return "a spin about an axis at right angles to it"
        if what.startswith(("ratio", "turn")):
            return TUMBLE
        return "a longer recording, or a given value"

    def quantity(self, of: Callable[[Values], float]) -> Quantity:
        """A function of the estimate with its standard deviation, or nothing where a direction that isn't
        identified changes it.
        """
        gradient = np.empty(len(self.unknowns))
        for k, step in enumerate(STEP * self.unknowns.scales(self.values)):
            change = step * np.eye(len(gradient))[k]
            sides = [of(self.unknowns.moved(self.values, sign * change)) for sign in (1.0, -1.0)]
            gradient[k] = (sides[0] - sides[1]) / (2.0 * step)
        along = self._directions.T @ (self._units * gradient)
        size = float(np.linalg.norm(along))
        if np.any(np.abs(along[self._unidentified]) > LEAST_SHARE * size):
            return Quantity(None, None)
        good = ~self._unidentified
        return Quantity(float(of(self.values)), float(np.linalg.norm(along[good] / self.roots[good])))


def _coordinates(unknowns: Unknowns, values: Values, length: float) -> tuple[list[str], np.ndarray]:
    """Names of the unknowns, and what is much of each (n,)."""
    names, units = [], []
    for k, (group, index) in enumerate(unknowns.slots):
        names.append(COORDINATES[group][index] if group in COORDINATES else unknowns.name(k).replace("_", " "))
        unit = length if group == "com" else UNITS.get(group, 1.0)
        if group == "damping":
            unit = values.mass if index == 0 else float(np.trace(values.inertia)) / 3.0
        units.append(unit)
    return names, np.array(units)


def _orthonormal(space: np.ndarray) -> np.ndarray:
    """A basis of the columns that aren't nothing."""
    left, sizes, _ = np.linalg.svd(space, full_matrices=False)
    return left[:, sizes > 0.5]


def summary(unidentified: Sequence[Unidentified], identified: Sequence[str]) -> str:
    """The verdict in a sentence or two."""
    if not unidentified:
        return "everything that was asked for is identified from this motion"
    found = ", ".join(identified) or "nothing that was asked for"
    return f"identified from this motion: {found}; not identified: {', '.join(one.what for one in unidentified)}"
