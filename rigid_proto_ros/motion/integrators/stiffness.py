# SPDX-License-Identifier: MIT
"""Whether a segment's damping is stiff: so fast that it, and not the motion, would set the length of explicit steps."""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from .. import problem as of

STIFF_RATE = 2e4
"""/s; slower damping leaves explicit steps of 75 µs and more, so that even they are far faster than the clock."""

STIFF_RATIO = 100.0
"""Of a damping's rate to those of the motion beside it: the cost of an implicit step over an explicit
one's, by their lengths.
"""

RADIANS, RADIANS_ON_A_STRING = 0.2, 0.04
"""That an implicit step covers of the motion: measured at accuracy 1e-9. 0.6 and 0.1 at 1e-6, 0.1 and 0.02 at 1e-12."""

EVALUATIONS = 60.0
"""In an implicit step: measured 40 to 72."""

OVERDAMPED = 4.0
"""Of a string's damping rate c/m to its swing √(k/m): twice the damping ratio, 2 being critical."""


@njit(cache=True, error_model="numpy", allocates=False)
def damping_and_motion(p: np.ndarray, y: np.ndarray, taut: bool) -> tuple[float, float]:
    """The fastest damping [1/s] of a segment with problem p from variables y on, and the rate of the motion beside it
    [rad/s]. taut: the string counts.
    """
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    smallest = p[of.MOMENTS]
    angular, fastest, motion = p[of.DAMPING_ANGULAR], 0.0, spin
    if angular > 0.0:
        torque = 0.0
        for k in range(3):
            torque += abs(p[of.TORQUE_BODY + k]) + abs(p[of.TORQUE_WORLD + k])
        for k in range(9):
            torque += abs(p[of.MOMENT + k])
        # Where damping is stiff the spin is soon what the torque keeps up.
        motion += torque / angular
        if spin > 0.0 or torque > 0.0 or p[of.HAS_STRING] != 0.0:
            fastest = angular / smallest
    if p[of.TRANSLATES] != 0.0:
        fastest = max(fastest, p[of.DAMPING_LINEAR])
    if taut and p[of.HAS_STRING] != 0.0:
        arm = p[of.ATTACH] ** 2 + p[of.ATTACH + 1] ** 2 + p[of.ATTACH + 2] ** 2
        lightness = 1.0 / p[of.MASS] + arm / smallest
        swing, damping = math.sqrt(p[of.STIFFNESS] * lightness), p[of.STRING_DAMPING] * lightness
        if damping > OVERDAMPED * swing:
            fastest = max(fastest, damping)
            motion += p[of.STIFFNESS] / p[of.STRING_DAMPING]
        else:
            motion += swing
    return fastest, motion


@njit(cache=True, error_model="numpy", allocates=False)
def damping_is_stiff(p: np.ndarray, y: np.ndarray, taut: bool) -> bool:
    """Whether some damping is so much faster than the motion beside it that it would set the length of explicit steps.

    An explicit step is about 1.5/λ long; an implicit one is some tenths of a radian of the motion, and costs some
    hundred times as much.
    """
    fastest, motion = damping_and_motion(p, y, taut)
    return fastest > max(STIFF_RATE, STIFF_RATIO * motion)


def implicit_effort(p: np.ndarray, y: np.ndarray, taut: bool) -> tuple[float, float]:
    """Steps, and evaluations of the equations of motion, that a second takes where damping is stiff, about."""
    _, motion = damping_and_motion(p, y, taut)
    if p[of.DAMPING_ANGULAR] / p[of.MOMENTS + 2] > STIFF_RATE:
        motion -= math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])  # soon gone
    steps = motion / (RADIANS_ON_A_STRING if taut and p[of.HAS_STRING] != 0.0 else RADIANS)
    return steps, steps * EVALUATIONS
