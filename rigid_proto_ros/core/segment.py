# SPDX-License-Identifier: MIT
"""A stretch of simulated time in which all commands are constant.

Steps count from the segment's start. ``advance`` commits the full steps that fit; ``look`` and ``cut`` take the one shorter
step from the last committed variables to the time asked for, on a copy. So the motion depends on where segments begin
and end, that is on commands and their times, and not on how often or in which portions it was asked for.
"""

from __future__ import annotations

import numpy as np

from .integrators.integrator import MAX_SPEED, Integrator
from .integrators.stepping import OneStep
from .motion import HAND_WORK, HEAT, new_variables, to_good_row
from .problem import HAS_STRING
from .state import State


class IntegrationFailed(ArithmeticError):
    """The motion ran away (|x|, |v| or |ω| beyond 1e100, or not finite), or no step was short enough; ``last_good`` is the
    state before that step.
    """

    def __init__(self, last_good: State) -> None:
        self.last_good = last_good
        when = f"{last_good.time_ns * 1e-9:.9g} s"
        super().__init__(f"the motion passed {MAX_SPEED:g}, was not finite or too fast for any step after {when}")


class Segment:
    """start: state at the segment's start; problem: core/problem.py; step_ns: the fixed step; accuracy: local error rate
    for integrators that choose their own. hand_work, heat: what the string's hand has worked and its damper has lost [J]
    from the start to the time last looked at.
    """

    def __init__(
        self, start: State, problem: np.ndarray, integrator: Integrator, step_ns: int, accuracy: float = 1e-9
    ) -> None:
        self.start = start
        self.start_ns = start.time_ns
        self.committed_ns = start.time_ns
        self.hand_work = 0.0
        self.heat = 0.0
        self._problem = problem
        self._has_string = bool(problem[HAS_STRING])
        self._variables = new_variables(start.row, problem)
        self._scratch = np.empty_like(self._variables)
        self.stepper = integrator.stepper(integrator, problem, self._variables, step_ns, accuracy)

    @property
    def steps(self) -> int:
        """Steps committed so far."""
        return self.stepper.steps

    @property
    def evaluates_once(self) -> bool:
        """Whether the segment is one exact step, however long, of a body that turns."""
        return isinstance(self.stepper, OneStep) and not self.stepper.sleeping

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in those steps."""
        return self.stepper.evaluations

    def advance(self, until_ns: int) -> None:
        """Commit every full step that ends at or before ``until_ns``; raises IntegrationFailed."""
        if until_ns == self.committed_ns:
            return
        advanced_ns, good = self.stepper.advance(self._variables, self._problem, until_ns - self.committed_ns)
        self.committed_ns += advanced_ns
        if not good:
            raise IntegrationFailed(self._last_good())

    def look(self, until_ns: int) -> State:
        """State at ``until_ns``, less than one step after the last committed one; commits nothing."""
        if until_ns == self.start_ns:
            return self.start
        variables = self._variables
        rest_ns = until_ns - self.committed_ns
        if rest_ns > 0:
            committed, variables = variables, self._scratch
            variables[:] = committed
            if not self.stepper.look(variables, self._problem, rest_ns):
                raise IntegrationFailed(self._last_good())
        row = np.empty(13)
        if not to_good_row(variables, self._problem, (until_ns - self.start_ns) * 1e-9, row, MAX_SPEED):
            raise IntegrationFailed(self._last_good())
        if self._has_string:
            self.hand_work, self.heat = float(variables[HAND_WORK]), float(variables[HEAT])
        return State(until_ns, row)

    def cut(self, at_ns: int) -> None:
        """End the segment by the step that looking at ``at_ns`` takes."""
        if at_ns > self.committed_ns:
            self.stepper.cut()

    def _last_good(self) -> State:
        """The state at the last committed step."""
        if self.committed_ns == self.start_ns:
            return self.start
        row = np.empty(13)
        to_good_row(self._variables, self._problem, (self.committed_ns - self.start_ns) * 1e-9, row, MAX_SPEED)
        return State(self.committed_ns, row)
