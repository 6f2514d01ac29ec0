# SPDX-License-Identifier: MIT
"""free_body_4: exact free motion and kicks composed to order 4, Runge-Kutta-Nyström type with six kicks.

Order 4, six evaluations a step. Source: Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313, method S6 of order 4.
Like all of its kind it needs loads that depend on the attitude and not on velocities: no damping of an integrated
velocity.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ..problem import MOMENTS, TRANSLATES
from .free_body_step import free_step
from .integrator import LOADS, Integrator
from .kick import drift_freely, kick, push
from .runge_kutta import is_good
from .stepping import fixed_steps

_B1, _B2, _B3 = 0.0829844064174052, 0.396309801498368, -0.0390563049223486
_A1, _A2 = 0.245298957184271, 0.604872665711080
KICKS = (_B1, _B2, _B3, 1.0 - 2.0 * (_B1 + _B2 + _B3), _B3, _B2, _B1)
DRIFTS = (_A1, _A2, 0.5 - (_A1 + _A2), 0.5 - (_A1 + _A2), _A2, _A1)


@njit(cache=True, error_model="numpy")
def free_body_4_steps(y: np.ndarray, p: np.ndarray, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    a, b, c = p[MOMENTS], p[MOMENTS + 1], p[MOMENTS + 2]
    new = y.copy()
    pushed = push(new, p)
    for done in range(n):
        for stage in range(6):
            kick(new, p, KICKS[stage] * h, pushed)
            t = DRIFTS[stage] * h
            new[0], new[1], new[2], new[3], new[4], new[5], new[6] = free_step(
                new[0], new[1], new[2], new[3], new[4], new[5], new[6], a, b, c, t
            )
            if p[TRANSLATES] != 0.0:
                drift_freely(new, t)
            pushed = push(new, p)
        kick(new, p, KICKS[6] * h, pushed)
        if not is_good(new):
            return done
        y[:] = new
    return n


FREE_BODY_4 = Integrator(
    name="free_body_4",
    order=4,
    evaluations=6,
    source="Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313",
    limits="No string, no angular damping; pays when the body spins fast under weak loads.",
    stability_limit=math.inf,
    supports=LOADS,
    kernel=free_body_4_steps,
    make_methods=fixed_steps,
)
