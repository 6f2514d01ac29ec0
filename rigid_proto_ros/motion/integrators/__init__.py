# SPDX-License-Identifier: MIT
"""Integrators by name.

An integrator takes the variables of a segment (motion/variables.py) forward in time under the segment's problem
(motion/problem.py). It keeps two promises: a step is a function of the variables, the problem and the step size alone,
and ``advance`` commits only steps at full length, so that sampling the motion never changes it.

Kernels divide as IEEE 754 does (``error_model="numpy"``): a step that explodes comes out as inf or NaN and is refused,
where Python's rule would raise in the middle of it.
"""

from __future__ import annotations

from ...base.errors import CommandRefused, InputError
from .auto import AUTO
from .dop853 import DOP853
from .free_body import FREE_BODY
from .free_body_strang import FREE_BODY_STRANG
from .gram_schmidt import EULER, MIDPOINT
from .integrator import Integrator
from .lie_midpoint import LIE_MIDPOINT
from .rk4 import RK4
from .semi_implicit_euler import SEMI_IMPLICIT_EULER
from .taylor import TAYLOR

INTEGRATORS: dict[str, Integrator] = {
    integrator.name: integrator
    for integrator in (
        AUTO,
        EULER,
        MIDPOINT,
        SEMI_IMPLICIT_EULER,
        RK4,
        LIE_MIDPOINT,
        DOP853,
        TAYLOR,
        FREE_BODY,
        FREE_BODY_STRANG,
    )
}


def check_supported(integrator: Integrator, needs: frozenset[str]) -> None:
    """Raises CommandRefused (``integrator``) naming those that can when ``integrator`` can't meet all ``needs``."""
    lacks = integrator.lacks(needs)
    if lacks:
        able = ", ".join(name for name, other in INTEGRATORS.items() if not other.lacks(needs))
        wanted = " and ".join(sorted(needs))
        raise CommandRefused("integrator", "integrator", integrator.name, f"one that supports {wanted}: {able}")


def integrator_named(name: str) -> Integrator:
    """The integrator of this name; raises InputError listing the names that exist."""
    if name not in INTEGRATORS:
        raise InputError("integrator", name, ", ".join(INTEGRATORS))
    return INTEGRATORS[name]
