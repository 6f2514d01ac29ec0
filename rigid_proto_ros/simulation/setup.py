# SPDX-License-Identifier: MIT
"""Everything that parameters decide about the motion, already checked and in the core's own types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.addresses import address_of_array
from ..base.rotation import length
from ..motion.body import BODY, LENGTH, Body
from ..motion.integrators.integrator import Integrator
from ..motion.integrators.stepping import COLUMNS, ROWS, method_table
from ..motion.integrators.taylor_adaptive import degree_for
from ..motion.loads import light_amount
from ..motion.problem import SIZE, begin_body
from ..motion.string import StringSettings
from ..motion.surface import Surface
from . import flight as fl
from .in_flight import InFlight
from .thrusters import Thruster


class FlightStart(NamedTuple):
    """f (ROOM,) and n (INTEGERS,) as simulation/flight.py lays them out; methods: the integrator's table, and its
    address. room: of the largest workspace [doubles].
    """

    f: np.ndarray
    n: np.ndarray
    methods: np.ndarray
    methods_at: int
    room: int


@dataclass(frozen=True)
class Setup:
    """geometry: equal values mean the same mesh at the same size, so that a change of COM moves the COM and not the
    mesh. contacts: mesh coordinates by name. gravity (3,) [m/s², world], linear_damping [N s/m], angular_damping [N m
    s]. wrench_timeout_ns 0 holds for ever. accuracy: local error rate for integrators that choose their own steps.
    initial (13,): the state row at time 0. initial_string_mass [kg]: from what stiffness and damping follow of a
    string that is tied at time 0; 0 for the effective mass of the body as it is then. thrusters: by name, in its order.
    in_flight: what of an earlier flight goes on at time 0.
    """

    body: Body
    inertia_model: str
    surface: Surface | None
    geometry: tuple
    contacts: Mapping[str, tuple[float, float, float]]
    gravity: np.ndarray
    linear_damping: float
    angular_damping: float
    gyroscopic: bool
    integrator: Integrator
    step_ns: int
    wrench_timeout_ns: int
    poke_duration_ns: int
    initial: np.ndarray
    world_frame: str = "world"
    body_frame: str = "body"
    accuracy: float = 1e-9
    string: StringSettings = StringSettings()
    initial_string_mass: float = 0.0
    thrusters: Mapping[str, Thruster] = field(default_factory=dict)
    in_flight: InFlight | None = None

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
        f, n, degree = np.zeros(fl.ROOM), np.zeros(fl.INTEGERS, np.int64), degree_for(self.accuracy)
        f[fl.ROW : fl.ROW + 13] = f[fl.START : fl.START + 13] = self.initial
        f[fl.BODY : fl.BODY + BODY] = self.body_row
        f[fl.COMMON : fl.COMMON + SIZE] = self.problem
        f[fl.ACCURACY], f[fl.DEGREE] = self.accuracy, degree
        n[fl.STEP_NS], n[fl.TIMEOUT_NS], n[fl.POKE_NS] = self.step_ns, self.wrench_timeout_ns, self.poke_duration_ns
        n[fl.CHOOSES] = self.integrator.chooses
        # None yet: the first that adapts its steps gets a clean workspace, as every other does.
        n[fl.METHOD] = -1
        methods = method_table(self.integrator, degree)
        room = int((methods[:, ROWS] * methods[:, COLUMNS]).max())
        return FlightStart(f, n, methods, address_of_array(methods), room)

    @cached_property
    def light_amount(self) -> float:
        """Of a load that is far from too strong for the body (motion/loads.py)."""
        return light_amount(self.body)

    @cached_property
    def problem(self) -> np.ndarray:
        """What all segments under this setup have in common (motion/problem.py)."""
        p, gravity = np.zeros(SIZE), np.asarray(self.gravity, dtype=float)
        damping = (float(self.linear_damping), float(self.angular_damping))
        begin_body(p, self.body_row, gravity, damping[0], damping[1], float(self.gyroscopic))
        return p
