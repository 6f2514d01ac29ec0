# SPDX-License-Identifier: MIT
"""free_body_strang: half a kick, exact free motion, half a kick. A kick is what loads and damping do to the
velocities while the attitude stands still.

Order 2, one evaluation a step, time-reversible. Source: Strang, SIAM J. Numer. Anal. 5 (1968) 506; for rigid bodies
McLachlan and Quispel, Acta Numerica 11 (2002) 341. Its error has the torque as a factor, so it pays when the body spins
fast under weak loads, at any |ω|h; angular momentum is exact under loads without torque.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate
from ..variables import damping_functions, is_good
from .equations import parts_of, undamped_torque
from .free_body import free_step
from .integrator import ANGULAR_DAMPING, LOADS, Integrator


@njit(cache=True, error_model="numpy", allocates=False)
def _push(y: np.ndarray, p: np.record) -> tuple[float, ...]:
    """Torque (principal axes) and acceleration (world axes) at the attitude of y: six numbers."""
    tx, ty, tz = undamped_torque((y[0], y[1], y[2], y[3]), p)
    if not p.translates:
        return tx, ty, tz, 0.0, 0.0, 0.0
    own, added = p.acceleration_body, p.acceleration_added
    ax, ay, az = rotate(y[0], y[1], y[2], y[3], own[0], own[1], own[2])
    return tx, ty, tz, ax + added[0], ay + added[1], az + added[2]


@njit(cache=True, error_model="numpy", allocates=False)
def _kick(y: np.ndarray, p: np.record, h: float, pushed: tuple[float, ...]) -> None:
    """Let ``_push`` act for h seconds on ω and the added velocity, in place; damping in closed form."""
    angular, linear = p.damping_angular, p.damping_linear
    for k in range(3):
        rate = pushed[k] / p.moments[k]
        if angular == 0.0:
            y[4 + k] += h * rate
        else:
            # ω' = rate − z ω: ω + h φ₁(zh)(rate − z ω).
            z = angular / p.moments[k]
            y[4 + k] += h * damping_functions(z * h)[0] * (rate - z * y[4 + k])
        if p.translates:
            y[10 + k] += h * damping_functions(linear * h)[0] * (pushed[3 + k] - linear * y[10 + k])


@njit(cache=True, error_model="numpy")
def free_body_strang_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    moments = p.moments[0], p.moments[1], p.moments[2]
    new = y.copy()
    pushed = _push(new, p)
    for done in range(n):
        _kick(new, p, 0.5 * h, pushed)
        q, w, _, _ = parts_of(new)
        (new[0], new[1], new[2], new[3]), (new[4], new[5], new[6]) = free_step(q, w, moments, h)
        if p.translates:
            for k in range(3):
                new[7 + k] += h * new[10 + k]
        # The next step's first half kick sees the same attitude.
        pushed = _push(new, p)
        _kick(new, p, 0.5 * h, pushed)
        if not is_good(new):
            return done
        y[:] = new
    return n


FREE_BODY_STRANG = Integrator(
    name="free_body_strang",
    order=2,
    evaluations=1,
    source="Strang, SIAM J. Numer. Anal. 5 (1968) 506",
    limits="No string; the error per step grows with torque times h³, not with the spin alone.",
    stability_limit=math.inf,
    supports=LOADS | {ANGULAR_DAMPING},
    kernel=free_body_strang_steps,
)
