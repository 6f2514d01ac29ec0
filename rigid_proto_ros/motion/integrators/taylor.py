# SPDX-License-Identifier: MIT
"""taylor: power series of the motion under a wrench that turns with the body.

With the wrench fixed in body axes, Euler's equations, q' = ½ q ⊗ ω and u' = R g_b + a are polynomial, so the
coefficients follow from each other by Cauchy products, to any degree. Order 18 by default. Source: Jorba and Zou,
Experimental Mathematics 14 (2005) 99. Within its disc of convergence (|ω|h of about 1 to 3) the best there is for a
held body-axes wrench; beyond it the series diverges.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from .integrator import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, Integrator
from .series import SPIN_COLUMNS, are_good, put_variables, spin_at, spin_series, variables_of

DEGREE = 18


@njit(cache=True, error_model="numpy")
def taylor_steps_of_degree(y: np.ndarray, p: np.record, h: float, n: int, degree: int) -> int:
    """Up to n steps of h seconds in place by series of this degree; returns the number of good ones."""
    c, here = np.zeros((degree + 1, SPIN_COLUMNS)), variables_of(y)
    for done in range(n):
        spin_series(here, p, degree, c)
        there = spin_at(c, degree, h)
        if not are_good(there):
            n = done
            break
        here = there
    put_variables(here, y)
    return n


@njit(cache=True, error_model="numpy")
def taylor_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return taylor_steps_of_degree(y, p, h, n, DEGREE)


TAYLOR = Integrator(
    name="taylor",
    order=DEGREE,
    evaluations=1,
    source="Jorba and Zou, Experimental Mathematics 14 (2005) 99",
    limits="A held body-axes wrench, no world torque, no string; diverges beyond |ω|h of about 2.",
    stability_limit=1.0,
    supports=frozenset({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING}),
    kernel=taylor_steps,
)
