# SPDX-License-Identifier: MIT
"""The compiled flight of one body under commands, shared by live simulations, offline runs, replays and sweeps.

The state of a flight is one record (FLIGHT) and a table of loads (LOAD_ROW). Commands divide it into segments with
constant loads; ``fly`` advances from event to event up to a given time and records which loads began and ended. Events
that it can't handle (a ray, a change of parameters, a string tied or released) are applied between two calls, with the
same functions.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..base.arithmetic import exponent_of, scaled
from ..base.compilation import copy_numbers, copy_record, exported, njit, record_type
from ..base.rotation import norm
from ..base.vectors import FloatArray, Records, StateRow, Vector, Vector3
from ..motion import body as of_body
from ..motion.integrators.auto import kind_of_segment
from ..motion.integrators.integrator import ADAPTIVE, FIXED_STEPS
from ..motion.integrators.series_steps import FLOOR, begin_control
from ..motion.integrators.stepping import (
    CONTROL,
    commit,
    evaluations_of,
    method_for,
    reach,
    sleeps,
    way_of,
    workspace_of,
)
from ..motion.loads import (
    LOAD,
    LOADS_SIZE,
    accumulate_load,
    apply_impulse,
    is_within_magnitude,
    is_zero,
    needs_of_load,
)
from ..motion.problem import (
    HAND_WORK,
    HEAT,
    MAX_SPEED,
    PROBLEM,
    TIME,
    VARIABLES,
    Variables,
    accelerations,
    begin_problem,
    begin_rotor,
    begin_string,
    parts_of,
    tension_margin,
    to_good_row,
    to_variables,
)
from ..motion.string import STRING
from .commands import CLEAR, HELD_WRENCH, IMPULSE, NO_SLOT, PULSE

FLIGHT = record_type(
    [
        ("now_ns", np.int64),
        ("row", np.float64, 13),  # state at now_ns
        ("start_ns", np.int64),  # start of the segment
        ("start", np.float64, 13),  # state at start_ns
        ("committed_ns", np.int64),  # end of the segment's last committed step
        ("variables", np.float64, VARIABLES),  # at committed_ns
        ("trial", np.float64, VARIABLES),
        ("following", np.float64, VARIABLES),  # at the end of an adaptive method's pending step
        ("control", CONTROL),  # of an adaptive method
        ("common", PROBLEM),  # the part of the problem that all segments of this body share
        ("problem", PROBLEM),  # of the segment
        ("body", np.float64, of_body.BODY),
        # The string: a row as in motion/problem.py, valid while ``tied``; when its free end leaves its origin and is at
        # its target; when the last target came, and when it will be released (NEVER: not by itself); the effective mass
        # [kg] from which its stiffness and damping were computed; where the next target ties it [mesh coordinates].
        ("string", np.float64, STRING),
        ("string_mass", np.float64),
        ("tied", np.bool_),
        ("string_begin_ns", np.int64),
        ("string_end_ns", np.int64),
        ("string_last_ns", np.int64),
        ("string_release_ns", np.int64),
        ("string_attach", np.float64, 3),
        # The flywheel: its momentum [N m s, body axes] at rotor_ns, and what has driven it since then [N m].
        ("has_rotor", np.bool_),
        ("rotor", np.float64, 3),
        ("rotor_torque", np.float64, 3),
        ("rotor_ns", np.int64),
        ("sums", np.float64, LOADS_SIZE),  # sums of the active loads
        # Settings. A timeout of 0 means no timeout.
        ("accuracy", np.float64),
        ("degree", np.int64),
        ("step_ns", np.int64),
        ("timeout_ns", np.int64),
        ("poke_ns", np.int64),
        ("string_timeout_ns", np.int64),
        ("integrator", np.int64),  # its number
        ("supports", np.int64),  # what it supports, as bits (motion/loads.py, NEEDS)
        ("chooses", np.bool_),  # whether the method is selected for each segment, as by auto
        ("method", np.int64),
        ("segments", np.int64),  # number of segments begun
        # Work of the string's hand and heat in its damper [J]: from the segment's start to now_ns, and before it.
        ("work", np.float64),
        ("lost", np.float64),
        ("work_before", np.float64),
        ("lost_before", np.float64),
        ("taken", np.int64),  # steps of the segment, without those counted by an adaptive kernel
        ("steps_before", np.int64),
        ("evaluations_before", np.int64),
        ("floors", np.float64, 5),  # (FLOOR_KINDS,) largest error floors due to rounding since time 0
        # Rows of the table of loads. Active loads, in the order in which they began: 0 to acting − 1. Commands to be
        # applied next, in their order: due to due_end − 1.
        ("acting", np.int64),
        ("due", np.int64),
        ("due_end", np.int64),
        ("load_ids", np.int64),  # number of load ids assigned
        ("events", np.int64),  # number of events written in this call
        # Number of held wrenches and strings that timed out, and of commands that were refused, in this call.
        ("noteworthy", np.int64),
    ]
)

LOAD_ROW = record_type(
    [
        # A command: the time at which it acts or began; the duration of a pulse, −1 for the default of pokes; its kind
        # (simulation/commands.py). It replaces the active load in its slot; NO_SLOT replaces nothing.
        ("at_ns", np.int64),
        ("duration_ns", np.int64),
        ("kind", np.int64),
        ("slot", np.int64),
        ("end_ns", np.int64),
        ("id", np.int64),
        ("load", np.float64, LOAD),
        ("share", np.float64, LOADS_SIZE),  # while active, its contribution to the sums
    ]
)
EVENT = record_type(
    [
        ("time_ns", np.int64),
        ("what", np.int64),
        ("load_id", np.int64),
        ("row", np.int64),  # row of the command in the table; for TIMED_OUT the slot
        ("attitude", np.float64, 4),  # xyzw of the body at that time, only for APPLIED
    ]
)
"""An event of a load or command."""

APPLIED, BEGAN, ENDED, DONE, TIMED_OUT, RELEASED, TOO_LARGE, UNSUPPORTED = range(8)
"""Kinds of events. APPLIED: a command is applied, before the loads that it ends and begins. DONE: after these.
TIMED_OUT: a held wrench ended by its timeout; RELEASED: the string was released by its own. TOO_LARGE, UNSUPPORTED: a
command was refused, since the body or the integrator can't take its load.
"""

STEP_FLOOR, PULL_FLOOR, SPIN_FLOOR, TENSOR_FLOOR, PLACE_FLOOR, FLOOR_KINDS = range(6)
"""Causes of rounding errors above the requested accuracy: error rates [1/s] of very short steps and of the string's
tension; attitude error rates [rad/s] due to rounding of the spin and of a tensor that isn't given in its principal
axes; rounding of a position far from the world's origin, relative to the body's length.
"""

FLOORS = (
    "rounding of 32 units in the last place a step, in steps that short, comes to {:.2g} a second",
    "rounding of the string's length, which its stiffness multiplies, comes to {:.2g} a second",
    "rounding of the spin turns the attitude by up to {:.2g} rad a second",
    "rounding of a slender tensor given in axes other than its own turns the attitude by up to {:.2g} rad a second",
    "rounding of a position far from the world's origin is {:.2g} of the body's size",
)
"""Message for each kind of error floor."""

ROUNDINGS = 2.0
"""Attitude error of the exact free step in units of ε|ω|t. Measured in 36 flights at 1e3 to 1e6 rad/s: up to 1.1 with a
tensor given in its principal axes, otherwise up to 1.0 times I₃/I₁.
"""

NEVER = 1 << 62
"""Later than any simulated time [ns]."""

NOT_BEGUN = -1
"""Method of a flight whose first segment hasn't begun."""

REACHED, FAILED = range(2)
"""Result of a call."""


@njit(error_model="numpy", allocates=False)
def begin_segment(flight: np.record, loads: Records, room: FloatArray) -> None:
    """Begin a segment at ``start``: sum the active loads anew, in the order in which they began, and select the method.

    loads: the table. room: memory for the workspace of adaptive methods (ROOM in motion/integrators/stepping.py).
    """
    for k in range(LOADS_SIZE):
        flight.sums[k] = 0.0
    for row in range(flight.acting):
        share = loads[row].share
        for k in range(LOADS_SIZE):
            flight.sums[k] += share[k]
    problem = flight.problem
    copy_record(flight.common, flight.problem)
    complete_problem(flight, flight.start, flight.start_ns, problem)
    begin_variables(flight, room)


@njit(error_model="numpy", allocates=False, forceinline=True)
def complete_problem(flight: np.record, row: StateRow, time_ns: int, p: np.record) -> None:
    """Complete p, a copy of ``common``, to the problem of a segment with the initial state ``row``, the loads ``sums``
    and the string.
    """
    begin_problem(p, flight.sums, row)
    if flight.tied:
        begin_string(p, flight.body, flight.string, flight.string_begin_ns, flight.string_end_ns, row, time_ns)
    if flight.has_rotor:
        torque = flight.rotor_torque
        begin_rotor(p, rotor_momentum(flight, time_ns), (torque[0], torque[1], torque[2]))


@njit(error_model="numpy", allocates=False)
def rotor_momentum(flight: np.record, time_ns: int) -> Vector:
    """The flywheel's momentum at ``time_ns`` [N m s, body axes]."""
    h, rate, t = flight.rotor, flight.rotor_torque, (time_ns - flight.rotor_ns) * 1e-9
    return h[0] + t * rate[0], h[1] + t * rate[1], h[2] + t * rate[2]


@njit(error_model="numpy", allocates=False)
def take_rotor(flight: np.record, h: Vector, torque: Vector3) -> None:
    """From now_ns on the flywheel has the momentum h and is driven by ``torque`` (3,)."""
    for k in range(3):
        flight.rotor[k], flight.rotor_torque[k] = h[k], torque[k]
    flight.rotor_ns = flight.now_ns
    flight.has_rotor = bool(flight.rotor.any() or flight.rotor_torque.any())


@njit(error_model="numpy", allocates=False, forceinline=True)
def begin_variables(flight: np.record, room: FloatArray) -> None:
    """Set the initial variables and select the method of a segment whose problem is complete."""
    p, y = flight.problem, flight.variables
    for k in range(VARIABLES):
        y[k] = 0.0
    to_variables(flight.start, p, y)
    before = flight.method
    flight.method = method_for(flight.integrator, kind_of_segment(p, y) if flight.chooses else 0)
    if flight.method != before and way_of(flight.method) == ADAPTIVE:
        # Kernels rely on zeros in elements that they never write; another method may have written there.
        rows, columns = workspace_of(flight.method, flight.degree)
        for k in range(rows * columns):
            room[k] = 0.0
    begin_control(flight.control, flight.accuracy, flight.degree)
    flight.work, flight.lost = 0.0, 0.0
    flight.committed_ns, flight.taken = flight.start_ns, 0
    flight.segments += 1


@njit(error_model="numpy", allocates=False, forceinline=True)
def commit_until(flight: np.record, room: FloatArray, until_ns: int) -> bool:
    """Commit every full step of the segment that ends at or before ``until_ns``; returns whether all were good."""
    span_ns = until_ns - flight.committed_ns
    # If the pending step ends later, there is nothing to commit.
    if span_ns == 0 or span_ns < flight.control.accepted_ns:
        return True
    # Slices are plain arrays, as a kernel that is called by its address expects.
    y, following = flight.variables[:], flight.following[:]
    advanced, taken, good = commit(
        flight.method, y, flight.problem, flight.control, following, room, flight.step_ns, span_ns
    )
    flight.committed_ns += advanced
    flight.taken += taken
    return good


@njit(error_model="numpy", allocates=False, forceinline=True)
def sample(flight: np.record, room: FloatArray, at_ns: int, row: StateRow) -> bool:
    """Write the state at ``at_ns``, less than one step after the last committed step, into row and commit nothing.
    Returns whether the state is good.
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
        if not reach(flight.method, y, p, flight.control, following, room, rest_ns):
            return False
    if not to_good_row(y, p, (at_ns - flight.start_ns) * 1e-9, row, MAX_SPEED):
        return False
    flight.work, flight.lost = y[HAND_WORK], y[HEAT]
    return True


@njit(error_model="numpy", allocates=False, forceinline=True)
def advance_segment(flight: np.record, room: FloatArray, until_ns: int) -> int:
    """Advance within the segment to ``until_ns``: full steps, then one shorter step on a copy, which ends there."""
    if not (commit_until(flight, room, until_ns) and sample(flight, room, until_ns, flight.row)):
        stop_in_last_good_state(flight)
        return FAILED
    flight.now_ns = until_ns
    return REACHED


@exported(FLIGHT, [PROBLEM], "f8[:]", returns="f8 f8 f8 f8 f8 f8")
def accelerations_now(flight: np.record, problem: Records, y: Variables) -> tuple[float, ...]:
    """Accelerations at now_ns by the equations of motion: of the COM [m/s², world], angular [rad/s², body axes]; six
    numbers. problem (1,) and y (VARIABLES,) are scratch memory.
    """
    copy_record(flight.common, problem[0])
    p = problem[0]
    complete_problem(flight, flight.row, flight.now_ns, p)
    to_variables(flight.row, p, y)
    q, w, d, u = parts_of(y)
    (ex, ey, ez), (ax, ay, az), _, _ = accelerations(q, w, d, u, y[TIME], p, tension_margin(y, p) > 0.0)
    a, v, P, c = p.reference_acceleration, p.reference_velocity, p.principal_axes, p.reference_damping
    return (
        *(a[0] - c * v[0] + ax, a[1] - c * v[1] + ay, a[2] - c * v[2] + az),
        P[0] * ex + P[1] * ey + P[2] * ez,
        P[3] * ex + P[4] * ey + P[5] * ez,
        P[6] * ex + P[7] * ey + P[8] * ez,
    )


@njit(error_model="numpy", allocates=False)
def stop_in_last_good_state(flight: np.record) -> None:
    """Set the state to the end of the last good step, or leave it at now_ns if that is later."""
    row, good = flight.trial[:13], True
    if flight.committed_ns == flight.start_ns:
        copy_numbers(flight.start, row)
    else:
        elapsed = (flight.committed_ns - flight.start_ns) * 1e-9
        good = to_good_row(flight.variables, flight.problem, elapsed, row, MAX_SPEED)
    if good and flight.committed_ns >= flight.now_ns:
        copy_numbers(row, flight.row)
        flight.now_ns = flight.committed_ns


@njit(error_model="numpy", allocates=False)
def steps_of_segment(flight: np.record) -> int:
    """Steps committed in the segment."""
    return int(flight.taken + flight.control.steps)


@njit(error_model="numpy", allocates=False)
def evaluations_of_segment(flight: np.record) -> int:
    """Evaluations of the equations of motion in the segment's committed steps."""
    # The shorter step that ends a segment uses the series of the pending step.
    counted = flight.control.evaluations + flight.control.pending
    return int(flight.taken * evaluations_of(flight.method) + counted)


@exported(FLIGHT, "f8[:]")
def note_floors(flight: np.record, floors: FloatArray) -> None:
    """Update ``floors`` (FLOOR_KINDS,) with limits of double precision in the segment up to now_ns, which no method can
    improve. Rounding ω to ε causes an attitude error of ε|ω|t. A position is rounded to half a unit in its last place.
    The tensor of a slender body, unless given in its principal axes, holds its smallest moment and the difference of
    the others only to ε I₃. Fixed steps have no accuracy that could be missed.
    """
    accuracy, control, body, row = flight.accuracy, flight.control, flight.body, flight.row
    way = way_of(flight.method)
    if way == FIXED_STEPS or flight.now_ns == flight.start_ns:
        return
    floors[STEP_FLOOR] = max(floors[STEP_FLOOR], control.floor_rate)
    floors[PULL_FLOOR] = max(floors[PULL_FLOOR], control.pull_floor_rate)
    rate = ROUNDINGS * 2.0**-52 * norm(row[10], row[11], row[12])
    if way != ADAPTIVE and not sleeps(flight.method) and rate > accuracy:
        floors[SPIN_FLOOR] = max(floors[SPIN_FLOOR], rate)
    I, M = of_body.INERTIA, of_body.MOMENTS
    if body[I + 1] != 0.0 or body[I + 2] != 0.0 or body[I + 5] != 0.0:
        rate *= body[M + 2] / body[M]
        if rate > accuracy:
            floors[TENSOR_FLOOR] = max(floors[TENSOR_FLOOR], rate)
    farthest = max(abs(row[0]), abs(row[1]), abs(row[2]))
    place = scaled(1.0, exponent_of(farthest) - 54) / body[of_body.LENGTH]
    if place > max(accuracy * (flight.now_ns - flight.start_ns) * 1e-9, FLOOR):
        floors[PLACE_FLOOR] = max(floors[PLACE_FLOOR], place)


def floor_text(floors: Iterable[float]) -> str:
    """Message about the error floors of a flight, given by kind; empty when there are none."""
    return "; ".join(text.format(floor) for text, floor in zip(FLOORS, floors, strict=True) if floor)


@njit(error_model="numpy", allocates=False, forceinline=True)
def finish_segment(flight: np.record, loads: Records, room: FloatArray) -> None:
    """Add the segment's counts to the totals and begin another segment at the state at now_ns."""
    note_floors(flight, flight.floors)
    flight.steps_before += steps_of_segment(flight)
    flight.evaluations_before += evaluations_of_segment(flight)
    flight.work_before += flight.work
    flight.lost_before += flight.lost
    copy_numbers(flight.row, flight.start)
    flight.start_ns = flight.now_ns
    begin_segment(flight, loads, room)


@njit(error_model="numpy", allocates=False, forceinline=True)
def cut_segment(flight: np.record, loads: Records, room: FloatArray) -> None:
    """End the segment at now_ns, counting the shorter step that was taken to that time, and begin another."""
    if flight.now_ns > flight.committed_ns and not sleeps(flight.method):
        flight.taken += 1
    finish_segment(flight, loads, room)


@njit(error_model="numpy", allocates=False, forceinline=True)
def _write(flight: np.record, events: Records, what: int, load_id: int, row: int) -> None:
    event = events[flight.events]
    event.time_ns, event.what, event.load_id, event.row = flight.now_ns, what, load_id, row
    flight.events += 1


@njit(error_model="numpy", allocates=False, forceinline=True)
def end_due(flight: np.record, loads: Records, events: Records) -> bool:
    """End the loads whose end is at or before now_ns, and release a string that has timed out; returns whether anything
    ended, or the string's free end arrives at its target now.
    """
    kept = 0
    for row in range(flight.acting):
        if loads[row].end_ns > flight.now_ns:
            if kept != row:
                copy_record(loads[row], loads[kept])
            kept += 1
            continue
        if loads[row].kind == HELD_WRENCH:
            _write(flight, events, TIMED_OUT, loads[row].id, loads[row].slot)
            flight.noteworthy += 1
        else:
            _write(flight, events, ENDED, loads[row].id, row)
    ended = kept != flight.acting
    flight.acting = kept
    if not flight.tied:
        return bool(ended)
    if flight.string_release_ns <= flight.now_ns:
        flight.tied = False
        _write(flight, events, RELEASED, 0, 0)
        flight.noteworthy += 1
        return True
    return bool(ended or flight.string_end_ns == flight.now_ns)


@njit(error_model="numpy", allocates=False)
def end_slot(flight: np.record, loads: Records, events: Records, slot: int) -> None:
    """End the active load in a slot, if there is one."""
    ended = False
    for row in range(flight.acting):
        if ended:
            copy_record(loads[row], loads[row - 1])
        elif loads[row].slot == slot:
            _write(flight, events, ENDED, loads[row].id, row)
            ended = True
    if ended:
        flight.acting -= 1


@njit(error_model="numpy", allocates=False)
def end_all(flight: np.record, loads: Records, events: Records) -> None:
    """End all active loads."""
    for row in range(flight.acting):
        _write(flight, events, ENDED, loads[row].id, row)
    flight.acting = 0


@njit(error_model="numpy", allocates=False)
def end_of_held(flight: np.record, begin_ns: int) -> int:
    """End time [ns] of a held wrench that began at ``begin_ns``."""
    return max(begin_ns + flight.timeout_ns, flight.now_ns) if flight.timeout_ns != 0 else NEVER


@njit(error_model="numpy", allocates=False)
def take_body(flight: np.record, loads: Records) -> None:
    """Recompute the contributions and end times of the active loads for another body and other settings."""
    for row in range(flight.acting):
        acting = loads[row]
        accumulate_load(acting.load, flight.body, acting.share)
        if acting.kind == HELD_WRENCH:
            acting.end_ns = end_of_held(flight, acting.at_ns)


@njit(error_model="numpy", allocates=False, forceinline=True)
def _begin(flight: np.record, loads: Records, row: int, end_ns: int) -> None:
    """Make the load in a row active from now_ns until ``end_ns``, as the last of the active loads."""
    to = flight.acting
    if to != row:
        copy_record(loads[row], loads[to])
    acting = loads[to]
    acting.at_ns, acting.end_ns, acting.id = flight.now_ns, end_ns, flight.load_ids
    accumulate_load(acting.load, flight.body, acting.share)
    flight.acting += 1


@njit(error_model="numpy", allocates=False)
def takes(flight: np.record, kind: int, load: FloatArray) -> int:
    """Whether body and integrator can take a command's load: DONE, TOO_LARGE or UNSUPPORTED. An impulse acts at once:
    the integrator never sees it.
    """
    if not is_within_magnitude(load, flight.body):
        return TOO_LARGE
    if kind != IMPULSE and needs_of_load(load) & ~flight.supports != 0:
        return UNSUPPORTED
    return DONE


@njit(error_model="numpy", allocates=False)
def apply(flight: np.record, loads: Records, events: Records, row: int) -> bool:
    """Apply the command in a row at now_ns; returns whether it was accepted. Active loads may be written to the rows
    before it.
    """
    kind, load = loads[row].kind, loads[row].load
    if kind != CLEAR:
        taken = takes(flight, kind, load)
        if taken != DONE:
            _write(flight, events, taken, 0, row)
            flight.noteworthy += 1
            return False
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
    return True


@njit(error_model="numpy", allocates=False, forceinline=True)
def next_event_ns(flight: np.record, loads: Records) -> int:
    """Time of the next event: a load ends, a command is due, the string's free end arrives at its target, or the string
    is released.
    """
    event_ns = loads[flight.due].at_ns if flight.due < flight.due_end else NEVER
    for row in range(flight.acting):
        event_ns = min(event_ns, loads[row].end_ns)
    if flight.tied:
        event_ns = min(event_ns, flight.string_release_ns)
        if flight.string_end_ns > flight.start_ns:
            event_ns = min(event_ns, flight.string_end_ns)
    return event_ns


@njit(error_model="numpy", allocates=False)
def fly(
    flight: np.record,
    loads: Records,
    events: Records,
    room: FloatArray,
    until_ns: int,
) -> int:
    """Advance the flight to ``until_ns``; ``row`` is then the state before events at that same time are applied.

    Returns REACHED or FAILED (``row`` is the last good state).
    """
    flight.events, flight.noteworthy = 0, 0
    while True:
        # 1. Until the next event: full steps, then one shorter step that ends exactly there.
        event_ns = min(next_event_ns(flight, loads), until_ns)
        came = advance_segment(flight, room, event_ns)
        if came != REACHED or event_ns == until_ns:
            return came
        # 2. Loads end, then commands are applied; a new segment begins with the new loads.
        changed = end_due(flight, loads, events)
        while flight.due < flight.due_end and loads[flight.due].at_ns == event_ns:
            changed = apply(flight, loads, events, flight.due) or changed
            flight.due += 1
        if changed:
            cut_segment(flight, loads, room)
