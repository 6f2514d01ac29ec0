# SPDX-License-Identifier: MIT
"""The string from its free end to its knot: straight while taut, sagging along gravity while slack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..base.vectors import BoolArray, FloatArray, IntArray, Points, Vector3
from ..motion.string import StringState
from ..simulation.observer import StringChanged

POINTS = 25
"""Points of a slack string's curve."""
BISECTIONS = 40
"""Bisections of the sag, to 12 digits."""
DEEPEST = 0.6
"""Upper bound of the sag relative to the length: 0.5 if the ends coincide, and hardly more otherwise."""
DOWN = np.array([0.0, 0.0, -1.0])
"""Direction of the sag without gravity, so that the string is visibly slack."""


def string_curves(free: Points, knots: Points, lengths: FloatArray, gravity: Vector3) -> FloatArray:
    """Points (n, POINTS, 3) of slack strings from their free ends (n, 3) to their knots (n, 3): parabolas that sag
    along gravity (3,) [m/s², world], each with the polyline length ``lengths`` (n,).
    """
    pull = float(np.linalg.norm(gravity))
    down = gravity / pull if pull else DOWN
    along = np.linspace(0.0, 1.0, POINTS)[:, np.newaxis]
    straight = free[:, np.newaxis] + along * (knots - free)[:, np.newaxis]
    bulge = 4.0 * along * (1.0 - along) * down
    low, high = np.zeros(len(free)), DEEPEST * lengths
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        curves = straight + middle[:, np.newaxis, np.newaxis] * bulge
        short = np.linalg.norm(np.diff(curves, axis=1), axis=2).sum(axis=1) < lengths
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return straight + low[:, np.newaxis, np.newaxis] * bulge


@dataclass(frozen=True)
class StringRows:
    """The string at the m of n states at which one is tied. tied (n,): which states. free, knots (m, 3) [m, world]:
    ends; lengths (m,) [m]: rest length, 0 for a bilateral string, which is always straight; energies (m,) [J]; pulls
    (m,): it is taut.
    """

    tied: BoolArray
    free: Points
    knots: Points
    lengths: FloatArray
    energies: FloatArray
    pulls: BoolArray

    @property
    def directions(self) -> Points:
        """Unit vectors (m, 3) from the free ends to the knots."""
        spans = self.knots - self.free
        sizes: FloatArray = np.maximum(np.linalg.norm(spans, axis=1, keepdims=True), np.finfo(float).tiny)
        return spans / sizes

    @property
    def held(self) -> FloatArray:
        """Energy stored in the string at each state (n,) [J]; 0 where no string is tied."""
        found = np.zeros(len(self.tied))
        found[self.tied] = self.energies
        return found


class Strings:
    """The string of one run, as a list of its changes."""

    def __init__(self) -> None:
        self._changes: list[StringChanged] = []
        self.was_tied = False
        """Whether the run has had a string."""

    def change(self, event: StringChanged) -> None:
        """Add a change: target, knot, tied or released."""
        self._changes.append(event)
        self.was_tied = self.was_tied or event.string is not None

    @property
    def tied(self) -> bool:
        """Whether there is a string now."""
        return bool(self._changes) and self._changes[-1].string is not None

    def _spells(self, times_ns: IntArray) -> Iterator[tuple[slice, StringState, Vector3]]:
        """Yield the tied strings with their knots relative to the COM, each with a slice of the times (n,)."""
        begins = np.searchsorted(times_ns, [change.time_ns for change in self._changes], side="left").tolist()
        for begin, end, change in zip(begins, [*begins, len(times_ns)][1:], self._changes, strict=True):
            if change.string is not None and change.arm is not None and end > begin:
                yield slice(begin, end), change.string, change.arm

    def rows(self, times_ns: IntArray, rows: FloatArray, R: FloatArray) -> StringRows:
        """The string at times (n,), ascending, of states (n, 13) with attitudes R (n, 3, 3)."""
        tied, pulls = np.zeros((2, len(rows)), dtype=bool)
        (free, knots), (lengths, energies) = np.zeros((2, len(rows), 3)), np.zeros((2, len(rows)))
        for at, string, arm in self._spells(times_ns):
            tied[at] = True
            free[at] = [string.free_end(time_ns) for time_ns in times_ns[at].tolist()]
            knots[at] = rows[at, 0:3] + R[at] @ arm
            lengths[at] = 0.0 if string.bilateral else string.rest_length
            stretch = np.linalg.norm(knots[at] - free[at], axis=1) - string.rest_length
            pulls[at] = string.bilateral | (stretch > 0.0)
            energies[at] = 0.5 * string.stiffness * np.where(pulls[at], stretch, 0.0) ** 2
        return StringRows(tied, free[tied], knots[tied], lengths[tied], energies[tied], pulls[tied])

    def forget_before(self, time_ns: int) -> None:
        """Discard changes that later states don't need."""
        while len(self._changes) > 1 and self._changes[1].time_ns <= time_ns:
            self._changes.pop(0)
