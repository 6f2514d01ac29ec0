# SPDX-License-Identifier: MIT
"""What every flight under one setup begins with, made once: its arrays at time 0, and the methods that step it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.arrays_at import address_of_array
from ..motion.body import BODY
from ..motion.integrators.stepping import COLUMNS, ROWS, method_table
from ..motion.integrators.taylor_adaptive import degree_for
from ..motion.problem import SIZE
from . import flight as fl

if TYPE_CHECKING:
    from .setup import Setup


class FlightStart(NamedTuple):
    """f (ROOM,) and n (INTEGERS,) as simulation/flight.py lays them out; methods: the integrator's table, and its
    address. room: of the largest workspace [doubles].
    """

    f: np.ndarray
    n: np.ndarray
    methods: np.ndarray
    methods_at: int
    room: int


def flight_start(setup: Setup) -> FlightStart:
    """Of flights under this setup."""
    f, n, degree = np.zeros(fl.ROOM), np.zeros(fl.INTEGERS, np.int64), degree_for(setup.accuracy)
    f[fl.ROW : fl.ROW + 13] = f[fl.START : fl.START + 13] = setup.initial
    f[fl.BODY : fl.BODY + BODY] = setup.body_row
    f[fl.COMMON : fl.COMMON + SIZE] = setup.problem
    f[fl.ACCURACY], f[fl.DEGREE] = setup.accuracy, degree
    n[fl.STEP_NS], n[fl.TIMEOUT_NS], n[fl.POKE_NS] = setup.step_ns, setup.wrench_timeout_ns, setup.poke_duration_ns
    n[fl.CHOOSES], n[fl.HELD] = setup.integrator.chooses, fl.NONE_HELD
    # None yet: the first that adapts its steps gets a clean workspace, as every other does.
    n[fl.METHOD] = -1
    methods = method_table(setup.integrator, degree)
    room = int((methods[:, ROWS] * methods[:, COLUMNS]).max())
    return FlightStart(f, n, methods, address_of_array(methods), room)
