# SPDX-License-Identifier: MIT
"""The search for the unknowns that all segments share, each segment's start projected out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from . import mass_parameters as mp
from .local_motion import high_rate
from .shooting import START, ShootingInterval, Variations, compressed, linearized, moved_starts
from .triangles import upper_triangle
from .unknowns import NONE, Unknowns, Values

PRIOR_STEPS = 1.0 / mp.STEP
"""Widths of the prior in steps of difference quotients: moments by a factor e, the COM by the body's size. It holds
what the motion can't tell; the rest it hardly moves, as it is about the last stage's estimate.
"""
SETTLING = 6
"""Most steps of the starts alone before the first step of the unknowns."""
CONVERGED = 0.1
"""Part of the squares that starts could still take away, by a step that is then the last one."""

START_WIDTHS = np.repeat([1e3, 0.1, 1e3, 1e3], 3)
"""Standard deviations of what is assumed of a start beforehand, little: what too few samples leave open stays where it
is, and takes nothing of the residuals.
"""
FAILED = 1e20
"""Residual of a flight that didn't come through, in standard deviations: the step is then taken back."""
FIRST_STEP = 1.0
"""In units of the prior: moments by a factor e."""
SMALL_STEP = 0.03
"""Of all residuals together, in standard deviations: such a step is the last one."""


class Problem:
    """Residuals of all segments and of a wide prior as SciPy takes them, of the unknowns alone.

    With [J_start J r] = Q R the start of a segment takes what it can of the residuals, and the rows of R below the
    twelfth are what is left: so every segment finds its own start while SciPy steps in the few numbers that all share
    (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's derivative).
    """

    def __init__(
        self, segments: Sequence[ShootingInterval], starts: np.ndarray, values: Values, unknowns: Unknowns
    ) -> None:
        self.segments, self.unknowns, self._given = segments, unknowns, values
        self.first = unknowns.read(values)
        self.widths = PRIOR_STEPS * unknowns.steps(values)
        self._base: _Linearized | None = None
        self._trial: _Linearized | None = None
        self._starts = starts
        self.evaluations = 0
        """Of all residuals, with their derivatives."""
        rates = {id(flight): high_rate(flight) for flight in {id(s.flight): s.flight for s in segments}.values()}
        self._turn = max(rates[id(segment.flight)] * segment.duration_s for segment in segments)

    def values(self, numbers: np.ndarray) -> Values:
        """With these unknowns."""
        return self.unknowns.put(self._given, numbers)

    def starts(self, numbers: np.ndarray) -> np.ndarray:
        """The best starts (k, 13) for these unknowns, as the nearest derivatives say."""
        for known in (self._trial, self._base):
            if known is not None and np.array_equal(known.numbers, numbers):
                return known.starts_for(numbers)
        return (self._base or self._at(numbers)).starts_for(numbers)

    def residuals(self, numbers: np.ndarray) -> np.ndarray:
        """For SciPy."""
        return self._at(numbers).residuals

    def jacobian(self, numbers: np.ndarray) -> np.ndarray:
        """For SciPy, which asks only where it stays: later starts are foretold from here."""
        self._base = self._at(numbers)
        return self._base.jacobian

    def _at(self, numbers: np.ndarray) -> _Linearized:
        for known in (self._trial, self._base):
            if known is not None and np.array_equal(known.numbers, numbers):
                return known
        self.evaluations += 1
        if self._base is not None:
            self._trial = self._linearized(numbers, self._base.starts_for(numbers))
            return self._trial
        # What a start could still take counts as taken already: so it has to be near before steps are measured by
        # what is left.
        self._trial = self._linearized(numbers, self._settled(numbers))
        return self._trial

    def _settled(self, numbers: np.ndarray) -> np.ndarray:
        """The given starts improved by steps of their own, each as long as its segment's residuals become less."""
        kept = tried = self._starts
        least = np.full(len(tried), np.inf)
        for _ in range(SETTLING):
            alone = self._linearized(numbers, tried, of_starts=True)
            better = alone.squares < least
            kept, least = np.where(better[:, None], tried, kept), np.where(better, alone.squares, least)
            if not better.any():
                break
            tried = np.where(better[:, None], alone.starts_for(numbers), kept)
            if alone.is_converged:
                return tried
        return kept

    def _linearized(self, numbers: np.ndarray, starts: np.ndarray, of_starts: bool = False) -> _Linearized:
        """of_starts: without the derivatives by the unknowns, which take most of the flights."""
        values, unknowns = self.values(numbers), NONE if of_starts else self.unknowns
        free = len(unknowns)
        triangles: list[np.ndarray] = []
        variations = Variations(values, unknowns, central=False, turn=self._turn)
        for segment, start in zip(self.segments, starts, strict=True):
            flown = linearized(segment, start, variations)
            if flown is None:
                failed = np.concatenate([np.zeros(free), [FAILED]])
                return _Linearized(numbers, starts, None, failed, np.eye(free + 1, free))
            triangles.append(compressed(flown, START_WIDTHS))
        rows = [triangle[START:, START:] for triangle in triangles]
        if not of_starts:
            rows.append(np.column_stack([np.diag(1.0 / self.widths), (numbers - self.first) / self.widths]))
        # All of it together as a triangle: what SciPy's algebra would share out among threads is small then.
        left = upper_triangle(np.concatenate(rows).T)
        return _Linearized(numbers, starts, triangles, left[:, -1], left[:, :-1])


@dataclass(frozen=True)
class _Linearized:
    """numbers: the unknowns. starts (k, 13): where the segments were flown from. triangles:
    ``compressed`` ones, None where one failed.
    """

    numbers: np.ndarray
    starts: np.ndarray
    triangles: list[np.ndarray] | None
    residuals: np.ndarray
    jacobian: np.ndarray

    @property
    def squares(self) -> np.ndarray:
        """Sum of the squared residuals of each segment (k,), infinite where one failed."""
        if self.triangles is None:
            return np.full(len(self.starts), np.inf)
        return np.array([float(triangle[:, -1] @ triangle[:, -1]) for triangle in self.triangles])

    @property
    def is_converged(self) -> bool:
        """Whether the starts are as good as they can be for these unknowns, or so bad that they can't be flown."""
        if self.triangles is None:
            return True
        could = sum(float(triangle[:START, -1] @ triangle[:START, -1]) for triangle in self.triangles)
        return could <= CONVERGED * float(self.residuals @ self.residuals)

    def starts_for(self, numbers: np.ndarray) -> np.ndarray:
        """The best starts for other unknowns, as far as the derivatives say."""
        if self.triangles is None:
            return self.starts
        free = self.jacobian.shape[1]
        change = np.append((numbers - self.numbers)[:free], 1.0)
        steps = []
        for triangle in self.triangles:
            steps.append(-np.linalg.solve(triangle[:START, :START], triangle[:START, START:] @ change))
        return moved_starts(self.starts, np.array(steps))


class _LastStepError(Exception):
    """Ends SciPy's search where the next step changes hardly anything any more; numbers: where it leads."""

    def __init__(self, numbers: np.ndarray) -> None:
        super().__init__("the search has ended")
        self.numbers = numbers


def best_unknowns(problem: Problem, most: int, tolerance: float) -> np.ndarray:
    """The best unknowns, by SciPy, until a step promises less than this part of the squares: it is taken unseen."""
    # In units of the prior, and away from 0: SciPy takes the length of the first numbers for how far a first step may
    # go.
    widths, away = problem.widths, np.full(len(problem.first), FIRST_STEP / np.sqrt(len(problem.first)))

    def jacobian(z: np.ndarray) -> np.ndarray:
        numbers = problem.first + widths * (z - away)
        matrix, right = problem.jacobian(numbers) * widths, problem.residuals(numbers)
        # Of all steps the best one takes from the residuals what isn't below the triangle.
        step, gain = -np.linalg.solve(matrix[:-1], right[:-1]), float(right[:-1] @ right[:-1])
        if gain < max(SMALL_STEP**2, tolerance * float(right @ right)):
            raise _LastStepError(numbers + widths * step)
        return matrix

    try:
        found = least_squares(
            lambda z: problem.residuals(problem.first + widths * (z - away)),
            away,
            jacobian,
            max_nfev=most,
            ftol=tolerance,
        )
    except _LastStepError as end:
        return end.numbers
    return problem.first + widths * (found.x - away)
