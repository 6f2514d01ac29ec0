# SPDX-License-Identifier: MIT
"""Where the two ends of the string are."""

from __future__ import annotations

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..simulation.observer import ShownString


def string_ends(
    strings: list[tuple[int, ShownString | None]], times_ns: np.ndarray, poses: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The free end and the knot (n, 3) each [m, world] at times (n,) of a body with poses (n, 7); NaN while no string
    is tied. At the time of a change it is the string before it.
    """
    free, knots = np.full((len(times_ns), 3), np.nan), np.full((len(times_ns), 3), np.nan)
    begins = np.searchsorted(times_ns, [t for t, _ in strings[1:]], side="right").tolist()
    for begin, end, (_, string) in zip([0, *begins], [*begins, len(times_ns)], strings, strict=False):
        if string is None or end <= begin:
            continue
        times, own = times_ns[begin:end], poses[begin:end]
        lasts = max(string.end_ns - string.begin_ns, 1)
        done = np.clip((times - string.begin_ns) / lasts, 0.0, 1.0)[:, np.newaxis]
        free[begin:end] = string.origin + done * (np.asarray(string.target) - string.origin)
        knots[begin:end] = own[:, :3] + matrix_from_quaternion(own[:, 3:]) @ string.attach
    return free, knots
