# SPDX-License-Identifier: MIT
"""The string as it is drawn everywhere: straight while it pulls, hanging through while it is slack."""

from __future__ import annotations

import numpy as np

POINTS = 25
BISECTIONS = 40
"""Enough for the sag to 12 digits."""


def sag(distances: np.ndarray, lengths: np.ndarray | float) -> np.ndarray:
    """How deep (n,) parabolas hang through whose ends are ``distances`` (n,) apart and which are ``lengths`` (n,) long;
    0 where the ends are farther apart than that.

    With half span h and slope a = 2 s/h at the end, the arc is h √(1 + a²) + (h/a) asinh a.
    """
    lengths = np.broadcast_to(lengths, distances.shape)
    half = np.maximum(0.5 * distances, np.maximum(1e-9 * lengths, np.finfo(float).tiny))
    low, high = np.zeros_like(half), 0.5 * lengths
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        a = 2.0 * middle / half
        arc = half * np.sqrt(1.0 + a * a) + half * np.divide(np.arcsinh(a), a, out=np.ones_like(a), where=a > 0.0)
        low, high = np.where(arc < lengths, middle, low), np.where(arc < lengths, high, middle)
    return np.where(distances < lengths, 0.5 * (low + high), 0.0)


def sag_directions(spans: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) square to the spans (n, 3) that point down most; sideways along x, or y, for one that is
    vertical.
    """
    lengths = np.linalg.norm(spans, axis=1, keepdims=True)
    axes = np.divide(spans, lengths, out=np.tile([1.0, 0.0, 0.0], (len(spans), 1)), where=lengths > 0.0)

    def square(direction: tuple[float, float, float]) -> np.ndarray:
        return direction - axes * (axes @ np.array(direction))[:, np.newaxis]

    down = square((0.0, 0.0, -1.0))
    down = np.where(np.linalg.norm(down, axis=1, keepdims=True) < 1e-6, square((1.0, 0.0, 0.0)), down)
    return down / np.linalg.norm(down, axis=1, keepdims=True)


def string_curves(free: np.ndarray, knots: np.ndarray, lengths: np.ndarray | float) -> np.ndarray:
    """Points (n, POINTS, 3) of strings from their free ends (n, 3) to their knots (n, 3), a parabola each.

    lengths (n,) [m] are those that a slack one has: the rest length, and 0 of one that is always straight.
    """
    spans = knots - free
    depths = sag(np.linalg.norm(spans, axis=1), lengths)
    along = np.linspace(0.0, 1.0, POINTS)[:, np.newaxis]
    down = 4.0 * along * (1.0 - along) * (depths[:, np.newaxis] * sag_directions(spans))[:, np.newaxis]
    return free[:, np.newaxis] + along * spans[:, np.newaxis] + down
