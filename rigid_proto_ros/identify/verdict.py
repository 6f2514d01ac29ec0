# SPDX-License-Identifier: MIT
"""What a motion can tell of a body, before any number: the directions in which its Fisher information is
nothing, in physical words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from . import mass_parameters as mp
from . import shooting as sh
from .fitting import Estimate
from .unknowns import Unknowns, Values

MOST_RELATIVE = 0.5
"""A standard deviation of more than half of what is looked for says nothing: neither the number nor its
error is printed.
"""
LEAST_SHARE = 1e-3
"""A quantity that changes by more than this part of itself along a direction that can't be seen can't be
seen either.
"""
ROUNDING = 0.5
"""Where longer difference quotients leave less than this part of the information, by its root, it is rounding."""
NAMED = 0.98
"""Part of a named direction's square that must lie among those that can't be seen."""

DOUBTED = 0.01
"""Standard deviations above this are tried out: a spin whose wobble is only noise seems to tell what it doesn't."""
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
"""Of what a standard deviation is to be small for it to be seen: N s/m and N m s by the body's own, m/s²,
s, rad/s, m/s², m.
"""


@dataclass(frozen=True)
class Hidden:
    """A direction that can't be seen: what it is, and what would make it visible."""

    what: str
    remedy: str


@dataclass(frozen=True)
class Quantity:
    """A number with its standard deviation; both None where the motion can't tell it."""

    value: float | None
    sd: float | None


class Visibility:
    """Which directions of the unknowns a flight tells, in coordinates in which 1 is much:
    (``mass_parameters.SEEN``, then the others).
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
        self._hidden = (self.roots < 1.0 / MOST_RELATIVE) | (wide < ROUNDING * self.roots)
        for k in np.flatnonzero(~self._hidden & (self.sds > DOUBTED)):
            self._hidden[k] = not _withstands(estimate, back @ self._directions[:, k], float(self.sds[k]))

    @property
    def sds(self) -> np.ndarray:
        """Standard deviations along all directions, ascending."""
        return 1.0 / np.maximum(self.roots, 1e-300)

    @cached_property
    def hidden(self) -> list[Hidden]:
        """The directions that can't be seen, named."""
        space = self._directions[:, self._hidden]
        found: list[Hidden] = []
        for what, vector in self._named():
            if space.shape[1] and np.sum((space.T @ vector) ** 2) > NAMED:
                found.append(Hidden(what, self._remedy(what)))
                # What is left of the space is at right angles to it.
                space = space - np.outer(vector, vector @ space)
                space = _orthonormal(space)
        for direction in space.T:
            largest = [self.names[k] for k in np.argsort(-np.abs(direction))[:3] if abs(direction[k]) > 0.2]
            found.append(Hidden(f"a mixture of {', '.join(largest)}", f"{TUMBLE}, {POKE}"))
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
        if mp.SEEN[-1] not in self.names:
            return []
        first = self.names.index(mp.SEEN[7])
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
            return "a spin about an axis across it"
        if what.startswith(("ratio", "turn")):
            return TUMBLE
        return "a longer flight, or a given value"

    def told(self, count: int) -> int:
        """How many of the directions among the first ``count`` coordinates can be seen."""
        return count - int(np.linalg.matrix_rank(self._directions[:count, self._hidden], tol=0.5))

    def quantity(self, of: Callable[[Values], float]) -> Quantity:
        """A function of the estimate with its standard deviation, or nothing where a direction that can't
        be seen changes it.
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
        if np.any(np.abs(along[self._hidden]) > LEAST_SHARE * size):
            return Quantity(None, None)
        seen = ~self._hidden
        return Quantity(float(of(self.values)), float(np.linalg.norm(along[seen] / self.roots[seen])))


def _withstands(estimate: Estimate, direction: np.ndarray, sd: float) -> bool:
    """Whether the flights contradict a body far away along a direction of the physical unknowns, whatever
    their starts were.
    """
    problem = sh.Problem(estimate.segments, estimate.starts, estimate.values, estimate.unknowns.physical)
    best = problem.residuals(problem.first)
    for side in (1.0, -1.0):
        tried = sh.Problem(estimate.segments, estimate.starts, estimate.values, estimate.unknowns.physical)
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
            names.append(mp.SEEN[mp.MASS])
            # The tensor for each kg stays: so its size grows with the mass.
            matrix[k, k] = 2.0
            for other, slot in enumerate(unknowns.slots):
                if slot == ("tensor_change", 0):
                    matrix[other, k] = 2.0
        elif name == "theta":
            names.append(mp.SEEN[index])
            matrix[k, k] = 1.0 / length
        elif name == "tensor_change":
            names.append(mp.SEEN[1 + index])
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


def summary(hidden: Sequence[Hidden], seen: Sequence[str]) -> str:
    """The verdict in a sentence or two."""
    if not hidden:
        return "this motion tells all that was asked for"
    told = f"this motion tells {', '.join(seen)}; " if seen else "this motion tells nothing of what was asked for; "
    return told + "it can't tell " + ", ".join(one.what for one in hidden)
