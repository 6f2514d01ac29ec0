# SPDX-License-Identifier: MIT
"""Simulation of many rows of one scene in one compiled call that releases the GIL: bodies, flights and measures.

A row starts from the record of a setup's flight, filled with the numbers in which it differs, and is advanced by the
functions of simulation/flight.py. All operations have the same order as in a scene's setup and a simulation's commands,
so results agree bit for bit. Unusual cases (a limit, a doubtful tensor, a string that is too fast) give no result: the
caller then runs the simulation, which handles them or reports the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arithmetic import exact_quotient
from ..base.compilation import copy_numbers, copy_record, local_matrix, local_numbers, njit, record_type
from ..base.simd import aligned
from ..base.vectors import FloatArray, IntArray, Matrix3, Records, Vector, Vector3
from ..mass import moments as of_mesh
from ..mass.closed_form import given_mass, is_plainly_good, spread_mass
from ..mass.properties import SCALE_LIMITS
from ..mass.tensor import principal_axes_kernel
from ..motion.body import AXES, COM, INERTIA, LENGTH, MASS, MOMENTS, BodyRow, arm, fill_body
from ..motion.integrators.auto import FASTEST
from ..motion.integrators.integrator import provide_kernel
from ..motion.loads import is_within_magnitude
from ..motion.problem import ENVIRONMENT_FIELDS, KNOT, ORIGIN, PUSHES, REST, TARGET, C, K, begin_body
from ..motion.state import fill_initial_row
from ..motion.string import effective_mass, energy_of, most_yielding, span_of, spring_of
from . import flight as fl
from .commands import CLEAR
from .quantities import CONTEXT, STATE, begin, fill_state, measure_flight
from .setup import Setup

_NUMBERS: list[tuple[Any, ...]] = [
    ("scale", np.float64, 3),
    ("mass", np.float64),  # [kg]; 0: computed from the density
    ("density", np.float64),  # [kg/m³]
    ("explicit_inertia_mass", np.float64),  # [kg]
    ("explicit_inertia_center_of_mass", np.float64, 3),  # [mesh coordinates]
    ("explicit_inertia_tensor", np.float64, 6),  # ixx ixy ixz iyy iyz izz [kg m²]
    *ENVIRONMENT_FIELDS,
    ("initial_position", np.float64, 3),  # [m, world]
    ("initial_orientation_xyzw", np.float64, 4),  # needn't be normalized
    ("initial_linear_velocity", np.float64, 3),  # [m/s, world]
    ("initial_angular_velocity", np.float64, 3),  # [rad/s, world]
    ("string_attach", np.float64, 3),  # [mesh coordinates]
    ("string_target", np.float64, 3),  # [m, world]
    ("string_stiffness", np.float64),  # [N/m]
    ("string_frequency", np.float64),  # [rad/s], overrides the stiffness if > 0
    ("string_damping_ratio", np.float64),
    ("string_rest_length", np.float64),  # [m]
]
ROW = record_type(
    [
        # Parameters by name, with dots as underscores: numbers in which the rows of a batch may differ.
        *_NUMBERS,
        # The same in all rows of a batch: flags of the string, then properties of mesh and model.
        ("string_attached", np.bool_),  # at time 0
        ("string_bilateral", np.bool_),
        ("model", np.int64),  # EXPLICIT, ORDINARY or STRETCHED
        ("solid_measure", np.float64),  # volume at unit scale; NaN when the surface bounds no volume
        ("moments", of_mesh.MOMENTS),  # of the model, its place that of the chosen COM
        ("has_surface", np.bool_),
        ("extent", np.float64, 3),  # sides of the bounding box
    ]
)
NUMBERS = tuple(name for name, *_ in _NUMBERS)
"""Fields in which rows of one batch may differ."""
PARAMETERS = (*NUMBERS, "string_attached", "string_bilateral")
"""Fields that are set by parameters."""

EXPLICIT, ORDINARY, STRETCHED = range(3)

CERTAIN = 0.999
"""Fraction of a limit up to which a row is accepted here; closer to the limit the simulation decides."""


_Side = tuple[Records, FloatArray, Records, Records, Records]
"""Arrays of a batch."""
_Tables = tuple[Records, Records, FloatArray]
"""Loads, events and workspace of a flight."""


@dataclass
class Batch:
    """A batch of rows. rows (n,) ROW. ballast (k, 4): masses [kg], above 0, and their positions [mesh coordinates].
    setup: the scene's. commands (n or 1, c) LOAD_ROW: loads, in the order in which they act.
    """

    rows: Records
    ballast: FloatArray
    setup: Setup
    commands: Records

    @property
    def arrays(self) -> _Side:
        """Arguments of the compiled call."""
        start = self.setup.flight_start
        for number in range(len(start.methods)):
            provide_kernel(self.setup.integrator, start.methods, number)
        return self.rows, self.ballast, start.flight, start.methods, np.ascontiguousarray(self.commands)


@dataclass
class Results:
    """Results of a batch. status (n,): 1 done, 0 the simulation must run the row. measured (n, k). floors (n,
    FLOOR_KINDS): error floors due to rounding (simulation/flight.py).
    """

    status: IntArray
    measured: FloatArray
    floors: FloatArray


def new_results(rows: int, measures: int) -> Results:
    """Results with the values of rows without a result: status 0, NaN, no error floors."""
    unknown, floors = np.full((rows, measures), np.nan), np.zeros((rows, fl.FLOOR_KINDS))
    return Results(np.zeros(rows, np.int64), unknown, floors)


# A row's body


@njit(error_model="numpy", allocates=False)
def _explicit(
    own: np.record, ballast: FloatArray, com: Vector3, inertia: Matrix3, moments: Vector3, axes: Matrix3
) -> tuple[float, bool]:
    """Mass, COM (3,), inertia (3, 3), its principal moments and axes, and whether the numbers are certainly valid."""
    given, matrix = own.explicit_inertia_tensor, local_matrix(3, 3)
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = given[0], given[3], given[5]
    matrix[0, 1] = matrix[1, 0] = given[1]
    matrix[0, 2] = matrix[2, 0] = given[2]
    matrix[1, 2] = matrix[2, 1] = given[4]
    mass = own.explicit_inertia_mass
    good = 0.0 < mass < math.inf
    # Without ballast the resulting tensor, checked below, is the given one.
    if ballast.shape[0] > 0:
        principal_axes_kernel(matrix, moments, axes)
        good = good and is_plainly_good(moments)
    center = own.explicit_inertia_center_of_mass
    total = given_mass(mass, center, matrix, own.scale, ballast, com, inertia, moments, axes)
    return total, good and is_plainly_good(moments)


@njit(error_model="numpy", allocates=False)
def _spread(
    own: np.record, ballast: FloatArray, com: Vector3, inertia: Matrix3, moments: Vector3, axes: Matrix3
) -> tuple[float, bool]:
    """The same for a model whose mass is distributed over a mesh."""
    s, mass, left = own.scale, own.mass, local_numbers(3)
    if not mass > 0.0:
        mass = own.density * own.solid_measure * abs(s[0] * s[1] * s[2])
    uniform = True
    for k in range(3):
        left[k] = s[k]
        if own.model == STRETCHED:
            uniform = uniform and abs(s[k]) == abs(s[0])
            left[k] = math.copysign(abs(s[0]), s[k])
    total = spread_mass(mass, own.moments, s, left, ballast, com, inertia, moments, axes)
    return total, uniform and 1e-300 < mass < math.inf and is_plainly_good(moments)


@njit(error_model="numpy", allocates=False, forceinline=True)
def _make_body(own: np.record, ballast: FloatArray, body: BodyRow) -> bool:
    """Fill ``body`` (BODY,) from a row and ballast (k, 4); returns False when the simulation must check it."""
    s = own.scale
    for k in range(3):
        if not SCALE_LIMITS[0] <= abs(s[k]) <= SCALE_LIMITS[1]:
            return False
    com, inertia, moments, axes = local_numbers(3), local_matrix(3, 3), local_numbers(3), local_matrix(3, 3)
    if own.model == EXPLICIT:
        mass, good = _explicit(own, ballast, com, inertia, moments, axes)
    else:
        mass, good = _spread(own, ballast, com, inertia, moments, axes)
    if not good:
        return False
    diagonal = 0.0
    for k in range(3):
        com[k] = exact_quotient(com[k], s[k]) * s[k]
        side = own.extent[k] * s[k]
        diagonal += side * side
    fill_body(mass, com, inertia, moments, axes, s, body)
    if own.has_surface:
        body[LENGTH] = 0.5 * math.sqrt(diagonal)
    return math.isfinite(body[MASS] + body[COM] + body[COM + 1] + body[COM + 2] + body[LENGTH])


# A row's string


@njit(error_model="numpy", allocates=False)
def _span(flight: np.record) -> Vector:
    """Vector from the string's free end, which is at rest at its target, to the knot: three numbers [m, world]."""
    string = flight.string
    rx, ry, rz = arm(flight.body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    return span_of(rx, ry, rz, flight.row, string[TARGET], string[TARGET + 1], string[TARGET + 2])


@njit(error_model="numpy", allocates=False)
def _string_energy(flight: np.record) -> float:
    """Current energy of the string [J]; 0 without a string."""
    if not flight.tied:
        return 0.0
    string = flight.string
    return energy_of(_span(flight), string[K], string[REST], string[PUSHES] != 0.0)


@njit(error_model="numpy", allocates=False)
def _tie(own: np.record, flight: np.record) -> bool:
    """Tie the string of a row; returns False when its rates may exceed the integrator's limit."""
    string, body = flight.string, flight.body
    for k in range(3):
        string[KNOT + k] = own.string_attach[k]
        string[ORIGIN + k] = string[TARGET + k] = own.string_target[k]
    flight.tied = True
    flight.string_begin_ns = flight.string_end_ns = flight.now_ns
    stiffness, frequency, ratio = own.string_stiffness, own.string_frequency, own.string_damping_ratio
    rest = own.string_rest_length
    rx, ry, rz = arm(body, string[KNOT], string[KNOT + 1], string[KNOT + 2])
    if flight.chooses:
        P, M = AXES, MOMENTS
        a = body[P] * rx + body[P + 3] * ry + body[P + 6] * rz
        b = body[P + 1] * rx + body[P + 4] * ry + body[P + 7] * rz
        c = body[P + 2] * rx + body[P + 5] * ry + body[P + 8] * rz
        yields = most_yielding(body[MASS], body[M], body[M + 1], body[M + 2], a, b, c)
        # The effective mass of a point is at most the body's mass.
        largest, damping = spring_of(body[MASS], stiffness, frequency, ratio)
        if math.sqrt(largest * yields) > CERTAIN * FASTEST or damping * yields > CERTAIN * FASTEST:
            return False
    mass = effective_mass(body, rx, ry, rz, flight.row, _span(flight), rest)
    string[K], string[C] = spring_of(mass, stiffness, frequency, ratio)
    string[REST], string[PUSHES] = rest, 1.0 if own.string_bilateral else 0.0
    return True


# A row's flight


@njit(error_model="numpy")
def _begin(own: np.record, ballast: FloatArray, flight: np.record, commands: Records, loads: Records) -> bool:
    """Initialize a row's flight, a copy of its setup's, and loads; returns False when the simulation must run it."""
    body = flight.body
    if not _make_body(own, ballast, body):
        return False
    begin_body(flight.common, body, own, flight.common.gyroscopic)
    linear, angular = own.linear_damping / body[MASS], own.angular_damping / body[MOMENTS]
    if flight.chooses and not (linear <= FASTEST and angular <= FASTEST):
        return False
    for c in range(commands.shape[0]):
        if commands[c].kind < CLEAR and not is_within_magnitude(commands[c].load, body):
            return False
        copy_record(commands[c], loads[c])
    attitude, velocity, spin = own.initial_orientation_xyzw, own.initial_linear_velocity, own.initial_angular_velocity
    if not fill_initial_row(own.initial_position, attitude, velocity, spin, flight.row):
        return False
    copy_numbers(flight.row, flight.start)
    return not own.string_attached or _tie(own, flight)


@njit(error_model="numpy", forceinline=True)
def _fly_row(
    i: int,
    rows: Records,
    ballast: FloatArray,
    start: Records,
    methods: Records,
    commands: Records,
    sample_ns: IntArray,
    context: FloatArray,
    flights: Records,
    tables: _Tables,
    states: FloatArray,
) -> bool:
    """Simulate row i: fills states (m, STATE) at the ascending times sample_ns (m,), before events at those same times.

    context: see simulation/quantities.py; it is filled here. Returns False when the simulation must run the row.
    """
    due = commands[i if commands.shape[0] > 1 else 0]
    copy_record(start[0], flights[0])
    flight, (loads, events, room) = flights[0], tables
    if not _begin(rows[i], ballast, flight, due, loads):
        return False
    body, gravity = flight.body, rows[i].gravity
    fill_state(flight.row, _string_energy(flight), body[MASS], body[INERTIA : INERTIA + 9], gravity, states[0])
    begin(states[0], context)
    fl.begin_segment(flight, loads, methods, room)
    for sample in range(sample_ns.shape[0]):
        while flight.due_end < due.shape[0] and due[flight.due_end].at_ns < sample_ns[sample]:
            flight.due_end += 1
        if fl.fly(flight, loads, events, methods, room, sample_ns[sample]) != fl.REACHED:
            return False
        energy, inertia = _string_energy(flight), body[INERTIA : INERTIA + 9]
        fill_state(flight.row, energy, body[MASS], inertia, gravity, states[sample])
    return True


@njit(nogil=True, error_model="numpy", allocates=False)
def _fly_rows(
    own: _Side,
    references: _Side,
    has_references: bool,
    sample_ns: IntArray,
    measures: FloatArray,
    results: tuple[IntArray, FloatArray, FloatArray],
    room: tuple[FloatArray, Records, _Tables, FloatArray, FloatArray],
) -> None:
    """Simulate all rows of a batch, each together with the same row of the references if there are any."""
    status, measured, floors = results
    context, flights, tables, states, others = room
    # A single call for both, since a second one would be compiled a second time.
    sides, kept = (references, own), (others, states)
    for i in range(status.shape[0]):
        came = False
        for side in range(0 if has_references else 1, 2):
            came = _fly_row(i, *sides[side], sample_ns, context, flights, tables, kept[side])
            if not came:
                break
        if not came:
            continue
        status[i] = 1
        copy_numbers(flights[0].floors, floors[i])
        fl.note_floors(flights[0], own[3], floors[i])
        measure_flight(measures, states, others, sample_ns, context, measured[i])


def fly_rows(
    batch: Batch,
    references: Batch | None,
    sample_ns: IntArray,
    measures: FloatArray,
) -> Results:
    """Simulate all rows, each with its reference if there are any; rows that can't be checked here have status 0.

    sample_ns (m,) ascending, measures (j, MEASURE): see simulation/quantities.py.
    """
    sides = (batch,) if references is None else (batch, references)
    results = new_results(len(batch.rows), len(measures))
    filled = results.status, results.measured, results.floors
    loads = max(side.commands.shape[1] for side in sides) + 1
    # The workspace is aligned to a cache line.
    work = aligned(max(1, *(side.setup.flight_start.room for side in sides)))
    tables = np.zeros(loads, fl.LOAD_ROW), np.zeros(4 * loads + 4, fl.EVENT), work
    states, others = (np.zeros((len(sample_ns), STATE)) for _ in range(2))
    room = np.zeros(CONTEXT), np.zeros(1, fl.FLIGHT), tables, states, others
    arrays = batch.arrays, sides[-1].arrays, references is not None
    _fly_rows(*arrays, sample_ns, measures, filled, room)
    return results
