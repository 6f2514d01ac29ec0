# SPDX-License-Identifier: MIT
"""Arrows of the loads that act: at their true points, in their true directions, of a length that can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..simulation.observer import ShownLoad
from .derived import to_world

IMPULSE_SHOWN_NS = 150_000_000
"""[ns of simulated time] An impulse acts at an instant; its arrow stays this long so that it can be seen."""

SHORTEST, LONGEST = 0.25, 0.9
"""Arrow lengths in body sizes: that of a vanishing and of an infinite load."""


def arrow_length(magnitude: np.ndarray | float, reference: float, size: float) -> np.ndarray | float:
    """Length [m] of the arrow for a load: grows with the load, half way between the limits at ``reference``."""
    return size * (SHORTEST + (LONGEST - SHORTEST) * magnitude / (magnitude + reference))


@dataclass(frozen=True)
class ArrowScale:
    """size [m] of the body; force [N], torque [N m], impulse [N s] and angular impulse [N m s] of middling arrows."""

    size: float
    force: float
    torque: float
    impulse: float
    angular_impulse: float

    @staticmethod
    def of(mass: float, size: float) -> ArrowScale:
        """Middling is the body's weight on earth; for impulses what gives it 1 m/s; torques at half its size."""
        lever = 0.5 * size
        return ArrowScale(size, 9.81 * mass, 9.81 * mass * lever, mass, mass * lever)

    def lengths(self, load: ShownLoad) -> tuple[float, float]:
        """Of the force arrow and the torque arrow [m]; 0 where there is none."""
        impulsive = load.kind == "impulse"
        references = (self.impulse, self.angular_impulse) if impulsive else (self.force, self.torque)
        return self._length(load.force, references[0]), self._length(load.torque, references[1])

    def _length(self, vector: np.ndarray, reference: float) -> float:
        magnitude = float(np.linalg.norm(vector))
        return float(arrow_length(magnitude, reference, self.size)) if magnitude > 0.0 else 0.0


@dataclass(frozen=True)
class Arrow:
    """point (3,) [m, body axes from the COM], vector (3,) [m] as drawn, in ``axes`` ``world`` or ``body``.

    A load that pushes towards the COM is drawn with its tip at the point, as a finger would stand, so that the arrow
    isn't hidden inside the body; one that pulls has its tail there.
    """

    point: np.ndarray
    vector: np.ndarray
    axes: str
    tip_at_point: bool
    label: str


@dataclass
class ArrowSamples:
    """Rows of one Arrows3D entity: per row a time and any number of arrows; none ends those before."""

    times: list[np.ndarray] = field(default_factory=list)
    walls: list[np.ndarray] = field(default_factory=list)
    counts: list[np.ndarray] = field(default_factory=list)
    origins: list[np.ndarray] = field(default_factory=list)
    vectors: list[np.ndarray] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    showing: bool = False

    def add(
        self,
        times: np.ndarray,
        walls: np.ndarray,
        states: np.ndarray,
        arrows: Sequence[Arrow],
    ) -> None:
        """The same arrows at every state (n, 13), moving with the body."""
        n, k = len(times), len(arrows)
        if n == 0 or (k == 0 and not self.showing):
            return
        if k == 0:
            times, walls, n = times[:1], walls[:1], 1
        self.showing = k > 0
        self.times.append(times)
        self.walls.append(walls)
        self.counts.append(np.full(n, k))
        if k == 0:
            return
        R = matrix_from_quaternion(states[:, 3:7])
        origins, vectors = np.empty((n, k, 3)), np.empty((n, k, 3))
        for j, arrow in enumerate(arrows):
            vectors[:, j] = to_world(R, arrow.vector) if arrow.axes == "body" else arrow.vector
            origins[:, j] = states[:, 0:3] + to_world(R, arrow.point) - arrow.tip_at_point * vectors[:, j]
        self.origins.append(origins.reshape(-1, 3))
        self.vectors.append(vectors.reshape(-1, 3))
        self.labels.extend([arrow.label for arrow in arrows] * n)

    def clear(self) -> None:
        """Forget rows that were sent."""
        for rows in (self.times, self.walls, self.counts, self.origins, self.vectors, self.labels):
            rows.clear()


def arrows_of(load: ShownLoad, scale: ArrowScale, R: np.ndarray) -> tuple[Arrow | None, Arrow | None]:
    """The arrows of a load's force and torque (None without), decided with the body at attitude R (3, 3)."""
    impulsive = load.kind == "impulse"
    lengths = scale.lengths(load)
    point = np.asarray(load.point, dtype=float)
    arrows: list[Arrow | None] = []
    for value, length, unit in (
        (np.asarray(load.force, dtype=float), lengths[0], "N s" if impulsive else "N"),
        (np.asarray(load.torque, dtype=float), lengths[1], "N m s" if impulsive else "N m"),
    ):
        magnitude = float(np.linalg.norm(value))
        if magnitude == 0.0:
            arrows.append(None)
            continue
        body_value = value if load.axes == "body" else R.T @ value
        pushes = len(arrows) == 0 and float(point @ body_value) < 0.0
        arrows.append(Arrow(point, value * (length / magnitude), load.axes, pushes, f"{_short(magnitude)} {unit}"))
    return arrows[0], arrows[1]


def _short(value: float) -> str:
    """Three figures, without an exponent where people wouldn't write one."""
    return f"{value:.0f}" if 1e3 <= value < 1e5 else f"{value:.3g}"
