# SPDX-License-Identifier: MIT
"""The path of one point of the body as points so close that they look like a line."""

from __future__ import annotations

import numpy as np

POINTS_PER_PIECE_MAX = 16


class Trail:
    """Remembers where it has got to."""

    def __init__(self) -> None:
        self._last: tuple[int, np.ndarray, np.ndarray] | None = None

    def between(
        self, times_ns: np.ndarray, rows: np.ndarray, R: np.ndarray, point: np.ndarray, spacing: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Counts (n,) and points (m, 3) [world] on the path from the state before to each of rows (n, 13) with
        attitudes R (n, 3, 3).

        The body point (3,) moves between two states on the cubic that has its position and velocity at both.
        """
        at = rows[:, 0:3] + R @ point
        velocity = rows[:, 7:10] + np.einsum("nij,nj->ni", R, np.cross(rows[:, 10:13], point))
        if self._last is None:
            self._last = (int(times_ns[0]), at[0], velocity[0])
        first_ns, first_at, first_velocity = self._last
        h = 1e-9 * np.diff(times_ns, prepend=first_ns)[:, np.newaxis]
        start = np.vstack([first_at, at[:-1]])
        start_slope, end_slope = np.vstack([first_velocity, velocity[:-1]]) * h, velocity * h
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
        return counts, points
