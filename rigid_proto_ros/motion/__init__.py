# SPDX-License-Identifier: MIT
"""One body's state, loads, string and equations of motion; the integrators are in a folder of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .integrators.integrator import Integrator

INTEGRATOR_NAMES = (
    "auto",
    "euler",
    "midpoint",
    "semi_implicit_euler",
    "rk4",
    "lie_midpoint",
    "dop853",
    "taylor",
    "free_body",
    "free_body_strang",
)
"""For who chooses an integrator by its name, without loading any, in the order of their numbers in a scene."""


def integrators() -> tuple[Integrator, ...]:
    """The integrators of these names, in this order, with their kernels."""
    from .integrators.auto import AUTO
    from .integrators.free_body import FREE_BODY, FREE_BODY_STRANG
    from .integrators.gram_schmidt import EULER, MIDPOINT
    from .integrators.lie_midpoint import LIE_MIDPOINT
    from .integrators.runge_kutta import DOP853, RK4, SEMI_IMPLICIT_EULER
    from .integrators.series import TAYLOR

    return (
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
