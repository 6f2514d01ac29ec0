# SPDX-License-Identifier: MIT
"""A segment by itself: a problem and a start without a simulation around them."""

from __future__ import annotations

import numpy as np

from rigid_proto_ros.motion.body import LENGTH, Body
from rigid_proto_ros.motion.integrators import control
from rigid_proto_ros.motion.integrators.integrator import Integrator
from rigid_proto_ros.motion.integrators.stepping import COLUMNS, ROWS, method_table, provide_kernel
from rigid_proto_ros.motion.integrators.taylor_adaptive import degree_for
from rigid_proto_ros.motion.loads import LoadSum
from rigid_proto_ros.motion.problem import SIZE, begin_body, begin_problem, begin_string
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.motion.string import Tied
from rigid_proto_ros.motion.variables import STORED, to_variables
from rigid_proto_ros.simulation import flight as fl


def make_problem(
    body: Body,
    loads: LoadSum,
    gravity,
    linear_damping: float,
    angular_damping: float,
    gyroscopic: bool,
    state: State,
    string: Tied | None = None,
    length: float = 1.0,
) -> np.ndarray:
    """The segment's problem (SIZE,) for a body under summed loads, and a string if tied, from a state on."""
    p, row = np.zeros(SIZE), body.row.copy()
    row[LENGTH] = length
    begin_body(p, row, np.asarray(gravity, dtype=float), linear_damping, angular_damping, float(gyroscopic))
    begin_problem(p, loads.values, state.row)
    if string is not None:
        begin_string(p, row, string.row, string.begin_ns, string.end_ns, state.row, state.time_ns)
    return p


def new_variables(row: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Variables (STORED,) of a state row at a segment's start."""
    y = np.zeros(STORED)
    to_variables(row, p, y)
    return y


def new_control(accuracy: float, degree: int) -> np.ndarray:
    """The step control of a segment's start."""
    array = np.zeros(control.SIZE)
    array[control.ACCURACY], array[control.DEGREE] = accuracy, degree
    return array


class OneSegment:
    """``advance`` commits full steps, ``look`` takes the shorter one to the time asked for, on a copy."""

    def __init__(
        self, start: State, problem: np.ndarray, integrator: Integrator, step_ns: int, accuracy: float = 1e-9
    ) -> None:
        degree = degree_for(accuracy)
        self._methods = method_table(integrator, degree)
        room = int((self._methods[:, ROWS] * self._methods[:, COLUMNS]).max())
        self._f, self._n = np.zeros(fl.ROOM + room), np.zeros(fl.INTEGERS, np.int64)
        f, n = self._f, self._n
        f[fl.PROBLEM : fl.PROBLEM + SIZE] = problem
        f[fl.START : fl.START + 13] = start.row
        f[fl.ACCURACY], f[fl.DEGREE] = accuracy, degree
        n[fl.NOW_NS] = n[fl.START_NS] = start.time_ns
        n[fl.STEP_NS], n[fl.CHOOSES] = step_ns, integrator.chooses
        fl.begin_variables(f, n, self._methods)
        provide_kernel(integrator, self._methods, int(n[fl.METHOD]))

    @property
    def steps(self) -> int:
        return int(fl.steps_of_segment(self._f, self._n))

    def advance(self, until_ns: int) -> None:
        assert fl.commit_until(self._f, self._n, self._methods, until_ns)

    def look(self, at_ns: int) -> State:
        row = np.empty(13)
        assert fl.sample(self._f, self._n, self._methods, at_ns, row)
        return State(at_ns, row)
