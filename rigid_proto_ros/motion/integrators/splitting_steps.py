# SPDX-License-Identifier: MIT
"""free_body_strang with steps as long as the accuracy allows, for a fast spin under weak loads: up to thousands of
turns in one.

Where |ω|h is large, half kicks at a step's ends sample the loads at phases that have nothing to do with their mean, and
no comparison of steps could tell: at other lengths the phases may agree. So the error is bounded beforehand, in two
ways, of which the one that allows the longer step counts.

For any phase and any loads: the loads turn the body by at most κ, kicks as well, and what is lost after h is what a
change of κh in the spin does in free motion:

    attitude angle and |Δω|/|ω| ≤ (1 + s) κ h²,

where s says how fast free motions from neighbouring spins part: s = 2.5 while they have no time to part exponentially
near the middle axis, ω_p h ≤ 1, and s = 4 + 0.3/m₁ for any time, with ω_p and m₁ of free_body_step.py: m₁ is 0 on the
separatrix. Measured over 400 000 random bodies, spins and times, |ω|t from 0.1 to 1e4: at most 2.4, and 4.3, 20, 62,
330 for m₁ down to 1e-1, 1e-2, 1e-3, 1e-4. Steps of at most 2 rad resolve the turn, and err at most ½ κ h² min(1, |ω|h):
measured 0.38 and 0.34. A force that turns with the body, g in acceleration, adds at most 2gh to the velocity and gh² to
the place.

From the phase at the step's start, with loads averaged over the free motion (averaged_loads.py): to first order in the
loads, and the square of (1 + s) κ h² for the second. Steps are some ten times longer so.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import cube_root
from .. import problem as of
from ..variables import SPIN
from . import control as ctl
from .averaged_loads import DIRECT, averaged_error
from .free_body_step import circulation
from .free_body_strang import free_body_strang_steps

SHORT_SPREAD, SHORT_PHASE = 2.5, 1.0
"""s while ω_p h is at most this."""

SPREAD, SPREAD_AT_SEPARATRIX = 4.0, 0.3
"""s at any ω_p h: the first, and the second over m₁."""

PART = 0.75
"""Of the accuracy, what an error with averaged loads gets."""

SECOND_ORDER = 0.1
"""Of that, what goes to the second order in the loads: the square of the first."""

RESOLVED = 2.0
"""|ω|h [rad] up to which a step resolves the turn."""

TURN_THAT_PAYS, TURN_THAT_PAYS_IN_WORLD = 4.0, 1.5
"""|ω|h [rad] from which on steps are cheaper than a Taylor series, of the spin alone or of the whole motion: measured,
the series cost 0.28 and 0.56 µs a radian, a step 0.6 to 1.2 µs.
"""

ROUNDING = 64.0 * 2.0**-52
"""Accuracy over |ω| below which the rounding of long free steps could show: an exact step errs some ε|ω|h."""


@njit(cache=True, error_model="numpy", allocates=False)
def _length(p: np.ndarray, at: int, count: int) -> float:
    square = 0.0
    for k in range(at, at + count):
        square += p[k] * p[k]
    return math.sqrt(square)


@njit(cache=True, error_model="numpy", allocates=False)
def _strongest(p: np.ndarray) -> float:
    """κ [rad/s²]: no attitude gives the loads a larger angular acceleration."""
    T, I = of.TORQUE_BODY, of.MOMENTS
    x, y, z = p[T] / p[I], p[T + 1] / p[I + 1], p[T + 2] / p[I + 2]
    turning = _length(p, of.TORQUE_WORLD, 3) + math.sqrt(2.0) * _length(p, of.MOMENT, 9)
    return math.sqrt(x * x + y * y + z * z) + turning / p[I]


@njit(cache=True, error_model="numpy", allocates=False)
def _averaged(y: np.ndarray, p: np.ndarray, accuracy: float, strongest: float, most: float) -> float:
    """The longest step [s] whose error, with loads averaged over the free motion, is PART of the accuracy at most; 0
    where that isn't known. most: what the error is at most over h² [1/s²].
    """
    if PART * accuracy * _length(y, SPIN, 3) <= DIRECT * strongest:
        return 0.0
    growing, oscillating = averaged_error(y, p, strongest)
    left = PART * accuracy - oscillating
    if left <= 0.0:
        return 0.0
    second = cube_root(SECOND_ORDER * left / (most * most))
    return min((1.0 - SECOND_ORDER) * 2.0 * left / growing, second) if growing > 0.0 else second


@njit(cache=True, error_model="numpy", allocates=False)
def step_length(y: np.ndarray, p: np.ndarray, accuracy: float) -> float:
    """The longest step [s] whose error is bounded by the accuracy times itself."""
    strongest, spin = _strongest(p), _length(y, SPIN, 3)
    h = ctl.LONGEST
    if strongest > 0.0:
        rate, distance = circulation(p[of.MOMENTS], p[of.MOMENTS + 1], p[of.MOMENTS + 2], y[4], y[5], y[6])
        allowed = accuracy / strongest
        # The last one is for a spin that the loads have stopped: |ω| is κh then.
        resolved = min(RESOLVED / spin, math.sqrt(2.0 * allowed / spin), cube_root(allowed / strongest))
        short = min(SHORT_PHASE / rate, allowed / (1.0 + SHORT_SPREAD))
        long = allowed / (1.0 + SPREAD + SPREAD_AT_SEPARATRIX / distance)
        h = max(resolved, short, long)
        known = (1.0 + SPREAD + SPREAD_AT_SEPARATRIX / distance) * strongest
        h = min(max(h, _averaged(y, p, accuracy, strongest, known)), ctl.LONGEST)
    if p[of.TRANSLATES] != 0.0:
        h = min(h, accuracy * p[of.LENGTH] / _length(p, of.ACCELERATION_BODY, 3))
    return h


@njit(cache=True, error_model="numpy", allocates=False)
def splitting_pays(p: np.ndarray, y: np.ndarray, accuracy: float) -> bool:
    """Whether loads are so weak against the spin that steps are cheaper than those of a series."""
    spin = _length(y, SPIN, 3)
    if p[of.GYROSCOPIC] == 0.0 or p[of.DAMPING_ANGULAR] != 0.0 or accuracy < ROUNDING * spin:
        return False
    # What a kick adds to the velocity may be wrong altogether.
    force_shows = p[of.DAMPING_LINEAR] != 0.0 or 2.0 * _length(p, of.ACCELERATION_BODY, 3) > accuracy * p[of.LENGTH]
    if p[of.TRANSLATES] != 0.0 and force_shows:
        return False
    least = TURN_THAT_PAYS_IN_WORLD if p[of.HAS_WORLD_TORQUE] != 0.0 else TURN_THAT_PAYS
    return spin * step_length(y, p, accuracy) >= least


def workspace(_degree: int) -> np.ndarray:
    """None is needed; a table of methods wants a shape."""
    return np.empty((1, 1))


@njit(cache=True, error_model="numpy")
def steps(
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    following: np.ndarray,
    _room: np.ndarray,
    span_ns: int,
    sampling: bool,
) -> int:
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays.

    sampling: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it
    failed.
    """
    if sampling:
        return span_ns if free_body_strang_steps(y, p, span_ns * 1e-9, 1) == 1 else 0
    advanced = 0
    while True:
        if control[ctl.ACCEPTED_NS] == 0.0:
            length_ns = math.floor(step_length(y, p, control[ctl.ACCURACY]) * 1e9)
            following[:] = y
            if length_ns < 1.0 or free_body_strang_steps(following, p, length_ns * 1e-9, 1) != 1:
                control[ctl.FAILED] = 1.0
                return advanced
            ctl.accept(control, length_ns)
            control[ctl.PENDING] = 1.0
        length = ctl.commit(control, y, following, span_ns - advanced)
        if length == 0:
            return advanced
        advanced += length
