# SPDX-License-Identifier: MIT
"""Where rounding, and not the accuracy asked for, decides how far a motion can be trusted: said in one line.

A state is held in doubles, so three things no method can better: a spin known to ε turns into an attitude known to
ε|ω|t, a position far from the world's origin is known to half a unit in its last place, and a slender body's tensor
given in axes other than its own holds its smallest moment, and the difference of the others, to ε I₃ alone.
"""

from __future__ import annotations

import math

from ..motion.integrators.error_measure import FLOOR
from ..motion.state import State
from .setup import Setup

_EPSILON = 2.0**-52
ROUNDINGS = 2.0
"""ε|ω|t that the exact free step's attitude may err. Measured in 36 flights at 1e3 to 1e6 rad/s: up to 1.1 where the
tensor is given in its own axes, and up to 1.0 times I₃/I₁ where it isn't.
"""


def accuracy_floor(setup: Setup, state: State, step_floor: bool, exact_step: bool, elapsed: float) -> str:
    """Why the motion is held to less than ``setup.accuracy``; empty when it is held to it.

    step_floor: the stepper's own report. exact_step: the segment is one exact step. elapsed: since the segment's start
    [s].
    """
    accuracy, spin = setup.accuracy, math.sqrt(float((state.angular_velocity_body**2).sum()))
    inertia, moments = setup.body.inertia, setup.body.principal_moments
    rate = ROUNDINGS * _EPSILON * spin
    if exact_step and rate > accuracy:
        return f"rounding of a spin of {spin:.3g} rad/s turns the attitude by up to {rate:.2g} rad a second"
    if inertia[0, 1] or inertia[0, 2] or inertia[1, 2]:
        ratio = float(moments[2] / moments[0])
        if ratio * rate > accuracy:
            what = f"a tensor whose moments differ {ratio:.3g} times, given in other axes than its own"
            return f"rounding of {what}, turns the attitude by up to {ratio * rate:.2g} rad a second"
    farthest = float(abs(state.position).max())
    place = 0.5 * math.ulp(farthest) / setup.length
    if place > max(accuracy * elapsed, FLOOR):
        return f"rounding of a position {farthest:.3g} m from the world's origin is {place:.2g} of the body's size"
    if step_floor:
        return "rounding sets what a step may err, 32 units in the last place: steps are too short for the accuracy"
    return ""
