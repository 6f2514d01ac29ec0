# SPDX-License-Identifier: MIT
"""Sensitivity: the difference between the final states of a flight and of a second, ten times as accurate flight with
the same commands.

Errors of a chaotic motion grow exponentially, which the error of a single step doesn't show: an undamped spring whose
knot passes its free end may be off by a radian after some seconds although every step meets the accuracy. If the two
flights agree, the first one's final state is about as accurate as their difference. Source: Hairer, Nørsett and Wanner,
Solving Ordinary Differential Equations I (1993), section II.4, on comparison with a more accurate result.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..parameters.declarations import PARAMETERS, Parameters
from ..simulation.commands import Change, Command
from ..simulation.quantities import DIFFERENCES, STATE, difference
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation
from .scenario import Scenario
from .scenario_run import OfflineRun, after_change

FINER = 10.0
"""Ratio of the first flight's errors to the second's."""


def finer_values(parameters: Parameters, order: int | None) -> dict[str, float]:
    """The parameter, by name, and the value that makes a motion FINER times as accurate. For an integrator that
    controls its step, whose order is None, it is the accuracy. For one of order p, the step is divided by the p-th root
    of FINER. Raises InputError if that is below the parameter's bound.
    """
    if order is None:
        name, factor, value = "accuracy", FINER, parameters.accuracy / FINER
    else:
        name, factor = "step", FINER ** (1 / order)
        value = round(parameters.step * 1e9 / factor) / 1e9
    present, least = getattr(parameters, name), PARAMETERS[name].lower
    if not least < value < present:
        accepted = f"{name} above {least * factor:g}, so that a second simulation can be ten times as accurate"
        raise InputError("sensitivity", f"{name} {present:g}", accepted)
    return {name: value}


def finer(scenario: Scenario) -> Scenario:
    """The scene, FINER times as accurate. Raises InputError."""
    return scenario.with_changes(finer_values(scenario.parameters, scenario.setup.integrator.order))


class FinerRun(OfflineRun):
    """The run of a script FINER times as accurate, also after a command that sets the accuracy or the integrator."""

    def __init__(self, scenario: Scenario, script: Iterable[Command]) -> None:
        self._original = scenario
        super().__init__(finer(scenario), script)

    def setup_of(self, command: Change, at_hand: Scenario | None = None) -> Setup:
        """Apply a change to the original scene, then make the result finer."""
        self._original = after_change(self._original, command, at_hand)
        return self.replace(finer(self._original))


def sensitivity_of(simulation: Simulation, scenario: Scenario, script: Iterable[Command]) -> dict[str, Any]:
    """The difference between the final states of this simulation of a scene and a script and of a flight FINER times as
    accurate: DIFFERENCES [rad, m, m/s, rad/s], the parameter that was finer, and the wall time of the second flight
    [s]. All differences are None if one of the two motions failed.

    Raises InputError if no finer value is permitted.
    """
    began = time.perf_counter()
    second = FinerRun(scenario, script)
    good = second.advance(simulation.time_ns) and not simulation.failure
    states = np.zeros((2, STATE))
    for state, one in zip(states, (simulation, second.simulation), strict=True):
        one.fill_state(state)
    found: dict[str, Any] = {
        name: difference(code, states[0], states[1]) if good else None for code, name in enumerate(DIFFERENCES)
    }
    finer_parameters = second.scenario.parameters
    name = "accuracy" if second.simulation.setup.integrator.order is None else "step"
    return {**found, name: getattr(finer_parameters, name), "wall_time": time.perf_counter() - began}
