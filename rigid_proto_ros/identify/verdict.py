# SPDX-License-Identifier: MIT
"""What a motion identifies of a body: the directions in which its Fisher information vanishes, in physical words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import mass_parameters as mp
from .fitting import Estimate
from .unknowns import Unknowns, Values
from .variable_projection import Problem

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
TUMBLE = "a flight that tumbles about several axes"
_REMEDIES = {
    "mass": "one poke of a known force, or --mass",
    "size of the tensor": f"{POKE}, or a known torque",
    "mass, tensor and damping by one factor": f"{POKE}, or --mass",
}
UNITS = {"damping": 1.0, "gravity": 1.0, "offsets": 0.01, "gyro_bias": 0.1, "accel_bias": 1.0, "imu_place": 0.1}
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
    """Which directions of the unknowns the flights identify, in coordinates in which 1 is a large change:
    (``mass_parameters.COORDINATES``, then the others).
    """

    def __init__(self, estimate: Estimate, length: float) -> None:
        """length: by which an error of the centre of mass is called large [m]."""
        self.unknowns, self.values = estimate.unknowns.physical, estimate.values
        self.names, self._to_physical = _coordinates(estimate.unknowns, estimate.values, length)
        back = np.linalg.inv(self._to_physical)
        root = estimate.root @ back
        # Fewer rows than columns: the rest of the directions has no information at all.
        short = root.shape[1] - root.shape[0]
        root = np.vstack([root, np.zeros((max(short, 0), root.shape[1]))])
        _, self.roots, directions = np.linalg.svd(root, full_matrices=False)
        self._directions = directions.T
        wide = np.linalg.norm(estimate.root_wide @ back @ self._directions, axis=0)
        self._unidentified = (self.roots < 1.0 / MOST_RELATIVE) | (wide < ROUNDING * self.roots)
        for k in np.flatnonzero(~self._unidentified & (self.sds > DOUBTED)):
            self._unidentified[k] = not _is_confirmed(estimate, back @ self._directions[:, k], float(self.sds[k]))

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
        if mp.COORDINATES[-1] not in self.names:
            return []
        first = self.names.index(mp.COORDINATES[7])
        _, axes = mp.principal(self.values.theta)
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
        return "a longer flight, or a given value"

    def count_identified(self, count: int) -> int:
        """How many of the directions among the first ``count`` coordinates are identified."""
        return count - int(np.linalg.matrix_rank(self._directions[:count, self._unidentified], tol=0.5))

    def quantity(self, of: Callable[[Values], float]) -> Quantity:
        """A function of the estimate with its standard deviation, or nothing where a direction that isn't
        identified changes it.
        """
        base, steps = self.unknowns.read(self.values), self.unknowns.steps(self.values)
        gradient = np.empty(len(base))
        for k, step in enumerate(steps):
            sides = []
            for sign in (1.0, -1.0):
                numbers = base.copy()
                numbers[k] += sign * step
                sides.append(of(self.unknowns.put(self.values, numbers)))
            gradient[k] = (sides[0] - sides[1]) / (2.0 * step)
        along = self._directions.T @ np.linalg.solve(self._to_physical.T, gradient)
        size = float(np.linalg.norm(along))
        if np.any(np.abs(along[self._unidentified]) > LEAST_SHARE * size):
            return Quantity(None, None)
        good = ~self._unidentified
        return Quantity(float(of(self.values)), float(np.linalg.norm(along[good] / self.roots[good])))


def _is_confirmed(estimate: Estimate, direction: np.ndarray, sd: float) -> bool:
    """Whether the flights contradict a body far away along a direction of the physical unknowns, whatever
    their starts were.
    """
    problem = Problem(estimate.segments, estimate.starts, estimate.values, estimate.unknowns.physical)
    best = problem.residuals(problem.first)
    for side in (1.0, -1.0):
        tried = Problem(estimate.segments, estimate.starts, estimate.values, estimate.unknowns.physical)
        there = tried.residuals(tried.first + side * min(TRIED * sd, MOST_RELATIVE) * direction)
        if there @ there - best @ best < LEAST_RISE:
            return False
    return True


def _coordinates(unknowns: Unknowns, values: Values, length: float) -> tuple[list[str], np.ndarray]:
    """Names of the coordinates in which 1 is much, and their change with the (physical) unknowns (n, n)."""
    body = values.body
    names, matrix = [], np.zeros((len(unknowns), len(unknowns)))
    for k, (name, index) in enumerate(unknowns.slots):
        matrix[k, k] = 1.0
        if name == "theta" and index == mp.MASS:
            names.append(mp.COORDINATES[mp.MASS])
            # The tensor for each kg stays: so its size grows with the mass.
            matrix[k, k] = 2.0
            for other, slot in enumerate(unknowns.slots):
                if slot == ("tensor_change", 0):
                    matrix[other, k] = 2.0
        elif name == "theta":
            names.append(mp.COORDINATES[index])
            matrix[k, k] = 1.0 / length
        elif name == "tensor_change":
            names.append(mp.COORDINATES[1 + index])
        else:
            unit = UNITS[name]
            if name == "damping":
                unit = body.mass if index == 0 else float(np.trace(body.inertia)) / 3.0
            names.append(unknowns.names[k].replace("_", " "))
            matrix[k, k] = 1.0 / unit
    return names, matrix


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
