# SPDX-License-Identifier: MIT
"""Where the two ends of the string are, and the keys of a stick of length 1 along z that is stretched between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.rotation import matrix_from_quaternion, multiply
from ..rerun_view.string_curve import POINTS, string_curves
from ..simulation.observer import ShownString
from .interpolation import Keys, fewest_keys, rounded, slerp

SHARE = 0.2
"""Of the tolerance, for keys that are left out of each of the stick's place, direction and length."""

Strings = list[tuple[int, ShownString | None]]
"""(time_ns, the string from then on or None)"""


def string_ends(strings: Strings, times_ns: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The free end and the knot (n, 3) each [m, world] at times (n,) of a body with poses (n, 7); NaN while no string
    is tied. At the time of a change it is the string before it, but for one that is tied from time 0 on.
    """
    free, knots = np.full((len(times_ns), 3), np.nan), np.full((len(times_ns), 3), np.nan)
    begins = np.searchsorted(times_ns, [t if t > 0 else -1 for t, _ in strings], side="right").tolist()
    for begin, end, (_, string) in zip(begins, [*begins[1:], len(times_ns)], strings, strict=False):
        if string is None or end <= begin:
            continue
        times, own = times_ns[begin:end], poses[begin:end]
        free[begin:end] = string.free_end(times)
        knots[begin:end] = own[:, :3] + matrix_from_quaternion(own[:, 3:]) @ string.attach
    return free, knots


def slack_lengths(strings: Strings, times_ns: np.ndarray) -> np.ndarray:
    """Lengths (n,) [m] that the string has at times (n,) where its ends are nearer than that; 0 of one that pushes,
    too, and of none.
    """
    lengths = [0.0, *(0.0 if string is None or string.bilateral else string.rest_length for _, string in strings)]
    begins = [t if t > 0 else -1 for t, _ in strings]
    return np.array(lengths)[np.searchsorted(begins, times_ns, side="left")]


def string_points(strings: Strings, times_ns: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """The string's points (n, POINTS, 3) [m, world], from the free end to the knot, as ``string_ends`` has them."""
    free, knots = string_ends(strings, times_ns, poses)
    curves = np.full((len(times_ns), POINTS, 3), np.nan)
    tied = ~np.isnan(free[:, 0])
    curves[tied] = string_curves(free[tied], knots[tied], slack_lengths(strings, times_ns)[tied])
    return curves


def string_breaks(strings: Strings) -> list[int]:
    """Times [ns] at which the free end begins to move or stops."""
    return [t for _, string in strings if string is not None for t in (string.begin_ns, string.end_ns)]


def between_ends(
    ends: tuple[np.ndarray, np.ndarray], where: np.ndarray, u: np.ndarray, found: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """How far (m,) [m] the ends ``found`` lie from what is shown at the shares u (m, 1) between the times number
    ``where`` and the next: of a straight line's two points, and of a stick that turns and stretches evenly. NaN where
    there is no string.
    """
    free, knots = ends
    mid = (1.0 - u) * free[where] + u * free[where + 1]
    straight = (1.0 - u) * knots[where] + u * knots[where + 1]
    lengths, ways = _lengths_and_ways(free, knots)
    stick = mid + ((1.0 - u) * lengths[where] + u * lengths[where + 1]) * slerp(ways[where], ways[where + 1], u)
    apart = [np.linalg.norm(seen - found[k], axis=1) for k, seen in ((0, mid), (1, straight), (1, stick))]
    return np.max(apart, axis=0)


def _lengths_and_ways(free: np.ndarray, knots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    lengths = np.linalg.norm(knots - free, axis=1, keepdims=True)
    return lengths, (knots - free) / np.maximum(lengths, np.finfo(float).tiny)


@dataclass(frozen=True)
class StringKeys:
    """Of a stick along z: its lower end [m, world], its attitude xyzw, and its stretch along z, 0 without a string."""

    places: Keys
    attitudes: Keys
    scales: Keys

    def played(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Both ends (n, 3) that a player shows at these times (n,)."""
        x, y, z, w = self.attitudes.played(times).T
        way = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        free = self.places.played(times)
        return free, free + self.scales.played(times)[:, 2:] * way


def string_keys(
    seconds: np.ndarray, free: np.ndarray, knots: np.ndarray, tolerance: float | None = None
) -> StringKeys | None:
    """The stick at times (n,) [s, single precision] of its ends (n, 3): as few as keep it within the tolerance [m], or
    all without one; None where a string is never tied.
    """
    tied = ~np.isnan(free[:, 0])
    if not tied.any():
        return None
    times = seconds.copy()
    # Two looks at one single-precision time stand on both sides of a change.
    before = np.flatnonzero(times[1:] == times[:-1])
    times[before] = np.nextafter(times[before].astype(np.float32), np.float32(-1.0))
    at = np.flatnonzero(np.append(times[1:] > times[:-1], True) & np.append(True, times[1:] > times[:-1]))
    times, tied = times[at], tied[at]
    known = np.flatnonzero(tied)
    # Without a string the stick stays where it was, of no length.
    nearest = at[known[np.clip(np.searchsorted(known, np.arange(len(at)), side="right") - 1, 0, None)]]
    lengths, ways = _lengths_and_ways(free[nearest], knots[nearest])
    shown = tied[:, np.newaxis].astype(float)
    scales = np.hstack([shown, shown, lengths * shown])
    attitudes = _attitudes(ways)
    places = free[nearest]
    chosen = [np.arange(len(times))] * 3
    if tolerance is not None:
        changed = np.isin(at[1:], before + 1) | (tied[1:] != tied[:-1])
        runs = np.split(np.arange(len(times)), np.flatnonzero(changed) + 1)
        own = SHARE * tolerance
        of = ((places, own), (attitudes, own / max(float(lengths.max()), own)), (scales, own))
        chosen = [
            np.concatenate([run[fewest_keys(times[run], values[run], within)] for run in runs]) for values, within in of
        ]
    scale_times, scales = _with_ends(times[chosen[2]], scales[chosen[2]], tied[chosen[2]])
    return StringKeys(
        Keys(times[chosen[0]], rounded(places[chosen[0]])),
        Keys(times[chosen[1]], rounded(attitudes[chosen[1]])),
        Keys(scale_times, rounded(scales)),
    )


def _with_ends(times: np.ndarray, scales: np.ndarray, tied: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scales with a last zero right before a string is tied, and a first one right after it is let go."""
    extra_times, extra = [], []
    for k in (np.flatnonzero(tied[1:] != tied[:-1]) + 1).tolist():
        # From one single-precision number to the next, on the side that has no string.
        known, side = (k, -1.0) if tied[k] else (k - 1, np.inf)
        t = float(np.nextafter(np.float32(times[known]), np.float32(side)))
        if times[k - 1] < t < times[k]:
            extra_times.append(t)
            extra.append(np.zeros(3))
    if not extra:
        return times, scales
    all_times = np.concatenate([times, extra_times])
    order = np.argsort(all_times)
    return all_times[order], np.vstack([scales, extra])[order]


def _attitudes(ways: np.ndarray) -> np.ndarray:
    """Attitudes (n, 4) xyzw that take z to these directions (n, 3), each turned from the one before the short way."""
    attitudes = np.empty((len(ways), 4))
    attitude, before = (0.0, 0.0, 0.0, 1.0), np.array([0.0, 0.0, 1.0])
    for k, way in enumerate(ways):
        if way.any():
            attitude = multiply(*_short_turn(before, way), *attitude)
            before = way
        attitudes[k] = attitude
        attitudes[k] /= np.linalg.norm(attitudes[k])
    return attitudes


def _short_turn(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float, float]:
    """The attitude that turns the unit vector a to b about the axis square to both; any such one for opposite ones."""
    half = a + b
    if (length := float(np.linalg.norm(half))) < 1e-9:
        side = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 1.0, 0.0])
        x, y, z = side / np.linalg.norm(side)
        return x, y, z, 0.0
    x, y, z = np.cross(a, half / length)
    return x, y, z, float(a @ half) / length
