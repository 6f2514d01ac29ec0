# SPDX-License-Identifier: MIT
"""free_body: torque-free motion, exact to rounding for any time in one step.

Its kernel can take many steps, for splittings and tests; in a simulation each sample is one step from the segment's
start, so nothing accumulates. Attitude errs less than 50 ε (1 + |ω|h) rad. World forces at the COM, gravity and linear
damping are closed form beside it.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from .free_body_step import free_step
from .integrator import MAX_SPEED, ONE_STEP, Integrator, Method


@njit(cache=True, error_model="numpy", allocates=False)
def free_body_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    q0, q1, q2, q3, w1, w2, w3 = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
    a, b, c = p.moments[0], p.moments[1], p.moments[2]
    for done in range(n):
        q0, q1, q2, q3, w1, w2, w3 = free_step(q0, q1, q2, q3, w1, w2, w3, a, b, c, h)
        if not (abs(w1) + abs(w2) + abs(w3) <= MAX_SPEED and math.isfinite(q0 + q1 + q2 + q3)):
            return done
        y[0], y[1], y[2], y[3], y[4], y[5], y[6] = q0, q1, q2, q3, w1, w2, w3
    return n


def _methods(_integrator: Integrator) -> tuple[Method, ...]:
    return (Method(ONE_STEP, free_body_steps, lambda _p, _step_s, _accuracy: "free_body: one exact step", 1),)


FREE_BODY = Integrator(
    name="free_body",
    order=None,
    evaluations=1,
    source="Jacobi's elliptic functions; see integrators/free_body_step.py",
    limits="Torque-free motion alone, exact; the step has no bearing.",
    stability_limit=math.inf,
    supports=frozenset(),
    kernel=free_body_steps,
    make_methods=_methods,
)
