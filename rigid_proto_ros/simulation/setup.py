# SPDX-License-Identifier: MIT
"""Everything that parameters decide about the motion, already checked and in the core's own types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.compilation import new_record
from ..base.rotation import length
from ..motion.body import LENGTH, Body
from ..motion.integrators.integrator import Integrator, method_table, workspace_size
from ..motion.integrators.series_steps import degree_for
from ..motion.problem import PROBLEM, Environment, begin_body
from ..motion.string import StringSettings
from ..motion.surface import Surface
from .flight import FLIGHT
from .thrusters import Thruster


class FlightStart(NamedTuple):
    """flight (1,): a record FLIGHT (simulation/flight.py), and its memory as integers. methods: the integrator's table.
    room: of the largest workspace [doubles].
    """

    flight: np.ndarray
    integers: memoryview
    methods: np.ndarray
    room: int


@dataclass(frozen=True)
class Setup(Environment):
    """geometry: equal values mean the same mesh at the same size, so that a change of COM moves the COM and not the
    mesh. contacts: mesh coordinates by name. wrench_timeout_ns 0 holds for ever. accuracy: local error rate for
    integrators that choose their own steps. initial (13,): the state row at time 0. initial_string_mass [kg]: from what
    stiffness and damping follow of a string that is tied at time 0; 0 for the effective mass of the body as it is then.
    thrusters: by name, in its order.
    """

    body: Body
    inertia_model: str
    surface: Surface | None
    geometry: tuple[object, ...]
    contacts: Mapping[str, tuple[float, float, float]]
    integrator: Integrator
    step_ns: int
    wrench_timeout_ns: int
    poke_duration_ns: int
    initial: np.ndarray
    accuracy: float = 1e-9
    string: StringSettings = StringSettings()
    initial_string_mass: float = 0.0
    thrusters: Mapping[str, Thruster] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """Half the diagonal of the mesh's box as scaled, by which displacement errors are measured; 1 m
        without a mesh.
        """
        if self.surface is None:
            return 1.0
        diagonal = self.surface.extent * self.body.scale
        return 0.5 * length(diagonal)

    @cached_property
    def body_row(self) -> np.ndarray:
        """The body with its length, as compiled functions read it (BODY,)."""
        row = self.body.row.copy()
        row[LENGTH] = self.length
        return row

    @cached_property
    def flight_start(self) -> FlightStart:
        """What flights under this setup begin with."""
        start, degree = np.zeros(1, FLIGHT), degree_for(self.accuracy)
        flight = start[0]
        flight.row[:] = flight.start[:] = self.initial
        flight.body[:] = self.body_row
        flight.common = self.problem
        flight.accuracy, flight.degree, flight.step_ns = self.accuracy, degree, self.step_ns
        flight.timeout_ns, flight.poke_ns = self.wrench_timeout_ns, self.poke_duration_ns
        flight.chooses = self.integrator.chooses
        # None yet: the first that adapts its steps gets a clean workspace, as every other does.
        flight.method = -1
        methods = method_table(self.integrator, degree)
        integers = start.view(np.uint8).view(np.int64).data
        return FlightStart(start, integers, methods, workspace_size(methods))

    @cached_property
    def problem(self) -> np.record:
        """What all segments under this setup have in common (motion/problem.py)."""
        problem = new_record(PROBLEM)
        begin_body(problem, self.body_row, self.environment, float(self.gyroscopic))
        return problem
