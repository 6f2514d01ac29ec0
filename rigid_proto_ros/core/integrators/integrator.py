# SPDX-License-Identifier: MIT
"""What every fixed-step integrator is: a name, facts about it, and one compiled kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

MAX_SPEED = 1e100
"""|x|, |v| or |ω| beyond this is a runaway: squares of it still fit a double, and nothing physical is near."""


@dataclass(frozen=True)
class Integrator:
    """A fixed-step integrator.

    order: global order of accuracy. evaluations: force evaluations per step. steps(y, p, h, n): take up to n steps of h
    seconds in place and return how many were good; a step whose result isn't finite or passes MAX_SPEED is undone.
    """

    name: str
    order: int
    evaluations: int
    steps: Callable[[np.ndarray, np.ndarray, float, int], int]
