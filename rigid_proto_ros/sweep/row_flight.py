# SPDX-License-Identifier: MIT
"""One row flown by ``Simulation``: what a row is by definition, and how those go that the compiled batch
can't fly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..scene.offline import OfflineRun
from ..scene.scenario import Scenario
from ..simulation.flight import FLOOR_KINDS
from ..simulation.flight_measures import measure_flight
from ..simulation.quantities import CONTEXT, STATE, begin, which_is_met
from ..simulation.simulation import Simulation
from .measures import Measures
from .study import Study
from .variation import Variation


@dataclass
class RowResult:
    """failure: why there is no result, or empty. stop: number of the condition that ended the flight, or −1. end_ns:
    when it ended. measured (k,), state (13,) at the end. floors (FLOOR_KINDS,): simulation/flight.py.
    """

    failure: str
    stop: int
    end_ns: int
    measured: np.ndarray
    state: np.ndarray
    floors: np.ndarray


def fly_row(study: Study, row: Variation) -> RowResult:
    """The row's flight, beside its reference if the study has one; a failure is told, not raised."""
    measures = study.measures
    measured = np.full(len(measures.table), np.nan)
    states, others = np.zeros((len(measures.sample_ns), STATE)), np.zeros((len(measures.sample_ns), STATE))
    context, floors = np.zeros(CONTEXT), np.zeros(FLOOR_KINDS)
    try:
        scenario = row.scenario
        if study.reference is not None:
            reference = scenario.with_changes(study.reference)
            reached, _, failure = _fly(reference, row, measures, others, context, np.zeros((0, 3)), floors)
            if failure:
                return RowResult(f"reference: {failure}", -1, 0, measured, np.full(13, np.nan), floors)
        reached, stop, failure = _fly(scenario, row, measures, states, context, measures.stops, floors)
    except InputError as error:
        return RowResult(" ".join(str(error).split()), -1, 0, measured, np.full(13, np.nan), floors)
    if failure:
        return RowResult(failure, -1, 0, measured, np.full(13, np.nan), floors)
    times = measures.sample_ns
    measure_flight(measures.table, states, others, times, measures.watched, reached, context, measured)
    return RowResult("", stop, int(times[reached - 1]), measured, states[reached - 1, :13].copy(), floors)


def _fly(
    scenario: Scenario,
    row: Variation,
    measures: Measures,
    states: np.ndarray,
    context: np.ndarray,
    stops: np.ndarray,
    floors: np.ndarray,
) -> tuple[int, int, str]:
    """Fill ``states`` at the times, and ``floors``; how many were reached, which stop held, and why it failed."""
    simulation = OfflineRun(scenario, row.commands).simulation
    body = simulation.setup.body
    first = _state(simulation)
    begin(body.mass, body.inertia.ravel(), simulation.setup.gravity, first, context)
    for k, time_ns in enumerate(measures.sample_ns.tolist()):
        simulation.advance(time_ns)
        if simulation.failure:
            return 0, -1, simulation.failure
        states[k] = _state(simulation)
        floors[:] = simulation.floors
        stop = which_is_met(stops, states[k], context)
        if stop >= 0:
            return k + 1, stop, _refusals(simulation)
    return len(measures.sample_ns), -1, _refusals(simulation)


def _state(simulation: Simulation) -> np.ndarray:
    """State row and the string's energy (STATE,)."""
    string = simulation.string
    energy = string.potential_energy(simulation.setup.body, simulation.state) if string else 0.0
    return np.array([*simulation.state.row, energy])


def _refusals(simulation: Simulation) -> str:
    """A row whose commands were refused in flight isn't the row that was asked for."""
    return "; ".join(f"{count} commands refused: {reason}" for reason, count in simulation.refused.items())
