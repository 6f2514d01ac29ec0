# SPDX-License-Identifier: MIT
"""The string from the hand to its knot: straight while it pulls, hanging through along gravity while it is slack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..simulation.observer import ShownString

POINTS = 25
"""Of a slack string's curve."""
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


NO_DIRECTION = 1e-12
"""In rest lengths: a string shorter than this has no direction to pull in."""


@dataclass(frozen=True)
class StringRows:
    """The string at those m of n states at which one is tied: tied (n,) says which. free and knots (m, 3) [m, world];
    lengths (m,) [m] of a slack one, 0 of one that is always straight; tensions (m,) [N]; energies (m,) [J].
    """

    tied: np.ndarray
    free: np.ndarray
    knots: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    energies: np.ndarray

    @property
    def directions(self) -> np.ndarray:
        """Unit vectors (m, 3) from the free ends to the knots."""
        spans = self.knots - self.free
        return spans / np.maximum(np.linalg.norm(spans, axis=1, keepdims=True), np.finfo(float).tiny)

    @property
    def held(self) -> np.ndarray:
        """What the string holds at each of the n states (n,) [J]: nothing where none is tied."""
        found = np.zeros(len(self.tied))
        found[self.tied] = self.energies
        return found


class Strings:
    """The string of one run, by the times from which it is tied as it is."""

    def __init__(self) -> None:
        self._changes: list[tuple[int, ShownString | None]] = []
        self.was_tied = False
        """Whether the run has had a string."""

    def change(self, time_ns: int, string: ShownString | None) -> None:
        """Another target, another knot, tied or let go."""
        self._changes.append((time_ns, string))
        self.was_tied = self.was_tied or string is not None

    @property
    def tied(self) -> bool:
        """Whether there is a string now."""
        return bool(self._changes) and self._changes[-1][1] is not None

    def _spells(self, times_ns: np.ndarray) -> Iterator[tuple[slice, ShownString]]:
        """The string that is tied at each of the times (n,), by slices of them."""
        begins = np.searchsorted(times_ns, [change_ns for change_ns, _ in self._changes], side="left").tolist()
        for begin, end, (_, string) in zip(begins, [*begins, len(times_ns)][1:], self._changes, strict=True):
            if string is not None and end > begin:
                yield slice(begin, end), string

    def rows(self, times_ns: np.ndarray, rows: np.ndarray, R: np.ndarray) -> StringRows:
        """The string at times (n,), ascending, of states (n, 13) with attitudes R (n, 3, 3)."""
        found = StringRows(np.zeros(len(rows), dtype=bool), *np.zeros((2, len(rows), 3)), *np.zeros((3, len(rows))))
        for at, string in self._spells(times_ns):
            attach = np.asarray(string.attach, dtype=float)
            arm = R[at] @ attach
            velocity = rows[at, 7:10] + np.einsum("nij,nj->ni", R[at], np.cross(rows[at, 10:13], attach))
            found.tied[at] = True
            found.free[at] = string.free_end(times_ns[at])
            found.knots[at] = rows[at, 0:3] + arm
            found.lengths[at] = 0.0 if string.bilateral else string.rest_length
            span = found.knots[at] - found.free[at]
            stretch = np.linalg.norm(span, axis=1) - string.rest_length
            found.tensions[at] = _tension(string, span, velocity - _hand_velocity(string, times_ns[at]))
            stretch = stretch if string.bilateral else np.maximum(stretch, 0.0)
            found.energies[at] = 0.5 * string.stiffness * stretch**2
        tied = found.tied
        return StringRows(tied, *(getattr(found, name)[tied] for name in list(vars(found))[1:]))

    def forget_before(self, time_ns: int) -> None:
        """Keep what later states need."""
        while len(self._changes) > 1 and self._changes[1][0] <= time_ns:
            self._changes.pop(0)


def _hand_velocity(string: ShownString, times_ns: np.ndarray) -> np.ndarray:
    """Velocity (n, 3) [m/s] of the free end."""
    lasts_ns = string.end_ns - string.begin_ns
    if lasts_ns <= 0:
        return np.zeros((len(times_ns), 3))
    speed = (np.asarray(string.target, dtype=float) - string.origin) / (1e-9 * lasts_ns)
    return (times_ns < string.end_ns)[:, np.newaxis] * speed


def _tension(string: ShownString, span: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Tension (n,) [N]: k x + c ẋ, and nothing for a string that would have to push. span, velocity (n, 3): from the
    free end to the knot, and how fast that changes.
    """
    if string.rest_length == 0.0:
        return np.linalg.norm(string.stiffness * span + string.damping * velocity, axis=1)
    distance = np.linalg.norm(span, axis=1)
    direction = span / np.maximum(distance, np.finfo(float).tiny)[:, np.newaxis]
    stretch = distance - string.rest_length
    tension = string.stiffness * stretch + string.damping * np.einsum("ij,ij->i", direction, velocity)
    if not string.bilateral:
        tension = np.where(stretch > 0.0, np.maximum(tension, 0.0), 0.0)
    return np.where(distance < NO_DIRECTION * string.rest_length, 0.0, tension)
