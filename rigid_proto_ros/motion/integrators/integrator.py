# SPDX-License-Identifier: MIT
"""Definition of an integrator: name, properties, supported loads, and the way it steps through a segment: fixed steps,
one exact step, no step at all, or steps whose length follows from the error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..loads import ANGULAR_DAMPING, BODY_FORCE, BODY_TORQUE, ROTOR, STRING, WORLD_TORQUE
from ..problem import Variables

LOADS = frozenset({BODY_TORQUE, WORLD_TORQUE, BODY_FORCE})
"""Needs of wrenches and pokes. Gravity, world forces at the COM and linear damping have a closed form for all."""
EVALUATED = LOADS | {STRING, ANGULAR_DAMPING, ROTOR}
"""Needs that integrators support which take all rates from ``accelerations`` (motion/problem.py)."""


NOTHING, ONE_STEP, FIXED_STEPS, ADAPTIVE = range(4)
"""Ways to step. ONE_STEP: a single step of any length from the segment's start, for exact maps. NOTHING: the variables
are constant.
"""


Kernel = Callable[[Variables, np.record, float, int], int]
"""(y, p, h, n): takes up to n steps of h seconds in place and returns how many were good; a step whose result isn't
finite or exceeds MAX_SPEED is undone.
"""


@dataclass(frozen=True)
class Method:
    """A way to step, and its kernel, which integrators/stepping.py calls.

    kernel: a Kernel, or for ADAPTIVE (y, p, control, following, workspace, span_ns, sampling), which commits steps, or
    samples; control: CONTROL. choice: description and reason, a format string with {step_s}, {degree} and
    {degree_of_motion} of series, and {swing}, the string's highest frequency [rad/s]. evaluations: of the equations of
    motion per step; adaptive kernels count their own. spin_alone: its series is of the spin alone.
    sleeps: nothing moves.
    """

    way: int
    kernel: Callable[..., Any] | None
    choice: str
    evaluations: int = 0
    spin_alone: bool = False
    sleeps: bool = False


@dataclass(frozen=True)
class Integrator:
    """order: global order of accuracy, None when exact. evaluations: of the equations of motion per step. source:
    reference. limits: range of use and limits, in one sentence. stability_limit: largest |ω|h, and ω_s h of a string,
    at which a fixed step is still meaningful. supports: needs of a scene (above) that it can meet. kernel: for fixed
    steps; None for auto. ways: its methods, if they aren't fixed steps of the kernel.
    """

    name: str
    order: int | None
    evaluations: int
    source: str
    limits: str
    stability_limit: float
    supports: frozenset[str]
    kernel: Kernel | None
    ways: tuple[Method, ...] = ()

    @property
    def chooses(self) -> bool:
        """Whether the method is chosen for each segment (auto)."""
        return self.kernel is None

    @cached_property
    def methods(self) -> tuple[Method, ...]:
        """Its methods, in the order of auto's kinds of segments."""
        choice = f"{self.name}: fixed steps of {{step_s:g}} s"
        return self.ways or (Method(FIXED_STEPS, self.kernel, choice, self.evaluations),)

    @cached_property
    def supports_loads(self) -> bool:
        """Whether it supports every wrench and poke."""
        return self.supports >= LOADS

    def lacks(self, needs: frozenset[str]) -> frozenset[str]:
        """The needs of a scene that it doesn't support; empty if it supports all."""
        return needs - self.supports
