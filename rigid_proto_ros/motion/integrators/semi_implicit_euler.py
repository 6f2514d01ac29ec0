# SPDX-License-Identifier: MIT
"""semi_implicit_euler: velocities first, then positions with the new velocities, as game engines step.

Order 1, one evaluation a step; the attitude moves by the exponential map. Source: Hairer, Lubich and Wanner, Geometric
Numerical Integration (2006), section I.1 (symplectic Euler). Symplectic only where velocities do not act on velocities:
the gyroscopic term is taken explicitly, so a spinning body gains energy.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import exponential, multiply, normalize
from ..variables import DISPLACEMENT, HAND_WORK, HEAT, SPIN, VELOCITY
from .equations import accelerations, parts_of
from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .runge_kutta import ONE_STAGE, repeated


@njit(cache=True, error_model="numpy")
def _step(
    y: np.ndarray, p: np.record, h: float, pulls: bool, _tableau: np.ndarray, _k: np.ndarray, out: np.ndarray
) -> None:
    q, w, d, u = parts_of(y)
    turning, moving, work, heat = accelerations(q, w, d, u, p, pulls)
    for j in range(3):
        out[SPIN + j] = w[j] + h * turning[j]
        out[VELOCITY + j] = u[j] + h * moving[j]
        out[DISPLACEMENT + j] = d[j] + h * out[VELOCITY + j]
    turn = exponential(h * out[SPIN], h * out[SPIN + 1], h * out[SPIN + 2])
    out[0], out[1], out[2], out[3] = normalize(*multiply(*q, *turn))
    out[HAND_WORK], out[HEAT] = y[HAND_WORK] + h * work, y[HEAT] + h * heat


@njit(cache=True, error_model="numpy")
def semi_implicit_euler_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, ONE_STAGE, y, p, h, n)


SEMI_IMPLICIT_EULER = Integrator(
    name="semi_implicit_euler",
    order=1,
    evaluations=1,
    source="Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), section I.1",
    limits="First order; a string stays bounded up to ω_s h of about 2, "
    "a spinning body gains energy beyond |ω|h of 0.1.",
    stability_limit=0.1,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=semi_implicit_euler_steps,
)
