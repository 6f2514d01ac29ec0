# SPDX-License-Identifier: MIT
"""What every integrator is: a name, facts about it, what it supports, and a way to make steps of a segment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.compilation import njit
from ..loads import Load

MAX_SPEED = 1e100
"""|x|, |v| or |ω| beyond this is a runaway: squares of it still fit a double, and nothing physical is near."""


@njit(cache=True, error_model="numpy")
def is_good(y: np.ndarray) -> bool:
    """Whether variables y are finite and no runaway."""
    size = 0.0
    for j in range(4, 13):
        size += abs(y[j])
    # Negated sense, so that NaN counts as a runaway.
    return size <= MAX_SPEED and math.isfinite(y[0] + y[1] + y[2] + y[3])


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


@dataclass(frozen=True)
class Method:
    """A way to step, and the kernel that does it.

    kernel: (y, p, h, n), or for ADAPTIVE (y, p, control, following, workspace, span_ns, sampling), which commits steps,
    or samples; control: CONTROL of integrators/series_steps.py. choice(p, step_s, accuracy): what it is and why, in
    words. evaluations: of the equations of motion in a step; adaptive kernels count themselves. workspace(degree): room
    for the kernel. sleeps: nothing moves. on_string: for segments with a string alone. radians: of the fastest turn or
    swing that a step covers, about; 0 where steps don't follow it.
    """

    way: int
    kernel: Callable | None
    choice: Callable[[np.record, float, float], str]
    evaluations: int = 0
    workspace: Callable[[int], np.ndarray] | None = None
    sleeps: bool = False
    on_string: bool = False
    radians: float = 0.0


@dataclass(frozen=True)
class Integrator:
    """order: global order of accuracy, None when exact. evaluations: of the equations of motion per step. source: where
    it is from. limits: what it is good for and what breaks it, one sentence. stability_limit: largest |ω|h, and ω_s h
    of a string, at which a fixed step still says something. carries: which needs of a scene (above) it can meet.
    kernel(y, p, h, n): take up to n steps of h seconds in place and return how many were good; a step whose result
    isn't finite or passes MAX_SPEED is undone.
    make_methods: the ways in which segments are stepped; chooses: by what a segment holds
    (auto), else by whether a string is tied.
    """

    name: str
    order: int | None
    evaluations: int
    source: str
    limits: str
    stability_limit: float
    supports: frozenset[str]
    kernel: Callable[[np.ndarray, np.record, float, int], int] | None
    make_methods: Callable[[Integrator], tuple[Method, ...]]
    chooses: bool = False

    @cached_property
    def methods(self) -> tuple[Method, ...]:
        """How segments are stepped, in the order of auto's kinds, or without and with a string."""
        return self.make_methods(self)

    @cached_property
    def supports_loads(self) -> bool:
        """Whether it supports every wrench and poke."""
        return self.supports >= LOADS

    def lacks(self, needs: frozenset[str]) -> frozenset[str]:
        """What of a scene's needs it doesn't support; empty when it fits."""
        return needs - self.supports
