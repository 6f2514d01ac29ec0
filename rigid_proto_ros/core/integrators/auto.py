# SPDX-License-Identifier: MIT
"""auto: for each segment the cheapest method that meets ``accuracy``.

| what the segment holds | method |
|---|---|
| nothing moves, nothing pulls | none: the body sleeps |
| no spin, no torque | closed form |
| spin, no torque, no force that turns along | one exact step, however long |
| a body-axes wrench, damping | Taylor series of the spin and what it carries along |
| loads that depend on the attitude, a string | Taylor series of the whole motion |
| a string too stiff to resolve | discrete_gradient at the fixed step, accuracy not met and said so |

Taylor steps are as long as the accuracy allows, read off their coefficients. The choice is a function of the segment's problem and start; steps are functions of what they start from.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..motion import damping_functions
from ..problem import (
    ACCELERATION_ADDED,
    ACCELERATION_BODY,
    ATTACH,
    DAMPING_ANGULAR,
    DAMPING_LINEAR,
    GYROSCOPIC,
    HAND_VELOCITY,
    HAS_STRING,
    HAS_WORLD_TORQUE,
    MASS,
    MOMENTS,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    STIFFNESS,
    TORQUE_BODY,
    TRANSLATES,
)
from ..rotation import multiply, normalize, rotate
from . import control as ctl
from .discrete_gradient import DISCRETE_GRADIENT
from .equations import stretch
from .exponential import exponential
from .free_body import free_body_steps
from .integrator import ANGULAR_DAMPING, LOADS, NO_GYROSCOPIC_TERM, STRING, Integrator
from .runge_kutta import is_good
from .series_steps import series_steps
from .stepping import AdaptiveSteps, FixedSteps, OneStep, Stepper
from .taylor_adaptive import degree_for, taylor_adaptive_steps

FASTEST_STRING = 1e6
"""rad/s; above it resolving the string's swing would take millions of steps a second."""


@njit(cache=True, error_model="numpy")
def steady_steps(y, p, h, n):
    """Closed form for a body that doesn't spin, or whose spin nothing changes for want of the gyroscopic term."""
    for done in range(n):
        B, c = ACCELERATION_BODY, p[DAMPING_LINEAR]
        push = rotate(y[0], y[1], y[2], y[3], p[B], p[B + 1], p[B + 2])
        phi1, phi2 = damping_functions(c * h)
        if p[TRANSLATES] != 0.0:
            for k in range(3):
                a, u = push[k] + p[ACCELERATION_ADDED + k], y[10 + k]
                y[7 + k] += h * (phi1 * u + h * phi2 * a)
                y[10 + k] += h * phi1 * (a - c * u)
        rx, ry, rz, rw = exponential(h * y[4], h * y[5], h * y[6])
        qx, qy, qz, qw = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, rw)
        y[0], y[1], y[2], y[3] = normalize(qx, qy, qz, qw)
        if not is_good(y):
            return done
    return n


def _vector(p: np.ndarray, at: int) -> bool:
    return bool(p[at : at + 3].any())


def _choose(integrator: Integrator, p: np.ndarray, y: np.ndarray, step_ns: int, accuracy: float) -> Stepper:
    """The stepper of a segment with problem p from variables y on."""
    spins = _vector(y, 4)
    turned = _vector(p, TORQUE_BODY) or bool(p[HAS_WORLD_TORQUE]) or (spins and bool(p[DAMPING_ANGULAR]))
    if p[HAS_STRING]:
        return _choose_for_string(p, y, spins or turned, step_ns, accuracy)
    if not turned:
        if not spins and not p[TRANSLATES]:
            if _vector(p, REFERENCE_VELOCITY) or _vector(p, REFERENCE_ACCELERATION):
                return OneStep("auto: closed form, nothing turns the body", None, 0)
            return OneStep("auto: asleep, nothing moves or acts", None, 0, sleeping=True)
        if not spins or (not p[GYROSCOPIC] and not p[TRANSLATES]):
            return OneStep("auto: closed form, nothing changes the spin", steady_steps, 1)
        if not p[TRANSLATES]:
            return OneStep("auto: free_body, one exact step without torque", free_body_steps, 1)
    if p[HAS_WORLD_TORQUE]:
        return _series("loads that depend on the attitude", accuracy, series_steps)
    return _series("the loads turn with the body", accuracy, taylor_adaptive_steps)


def _series(why: str, accuracy: float, kernel) -> Stepper:
    degree = degree_for(accuracy)
    control = ctl.new_control(accuracy, degree)
    return AdaptiveSteps(f"auto: taylor of degree {degree}, {why}", control, kernel, 1)


def _choose_for_string(p, y, turns: bool, step_ns: int, accuracy: float) -> Stepper:
    x, _ = stretch(y, p)
    accelerated = _vector(p, ACCELERATION_ADDED) or _vector(p, ACCELERATION_BODY)
    if x <= 0.0 and not (turns or accelerated or _vector(y, 10) or _vector(p, HAND_VELOCITY)):
        return OneStep("auto: asleep, the string is slack and nothing moves", None, 0, sleeping=True)
    # The knot is lightest, and the swing fastest, where the whole arm counts against the smallest moment.
    arm = p[ATTACH : ATTACH + 3]
    lightness = 1.0 / p[MASS] + float((arm * arm).sum()) / p[MOMENTS]
    fastest = math.sqrt(p[STIFFNESS] * lightness)
    if fastest > FASTEST_STRING:
        stepper = FixedSteps(DISCRETE_GRADIENT, p, y, step_ns, accuracy)
        stepper.choice = f"auto: discrete_gradient at the fixed step, accuracy not met: a string of {fastest:.3g} rad/s"
        stepper.floor_binds = True
        return stepper
    return _series(f"a string of up to {fastest:.3g} rad/s", accuracy, series_steps)


AUTO = Integrator(
    name="auto",
    order=None,
    evaluations=0,
    source="integrators/auto.py",
    limits="Chooses per segment; steps follow from ``accuracy`` and not from ``step``.",
    stability_limit=math.inf,
    carries=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=None,
    stepper=_choose,
)
