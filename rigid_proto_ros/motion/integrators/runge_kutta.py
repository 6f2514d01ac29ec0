# SPDX-License-Identifier: MIT
"""One step of an explicit Runge-Kutta method given by its tableau, on all variables of a segment at once, and the loops
over steps of one length.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1. The quaternion is
normalized after the step; the right-hand side takes its direction only, so stages may leave the unit sphere.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...base.compilation import njit
from ...base.rotation import normalize
from ..variables import VARIABLES
from . import slack
from .equations import accelerations
from .integrator import MAX_SPEED

_Step = Callable[[np.ndarray, np.record, float, bool, np.ndarray], None]
"""One step: (y, p, h, taut, out)."""


@njit(cache=True, error_model="numpy")
def integrated(p: np.record) -> int:
    """How many of the variables change: attitude and spin; with added motion also that; with a string
    also its energies.
    """
    if p.has_string:
        return VARIABLES
    return 13 if p.translates else 7


@njit(cache=True, error_model="numpy")
def rates(z: np.ndarray, p: np.record, taut: bool, k: np.ndarray) -> None:
    """Time derivatives k of variables z, both (15,)."""
    qx, qy, qz, qw = z[0], z[1], z[2], z[3]
    wx, wy, wz = z[4], z[5], z[6]
    k[0] = 0.5 * (qw * wx + qy * wz - qz * wy)
    k[1] = 0.5 * (qw * wy - qx * wz + qz * wx)
    k[2] = 0.5 * (qw * wz + qx * wy - qy * wx)
    k[3] = -0.5 * (qx * wx + qy * wy + qz * wz)
    if p.translates or p.has_world_torque:
        qx, qy, qz, qw = normalize(qx, qy, qz, qw)
    k[4], k[5], k[6], k[10], k[11], k[12], k[13], k[14] = accelerations(
        qx, qy, qz, qw, wx, wy, wz, z[7], z[8], z[9], z[10], z[11], z[12], p, taut
    )
    k[7], k[8], k[9] = z[10], z[11], z[12]


@njit(cache=True, error_model="numpy")
def stages(
    y: np.ndarray, p: np.record, h: float, taut: bool, A: np.ndarray, count: int, k: np.ndarray, z: np.ndarray
) -> None:
    """Fill the stage derivatives k (count, 15); k[0] must hold the rates at y. z (15,) is scratch."""
    size = integrated(p)
    for i in range(1, count):
        for j in range(size):
            z[j] = 0.0
        for m in range(i):
            a = A[i, m]
            if a != 0.0:
                for j in range(size):
                    z[j] += a * k[m, j]
        for j in range(size):
            z[j] = y[j] + h * z[j]
        rates(z, p, taut, k[i])


@njit(cache=True, error_model="numpy")
def advance(y: np.ndarray, p: np.record, h: float, B: np.ndarray, count: int, k: np.ndarray, out: np.ndarray) -> None:
    """The new variables from the stages: out = y + h Σ bᵢ kᵢ with a unit quaternion."""
    size = integrated(p)
    for j in range(size):
        total = 0.0
        for i in range(count):
            total += B[i] * k[i, j]
        out[j] = y[j] + h * total
    for j in range(size, VARIABLES):
        out[j] = y[j]
    out[0], out[1], out[2], out[3] = normalize(out[0], out[1], out[2], out[3])


@njit(cache=True, error_model="numpy")
def is_good(y: np.ndarray) -> bool:
    """Finite and no runaway."""
    size = 0.0
    for j in range(4, 13):
        size += abs(y[j])
    # Negated sense, so that NaN counts as a runaway.
    return size <= MAX_SPEED and math.isfinite(y[0] + y[1] + y[2] + y[3])


@njit(inline="always", error_model="numpy")
def repeated(step: _Step, y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones. step: a kernel.

    Put into the kernel that calls it, since numba keeps no compiled code that was handed a function.
    """
    new = y.copy()
    for done in range(n):
        step(y, p, h, False, new)
        if not is_good(new):
            return done
        y[:] = new
    return n


@njit(inline="always", error_model="numpy")
def repeated_on_string(step: _Step, y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """``repeated``, each step cut where the string turns slack or taut."""
    new, trial = y.copy(), y.copy()
    search = slack.new_search()
    for done in range(n):
        new[:] = y
        slack.begin(search, new, p, h)
        while search[slack.REMAINING] > 0.0:
            step(new, p, search[slack.TRIAL], search[slack.TAUT] != 0.0, trial)
            if slack.check_trial(search, trial, p):
                new[:] = trial
        if not is_good(new):
            return done
        y[:] = new
    return n


@njit(cache=True, error_model="numpy")
def tableau_steps_on_string(y: np.ndarray, p: np.record, h: float, n: int, A: np.ndarray, B: np.ndarray) -> int:
    """The same for the method of stages A (s, s) and weights B (s,)."""
    count = len(B)
    k, z, new, trial = np.zeros((count, VARIABLES)), np.empty(VARIABLES), y.copy(), y.copy()
    search = slack.new_search()
    for done in range(n):
        new[:] = y
        slack.begin(search, new, p, h)
        while search[slack.REMAINING] > 0.0:
            taut = search[slack.TAUT] != 0.0
            rates(new, p, taut, k[0])
            stages(new, p, search[slack.TRIAL], taut, A, count, k, z)
            advance(new, p, search[slack.TRIAL], B, count, k, trial)
            if slack.check_trial(search, trial, p):
                new[:] = trial
        if not is_good(new):
            return done
        y[:] = new
    return n
