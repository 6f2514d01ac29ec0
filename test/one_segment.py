# SPDX-License-Identifier: MIT
"""A segment by itself: a problem and a start without a simulation around them."""

from __future__ import annotations

import numpy as np

from rigid_proto_ros.base.records import new_record
from rigid_proto_ros.motion.body import LENGTH, Body
from rigid_proto_ros.motion.integrators.integrator import Integrator, method_table, provide_kernel, workspace_size
from rigid_proto_ros.motion.integrators.series_steps import degree_for
from rigid_proto_ros.motion.problem import (
    PROBLEM,
    VARIABLES,
    Environment,
    begin_body,
    begin_problem,
    begin_string,
    to_variables,
)
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.motion.string import StringState
from rigid_proto_ros.simulation import flight as fl


def make_problem(
    body: Body,
    loads: np.ndarray,
    gravity,
    linear_damping: float,
    angular_damping: float,
    gyroscopic: bool,
    state: State,
    string: StringState | None = None,
    length: float = 1.0,
) -> np.record:
    """The segment's problem for a body under summed loads, and a string if tied, from a state on."""
    p, row = new_record(PROBLEM), body.row.copy()
    row[LENGTH] = length
    around = Environment(gravity=gravity, linear_damping=linear_damping, angular_damping=angular_damping)
    begin_body(p, row, around.environment, float(gyroscopic))
    begin_problem(p, loads, state.row)
    if string is not None:
        begin_string(p, row, string.row, string.begin_ns, string.end_ns, state.row, state.time_ns)
    return p


def new_variables(row: np.ndarray, p: np.record) -> np.ndarray:
    """Variables (VARIABLES,) of a state row at a segment's start."""
    y = np.zeros(VARIABLES)
    to_variables(row, p, y)
    return y


class OneSegment:
    """``advance`` commits full steps, ``look`` takes the shorter one to the time asked for, on a copy."""

    def __init__(
        self, start: State, problem: np.record, integrator: Integrator, step_ns: int, accuracy: float = 1e-9
    ) -> None:
        degree = degree_for(accuracy)
        self._methods = method_table(integrator, degree)
        self._room = np.zeros(max(1, workspace_size(self._methods)))
        self._flight = flight = new_record(fl.FLIGHT)
        flight.problem = problem
        flight.start[:] = start.row
        flight.accuracy, flight.degree = accuracy, degree
        flight.now_ns = flight.start_ns = start.time_ns
        flight.step_ns, flight.chooses = step_ns, integrator.chooses
        fl.begin_variables(flight, self._methods, self._room)
        provide_kernel(integrator, self._methods, int(flight.method))

    @property
    def steps(self) -> int:
        return int(fl.steps_of_segment(self._flight))

    def advance(self, until_ns: int) -> None:
        assert fl.commit_until(self._flight, self._methods, self._room, until_ns)

    def look(self, at_ns: int) -> State:
        row = np.empty(13)
        assert fl.sample(self._flight, self._methods, self._room, at_ns, row)
        return State(at_ns, row)
