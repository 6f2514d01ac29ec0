# SPDX-License-Identifier: MIT
"""dop853: the explicit Runge-Kutta method of order 8 of Prince and Dormand, fixed steps.

Order 8, 12 evaluations a step. Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993),
section II.10. The one for large steps under loads of any kind; not conservative, and useless beyond |ω|h of about 4.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from .dop853_tableau import STAGES, WEIGHTS
from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .runge_kutta import advance, is_good, rates, stages, tableau_steps_on_string
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def dop853_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    k, z, new = np.zeros((12, 15)), np.empty(15), y.copy()
    for done in range(n):
        rates(y, p, False, k[0])
        stages(y, p, h, False, STAGES, 12, k, z)
        advance(y, p, h, WEIGHTS, 12, k, new)
        if not is_good(new):
            return done
        y[:] = new
    return n


@njit(cache=True, error_model="numpy")
def dop853_string_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """The same, each step cut where the string turns slack or taut."""
    return tableau_steps_on_string(y, p, h, n, STAGES, WEIGHTS)


DOP853 = Integrator(
    name="dop853",
    order=8,
    evaluations=12,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.10",
    limits="Explicit: accurate up to |ω|h of about 1, diverges beyond about 4.",
    stability_limit=2.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=dop853_steps,
    string_kernel=dop853_string_steps,
    make_methods=fixed_steps,
)
