# SPDX-License-Identifier: MIT
"""Integrators by name.

An integrator advances the variables of a segment under the segment's problem (both in motion/problem.py). It has two
invariants: a step is a function of only the variables, the problem and the step size, and only full steps are
committed, so that sampling the motion never changes it.

Kernels use IEEE 754 division (``error_model="numpy"``): a step that diverges gives inf or NaN and is rejected, whereas
Python's division would raise an exception in the middle of it.
"""

from __future__ import annotations

from ...base.errors import CommandRefused
from .. import integrators
from .integrator import Integrator

INTEGRATORS: dict[str, Integrator] = {one.name: one for one in integrators()}
"""By name, in the order of their numbers in a scene."""


def check_supported(integrator: Integrator, needs: frozenset[str]) -> None:
    """Raises CommandRefused (``integrator``), listing those that can, if ``integrator`` can't meet all ``needs``."""
    lacks = integrator.lacks(needs)
    if lacks:
        able = ", ".join(name for name, other in INTEGRATORS.items() if not other.lacks(needs))
        wanted = " and ".join(sorted(needs))
        raise CommandRefused("integrator", "integrator", integrator.name, f"one that supports {wanted}: {able}")
