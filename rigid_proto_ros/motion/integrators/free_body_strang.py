# SPDX-License-Identifier: MIT
"""free_body_strang: half a kick, exact free motion, half a kick.

Order 2, one evaluation a step, time-reversible. Source: Strang, SIAM J. Numer. Anal. 5 (1968) 506; for rigid bodies
McLachlan and Quispel, Acta Numerica 11 (2002) 341. Its error has the torque as a factor, so it pays when the body spins
fast under weak loads, at any |ω|h; angular momentum is exact under loads without torque.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from .free_body_step import free_step
from .integrator import ANGULAR_DAMPING, LOADS, Integrator
from .kick import drift_freely, kick, push
from .runge_kutta import is_good
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def free_body_strang_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    a, b, c = p.moments[0], p.moments[1], p.moments[2]
    new = y.copy()
    pushed = push(new, p)
    for done in range(n):
        kick(new, p, 0.5 * h, pushed)
        new[0], new[1], new[2], new[3], new[4], new[5], new[6] = free_step(
            new[0], new[1], new[2], new[3], new[4], new[5], new[6], a, b, c, h
        )
        if p.translates:
            drift_freely(new, h)
        # The next step's first half kick sees the same attitude.
        pushed = push(new, p)
        kick(new, p, 0.5 * h, pushed)
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
    make_methods=fixed_steps,
)
