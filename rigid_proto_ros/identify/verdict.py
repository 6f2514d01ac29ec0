# SPDX-License-Identifier: MIT
"""What a motion identifies of a body: the directions in which its Fisher information vanishes, in physical terms; and
whether the residuals are noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc

from ..base.vectors import FloatArray, Numbers, Points
from .fitting import Estimate, residuals_of
from .initial_estimate import noise_by_differences
from .measurements import ATTITUDE, UNITS, MeasuredFlight
from .unknowns import Unknowns, Values

MOST_RELATIVE = 0.5
"""Largest standard deviation relative to the quantity. Above it neither the number nor its error is printed."""
LEAST_SHARE = 1e-3
"""A quantity isn't identified if it changes by more than this fraction along a direction that isn't identified."""
NAMED = 0.98
"""Least fraction of a named direction's square in the space that isn't identified."""
DOUBTED = 0.01
"""Standard deviations above this are verified: a spin whose wobble is only noise seems to identify too much."""
TRIED = 4.0
"""Distance at which the fit is repeated, with other starts [standard deviations]."""
LEAST_RISE = 4.0
"""Least rise of the sum of squares there; sixteen is expected."""
GRADIENT_STEP = 2e-6
"""Step of the derivatives of quantities, in units in which 1 is a large change of an unknown."""

LAGS = 10
"""Number of lags of the residuals' autocorrelation."""
LEAST_PROBABILITY = 1e-4
"""Least probability of white noise with such an autocorrelation; below it the check fails."""
TOO_LARGE = 1.5
"""Residuals larger than this multiple of the noise between neighbouring samples are not noise."""
LOST = 0.3
"""Largest residual of attitudes [rad]. Above it the fit doesn't follow them, even if the residuals are white: the body
turned too far between samples.
"""

POKE = "one poke of a known force beside the centre of mass"
TUMBLE = "a motion that tumbles about several axes"
COORDINATES = {
    "mass": ("mass",),
    "inertia": (
        *("size of the tensor", "ratio of the largest moment to the others", "ratio of the two smaller moments"),
        *("turn of axes 2 and 3", "turn of axes 1 and 3", "turn of axes 1 and 2"),
    ),
    "com": ("centre of mass along x", "centre of mass along y", "centre of mass along z"),
}
"""Axes 1, 2, 3 are those of the moments, ascending; x, y, z those of the tracked frame."""
SMALL_UNITS = {"offset": 0.01, "gyro_bias": 0.1, "imu_place": 0.1}
"""Scale of an unknown, if it isn't 1, below which its standard deviation must be small for it to be identified: s,
rad/s, m.
"""


@dataclass(frozen=True)
class Unidentified:
    """A direction that isn't identified, and what would identify it."""

    what: str
    remedy: str


@dataclass(frozen=True)
class Quantity:
    """A number with its standard deviation; both are None if it isn't identified."""

    value: float | None
    sd: float | None


class Identifiability:
    """Which directions of the unknowns the flights identify, in coordinates in which 1 is a large change."""

    def __init__(self, estimate: Estimate, length: float) -> None:
        """length: an error of the centre of mass by this length is large [m]."""
        self.unknowns, self.values = estimate.unknowns, estimate.values
        self.names, self._units = _coordinates(estimate.unknowns, estimate.values, length)
        _, self.roots, directions = np.linalg.svd(estimate.root * self._units)
        # With fewer rows than columns, the remaining directions have no information.
        self.roots = np.append(self.roots, np.zeros(len(self.names) - len(self.roots)))
        self._directions = directions.T
        self._unidentified = self.roots < 1.0 / MOST_RELATIVE
        for k in np.flatnonzero(~self._unidentified & (self.roots < 1.0 / DOUBTED)):
            far = min(TRIED / self.roots[k], MOST_RELATIVE) * self._units * self._directions[:, k]
            self._unidentified[k] = min(estimate.rise(far), estimate.rise(-far)) < LEAST_RISE

    @cached_property
    def unidentified(self) -> list[Unidentified]:
        """The directions that aren't identified, with names."""
        space = self._directions[:, self._unidentified]
        found: list[Unidentified] = []
        for name, vector in zip(self.names, np.eye(len(self.names)), strict=True):
            if space.shape[1] and np.sum((space.T @ vector) ** 2) > NAMED:
                found.append(Unidentified(name, _remedy(name)))
                # The rest of the space, orthogonal to it.
                left, sizes, _ = np.linalg.svd(space - np.outer(vector, vector @ space), full_matrices=False)
                space = left[:, sizes > 0.5]
        for direction in space.T:
            largest = [self.names[k] for k in np.argsort(-np.abs(direction))[:3] if abs(direction[k]) > 0.2]
            found.append(Unidentified(f"a mixture of {', '.join(largest)}", f"{TUMBLE}, {POKE}"))
        return found

    def quantities(self, of: Callable[[Values], Numbers]) -> list[Quantity]:
        """Numbers of the estimate with their standard deviations; None for one that changes along a direction that
        isn't identified.
        """
        numbers = of(self.values)
        gradients = np.empty((len(numbers), len(self.unknowns)))
        for k, step in enumerate(GRADIENT_STEP * self.unknowns.scales(self.values)):
            change = step * np.eye(len(self.unknowns))[k]
            sides = [np.asarray(of(self.unknowns.moved(self.values, sign * change))) for sign in (1.0, -1.0)]
            gradients[:, k] = (sides[0] - sides[1]) / (2.0 * step)
        found = []
        for number, along in zip(numbers, (gradients * self._units) @ self._directions, strict=True):
            good, hidden = along[~self._unidentified], np.abs(along[self._unidentified])
            if np.any(hidden > LEAST_SHARE * np.linalg.norm(along)):
                found.append(Quantity(None, None))
            else:
                sd = np.linalg.norm(good / self.roots[~self._unidentified])
                found.append(Quantity(float(number), float(sd)))
        return found


def _coordinates(unknowns: Unknowns, values: Values, length: float) -> tuple[list[str], FloatArray]:
    """Names of the unknowns, and a large change of each (n,)."""
    names, units = [], []
    for k, (group, index) in enumerate(unknowns.slots):
        names.append(COORDINATES[group][index] if group in COORDINATES else unknowns.name(k).replace("_", " "))
        unit = length if group == "com" else SMALL_UNITS.get(group, 1.0)
        if group == "damping":
            unit = values.mass if index == 0 else float(np.trace(values.inertia)) / 3.0
        units.append(unit)
    return names, np.array(units)


def _remedy(name: str) -> str:
    if name == "mass":
        return "one poke of a known force, or --mass"
    if name == "size of the tensor":
        return f"{POKE}, or a known torque"
    if name.startswith("centre of mass"):
        return "a spin about an axis at right angles to it"
    if name.startswith(("ratio", "turn")):
        return TUMBLE
    return "a longer recording, or a given value"


@dataclass(frozen=True)
class ResidualCheck:
    """The check of one series. noise: estimated standard deviation. by_differences: the same from neighbouring samples.
    probability: that white noise looks like this (Ljung and Box).
    """

    flight: str
    series: str
    unit: str
    samples: int
    noise: float
    by_differences: float
    probability: float

    @property
    def is_white(self) -> bool:
        """Whether the residuals are compatible with white noise."""
        return self.probability >= LEAST_PROBABILITY

    @property
    def is_noise(self) -> bool:
        """Whether the residuals are no larger than noise."""
        is_lost = self.unit == UNITS[ATTITUDE] and self.noise > LOST
        return not is_lost and (self.is_white or self.noise <= TOO_LARGE * self.by_differences)

    @property
    def remarks(self) -> list[str]:
        """Sentences on the result; empty if the residuals are noise."""
        if self.is_noise:
            return []
        residuals = f"{self.series} of {self.flight}: the residuals of {self.noise:.3g} {self.unit}"
        if self.is_white:
            return [
                f"{residuals} are so large that nothing follows the attitudes: the body turns too far between samples"
            ]
        return [
            f"{residuals} aren't white noise, and neighbouring samples differ by {self.by_differences:.3g} only: drag"
            " (--fit damping), gravity (--fit gravity), clocks (--fit offset), a contact (--from and --to exclude it),"
            " or a wrench that isn't in the bag; the standard deviations are too small"
        ]


def check_residuals(flights: Sequence[MeasuredFlight], estimate: Estimate) -> list[ResidualCheck]:
    """Check every series of every flight."""
    found = []
    for flight, segment, start in zip(flights, estimate.problem.segments, estimate.starts, strict=True):
        for series, residuals in zip(segment.series, residuals_of(segment, start, estimate.values), strict=True):
            noise = estimate.problem.sigmas[series.name]
            check = flight.name, series.name, UNITS[series.kind], len(residuals), noise
            found.append(ResidualCheck(*check, noise_by_differences(series), _whiteness(residuals / noise)))
    return found


def _whiteness(scaled: Points) -> float:
    """Probability by Ljung and Box (Biometrika 65, 1978) of the three components together."""
    n = len(scaled)
    lags = min(LAGS, n // 4)
    centred = scaled - scaled.mean(axis=0)
    power = (centred**2).sum(axis=0)
    if lags < 1 or not np.all(power > 0.0):
        return 1.0
    total = 0.0
    for lag in range(1, lags + 1):
        correlation = (centred[lag:] * centred[:-lag]).sum(axis=0) / power
        total += float((correlation**2).sum()) * n * (n + 2) / (n - lag)
    return float(chdtrc(3 * lags, total))
