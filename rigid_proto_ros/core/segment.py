# SPDX-License-Identifier: MIT
"""A stretch of simulated time in which all commands are constant.

Steps count from the segment's start. ``advance`` commits the full steps that fit; ``look`` and ``cut`` take the one shorter
step from the last committed variables to the time asked for, on a copy. So the motion depends on where segments begin
and end, that is on commands and their times, and not on how often or in which portions it was asked for.
"""

from __future__ import annotations

import numpy as np

from .integrators.integrator import MAX_SPEED, Integrator
from .motion import new_variables, to_row
from .state import State


class IntegrationFailed(ArithmeticError):
    """The motion ran away (|x|, |v| or |ω| beyond 1e100, or not finite); ``last_good`` is the state before that step."""

    def __init__(self, last_good: State) -> None:
        self.last_good = last_good
        super().__init__(f"the motion passed {MAX_SPEED:g} or was not finite after {last_good.time_ns * 1e-9:.9g} s")


class Segment:
    """start: state at the segment's start; problem: core/problem.py; step_ns: the fixed step."""

    def __init__(self, start: State, problem: np.ndarray, integrator: Integrator, step_ns: int) -> None:
        self.start = start
        self.integrator = integrator
        self.steps = 0
        self.committed_ns = start.time_ns
        self._problem = problem
        self._step_ns = step_ns
        self._variables = new_variables(start.row, problem)
        self._scratch = np.empty_like(self._variables)

    def advance(self, until_ns: int) -> None:
        """Commit every full step that ends at or before ``until_ns``; raises IntegrationFailed."""
        wanted = (until_ns - self.committed_ns) // self._step_ns
        if wanted <= 0:
            return
        done = self.integrator.steps(self._variables, self._problem, self._step_ns * 1e-9, wanted)
        self.steps += done
        self.committed_ns += done * self._step_ns
        if done < wanted:
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
            if self.integrator.steps(variables, self._problem, rest_ns * 1e-9, 1) < 1:
                raise IntegrationFailed(self._state_of(self._variables, self.committed_ns))
        state = self._state_of(variables, until_ns)
        if not np.abs(state.row).max() <= MAX_SPEED:
            raise IntegrationFailed(self._state_of(self._variables, self.committed_ns))
        return state

    def cut(self, at_ns: int) -> State:
        """End the segment: the same step as looking at ``at_ns``."""
        if at_ns > self.committed_ns:
            self.steps += 1
        return self.look(at_ns)

    def _state_of(self, variables: np.ndarray, time_ns: int) -> State:
        if time_ns == self.start.time_ns:
            return self.start
        row = np.empty(13)
        to_row(variables, self._problem, (time_ns - self.start.time_ns) * 1e-9, row)
        return State(time_ns, row)
