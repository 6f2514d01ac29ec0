# SPDX-License-Identifier: MIT
"""auto: for each segment the cheapest method that meets ``accuracy``.

| the segment has | method |
|---|---|
| no motion and no load | none: the body sleeps |
| no spin, no torque | closed form |
| spin, no torque, no body-fixed force | one exact step of any length |
| a body-fixed wrench, damping, a flywheel | Taylor series of the spin and of the quantities that follow from it |
| loads that depend on the attitude, a string | Taylor series of the whole motion |

Taylor steps are as long as the accuracy allows, which follows from their coefficients. The choice depends only on the
segment's problem and initial state, and each step only on the state at its start. Strings, damping and
flywheels faster than FASTEST are refused (simulation/setup.py): they need steps below about 1.5/FASTEST, for which the
simulation would be slower than real time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base.compilation import njit
from ...base.rotation import exponential, multiply, normalize, rotate
from ...base.vectors import FloatArray
from ..loads import ANGULAR_DAMPING, NO_GYROSCOPIC_TERM, ROTOR, STRING
from ..problem import Variables, damping_functions, is_good, stretch
from .free_body import free_body_steps
from .integrator import ADAPTIVE, LOADS, NOTHING, ONE_STEP, Integrator, Method
from .series_steps import series_steps

FASTEST = 5e5
"""Highest frequency of a string or flywheel [rad/s] and rate of damping [1/s] that one core can simulate in real time:
3.3e5 steps per second, each of 2 to 3 µs.
"""


@njit(error_model="numpy", allocates=False)
def steady_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Closed form for a body without spin, or with a constant spin because the gyroscopic term is left out."""
    for done in range(n):
        own, c = p.acceleration_body, p.damping_linear
        push = rotate(y[0], y[1], y[2], y[3], own[0], own[1], own[2])
        phi1, phi2 = damping_functions(c * h)
        if p.translates:
            for k in range(3):
                a, u = push[k] + p.acceleration_added[k], y[10 + k]
                y[7 + k] += h * (phi1 * u + h * phi2 * a)
                y[10 + k] += h * phi1 * (a - c * u)
        rx, ry, rz, rw = exponential(h * y[4], h * y[5], h * y[6])
        qx, qy, qz, qw = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, rw)
        y[0], y[1], y[2], y[3] = normalize(qx, qy, qz, qw)
        if not is_good(y):
            return done
    return n


ASLEEP, COASTING, STEADY, FREE, TURNING_LOADS, ANY_LOADS, SLACK_AT_REST, ON_STRING = range(8)
"""Kinds of segments, as in the table above; each has its own method of auto."""


@njit(error_model="numpy", allocates=False)
def _any(v: FloatArray, at: int = 0) -> bool:
    """Whether any of three numbers isn't zero."""
    return bool(v[at] != 0.0 or v[at + 1] != 0.0 or v[at + 2] != 0.0)


@njit(error_model="numpy", allocates=False)
def kind_of_segment(p: np.record, y: Variables) -> int:
    """Kind of a segment with problem p and initial variables y."""
    spins = _any(y, 4)
    turned = _any(p.torque_body) or p.has_world_torque or (spins and p.damping_angular != 0.0)
    if p.has_rotor:
        turned = turned or _any(p.rotor_torque) or (spins and p.gyroscopic != 0.0)
    translates = p.translates
    if p.has_string:
        accelerated = _any(p.acceleration_added) or _any(p.acceleration_body)
        moves = spins or turned or accelerated or _any(y, 10) or _any(p.hand_velocity)
        return ON_STRING if moves or stretch(y, p)[0] > 0.0 else SLACK_AT_REST
    if not turned:
        if not spins and not translates:
            falls = _any(p.reference_velocity) or _any(p.reference_acceleration)
            return COASTING if falls else ASLEEP
        if not spins or (p.gyroscopic == 0.0 and not translates):
            return STEADY
        if not translates:
            return FREE
    return ANY_LOADS if p.has_world_torque else TURNING_LOADS


_SERIES = Method(
    ADAPTIVE,
    series_steps,
    "auto: taylor of degree {degree_of_motion}, loads that depend on the attitude",
)


_BY_KIND = {
    ASLEEP: Method(NOTHING, None, "auto: sleeping, nothing moves or acts", sleeps=True),
    COASTING: Method(NOTHING, None, "auto: closed form, nothing turns the body"),
    STEADY: Method(ONE_STEP, steady_steps, "auto: closed form, nothing changes the spin", 1),
    FREE: Method(ONE_STEP, free_body_steps, "auto: free_body, free rotation, exact", 1),
    TURNING_LOADS: replace(
        _SERIES, choice="auto: taylor of degree {degree}, the loads turn with the body", spin_alone=True
    ),
    ANY_LOADS: _SERIES,
    SLACK_AT_REST: Method(
        NOTHING,
        None,
        "auto: sleeping, the string is slack and nothing moves",
        sleeps=True,
    ),
    ON_STRING: replace(
        _SERIES,
        choice="auto: taylor of degree {degree_of_motion}, a string of up to {swing:.3g} rad/s",
    ),
}


AUTO = Integrator(
    name="auto",
    order=None,
    evaluations=0,
    source="integrators/auto.py",
    limits="Selects a method for each segment; steps follow from ``accuracy``, not ``step``.",
    stability_limit=math.inf,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM, ROTOR},
    kernel=None,
    ways=tuple(_BY_KIND[kind] for kind in range(len(_BY_KIND))),
)
