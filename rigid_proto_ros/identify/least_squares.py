# SPDX-License-Identifier: MIT
"""The search for the unknowns that all segments share, each segment's start projected out of it.

With [J_start J r] = Q R the start of a segment takes what it can of the residuals, and the rows of R below its own are
what is left: so every segment finds its own start while the steps are of the few numbers that all share (variable
projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, with Kaufman's derivative). The steps are Levenberg's and
Marquardt's, within a radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .incremental_qr import upper_triangle
from .local_motion import high_rate
from .shooting import Segment, Variations, compressed, linearized, moved_starts
from .unknowns import NONE, Unknowns, Values

SETTLING = 6
"""Most steps of the starts alone before the first step of the unknowns."""
CONVERGED = 0.1
"""Part of the squares that starts could still take away, by a step that is then the last one."""
FIRST_RADIUS, LEAST_RADIUS = 1.0, 1e-6
"""Of a step, in what counts as a large change of each unknown."""
SMALL_STEP = 0.03
"""Of all residuals together, in standard deviations: such a step is the last one."""
POOR, GOOD = 0.25, 0.75
"""Parts of what a step promised that it kept: below the first the radius shrinks, above the second it grows."""


@dataclass(frozen=True)
class Problem:
    """Segments flown by ``unknowns.moved(given, numbers)``, in numbers (n,) of which 1 is a large change."""

    segments: Sequence[Segment]
    given: Values
    unknowns: Unknowns

    @property
    def scales(self) -> np.ndarray:
        """Of the numbers (n,)."""
        return self.unknowns.scales(self.given)

    def values(self, numbers: np.ndarray) -> Values:
        """With these numbers."""
        return self.unknowns.moved(self.given, self.scales * numbers)

    def linear(self, numbers: np.ndarray, starts: Sequence[np.ndarray]) -> Linear | None:
        """The residuals and their derivatives about these numbers and starts; None where a flight failed."""
        scaled = self.scales
        turn = max(high_rate(segment.flight) * segment.duration_s for segment in self.segments)
        variations = Variations(self.unknowns, self.given, scaled * numbers, is_central=False, turn=turn)
        triangles = []
        for segment, start in zip(self.segments, starts, strict=True):
            columns = linearized(segment, start, variations)
            if columns is None:
                return None
            columns[-1 - len(scaled) : -1] *= scaled[:, None]
            triangles.append(compressed(columns, segment, start))
        # A wide prior about what was given holds what the motion can't tell; the rest it hardly moves.
        rows = [np.column_stack([np.eye(len(numbers)), numbers])]
        rows += [triangle[-1 - len(numbers) :, -1 - len(numbers) :] for triangle in triangles]
        left = upper_triangle(np.concatenate(rows).T)
        if not np.isfinite(left).all():
            return None
        return Linear(numbers, list(starts), triangles, left[:, -1], left[:, :-1])

    def settled(self, numbers: np.ndarray, starts: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Starts improved by steps of their own, each as long as its segment's residuals become less."""
        alone = Problem(self.segments, self.values(numbers), NONE)
        kept = tried = list(starts)
        least = np.full(len(kept), np.inf)
        for _ in range(SETTLING):
            linear = alone.linear(np.zeros(0), tried)
            if linear is None:
                break
            better = linear.squares < least
            kept = [one if is_better else old for one, old, is_better in zip(tried, kept, better, strict=True)]
            least = np.minimum(linear.squares, least)
            new = linear.starts_for(np.zeros(0))
            tried = [one if is_better else old for one, old, is_better in zip(new, kept, better, strict=True)]
            if linear.is_converged:
                return tried
            if not better.any():
                break
        return kept


@dataclass(frozen=True)
class Linear:
    """numbers (n,): the unknowns. starts: where the segments were flown from. triangles: of each, ``compressed``.

    residuals (k,) and their jacobian (k, n): of all segments together, the starts eliminated.
    """

    numbers: np.ndarray
    starts: list[np.ndarray]
    triangles: list[np.ndarray]
    residuals: np.ndarray
    jacobian: np.ndarray

    @property
    def cost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def squares(self) -> np.ndarray:
        """Sum of the squared residuals of each segment (k,) with its start as it is."""
        return np.array([float(triangle[:, -1] @ triangle[:, -1]) for triangle in self.triangles])

    @property
    def is_converged(self) -> bool:
        """Whether the starts are as good as they can be for these unknowns."""
        could = sum(float(t[: self._own(t), -1] @ t[: self._own(t), -1]) for t in self.triangles)
        return could <= CONVERGED * self.cost

    def _own(self, triangle: np.ndarray) -> int:
        """How many rows of a triangle are of its start."""
        return len(triangle) - 1 - len(self.numbers)

    def starts_for(self, numbers: np.ndarray) -> list[np.ndarray]:
        """The best starts for other unknowns, as far as the derivatives say."""
        change = np.append(numbers - self.numbers, 1.0)
        found = []
        for start, triangle in zip(self.starts, self.triangles, strict=True):
            own = self._own(triangle)
            step = -np.linalg.solve(triangle[:own, :own], triangle[:own, own:] @ change)
            found.append(moved_starts(start[None], step[None])[0])
        return found

    def step(self, radius: float) -> np.ndarray:
        """The best step (n,) no longer than a radius."""
        left, sizes, axes = np.linalg.svd(self.jacobian, full_matrices=False)
        along, damping = left.T @ self.residuals, 0.0
        while True:
            step = -axes.T @ (sizes * along / (sizes**2 + damping))
            if np.linalg.norm(step) <= radius:
                return step
            damping = max(3.0 * damping, 1e-3 * float(sizes[-1]) ** 2)


def best_unknowns(
    problem: Problem, starts: Sequence[np.ndarray], most: int, tolerance: float
) -> tuple[np.ndarray, list[np.ndarray]] | None:
    """The best numbers (n,) and starts, until a step promises less than this part of the squares: it is taken unseen.
    None where the first flight failed.
    """
    zero, radius = np.zeros(len(problem.unknowns)), FIRST_RADIUS
    # What a start could still take counts as taken already: so it has to be near before steps are measured by what is
    # left.
    here = problem.linear(zero, problem.settled(zero, starts))
    if here is None:
        return None
    for _ in range(most):
        step = here.step(radius)
        promised = here.cost - float(np.sum((here.residuals + here.jacobian @ step) ** 2))
        numbers = here.numbers + step
        if promised < max(SMALL_STEP**2, tolerance * here.cost):
            return numbers, here.starts_for(numbers)
        there = problem.linear(numbers, here.starts_for(numbers))
        kept = -np.inf if there is None else (here.cost - there.cost) / promised
        if kept < POOR:
            radius = POOR * float(np.linalg.norm(step))
        elif kept > GOOD:
            radius *= 2.0
        if there is not None and kept > 0.0:
            here = there
        elif radius < LEAST_RADIUS:
            break
    return here.numbers, here.starts_for(here.numbers)
