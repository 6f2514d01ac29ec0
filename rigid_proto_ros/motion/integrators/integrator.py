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

from ..loads import Load
from ..problem import ENVIRONMENT_NEEDS, Variables

BODY_TORQUE = "a torque"
WORLD_TORQUE = "a torque fixed in the world or a world force off the centre of mass"
BODY_FORCE = "a force that turns with the body"
ANGULAR_DAMPING = ENVIRONMENT_NEEDS["angular_damping"]
STRING = "a string"
NO_GYROSCOPIC_TERM = "gyroscopic: false"

LOADS = frozenset({BODY_TORQUE, WORLD_TORQUE, BODY_FORCE})
"""Needs of wrenches and pokes. Gravity, world forces at the COM and linear damping have a closed form for all."""
EVALUATED = LOADS | {STRING, *ENVIRONMENT_NEEDS.values()}
"""Needs that integrators support which take all rates from ``accelerations`` (motion/problem.py)."""


def needs_of_load(load: Load) -> frozenset[str]:
    """Needs of a wrench or poke, to be supported by the integrator."""
    turns = any(load.torque) or (load.mesh_point is not None and any(load.force))
    if load.axes == "world":
        return frozenset({WORLD_TORQUE}) if turns else frozenset()
    return frozenset(({BODY_TORQUE} if turns else set()) | ({BODY_FORCE} if any(load.force) else set()))


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
    motion per step; adaptive kernels count their own. workspace(degree): rows and columns of the kernel's memory.
    sleeps: nothing moves.
    """

    way: int
    kernel: Callable[..., Any] | None
    choice: str
    evaluations: int = 0
    workspace: Callable[[int], tuple[int, int]] | None = None
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
