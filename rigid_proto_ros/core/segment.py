# SPDX-License-Identifier: MIT
"""A stretch of simulated time in which all commands are constant.

Steps count from the segment's start. ``advance`` commits the full steps that fit; ``look`` and ``cut`` take the one shorter
step from the last committed variables to the time asked for, on a copy. So the motion depends on where segments begin
and end, that is on commands and their times, and not on how often or in which portions it was asked for.
"""

from __future__ import annotations

import numpy as np

from .integrators.integrator import MAX_SPEED, Integrator
from .motion import HAND_WORK, HEAT, new_variables, to_row
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
        self.committed_ns = start.time_ns
        self.hand_work = 0.0
        self.heat = 0.0
        self._problem = problem
        self._variables = new_variables(start.row, problem)
        self._scratch = np.empty_like(self._variables)
        self.stepper = integrator.stepper(integrator, problem, self._variables, step_ns, accuracy)

    @property
    def steps(self) -> int:
        """Steps committed so far."""
        return self.stepper.steps

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in those steps."""
        return self.stepper.evaluations

    def advance(self, until_ns: int) -> None:
        """Commit every full step that ends at or before ``until_ns``; raises IntegrationFailed."""
        advanced_ns, good = self.stepper.advance(self._variables, self._problem, until_ns - self.committed_ns)
        self.committed_ns += advanced_ns
        if not good:
            raise IntegrationFailed(self._state_of(self._variables, self.committed_ns))

    def look(self, until_ns: int) -> State:
        """State at ``until_ns``, less than one step after the last committed one; commits nothing."""
        rest_ns = until_ns - self.committed_ns
        if until_ns == self.start.time_ns:
            return self.start
        variables = self._variables
        if rest_ns > 0:
            variables = self._scratch
            variables[:] = self._variables
            if not self.stepper.look(variables, self._problem, rest_ns):
                raise IntegrationFailed(self._state_of(self._variables, self.committed_ns))
        state = self._state_of(variables, until_ns)
        if not np.abs(state.row).max() <= MAX_SPEED:
            raise IntegrationFailed(self._state_of(self._variables, self.committed_ns))
        self.hand_work, self.heat = float(variables[HAND_WORK]), float(variables[HEAT])
        return state

    def cut(self, at_ns: int) -> State:
        """End the segment: the same step as looking at ``at_ns``."""
        if at_ns > self.committed_ns:
            self.stepper.cut()
        return self.look(at_ns)

    def _state_of(self, variables: np.ndarray, time_ns: int) -> State:
        if time_ns == self.start.time_ns:
            return self.start
        row = np.empty(13)
        to_row(variables, self._problem, (time_ns - self.start.time_ns) * 1e-9, row)
        return State(time_ns, row)
