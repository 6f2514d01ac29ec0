# SPDX-License-Identifier: MIT
"""A stretch of simulated time in which all commands are constant, as it can be read off a flight.

Steps count from the segment's start, and only full ones are committed; sampling a time in between takes one shorter
step on a copy. So the motion depends on where segments begin and end, that is on commands and their times, and not on
how often or in which portions it was asked for.
"""

from __future__ import annotations

import numpy as np

from ..base.rotation import length
from ..motion.integrators.auto import fastest_swing
from ..motion.integrators.equations import stretch
from ..motion.integrators.integrator import FIXED_STEPS
from ..motion.state import State
from . import flight as fl
from .flight_arrays import FlightArrays


class Segment:
    """The segment that a flight is in: views of its record, which read current values.

    number: of segments begun before it and itself. start: state at the segment's start. committed_ns: where the last
    full step ended. problem: motion/problem.py. variables: motion/variables.py, at the last committed step.
    """

    def __init__(self, arrays: FlightArrays) -> None:
        self._arrays = arrays

    @property
    def number(self) -> int:
        """Which segment of the flight it is, counted from 1."""
        return int(self._arrays.flight.segments)

    @property
    def start(self) -> State:
        """State at the segment's start."""
        return State(int(self._arrays.flight.start_ns), self._arrays.flight.start.copy())

    @property
    def committed_ns(self) -> int:
        """Where its last full step ended [ns]."""
        return int(self._arrays.flight.committed_ns)

    @property
    def problem(self) -> np.record:
        """Its problem (motion/problem.py)."""
        return self._arrays.flight.problem

    @property
    def variables(self) -> np.ndarray:
        """Its variables at the last committed step (motion/variables.py)."""
        return self._arrays.flight.variables

    @property
    def sampled(self) -> np.ndarray:
        """The variables at the time last advanced to."""
        flight = self._arrays.flight
        return flight.trial if flight.now_ns > flight.committed_ns else flight.variables

    @property
    def steps(self) -> int:
        """Steps committed so far."""
        return int(fl.steps_of_segment(self._arrays.flight))

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion in them."""
        return int(fl.evaluations_of_segment(self._arrays.flight, self._arrays.methods))

    def expected_effort(self, now: State) -> tuple[float, float]:
        """Steps and evaluations that a second of the motion from now on takes, as far as that is known beforehand."""
        method = self._arrays.method
        if method.way == FIXED_STEPS:
            steps = 1e9 / int(self._arrays.flight.step_ns)
            return steps, steps * method.evaluations
        if method.radians == 0.0:
            return 0.0, 0.0
        fastest = length(now.angular_velocity_body)
        if method.on_string and stretch(self.sampled, self.problem)[0] > 0.0:
            fastest = max(fastest, fastest_swing(self.problem))
        return fastest / method.radians, fastest / method.radians

    @property
    def choice(self) -> str:
        """Which method, and why."""
        step_s = int(self._arrays.flight.step_ns) * 1e-9
        return self._arrays.method.choice(self.problem, step_s, float(self._arrays.flight.accuracy))

    @property
    def floor_binds(self) -> bool:
        """Some step's error allowance was set by rounding and not by the accuracy asked for."""
        return bool(self._arrays.flight.control.floor_rate)
