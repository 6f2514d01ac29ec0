# SPDX-License-Identifier: MIT
"""rk4: classical Runge-Kutta of order 4 on the quaternion, normalized after each step.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1; Euler's equations
with the gyroscopic term, Goldstein, Classical Mechanics (2002), section 5.5. Order 4, 4 evaluations a step. Explicit:
it loses accuracy as |ω|h nears 1 and diverges beyond about 2.8. Not conservative: energy drifts with h⁵ per step.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from .integrator import ANGULAR_DAMPING, LOADS, NO_GYROSCOPIC_TERM, STRING, Integrator
from .runge_kutta import repeated, tableau_step
from .stepping import fixed_steps

STAGES = np.array([[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
WEIGHTS = np.array([1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0])


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.record, h: float, pulls: bool, k: np.ndarray, out: np.ndarray) -> None:
    tableau_step(y, p, h, pulls, k, out, STAGES, WEIGHTS)


@njit(cache=True, error_model="numpy")
def rk4_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, y, p, h, n, 4)


RK4 = Integrator(
    name="rk4",
    order=4,
    evaluations=4,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1",
    limits="Explicit: diverges beyond |ω|h of about 2.8; energy drifts with h⁵ per step.",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=rk4_steps,
    make_methods=fixed_steps,
)
