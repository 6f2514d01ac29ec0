# SPDX-License-Identifier: MIT
"""What is drawn of the motion: arrows of ω and L at the COM, and the paths of the COM and of the farthest vertex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from ..base.rotation import matrix_from_quaternion
from . import entities as e
from .arrows import arrow_length
from .columns import Send
from .derived import to_world

POINTS_PER_PIECE_MAX = 16

TRAIL_RADIUS = 0.004
"""Of a path's points, in body sizes."""

MIDDLING_SPIN = 5.0
"""[rad/s] whose arrow is of middling length."""

MOTION_ARROWS = 0.7
"""Length of the arrows of ω and L against those of loads."""


class Trail:
    """The path of one body point as points so close that they look like a line; remembers where it has got to."""

    def __init__(self) -> None:
        self._last: tuple[int, np.ndarray, np.ndarray] | None = None

    def between(
        self, times_ns: np.ndarray, rows: np.ndarray, point: np.ndarray, spacing: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points (p, 3) [world] on the path from the state before to each of rows (n, 13), and their counts (n,).

        The body point (3,) moves between two states on the cubic that has its position and velocity at both.
        """
        R = matrix_from_quaternion(rows[:, 3:7])
        at = rows[:, 0:3] + to_world(R, point)
        velocity = rows[:, 7:10] + to_world(R, np.cross(rows[:, 10:13], point))
        if self._last is None:
            self._last = (int(times_ns[0]), at[0], velocity[0])
        first_ns, first_at, first_velocity = self._last
        h = 1e-9 * np.diff(times_ns, prepend=first_ns)
        start = np.vstack([first_at, at[:-1]])
        start_slope = np.vstack([first_velocity, velocity[:-1]]) * h[:, np.newaxis]
        end_slope = velocity * h[:, np.newaxis]
        self._last = (int(times_ns[-1]), at[-1].copy(), velocity[-1].copy())

        length = np.linalg.norm(at - start, axis=1)
        counts = np.clip(np.ceil(length / spacing), 1, POINTS_PER_PIECE_MAX).astype(int)
        piece = np.repeat(np.arange(len(at)), counts)
        within = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
        u = (within / counts[piece])[:, np.newaxis]
        points = (
            (1.0 + 2.0 * u) * (1.0 - u) ** 2 * start[piece]
            + u * (1.0 - u) ** 2 * start_slope[piece]
            + u * u * (3.0 - 2.0 * u) * at[piece]
            - u * u * (1.0 - u) * end_slope[piece]
        )
        return points, counts


@dataclass(frozen=True)
class ShownBody:
    """size: a length [m] that stands for the body. mean_moment: a third of its tensor's trace [kg m²]. tip: the vertex
    (3,) farthest from the COM [m, body axes], None without a mesh.
    """

    size: float
    mean_moment: float
    tip: np.ndarray | None


class MotionPicture:
    """Follows one run."""

    def __init__(self) -> None:
        self._trail = Trail()
        self._com_trail = Trail()

    def rows(
        self,
        times: list[Any],
        times_ns: np.ndarray,
        rows: np.ndarray,
        L: np.ndarray,
        shown: ShownBody,
        send: Send,
    ) -> None:
        """States (n, 13) of one body with their angular momenta (n, 3), world axes."""
        w = to_world(matrix_from_quaternion(rows[:, 3:7]), rows[:, 10:13])
        spin_of_middling = MIDDLING_SPIN * shown.mean_moment
        for entity, vectors, reference in (
            (e.ANGULAR_VELOCITY, w, MIDDLING_SPIN),
            (e.MOMENTUM, L, spin_of_middling),
        ):
            # None at rest: one of no length would still have its name written beside it.
            turns = vectors.any(axis=1)
            drawn = rr.Arrows3D.columns(vectors=_drawn(vectors[turns], reference, shown.size))
            send(entity, times, drawn.partition(turns.astype(int)))
        if shown.tip is not None:
            spacing = 1.5 * TRAIL_RADIUS * shown.size
            points, counts = self._trail.between(times_ns, rows, shown.tip, spacing)
            send(e.TRAIL, times, rr.Points3D.columns(positions=points).partition(counts))
            if rows[:, 7:10].any():
                points, counts = self._com_trail.between(times_ns, rows, np.zeros(3), spacing)
                send(e.COM_TRAIL, times, rr.Points3D.columns(positions=points).partition(counts))


def _drawn(vectors: np.ndarray, reference: float, size: float) -> np.ndarray:
    """Vectors (n, 3) in their directions, with lengths for the eye."""
    norms = np.linalg.norm(vectors, axis=1, keepdims=True)
    lengths = np.where(norms > 0.0, MOTION_ARROWS * arrow_length(norms, reference, size), 0.0)
    return vectors * np.divide(lengths, norms, out=np.zeros_like(norms), where=norms > 0.0)
