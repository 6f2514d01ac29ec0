# SPDX-License-Identifier: MIT
"""A block of variations in one compiled call without the interpreter's lock: bodies, flights and their measures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import boolean, float64, from_dtype, int64, types

from ..base.compilation import njit
from ..base.simd import aligned
from ..base.uncounted_arrays import copy_numbers, uncounted
from ..motion.body import BODY, INERTIA, MASS
from ..motion.integrators.integrator import Integrator
from ..motion.integrators.stepping import METHOD, method_table, provide_kernel, workspace_size
from ..motion.integrators.taylor_adaptive import MAX_DEGREE
from ..motion.loads import is_within_magnitude
from ..motion.problem import begin_body
from . import batch_body as b
from . import flight as fl
from .batch_body import make_body_row
from .flight_measures import measure_flight
from .quantities import CONTEXT, STATE, begin, which_is_met


@dataclass
class Variants:
    """Many variations of one scene. settings (n, SETTINGS), times (n, TIMES), ballast (n, k, 4), constants
    (CONSTANTS,): simulation/batch_body.py. commands (n, c, COMMAND), loads (n, c, LOAD): simulation/flight.py and
    motion/loads.py. Those alike in all have one row only.
    """

    settings: np.ndarray
    times: np.ndarray
    ballast: np.ndarray
    constants: np.ndarray
    integrator: Integrator
    commands: np.ndarray
    loads: np.ndarray

    def __len__(self) -> int:
        return len(self.settings)

    @property
    def is_tied(self) -> bool:
        """Whether a string is tied at time 0."""
        return bool(self.constants[b.TIED])

    @property
    def arrays(self) -> tuple:
        """What the compiled call takes of it."""
        ints = (self.times, self.commands)
        floats = (self.settings, self.ballast, self.constants, self.loads)
        return (
            *map(np.ascontiguousarray, (*floats, *ints)),
            self.integrator.chooses,
            _methods(self.integrator, self.is_tied),
        )


@dataclass
class Results:
    """status (n,): 1 done, 0 the simulation must do it. end_ns (n,), stop (n,): which condition ended it, −1 none.
    measured (n, k); states (n, 13) at the end. floors (n, FLOOR_KINDS): what has held the motion to less than its
    accuracy (simulation/flight.py).
    """

    status: np.ndarray
    end_ns: np.ndarray
    stop: np.ndarray
    measured: np.ndarray
    states: np.ndarray
    floors: np.ndarray


def new_results(rows: int, measures: int) -> Results:
    """Empty ones, as failed rows have them."""
    unknown = np.full((rows, measures), np.nan)
    state, floors = np.full((rows, STATE - 1), np.nan), np.zeros((rows, fl.FLOOR_KINDS))
    return Results(np.zeros(rows, np.int64), np.zeros(rows, np.int64), np.full(rows, -1), unknown, state, floors)


_VARIANTS = (
    float64[:, ::1],  # settings
    float64[:, :, ::1],  # ballast
    float64[::1],  # constants
    float64[:, :, ::1],  # loads
    int64[:, ::1],  # times
    int64[:, :, ::1],  # commands
    boolean,  # the method is chosen by what a segment holds
    from_dtype(METHOD)[:, ::1],  # methods by degree
)
_Flights = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool, np.ndarray]
"""Arrays of a block, in the order of _VARIANTS."""
_SAMPLING = (int64[::1], boolean[::1], float64[:, ::1], float64[:, ::1])
_RESULTS = (int64[::1], int64[::1], int64[::1], float64[:, ::1], float64[:, ::1], float64[:, ::1])


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _fly(
    settings: np.ndarray,
    times: np.ndarray,
    constants: np.ndarray,
    body: np.ndarray,
    chooses: bool,
    methods: np.ndarray,
    commands: np.ndarray,
    loads: np.ndarray,
    sample_ns: np.ndarray,
    stops: np.ndarray,
    context: np.ndarray,
    tables: tuple,
    states: np.ndarray,
) -> tuple[int, int]:
    """One flight: fills states (m, STATE) at sample_ns (m,) ascending, each before what acts at that very time.

    settings (SETTINGS,), times (TIMES,), constants (CONSTANTS,), body (BODY,): simulation/batch_body.py. methods:
    motion/integrators/stepping.py. commands (c, COMMAND) in the order in which they act and loads (c, LOAD).
    stops (k, 3): the flight ends at the first sample at which one holds. context: simulation/quantities.py, filled
    here. tables: arrays of simulation/flight.py with room for all. Returns how many samples it reached, and which stop
    held or −1; 0 samples: the simulation must say what is wrong.
    """
    flights, rows, events, room = tables
    flight = flights[0]
    count = commands.shape[0]
    for c in range(count):
        if commands[c, fl.KIND] != fl.CLEAR and not is_within_magnitude(loads[c], body):
            return 0, -1
    if not b.initial_row(settings, flight.row) or (chooses and not b.is_followed(settings, constants, body)):
        return 0, -1
    fl.begin_flight(flight)
    copy_numbers(body, flight.body)
    if constants[b.TIED] != 0.0:
        flight.tied, flight.string_begin_ns, flight.string_end_ns = True, 0, 0
        b.tie_string(settings, constants, body, flight.row, flight.string)
    copy_numbers(flight.row, states[0, :13])
    states[0, 13] = b.string_energy(flight)
    g = settings[b.GRAVITY : b.GRAVITY + 3]
    begin(body[MASS], body[INERTIA : INERTIA + 9], g, states[0], context)
    copy_numbers(flight.row, flight.start)
    begin_body(flight.common, body, g, settings[b.LINEAR_DAMPING], settings[b.ANGULAR_DAMPING], constants[b.GYROSCOPIC])
    flight.accuracy, flight.degree, flight.chooses = settings[b.ACCURACY], times[b.DEGREE], chooses
    flight.step_ns, flight.timeout_ns, flight.poke_ns = times[b.STEP_NS], times[b.TIMEOUT_NS], times[b.POKE_NS]
    for c in range(count):
        row = rows[c]
        row.at_ns, row.duration_ns = commands[c, fl.AT_NS], commands[c, fl.DURATION_NS]
        row.kind, row.slot = commands[c, fl.KIND], commands[c, fl.SLOT]
        copy_numbers(loads[c], row.load)
    flight.due_end = count
    fl.begin_segment(flight, rows, methods, room)
    for sample in range(sample_ns.shape[0]):
        if fl.fly(flight, rows, events, methods, room, sample_ns[sample]) != fl.REACHED:
            return 0, -1
        copy_numbers(flight.row, states[sample, :13])
        states[sample, 13] = b.string_energy(flight)
        stop = which_is_met(stops, states[sample], context)
        if stop >= 0:
            return sample + 1, stop
    return sample_ns.shape[0], -1


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _one(
    i: int,
    settings: np.ndarray,
    ballast: np.ndarray,
    constants: np.ndarray,
    loads: np.ndarray,
    times: np.ndarray,
    commands: np.ndarray,
    chooses: bool,
    methods: np.ndarray,
    body: np.ndarray,
    sample_ns: np.ndarray,
    stops: np.ndarray,
    context: np.ndarray,
    tables: tuple,
    states: np.ndarray,
) -> tuple[int, int]:
    """Body and flight of variation i; as ``_fly`` returns."""
    own = settings[i if settings.shape[0] > 1 else 0]
    if not make_body_row(own, ballast[i if ballast.shape[0] > 1 else 0], constants, body):
        return 0, -1
    command = commands[i if commands.shape[0] > 1 else 0]
    load = loads[i if loads.shape[0] > 1 else 0]
    own_times = times[i if times.shape[0] > 1 else 0]
    method = methods[own_times[b.DEGREE]]
    return _fly(
        own, own_times, constants, body, chooses, method, command, load, sample_ns, stops, context, tables, states
    )


_ROOM = (
    float64[::1],
    float64[::1],
    types.Tuple((from_dtype(fl.FLIGHT)[::1], from_dtype(fl.LOAD_ROW)[::1], from_dtype(fl.EVENT)[::1], float64[::1])),
    float64[:, ::1],
    float64[:, ::1],
)


def _room(variants: Variants, references: Variants | None, samples: int) -> tuple:
    """Arrays in which a block works, with room for any of these flights: body (BODY,), context (CONTEXT,), those of
    simulation/flight.py, states (m, STATE) at the samples, and those of the references.
    """
    sides = (variants,) if references is None else (variants, references)
    rows = max(side.commands.shape[1] for side in sides) + 1
    # The workspace begins a line of the processor's cache.
    room = aligned((1, max(1, *(workspace_size(_methods(side.integrator, side.is_tied)) for side in sides))))[0]
    flight = np.zeros(1, fl.FLIGHT), np.zeros(rows, fl.LOAD_ROW), np.zeros(4 * rows + 4, fl.EVENT), room
    others = np.zeros((samples if references is not None else 1, STATE))
    return np.zeros(BODY), np.zeros(CONTEXT), flight, np.zeros((samples, STATE)), others


def _fly_block(
    first: int,
    last: int,
    variants: _Flights,
    references: _Flights,
    has_references: bool,
    sample_ns: np.ndarray,
    watched: np.ndarray,
    stops: np.ndarray,
    measures: np.ndarray,
    results: tuple,
    room: tuple,
) -> None:
    """Variations first to last − 1."""
    variants, references = uncounted(variants), uncounted(references)
    sample_ns, watched, stops, measures = uncounted((sample_ns, watched, stops, measures))
    status, end_ns, stop, measured, finals, floors = uncounted(results)
    flights, times, chooses, methods = room[2][0], variants[4], variants[6], variants[7]
    body, context, tables, states, others = uncounted(room)
    # One place that flies, whichever it is: a second one would be compiled a second time.
    sides, kept, ends = (references, variants), (others, states), (stops[:0], stops)
    for i in range(first, last):
        status[i] = 0
        reached = 0
        for side in range(0 if has_references else 1, 2):
            reached, stop[i] = _one(i, *sides[side], body, sample_ns, ends[side], context, tables, kept[side])
            if reached == 0:
                break
        if reached == 0:
            continue
        status[i] = 1
        end_ns[i] = sample_ns[reached - 1]
        copy_numbers(states[reached - 1], finals[i])
        if chooses:
            degree = times[i if times.shape[0] > 1 else 0, b.DEGREE]
            copy_numbers(flights[0].floors, floors[i])
            fl.note_floors(flights[0], methods[degree], floors[i])
        measure_flight(measures, states, others, sample_ns, watched, reached, context, measured[i])


@cache
def _compiled() -> Callable:
    """``_fly_block`` compiled, or loaded from the cache: when it is first wanted and not at import."""
    block = (
        types.Tuple(_VARIANTS),
        types.Tuple(_VARIANTS),
        boolean,
        *_SAMPLING,
        types.Tuple(_RESULTS),
        types.Tuple(_ROOM),
    )
    signature = types.void(int64, int64, *block)
    return njit(signature, cache=True, nogil=True, error_model="numpy", allocates=False)(_fly_block)


@cache
def _methods(integrator: Integrator, tied: bool) -> np.ndarray:
    """Tables of the integrator's methods by degree, with the kernels that a flight with or without a string calls."""
    tables = [method_table(integrator, degree) for degree in range(MAX_DEGREE + 1)]
    for table in tables:
        for number, method in enumerate(integrator.methods):
            if method.on_string == tied:
                provide_kernel(integrator, table, number)
    return np.array(tables)


def fly_variants(
    variants: Variants,
    references: Variants | None,
    sample_ns: np.ndarray,
    watched: np.ndarray,
    stops: np.ndarray,
    measures: np.ndarray,
) -> Results:
    """Fly all variants, each beside its reference if there are any; the rows that it can't check have status 0."""
    rows = len(variants)
    results = new_results(rows, len(measures))
    filled = (results.status, results.end_ns, results.stop, results.measured, results.states, results.floors)
    own = variants.arrays
    other = own if references is None else references.arrays
    room = _room(variants, references, len(sample_ns))
    _compiled()(0, rows, own, other, references is not None, sample_ns, watched, stops, measures, filled, room)
    return results
