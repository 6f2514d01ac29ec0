# SPDX-License-Identifier: MIT
"""The string of a flight as numbers between which straight lines may be drawn, and the keys of an animation of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..picture.string import curve_points, sags
from ..simulation.observer import ShownString
from .flight_record import FlightRecord
from .interpolation import Keys, fewest_keys, rounded

SHARE = 0.25
"""Of the tolerance, for keys that are left out of the free end's, and as much for those of what is between the ends."""

PLACE, SPAN, SAG = slice(0, 3), slice(3, 6), slice(6, 9)
"""Columns of a shape: the free end [m, world], its way to the knot, how far the middle hangs below the span's."""


def string_shapes(record: FlightRecord, times_ns: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Shapes (n, 9) at times (n,) of a body with poses (n, 7); NaN while no string is tied. At the time of a change it
    is the string before it, but for one that is tied from time 0 on.
    """
    shapes = np.full((len(times_ns), 9), np.nan)
    gravity = _in_force(times_ns, [(drawn.time_ns, drawn.body.gravity) for drawn in record.bodies])
    for begin, end, string in _spells(times_ns, record.strings):
        if string is None or end <= begin:
            continue
        own = poses[begin:end]
        free = string.free_end(times_ns[begin:end])
        span = own[:, :3] + matrix_from_quaternion(own[:, 3:]) @ string.attach - free
        slack = 0.0 if string.bilateral else string.rest_length
        shapes[begin:end] = np.hstack([free, span, sags(span, slack, gravity[begin:end])])
    return shapes


def _spells(
    times_ns: np.ndarray, strings: list[tuple[int, ShownString | None]]
) -> list[tuple[int, int, ShownString | None]]:
    begins = np.searchsorted(times_ns, [t if t > 0 else -1 for t, _ in strings], side="right").tolist()
    return [(b, e, own) for b, e, (_, own) in zip(begins, [*begins[1:], len(times_ns)], strings, strict=False)]


def _in_force(times_ns: np.ndarray, values: list[tuple[int, np.ndarray]]) -> np.ndarray:
    """The value (n, 3) at each time; at that of a change the one before it."""
    begins = np.array([t for t, _ in values[1:]], dtype=np.int64)
    return np.array([value for _, value in values])[np.searchsorted(begins, times_ns, side="left")]


def string_points(shapes: np.ndarray) -> np.ndarray:
    """The string's points (n, POINTS, 3) [m, world], from the free end to the knot."""
    return curve_points(shapes[:, PLACE], shapes[:, SPAN], shapes[:, SAG])


def string_breaks(record: FlightRecord) -> list[int]:
    """Times [ns] at which the free end begins to move or stops."""
    return [t for _, string in record.strings if string is not None for t in (string.begin_ns, string.end_ns)]


def string_changes(record: FlightRecord) -> list[int]:
    """Times [ns] at which the drawn string may jump: another one, or another gravity."""
    bodies = [(drawn.time_ns, drawn.body.gravity) for drawn in record.bodies]
    pulled = [t for (_, old), (t, new) in zip(bodies, bodies[1:], strict=False) if not np.array_equal(old, new)]
    return [t for t, _ in record.strings if t > 0] + pulled


def shapes_apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far (n,) [m] two shapes (n, 9) lie apart at their ends or in the middle, whichever is most; NaN where there
    is no string.
    """
    d = a - b
    parts = d[:, PLACE], d[:, PLACE] + d[:, SPAN], d[:, PLACE] + 0.5 * d[:, SPAN] + d[:, SAG]
    return np.max([np.linalg.norm(part, axis=1) for part in parts], axis=0)


@dataclass(frozen=True)
class StringKeys:
    """Of the string: its free end [m, world], its span and sag (k, 6) [m], and whether it is shown: (k, 3) of 1 or 0,
    each until the next.
    """

    places: Keys
    forms: Keys
    shown: Keys

    def played(self, times: np.ndarray) -> np.ndarray:
        """Shapes (n, 9) that a player shows at these times (n,)."""
        return np.hstack([self.places.played(times), self.forms.played(times)])


def string_keys(seconds: np.ndarray, shapes: np.ndarray, tolerance: float | None = None) -> StringKeys | None:
    """Keys at times (n,) [s, single precision] of shapes (n, 9): as few as keep it within the tolerance [m], or all
    without one; None where a string is never tied.
    """
    tied = ~np.isnan(shapes[:, 0])
    if not tied.any():
        return None
    times = seconds.copy()
    # Of samples at one single-precision time the first is before a change, the last after it.
    alike = times[1:] == times[:-1]
    before = np.flatnonzero(np.append(alike, False) & ~np.append(False, alike))
    times[before] = np.nextafter(times[before].astype(np.float32), np.float32(-1.0))
    at = np.flatnonzero(np.append(times[1:] > times[:-1], True))
    times, tied = times[at], tied[at]
    known = np.flatnonzero(tied)
    # Without a string it stays as it was, unseen.
    values = shapes[at[known[np.clip(np.searchsorted(known, np.arange(len(at)), side="right") - 1, 0, None)]]]
    places, forms = values[:, PLACE], values[:, 3:]
    chosen = [np.arange(len(times))] * 2
    if tolerance is not None:
        changed = np.isin(at[:-1], before) | (tied[1:] != tied[:-1])
        runs = np.split(np.arange(len(times)), np.flatnonzero(changed) + 1)
        chosen = [
            np.concatenate([run[fewest_keys(times[run], own[run], SHARE * tolerance)] for run in runs])
            for own in (places, forms)
        ]
    return StringKeys(
        Keys(times[chosen[0]], rounded(places[chosen[0]])),
        Keys(times[chosen[1]], rounded(forms[chosen[1]])),
        _shown(times, tied),
    )


def _shown(times: np.ndarray, tied: np.ndarray) -> Keys:
    """From the first time at which a string is known on, until right after the last."""
    begins, seen = [float(times[0])], [float(tied[0])]
    for k in (np.flatnonzero(tied[1:] != tied[:-1]) + 1).tolist():
        after = float(np.nextafter(np.float32(times[k - 1]), np.float32(np.inf)))
        begins.append(float(times[k]) if tied[k] else min(after, float(times[k])))
        seen.append(float(tied[k]))
    return Keys(np.array(begins), np.repeat(np.array(seen)[:, np.newaxis], 3, axis=1))
