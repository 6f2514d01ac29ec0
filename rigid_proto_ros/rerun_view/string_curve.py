# SPDX-License-Identifier: MIT
"""The string as it is drawn everywhere: straight while it pulls, hanging through along gravity while it is slack."""

from __future__ import annotations

import numpy as np

POINTS = 25
BISECTIONS = 40
"""Enough for the sag to 12 digits."""
NEARLY_STRAIGHT = 1e-3
"""Of the span: below a sag of this, the arc is that of its series; the closed form loses digits there."""
DOWN = np.array([0.0, 0.0, -1.0])
"""Where a slack string hangs without gravity, so that it is seen to be slack."""


def down(gravity: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 3) along gravity (..., 3); -z where there is none."""
    pull = np.linalg.norm(gravity, axis=-1, keepdims=True)
    return np.where(pull > 0.0, gravity / np.where(pull > 0.0, pull, 1.0), DOWN)


def arc_lengths(along: np.ndarray, across: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """Lengths (n,) of parabolas p(u) = u span + 4 u (1 − u) depth ĝ, u from 0 to 1, of spans that go ``along`` (n,) and
    ``across`` (n,) ĝ: the mean of √(across² + w²) over w from along − 4 depth to along + 4 depth.
    """
    spans = np.hypot(along, across)
    across = np.maximum(across, 1e-9 * (spans + depths) + np.finfo(float).tiny)

    def integral(w: np.ndarray) -> np.ndarray:
        return 0.5 * (w * np.hypot(across, w) + across**2 * np.arcsinh(w / across))

    flat = depths <= NEARLY_STRAIGHT * spans
    own = np.where(flat, 1.0, depths)
    closed = (integral(along + 4.0 * own) - integral(along - 4.0 * own)) / (8.0 * own)
    spans = np.where(flat & (spans > 0.0), spans, np.inf)
    series = np.hypot(along, across) * (1.0 + 8.0 / 3.0 * ((depths / spans) * (across / spans)) ** 2)
    return np.where(flat, series, closed)


def sags(spans: np.ndarray, lengths: np.ndarray | float, gravity: np.ndarray) -> np.ndarray:
    """How far (n, 3) [m] the middles of strings hang below the middles of their spans (n, 3): along gravity, (3,) or
    (n, 3), so deep that a parabola is ``lengths`` (n,) long; nothing where the ends are as far apart as that.
    """
    distances = np.linalg.norm(spans, axis=1)
    lengths = np.broadcast_to(np.asarray(lengths, dtype=float), distances.shape)
    found = np.zeros_like(spans)
    slack = distances < lengths
    if not slack.any():
        return found
    ways = np.broadcast_to(down(gravity), spans.shape)[slack]
    own, lengths = spans[slack], lengths[slack]
    along = np.einsum("ij,ij->i", own, ways)
    across = np.linalg.norm(own - along[:, np.newaxis] * ways, axis=1)
    # Ends that meet are joined by a loop half as deep as it is long; no other one is deeper.
    low, high = np.zeros_like(lengths), 0.5 * lengths
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        short = arc_lengths(along, across, middle) < lengths
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    found[slack] = (0.5 * (low + high))[:, np.newaxis] * ways
    return found


def curve_points(free: np.ndarray, spans: np.ndarray, sags: np.ndarray) -> np.ndarray:
    """Points (n, POINTS, 3) from the free ends (n, 3) along the spans (n, 3), with the sags (n, 3) of ``sags``."""
    along = np.linspace(0.0, 1.0, POINTS)[:, np.newaxis]
    return free[:, np.newaxis] + along * spans[:, np.newaxis] + 4.0 * along * (1.0 - along) * sags[:, np.newaxis]


def string_curves(free: np.ndarray, knots: np.ndarray, lengths: np.ndarray | float, gravity: np.ndarray) -> np.ndarray:
    """Points (n, POINTS, 3) of strings from their free ends (n, 3) to their knots (n, 3), a parabola each.

    lengths (n,) [m] are those that a slack one has: the rest length, and 0 of one that is always straight. gravity (3,)
    or (n, 3) [m/s², world] says where it hangs.
    """
    spans = knots - free
    return curve_points(free, spans, sags(spans, lengths, gravity))
