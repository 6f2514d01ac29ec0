# SPDX-License-Identifier: MIT
"""How far the end of a motion moves when it is made ten times as accurate, by a second flight with the same commands.

Errors of a chaotic motion grow exponentially, of which no error of a single step tells: an undamped spring whose knot
passes its free end may be off by a radian after some seconds, though every step meets its accuracy. Where two flights
agree, the first one's end is about as good as they do. Source: Hairer, Nørsett and Wanner, Solving Ordinary
Differential Equations I (1993), section II.4, on comparison with a more accurate result.
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
"""How many times smaller the second flight's errors are."""


def finer_values(parameters: Parameters, order: int | None) -> dict[str, float]:
    """The parameter, by name, that makes a motion FINER times as accurate. An integrator that chooses its steps, whose
    order is None, takes another accuracy; the step of one of order p is divided by the p-th root of FINER. Raises
    InputError where that is less than the parameter may be.
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
    """The same scene, FINER times as accurate; raises InputError."""
    return scenario.with_changes(finer_values(scenario.parameters, scenario.setup.integrator.order))


class FinerRun(OfflineRun):
    """The run of a script FINER times as accurate, also behind a command that sets the accuracy or the integrator."""

    def __init__(self, scenario: Scenario, script: Iterable[Command]) -> None:
        self._asked = scenario
        super().__init__(finer(scenario), script)

    def setup_of(self, command: Change, at_hand: Scenario | None = None) -> Setup:
        """Put in force what a change makes of the scene that was asked for, made finer."""
        self._asked = after_change(self._asked, command, at_hand)
        return self.replace(finer(self._asked))


def sensitivity_of(simulation: Simulation, scenario: Scenario, script: Iterable[Command]) -> dict[str, Any]:
    """How far the end of this simulation of a scene and a script is from that of a flight FINER times as accurate:
    DIFFERENCES [rad, m, m/s, rad/s], the parameter that was finer, and what the second flight took [s, wall]; None for
    all differences where one of the two motions failed.

    Raises InputError where nothing finer can be asked for.
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
