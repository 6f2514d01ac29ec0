# SPDX-License-Identifier: MIT
"""A flight under commands, compiled: what live simulations, offline ones, replays and sweeps advance with.

Everything a flight is stands in one record (FLIGHT), beside a table of loads (LOAD_ROW). Commands cut it into
segments; ``fly`` goes from event to event until the time asked for, and writes down what began and ended on the way.
What it can't do (a ray, a change of parameters, a string tied or let go) is applied between two calls, by the same
functions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ..base.compilation import copy_numbers, njit, record_type
from ..base.rotation import norm
from ..motion import body as of_body
from ..motion.integrators.auto import kind_of_segment
from ..motion.integrators.integrator import ADAPTIVE, CONTROL, NOTHING, ONE_STEP, commit, is_provided, reach
from ..motion.integrators.series_steps import FLOOR, begin_control
from ..motion.loads import LOAD, LOADS_SIZE, accumulate_load, apply_impulse, is_zero
from ..motion.problem import (
    HAND_WORK,
    HEAT,
    MAX_SPEED,
    PROBLEM,
    STRING,
    VARIABLES,
    accelerations,
    begin_problem,
    begin_string,
    parts_of,
    tension_margin,
    to_good_row,
    to_variables,
)
from .commands import CLEAR, HELD_WRENCH, IMPULSE, NO_SLOT, PULSE

FLIGHT = record_type(
    [
        ("now_ns", np.int64),
        ("row", np.float64, 13),  # the state then
        ("start_ns", np.int64),  # of the segment
        ("start", np.float64, 13),  # the state then
        ("committed_ns", np.int64),  # where the last full step of the segment ended
        ("variables", np.float64, VARIABLES),  # there
        ("trial", np.float64, VARIABLES),
        ("following", np.float64, VARIABLES),  # of an adaptive method
        ("control", CONTROL),  # likewise
        ("common", PROBLEM),  # what the problems of all segments of this body have in common
        ("problem", PROBLEM),  # of the segment
        ("body", np.float64, of_body.BODY),
        ("string", np.float64, STRING),  # while ``tied``
        ("tied", np.bool_),
        ("string_begin_ns", np.int64),
        ("string_end_ns", np.int64),
        ("sums", np.float64, LOADS_SIZE),  # of the loads that act
        # Settings; a timeout of 0 is none.
        ("accuracy", np.float64),
        ("degree", np.int64),
        ("step_ns", np.int64),
        ("timeout_ns", np.int64),
        ("poke_ns", np.int64),
        ("chooses", np.bool_),  # the method by what the segment holds, as auto does
        ("method", np.int64),
        ("waits", np.bool_),  # for its kernel, in the middle of a call
        ("segments", np.int64),  # begun so far
        # Of the string's hand, and in its damper [J]: from the segment's start to now_ns, and before.
        ("work", np.float64),
        ("lost", np.float64),
        ("work_before", np.float64),
        ("lost_before", np.float64),
        ("taken", np.int64),  # steps of the segment, but for those that an adaptive kernel counts
        ("steps_before", np.int64),
        ("evaluations_before", np.int64),
        ("floors", np.float64, 5),  # (FLOOR_KINDS,) the most that rounding, and not the accuracy, has set since time 0
        # Rows of the table of loads: those that act are 0 to acting − 1, in the order in which they began; the commands
        # that are to act next, in their order, due to due_end − 1.
        ("acting", np.int64),
        ("due", np.int64),
        ("due_end", np.int64),
        ("load_ids", np.int64),  # given so far
        ("events", np.int64),  # written so far in this call
        ("timeouts", np.int64),  # held wrenches that timed out so far in this call
    ]
)

LOAD_ROW = record_type(
    [
        # A command: when it acts, or began; of a pulse how long it lasts, −1 as the setting for pokes says; which of
        # the kinds below. What acts in the same slot is replaced; NO_SLOT replaces nothing.
        ("at_ns", np.int64),
        ("duration_ns", np.int64),
        ("kind", np.int64),
        ("slot", np.int64),
        ("end_ns", np.int64),
        ("id", np.int64),
        ("load", np.float64, LOAD),
        ("share", np.float64, LOADS_SIZE),  # while it acts, what it adds to the sums
    ]
)
EVENT = record_type(
    [
        ("time_ns", np.int64),
        ("what", np.int64),
        ("load_id", np.int64),
        ("row", np.int64),  # the command's row in the table; of TIMED_OUT the slot
        ("attitude", np.float64, 4),  # xyzw of the body at that time, for APPLIED alone
    ]
)
"""Something became of a load."""

APPLIED, BEGAN, ENDED, DONE, TIMED_OUT = range(5)
"""What became of it. APPLIED: a command acts, before what it ends and begins. DONE: after that. TIMED_OUT: a held
wrench has ended so.
"""

STEP_FLOOR, PULL_FLOOR, SPIN_FLOOR, TENSOR_FLOOR, PLACE_FLOOR, FLOOR_KINDS = range(6)
"""Why the motion is held to less than its accuracy. Error rates [1/s] of steps too short for it, and of steps on a
string whose pull is known no better; rates [rad/s] at which the rounding of a spin, or of a tensor given in other axes
than its own, turns the attitude; the rounding of a place far from the world's origin, in lengths of the body.
"""

FLOORS = (
    "rounding of 32 units in the last place a step, in steps that short, comes to {:.2g} a second",
    "rounding of the string's length, which its stiffness multiplies, comes to {:.2g} a second",
    "rounding of the spin turns the attitude by up to {:.2g} rad a second",
    "rounding of a slender tensor given in axes other than its own turns the attitude by up to {:.2g} rad a second",
    "rounding of a position far from the world's origin is {:.2g} of the body's size",
)
"""What is said of each of these."""

ROUNDINGS = 2.0
"""ε|ω|t that the exact free step's attitude may err. Measured in 36 flights at 1e3 to 1e6 rad/s: up to 1.1 where the
tensor is given in its own axes, and up to 1.0 times I₃/I₁ where it isn't.
"""

NEVER = 1 << 62
"""Later than any simulated time [ns]."""

REACHED, FAILED, NO_KERNEL = range(3)
"""How a call came back. NO_KERNEL: the segment's method must be compiled first."""


@njit(cache=True, error_model="numpy", allocates=False)
def begin_flight(flight: np.record) -> None:
    """Time 0, before any segment: all that a flight counts."""
    flight.now_ns, flight.start_ns, flight.committed_ns = 0, 0, 0
    flight.method, flight.segments, flight.waits, flight.tied = 0, 0, False, False
    flight.steps_before, flight.evaluations_before = 0, 0
    flight.work_before, flight.lost_before = 0.0, 0.0
    for k in range(FLOOR_KINDS):
        flight.floors[k] = 0.0
    flight.acting, flight.due, flight.due_end, flight.load_ids, flight.events, flight.timeouts = 0, 0, 0, 0, 0, 0


@njit(cache=True, error_model="numpy", allocates=False)
def begin_segment(flight: np.record, loads: np.ndarray, methods: np.ndarray, room: np.ndarray) -> None:
    """Begin a segment at ``start``: what acts is summed afresh, in the order in which it began, and the method is
    chosen.

    loads: the table. methods: motion/integrators/integrator.py. room: for the workspace of the adaptive ones.
    """
    for k in range(LOADS_SIZE):
        flight.sums[k] = 0.0
    for row in range(flight.acting):
        share = loads[row].share
        for k in range(LOADS_SIZE):
            flight.sums[k] += share[k]
    problem = flight.problem
    flight.problem = flight.common
    complete_problem(flight, flight.start, flight.start_ns, problem)
    begin_variables(flight, methods, room)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def complete_problem(flight: np.record, row: np.ndarray, time_ns: int, p: np.record) -> None:
    """Complete ``common`` in p to the problem of a segment under ``sums`` and the string that begins with the state
    ``row``.
    """
    begin_problem(p, flight.sums, row)
    if flight.tied:
        begin_string(p, flight.body, flight.string, flight.string_begin_ns, flight.string_end_ns, row, time_ns)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def begin_variables(flight: np.record, methods: np.ndarray, room: np.ndarray) -> None:
    """Begin a segment whose problem is made."""
    p, y = flight.problem, flight.variables
    for k in range(VARIABLES):
        y[k] = 0.0
    to_variables(flight.start, p, y)
    before = flight.method
    if flight.chooses:
        flight.method = kind_of_segment(p, y)
    else:
        flight.method = 1 if p.has_string and methods.shape[0] > 1 else 0
    method = methods[flight.method]
    if flight.method != before and method.way == ADAPTIVE:
        # Kernels may count on zeros where they never write, and another method's were here.
        room[: method.rows * method.columns] = 0.0
    begin_control(flight.control, flight.accuracy, flight.degree)
    flight.work, flight.lost = 0.0, 0.0
    flight.committed_ns, flight.taken = flight.start_ns, 0
    flight.segments += 1


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def commit_until(flight: np.record, methods: np.ndarray, room: np.ndarray, until_ns: int) -> bool:
    """Commit every full step of the segment that ends at or before ``until_ns``; whether all were good."""
    span_ns = until_ns - flight.committed_ns
    # A step that waits and goes on beyond that leaves nothing to commit.
    if span_ns == 0 or span_ns < flight.control.accepted_ns:
        return True
    # Sliced, they are arrays as any other to a kernel that is called by its address.
    y, following = flight.variables[:], flight.following[:]
    method = methods[flight.method]
    advanced, taken, good = commit(method, y, flight.problem, flight.control, following, room, flight.step_ns, span_ns)
    flight.committed_ns += advanced
    flight.taken += taken
    return good


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def sample(flight: np.record, methods: np.ndarray, room: np.ndarray, at_ns: int, row: np.ndarray) -> bool:
    """The state at ``at_ns``, less than one step after the last committed one, into row; commits nothing.
    Whether it is good.
    """
    if at_ns == flight.start_ns:
        copy_numbers(flight.start, row)
        return True
    p, y = flight.problem, flight.variables[:]
    rest_ns = at_ns - flight.committed_ns
    if rest_ns > 0:
        trial, following = flight.trial[:], flight.following[:]
        copy_numbers(y, trial)
        y = trial
        if not reach(methods[flight.method], y, p, flight.control, following, room, rest_ns):
            return False
    if not to_good_row(y, p, (at_ns - flight.start_ns) * 1e-9, row, MAX_SPEED):
        return False
    flight.work, flight.lost = y[HAND_WORK], y[HEAT]
    return True


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def advance_segment(flight: np.record, methods: np.ndarray, room: np.ndarray, until_ns: int) -> int:
    """Go on in the segment to ``until_ns``: full steps, then one shorter step that ends exactly there, on a copy."""
    flight.waits = not is_provided(methods[flight.method])
    if flight.waits:
        return NO_KERNEL
    if not (commit_until(flight, methods, room, until_ns) and sample(flight, methods, room, until_ns, flight.row)):
        stop_in_last_good_state(flight)
        return FAILED
    flight.now_ns = until_ns
    return REACHED


@njit(cache=True, error_model="numpy", allocates=False)
def accelerations_now(flight: np.record, problem: np.ndarray, y: np.ndarray) -> tuple[float, ...]:
    """At now_ns, from the equations of motion: of the COM [m/s², world], angular [rad/s², body axes]; six numbers.
    problem (1,) and y (VARIABLES,) are scratch.
    """
    problem[0] = flight.common
    p = problem[0]
    complete_problem(flight, flight.row, flight.now_ns, p)
    to_variables(flight.row, p, y)
    q, w, d, u = parts_of(y)
    (ex, ey, ez), (ax, ay, az), _, _ = accelerations(q, w, d, u, p, tension_margin(y, p) > 0.0)
    a, v, P, c = p.reference_acceleration, p.reference_velocity, p.principal_axes, p.reference_damping
    return (
        *(a[0] - c * v[0] + ax, a[1] - c * v[1] + ay, a[2] - c * v[2] + az),
        P[0] * ex + P[1] * ey + P[2] * ez,
        P[3] * ex + P[4] * ey + P[5] * ez,
        P[6] * ex + P[7] * ey + P[8] * ez,
    )


@njit(cache=True, error_model="numpy", allocates=False)
def stop_in_last_good_state(flight: np.record) -> None:
    """Stay where the last good step ended, or at now_ns where that is later."""
    row = flight.trial
    if flight.committed_ns == flight.start_ns:
        copy_numbers(flight.start, row[:13])
    else:
        to_good_row(flight.variables, flight.problem, (flight.committed_ns - flight.start_ns) * 1e-9, row, MAX_SPEED)
    good = flight.committed_ns >= flight.now_ns
    for k in range(13):
        good = good and np.isfinite(row[k])
    if good:
        copy_numbers(row, flight.row)
        flight.now_ns = flight.committed_ns


@njit(cache=True, error_model="numpy", allocates=False)
def steps_of_segment(flight: np.record) -> int:
    """Steps committed in the segment."""
    return int(flight.taken + flight.control.steps)


@njit(cache=True, error_model="numpy", allocates=False)
def evaluations_of_segment(flight: np.record, methods: np.ndarray) -> int:
    """Evaluations of the equations of motion in them."""
    # The step that ends a segment takes the series of the one that waits.
    counted = flight.control.evaluations + flight.control.pending
    return int(flight.taken * methods[flight.method].evaluations + counted)


@njit(cache=True, error_model="numpy", allocates=False)
def note_floors(flight: np.record, methods: np.ndarray, floors: np.ndarray) -> None:
    """Take into ``floors`` (FLOOR_KINDS,) what no method can better in the segment up to now_ns: a state is held in
    doubles. A spin known to ε turns into an attitude known to ε|ω|t, a place is known to half a unit in its last digit,
    and a slender body's tensor given in axes other than its own holds its smallest moment, and the difference of the
    others, to ε I₃ alone.
    """
    accuracy, control, body, row = flight.accuracy, flight.control, flight.body, flight.row
    floors[STEP_FLOOR] = max(floors[STEP_FLOOR], control.floor_rate)
    floors[PULL_FLOOR] = max(floors[PULL_FLOOR], control.pull_floor_rate)
    rate = ROUNDINGS * 2.0**-52 * norm(row[10], row[11], row[12])
    method = methods[flight.method]
    if method.way in (NOTHING, ONE_STEP) and not method.sleeps and rate > accuracy:
        floors[SPIN_FLOOR] = max(floors[SPIN_FLOOR], rate)
    I, M = of_body.INERTIA, of_body.MOMENTS
    if body[I + 1] != 0.0 or body[I + 2] != 0.0 or body[I + 5] != 0.0:
        rate *= body[M + 2] / body[M]
        if rate > accuracy:
            floors[TENSOR_FLOOR] = max(floors[TENSOR_FLOOR], rate)
    farthest = max(abs(row[0]), abs(row[1]), abs(row[2]))
    place = math.ldexp(1.0, math.frexp(farthest)[1] - 54) / body[of_body.LENGTH]
    if place > max(accuracy * (flight.now_ns - flight.start_ns) * 1e-9, FLOOR):
        floors[PLACE_FLOOR] = max(floors[PLACE_FLOOR], place)


def floor_text(floors: Iterable[float]) -> str:
    """What floors of a flight, by kind, say; empty where there are none."""
    return "; ".join(text.format(floor) for text, floor in zip(FLOORS, floors, strict=True) if floor)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def finish_segment(flight: np.record, loads: np.ndarray, methods: np.ndarray, room: np.ndarray) -> None:
    """Keep the segment's counts and begin another from the state at now_ns."""
    note_floors(flight, methods, flight.floors)
    flight.steps_before += steps_of_segment(flight)
    flight.evaluations_before += evaluations_of_segment(flight, methods)
    flight.work_before += flight.work
    flight.lost_before += flight.lost
    copy_numbers(flight.row, flight.start)
    flight.start_ns = flight.now_ns
    begin_segment(flight, loads, methods, room)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def cut_segment(flight: np.record, loads: np.ndarray, methods: np.ndarray, room: np.ndarray) -> None:
    """End the segment at now_ns by the step that sampling there took, and begin another."""
    if flight.now_ns > flight.committed_ns and not methods[flight.method].sleeps:
        flight.taken += 1
    finish_segment(flight, loads, methods, room)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _write(flight: np.record, events: np.ndarray, what: int, load_id: int, row: int) -> None:
    event = events[flight.events]
    event.time_ns, event.what, event.load_id, event.row = flight.now_ns, what, load_id, row
    flight.events += 1


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def end_due(flight: np.record, loads: np.ndarray, events: np.ndarray) -> bool:
    """End what ends at now_ns or should have before; whether anything did."""
    kept = 0
    for row in range(flight.acting):
        if loads[row].end_ns > flight.now_ns:
            if kept != row:
                loads[kept] = loads[row]
            kept += 1
            continue
        if loads[row].kind == HELD_WRENCH:
            _write(flight, events, TIMED_OUT, loads[row].id, loads[row].slot)
            flight.timeouts += 1
        else:
            _write(flight, events, ENDED, loads[row].id, row)
    ended = kept != flight.acting
    flight.acting = kept
    return bool(ended)


@njit(cache=True, error_model="numpy", allocates=False)
def end_slot(flight: np.record, loads: np.ndarray, events: np.ndarray, slot: int) -> None:
    """End what acts in a slot, if anything does."""
    ended = False
    for row in range(flight.acting):
        if ended:
            loads[row - 1] = loads[row]
        elif loads[row].slot == slot:
            _write(flight, events, ENDED, loads[row].id, row)
            ended = True
    if ended:
        flight.acting -= 1


@njit(cache=True, error_model="numpy", allocates=False)
def end_all(flight: np.record, loads: np.ndarray, events: np.ndarray) -> None:
    """End everything that acts."""
    for row in range(flight.acting):
        _write(flight, events, ENDED, loads[row].id, row)
    flight.acting = 0


@njit(cache=True, error_model="numpy", allocates=False)
def end_of_held(flight: np.record, begin_ns: int) -> int:
    """When a held wrench that began at ``begin_ns`` ends."""
    return max(begin_ns + flight.timeout_ns, flight.now_ns) if flight.timeout_ns != 0 else NEVER


@njit(cache=True, error_model="numpy", allocates=False)
def take_body(flight: np.record, loads: np.ndarray) -> None:
    """What the loads that act add to the sums, for another body and other settings."""
    for row in range(flight.acting):
        acting = loads[row]
        accumulate_load(acting.load, flight.body, acting.share)
        if acting.kind == HELD_WRENCH:
            acting.end_ns = end_of_held(flight, acting.at_ns)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _begin(flight: np.record, loads: np.ndarray, row: int, end_ns: int) -> None:
    """Let the load of a row act from now_ns until ``end_ns``, as the last of those that act."""
    to = flight.acting
    if to != row:
        loads[to] = loads[row]
    acting = loads[to]
    acting.at_ns, acting.end_ns, acting.id = flight.now_ns, end_ns, flight.load_ids
    accumulate_load(acting.load, flight.body, acting.share)
    flight.acting += 1


@njit(cache=True, error_model="numpy", allocates=False)
def apply(flight: np.record, loads: np.ndarray, events: np.ndarray, row: int) -> None:
    """Apply the command of a row at now_ns. Rows before it may be taken by loads that act."""
    kind, load = loads[row].kind, loads[row].load
    if kind != CLEAR:
        flight.load_ids += 1
    load_id = flight.load_ids
    _write(flight, events, APPLIED, load_id, row)
    for k in range(4):
        events[flight.events - 1].attitude[k] = flight.row[3 + k]
    if kind == CLEAR:
        end_all(flight, loads, events)
    elif kind == IMPULSE:
        apply_impulse(load, flight.body, flight.row)
        _write(flight, events, BEGAN, load_id, row)
    else:
        if loads[row].slot != NO_SLOT:
            end_slot(flight, loads, events, loads[row].slot)
        duration_ns = loads[row].duration_ns
        if kind == PULSE:
            _begin(flight, loads, row, flight.now_ns + (flight.poke_ns if duration_ns < 0 else duration_ns))
            _write(flight, events, BEGAN, load_id, row)
        elif not is_zero(load):
            _begin(flight, loads, row, end_of_held(flight, flight.now_ns))
            _write(flight, events, BEGAN, load_id, row)
    _write(flight, events, DONE, load_id, row)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def next_event_ns(flight: np.record, loads: np.ndarray) -> int:
    """When the next load ends or command acts, or the string's free end arrives."""
    event_ns = loads[flight.due].at_ns if flight.due < flight.due_end else NEVER
    for row in range(flight.acting):
        event_ns = min(event_ns, loads[row].end_ns)
    if flight.tied and flight.string_end_ns > flight.start_ns:
        event_ns = min(event_ns, flight.string_end_ns)
    return event_ns


@njit(cache=True, error_model="numpy", allocates=False)
def fly(
    flight: np.record,
    loads: np.ndarray,
    events: np.ndarray,
    methods: np.ndarray,
    room: np.ndarray,
    until_ns: int,
) -> int:
    """Carry the body to ``until_ns``; ``row`` is its state there, before what acts at that very time.

    Returns REACHED, FAILED (``row`` is the last good state), or NO_KERNEL: then call again with the method's kernel.
    """
    if not flight.waits:
        flight.events, flight.timeouts = 0, 0
    while True:
        # 1. Until the next event: full steps, then one shorter step that ends exactly there.
        event_ns = min(next_event_ns(flight, loads), until_ns)
        came = advance_segment(flight, methods, room, event_ns)
        if came != REACHED or event_ns == until_ns:
            return came
        # 2. What ends, then what begins; with new loads a new segment.
        end_due(flight, loads, events)
        while flight.due < flight.due_end and loads[flight.due].at_ns == event_ns:
            apply(flight, loads, events, flight.due)
            flight.due += 1
        cut_segment(flight, loads, methods, room)
