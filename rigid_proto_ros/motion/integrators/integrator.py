# SPDX-License-Identifier: MIT
"""What every integrator is: a name, facts about it, what it supports, and a way to make steps of a segment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..loads import Load

BODY_TORQUE = "a torque"
WORLD_TORQUE = "a torque fixed in the world or a world force off the centre of mass"
BODY_FORCE = "a force that turns with the body"
ANGULAR_DAMPING = "angular damping"
STRING = "a string"
NO_GYROSCOPIC_TERM = "gyroscopic: false"

LOADS = frozenset({BODY_TORQUE, WORLD_TORQUE, BODY_FORCE})
"""What wrenches and pokes can ask for. Gravity, world forces at the COM and linear damping are closed form for all."""


def needs_of_load(load: Load) -> frozenset[str]:
    """What a wrench or poke asks of the integrator."""
    turns = any(load.torque) or (load.mesh_point is not None and any(load.force))
    if load.axes == "world":
        return frozenset({WORLD_TORQUE}) if turns else frozenset()
    return frozenset(({BODY_TORQUE} if turns else set()) | ({BODY_FORCE} if any(load.force) else set()))


NOTHING, ONE_STEP, FIXED_STEPS, ADAPTIVE = range(4)
"""Ways to step. ONE_STEP: a single one from the segment's start, however far: for exact maps. NOTHING:
the variables stay.
"""


Kernel = Callable[[np.ndarray, np.record, float, int], int]
"""(y, p, h, n): takes up to n steps of h seconds in place and returns how many were good; a step whose result isn't
finite or passes MAX_SPEED is undone.
"""


@dataclass(frozen=True)
class Method:
    """A way to step, and the kernel that does it.

    kernel: a Kernel, or for ADAPTIVE (y, p, control, following, workspace, span_ns, sampling), which commits steps, or
    samples; control: CONTROL of integrators/series_steps.py. choice: what it is and why, in words, with places for
    {step_s}, for {degree} and {degree_of_motion} of series, and for {swing}, the string's fastest [rad/s]. evaluations:
    of the equations of motion in a step; adaptive kernels count themselves. workspace(degree): room for the kernel.
    sleeps: nothing moves. on_string: for segments with a string alone.
    """

    way: int
    kernel: Callable[..., Any] | None
    choice: str
    evaluations: int = 0
    workspace: Callable[[int], np.ndarray] | None = None
    sleeps: bool = False
    on_string: bool = False


@dataclass(frozen=True)
class Integrator:
    """order: global order of accuracy, None when exact. evaluations: of the equations of motion per step. source: where
    it is from. limits: what it is good for and what breaks it, one sentence. stability_limit: largest |ω|h, and ω_s h
    of a string, at which a fixed step still says something. supports: which needs of a scene (above) it can meet.
    kernel: for fixed steps; None for auto. ways: how segments are stepped where that isn't by fixed steps of it.
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
        """Whether it goes by what a segment holds (auto), and not by whether a string is tied alone."""
        return self.kernel is None

    @cached_property
    def methods(self) -> tuple[Method, ...]:
        """How segments are stepped, in the order of auto's kinds, or without and with a string."""
        if self.ways:
            return self.ways
        choice = f"{self.name}: fixed steps of {{step_s:g}} s"
        without = Method(FIXED_STEPS, self.kernel, choice, self.evaluations)
        return without, replace(without, on_string=True)

    @cached_property
    def supports_loads(self) -> bool:
        """Whether it supports every wrench and poke."""
        return self.supports >= LOADS

    def lacks(self, needs: frozenset[str]) -> frozenset[str]:
        """What of a scene's needs it doesn't support; empty when it fits."""
        return needs - self.supports
