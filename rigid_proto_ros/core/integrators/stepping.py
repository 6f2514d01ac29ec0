# SPDX-License-Identifier: MIT
"""How a segment is stepped: fixed steps, one exact step, nothing at all, or steps whose length follows from the error.

All keep the same promise. ``advance`` commits only steps that are functions of the variables they start from; ``look`` takes
one shorter step from there on a copy. So neither depends on when anybody asked.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..motion import STORED
from . import control as ctl
from .integrator import Integrator


class Stepper(Protocol):
    """choice: which method, and why. sleeping: nothing moves. floor_binds: some step's error allowance was set by rounding
    and not by the accuracy asked for. steps, evaluations: committed so far.
    """

    choice: str
    sleeping: bool
    floor_binds: bool
    steps: int
    evaluations: int

    def advance(self, y: np.ndarray, p: np.ndarray, span_ns: int) -> tuple[int, bool]:
        """Commit steps in y that fit into ``span_ns``; returns how far it came [ns] and whether all were good."""
        ...

    def look(self, y: np.ndarray, p: np.ndarray, rest_ns: int) -> bool:
        """One step of ``rest_ns`` in y, a copy; returns whether it was good."""
        ...

    def cut(self) -> None:
        """Count the step that ends the segment."""
        ...


class FixedSteps:
    """Steps of one length, counted from the segment's start."""

    sleeping = False
    floor_binds = False

    def __init__(
        self, integrator: Integrator, problem: np.ndarray, variables: np.ndarray, step_ns: int, accuracy: float
    ):
        self.choice = f"{integrator.name}: fixed steps of {step_ns * 1e-9:g} s"
        self.steps = 0
        self._integrator = integrator
        self._kernel = integrator.kernel_for(problem)
        self._step_ns = step_ns

    @property
    def evaluations(self) -> int:
        return self.steps * self._integrator.evaluations

    def advance(self, y: np.ndarray, p: np.ndarray, span_ns: int) -> tuple[int, bool]:
        wanted = span_ns // self._step_ns
        if wanted <= 0:
            return 0, True
        done = self._kernel(y, p, self._step_ns * 1e-9, wanted)
        self.steps += done
        return done * self._step_ns, done == wanted

    def look(self, y: np.ndarray, p: np.ndarray, rest_ns: int) -> bool:
        return self._kernel(y, p, rest_ns * 1e-9, 1) == 1

    def cut(self) -> None:
        self.steps += 1


class OneStep:
    """A single step from the segment's start, however far: for exact maps. ``kernel`` None: y stays as it is."""

    floor_binds = False

    def __init__(self, choice: str, kernel, evaluations: int, sleeping: bool = False):
        self.choice = choice
        self.sleeping = sleeping
        self.steps = 0
        self.evaluations = 0
        self._kernel = kernel
        self._cost = evaluations

    def advance(self, y: np.ndarray, p: np.ndarray, span_ns: int) -> tuple[int, bool]:
        return 0, True

    def look(self, y: np.ndarray, p: np.ndarray, rest_ns: int) -> bool:
        return self._kernel is None or self._kernel(y, p, rest_ns * 1e-9, 1) == 1

    def cut(self) -> None:
        if not self.sleeping:
            self.steps += 1
            self.evaluations += self._cost


class AdaptiveSteps:
    """Steps as long as the error allows. kernel(y, p, control, following, workspace, span_ns, look) commits them, or looks;
    control: integrators/control.py.
    """

    sleeping = False

    def __init__(self, choice: str, control: np.ndarray, kernel, workspace: np.ndarray):
        self.choice = choice
        self._control = control
        self._following = np.empty(STORED)
        self._workspace = workspace
        self._kernel = kernel
        self._cuts = 0

    @property
    def floor_binds(self) -> bool:
        return bool(self._control[ctl.FLOOR_BINDS])

    @property
    def steps(self) -> int:
        return int(self._control[ctl.STEPS]) + self._cuts

    @property
    def evaluations(self) -> int:
        # The step that ends a segment takes the series of the one that waits.
        return int(self._control[ctl.EVALUATIONS] + self._control[ctl.PENDING])

    def advance(self, y: np.ndarray, p: np.ndarray, span_ns: int) -> tuple[int, bool]:
        advanced_ns = self._kernel(y, p, self._control, self._following, self._workspace, span_ns, False)
        return int(advanced_ns), not self._control[ctl.FAILED]

    def look(self, y: np.ndarray, p: np.ndarray, rest_ns: int) -> bool:
        return self._kernel(y, p, self._control, self._following, self._workspace, rest_ns, True) == rest_ns

    def cut(self) -> None:
        self._cuts += 1
