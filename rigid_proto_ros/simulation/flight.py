# SPDX-License-Identifier: MIT
"""A flight under commands, compiled: what live simulations, offline ones, replays and sweeps advance with.

Everything a flight is stands in a few arrays: doubles ``f``, integers ``n``, and tables whose rows are loads
(``times``, ``loads``). Commands cut it into segments; ``fly`` goes from event to event until the time asked for, and
writes down what began and ended on the way. What it can't do (a ray, a change of parameters, a string tied or let go)
is applied between two calls, by the same functions.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.uncounted_arrays import copy_numbers
from ..motion import body as of_body
from ..motion import problem as pr
from ..motion.integrators import control as ctl
from ..motion.integrators.auto import kind_of_segment
from ..motion.integrators.equations import accelerations, stretch, tension_margin
from ..motion.integrators.error_measure import FLOOR
from ..motion.integrators.integrator import ADAPTIVE, MAX_SPEED, NOTHING, ONE_STEP
from ..motion.integrators.stepping import COLUMNS, ROWS, SLEEPS, WAY, commit, is_provided, reach
from ..motion.integrators.stepping import EVALUATIONS as COST
from ..motion.loads import LOAD, LOADS_SIZE, apply_impulse, is_zero, share_of
from ..motion.variables import HAND_WORK, HEAT, STORED, to_good_row, to_variables

# Doubles of a flight.
ROW = 0  # (13,) state at NOW_NS
START = ROW + 13  # (13,) state at the segment's start
COMMON = START + 13  # (SIZE,) what the problems of all segments of this body have in common
PROBLEM = COMMON + pr.SIZE  # (SIZE,) of the segment
VARIABLES = PROBLEM + pr.SIZE  # (STORED,) at the last committed step
TRIAL = VARIABLES + STORED  # (STORED,)
FOLLOWING = TRIAL + STORED  # (STORED,) of an adaptive method
CONTROL = FOLLOWING + STORED  # (ctl.SIZE,) of an adaptive method
BODY = CONTROL + ctl.SIZE  # (BODY,)
STRING = BODY + of_body.BODY  # (STRING,) while TIED
SUMS = STRING + pr.STRING  # (LOADS_SIZE,) of the loads that act
ACCURACY = SUMS + LOADS_SIZE
DEGREE = ACCURACY + 1
WORK, LOST = DEGREE + 1, DEGREE + 2  # of the string's hand and in its damper, from the segment's start to NOW_NS [J]
WORK_BEFORE, LOST_BEFORE = DEGREE + 3, DEGREE + 4  # the same in the segments before
FLOORS = (
    DEGREE + 5
)  # (FLOOR_KINDS,) the most that rounding, and not the accuracy, has set since time 0; 0 where it hasn't
ROOM = FLOORS + 5  # workspace of the adaptive methods, to the end

# Integers of a flight.
NOW_NS, START_NS, COMMITTED_NS = range(3)  # COMMITTED_NS: where the last full step of the segment ended
STEP_NS, TIMEOUT_NS, POKE_NS = range(3, 6)  # settings; a timeout of 0 is none
METHOD, CHOOSES, SEGMENTS = range(6, 9)  # CHOOSES: by what the segment holds, as auto does; SEGMENTS begun so far
TAKEN = 9  # steps of the segment, but for those that an adaptive kernel counts
STEPS_BEFORE, EVALUATIONS_BEFORE = 10, 11
ACTING = 12  # the loads that act are rows 0 to ACTING − 1, in the order in which they began
TIMEOUTS = 13  # held wrenches that timed out so far in this call
DUE, DUE_END = 14, 15  # rows of the commands that are to act next, in their order
LOAD_IDS = 16  # given so far
EVENTS = 17  # written so far in this call
TIED, STRING_BEGIN_NS, STRING_END_NS = 18, 19, 20
WAITS = 21  # for a kernel, in the middle of a call
INTEGERS = 22

# A row of times. AT_NS: when a command acts, or a load began. DURATION_NS of a pulse: −1 as the setting for pokes says.
# SLOT: what acts in the same one is replaced; NO_SLOT replaces nothing.
AT_NS, DURATION_NS, KIND, SLOT, END_NS, ID, TIMES = range(7)
COMMAND = 4  # of these say what a command is: AT_NS to SLOT
NO_SLOT, UNNAMED_SLOT = 0, 1
HELD_WRENCH, PULSE, IMPULSE, CLEAR = range(4)
"""Kinds of commands."""

SHARE = LOAD
"""A row of loads: the load itself (LOAD,), and while it acts what it adds to the sums (LOADS_SIZE,)."""
LOAD_ROW = LOAD + LOADS_SIZE

# A row of events: something became of a load. ROW_OF: the command's row in the tables. ATTITUDE: (4,) xyzw of the body
# at that time, for APPLIED alone: doubles, by their bits.
EVENT_NS, WHAT, LOAD_ID, ROW_OF, ATTITUDE = range(5)
EVENT = ATTITUDE + 4
APPLIED, BEGAN, ENDED, DONE, TIMED_OUT = range(5)
"""APPLIED: a command acts, before what it ends and begins. DONE: after that. TIMED_OUT: a held wrench has ended so, and
ROW_OF is its slot.
"""

STEP_FLOOR, PASSAGE_FLOOR, SPIN_FLOOR, TENSOR_FLOOR, PLACE_FLOOR, FLOOR_KINDS = range(6)
"""Why the motion is held to less than its accuracy. An error rate [1/s] of steps too short for it; passages of a knot
by its hand; rates [rad/s] at which the rounding of a spin, or of a tensor given in other axes than its own, turns the
attitude; the rounding of a place far from the world's origin, in lengths of the body.
"""

ROUNDINGS = 2.0
"""ε|ω|t that the exact free step's attitude may err. Measured in 36 flights at 1e3 to 1e6 rad/s: up to 1.1 where the
tensor is given in its own axes, and up to 1.0 times I₃/I₁ where it isn't.
"""

NEVER = 1 << 62
"""Later than any simulated time [ns]."""

REACHED, FAILED, NO_KERNEL = range(3)
"""How a call came back. NO_KERNEL: the segment's method must be compiled first."""


@njit(cache=True, error_model="numpy", allocates=False)
def begin_segment(f: np.ndarray, n: np.ndarray, loads: np.ndarray, methods: np.ndarray) -> None:
    """Begin a segment at START: what acts is summed afresh, in the order in which it began, and the
    method is chosen.
    """
    for k in range(LOADS_SIZE):
        f[SUMS + k] = 0.0
    for row in range(n[ACTING]):
        for k in range(LOADS_SIZE):
            f[SUMS + k] += loads[row, SHARE + k]
    segment_problem(f, n, f[START : START + 13], n[START_NS], f[PROBLEM : PROBLEM + pr.SIZE])
    begin_variables(f, n, methods)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def segment_problem(f: np.ndarray, n: np.ndarray, row: np.ndarray, time_ns: int, p: np.ndarray) -> None:
    """The problem p of a segment under SUMS and the string that begins with the state ``row``."""
    copy_numbers(f[COMMON:], p)
    pr.begin_problem(p, f[SUMS : SUMS + LOADS_SIZE], row)
    if n[TIED] != 0:
        body, string = f[BODY : BODY + of_body.BODY], f[STRING : STRING + pr.STRING]
        pr.begin_string(p, body, string, n[STRING_BEGIN_NS], n[STRING_END_NS], row, time_ns)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def begin_variables(f: np.ndarray, n: np.ndarray, methods: np.ndarray) -> None:
    """Begin a segment whose PROBLEM is made."""
    p, y = f[PROBLEM : PROBLEM + pr.SIZE], f[VARIABLES : VARIABLES + STORED]
    for k in range(STORED):
        y[k] = 0.0
    to_variables(f[START : START + 13], p, y)
    before = n[METHOD]
    if n[CHOOSES] != 0:
        n[METHOD] = kind_of_segment(p, y)
    else:
        n[METHOD] = 1 if p[pr.HAS_STRING] != 0.0 and methods.shape[0] > 1 else 0
    if n[METHOD] != before and methods[n[METHOD], WAY] == ADAPTIVE:
        # Kernels may count on zeros where they never write, and another method's were here.
        f[ROOM : ROOM + methods[n[METHOD], ROWS] * methods[n[METHOD], COLUMNS]] = 0.0
    control = f[CONTROL : CONTROL + ctl.SIZE]
    for k in range(ctl.SIZE):
        control[k] = 0.0
    control[ctl.ACCURACY], control[ctl.DEGREE] = f[ACCURACY], f[DEGREE]
    f[WORK], f[LOST] = 0.0, 0.0
    n[COMMITTED_NS], n[TAKEN] = n[START_NS], 0
    n[SEGMENTS] += 1


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def commit_until(f: np.ndarray, n: np.ndarray, methods: np.ndarray, until_ns: int) -> bool:
    """Commit every full step of the segment that ends at or before ``until_ns``; whether all were good."""
    # A step that waits and goes on beyond that leaves nothing to commit.
    if until_ns == n[COMMITTED_NS] or until_ns - n[COMMITTED_NS] < f[CONTROL + ctl.ACCEPTED_NS]:
        return True
    advanced, taken, good = commit(
        methods[n[METHOD]],
        f[VARIABLES : VARIABLES + STORED],
        f[PROBLEM : PROBLEM + pr.SIZE],
        f[CONTROL : CONTROL + ctl.SIZE],
        f[FOLLOWING : FOLLOWING + STORED],
        f[ROOM:],
        n[STEP_NS],
        until_ns - n[COMMITTED_NS],
    )
    n[COMMITTED_NS] += advanced
    n[TAKEN] += taken
    return good


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def sample(f: np.ndarray, n: np.ndarray, methods: np.ndarray, at_ns: int, row: np.ndarray) -> bool:
    """The state at ``at_ns``, less than one step after the last committed one, into row; commits nothing.
    Whether it is good.
    """
    if at_ns == n[START_NS]:
        copy_numbers(f[START:], row)
        return True
    p, y = f[PROBLEM : PROBLEM + pr.SIZE], f[VARIABLES : VARIABLES + STORED]
    rest_ns = at_ns - n[COMMITTED_NS]
    if rest_ns > 0:
        trial = f[TRIAL : TRIAL + STORED]
        copy_numbers(y, trial)
        y = trial
        control, following = f[CONTROL : CONTROL + ctl.SIZE], f[FOLLOWING : FOLLOWING + STORED]
        if not reach(methods[n[METHOD]], y, p, control, following, f[ROOM:], rest_ns):
            return False
    if not to_good_row(y, p, (at_ns - n[START_NS]) * 1e-9, row, MAX_SPEED):
        return False
    f[WORK], f[LOST] = y[HAND_WORK], y[HEAT]
    return True


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def advance_segment(f: np.ndarray, n: np.ndarray, methods: np.ndarray, until_ns: int) -> int:
    """Go on in the segment to ``until_ns``: full steps, then one shorter step that ends exactly there, on a copy."""
    n[WAITS] = 0 if is_provided(methods, n[METHOD]) else 1
    if n[WAITS] != 0:
        return NO_KERNEL
    if not (commit_until(f, n, methods, until_ns) and sample(f, n, methods, until_ns, f[ROW : ROW + 13])):
        stop_in_last_good_state(f, n)
        return FAILED
    n[NOW_NS] = until_ns
    return REACHED


@njit(cache=True, error_model="numpy")
def accelerations_now(f: np.ndarray, n: np.ndarray) -> tuple[float, ...]:
    """At NOW_NS, from the equations of motion: of the COM [m/s², world], angular [rad/s², body axes]; six numbers."""
    row, p, y = f[ROW : ROW + 13], np.zeros(pr.SIZE), np.zeros(STORED)
    segment_problem(f, n, row, n[NOW_NS], p)
    to_variables(row, p, y)
    x, rate = stretch(y, p)
    q, w, d, u = (y[0], y[1], y[2], y[3]), (y[4], y[5], y[6]), (y[7], y[8], y[9]), (y[10], y[11], y[12])
    ex, ey, ez, ax, ay, az, _, _ = accelerations(*q, *w, *d, *u, p, tension_margin(x, rate, p) > 0.0)
    A, V, P, c = pr.REFERENCE_ACCELERATION, pr.REFERENCE_VELOCITY, pr.PRINCIPAL_AXES, p[pr.REFERENCE_DAMPING]
    return (
        *(p[A] - c * p[V] + ax, p[A + 1] - c * p[V + 1] + ay, p[A + 2] - c * p[V + 2] + az),
        p[P] * ex + p[P + 1] * ey + p[P + 2] * ez,
        p[P + 3] * ex + p[P + 4] * ey + p[P + 5] * ez,
        p[P + 6] * ex + p[P + 7] * ey + p[P + 8] * ez,
    )


@njit(cache=True, error_model="numpy", allocates=False)
def last_good_state(f: np.ndarray, n: np.ndarray, row: np.ndarray) -> None:
    """The state at the last committed step, into row."""
    if n[COMMITTED_NS] == n[START_NS]:
        copy_numbers(f[START:], row)
        return
    y, p = f[VARIABLES : VARIABLES + STORED], f[PROBLEM : PROBLEM + pr.SIZE]
    to_good_row(y, p, (n[COMMITTED_NS] - n[START_NS]) * 1e-9, row, MAX_SPEED)


@njit(cache=True, error_model="numpy", allocates=False)
def stop_in_last_good_state(f: np.ndarray, n: np.ndarray) -> None:
    """Stay where the last good step ended, or at NOW_NS where that is later."""
    row = f[TRIAL : TRIAL + 13]
    last_good_state(f, n, row)
    good = n[COMMITTED_NS] >= n[NOW_NS]
    for k in range(13):
        good = good and np.isfinite(row[k])
    if good:
        copy_numbers(row, f[ROW : ROW + 13])
        n[NOW_NS] = n[COMMITTED_NS]


@njit(cache=True, error_model="numpy", allocates=False)
def steps_of_segment(f: np.ndarray, n: np.ndarray) -> int:
    """Steps committed in the segment."""
    return n[TAKEN] + int(f[CONTROL + ctl.STEPS])


@njit(cache=True, error_model="numpy", allocates=False)
def evaluations_of_segment(f: np.ndarray, n: np.ndarray, methods: np.ndarray) -> int:
    """Evaluations of the equations of motion in them."""
    # The step that ends a segment takes the series of the one that waits.
    counted = f[CONTROL + ctl.EVALUATIONS] + f[CONTROL + ctl.PENDING]
    return n[TAKEN] * methods[n[METHOD], COST] + int(counted)


@njit(cache=True, error_model="numpy", allocates=False)
def note_floors(f: np.ndarray, n: np.ndarray, methods: np.ndarray, floors: np.ndarray) -> None:
    """Take into ``floors`` (FLOOR_KINDS,) what no method can better in the segment up to NOW_NS: a state is held in
    doubles. A spin known to ε turns into an attitude known to ε|ω|t, a place is known to half a unit in its last digit,
    and a slender body's tensor given in axes other than its own holds its smallest moment, and the difference of the
    others, to ε I₃ alone.
    """
    accuracy, control, body, row = f[ACCURACY], f[CONTROL:], f[BODY:], f[ROW:]
    floors[STEP_FLOOR] = max(floors[STEP_FLOOR], control[ctl.FLOOR_RATE])
    floors[PASSAGE_FLOOR] += control[ctl.PASSAGES]
    rate = ROUNDINGS * 2.0**-52 * math.sqrt(row[10] * row[10] + row[11] * row[11] + row[12] * row[12])
    way = methods[n[METHOD], WAY]
    if way in (NOTHING, ONE_STEP) and methods[n[METHOD], SLEEPS] == 0 and rate > accuracy:
        floors[SPIN_FLOOR] = max(floors[SPIN_FLOOR], rate)
    I, M = of_body.INERTIA, of_body.MOMENTS
    if body[I + 1] != 0.0 or body[I + 2] != 0.0 or body[I + 5] != 0.0:
        rate *= body[M + 2] / body[M]
        if rate > accuracy:
            floors[TENSOR_FLOOR] = max(floors[TENSOR_FLOOR], rate)
    farthest = max(abs(row[0]), abs(row[1]), abs(row[2]))
    place = math.ldexp(1.0, math.frexp(farthest)[1] - 54) / body[of_body.LENGTH]
    if place > max(accuracy * (n[NOW_NS] - n[START_NS]) * 1e-9, FLOOR):
        floors[PLACE_FLOOR] = max(floors[PLACE_FLOOR], place)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def finish_segment(f: np.ndarray, n: np.ndarray, loads: np.ndarray, methods: np.ndarray) -> None:
    """Keep the segment's counts and begin another from the state at NOW_NS."""
    note_floors(f, n, methods, f[FLOORS : FLOORS + FLOOR_KINDS])
    n[STEPS_BEFORE] += steps_of_segment(f, n)
    n[EVALUATIONS_BEFORE] += evaluations_of_segment(f, n, methods)
    f[WORK_BEFORE] += f[WORK]
    f[LOST_BEFORE] += f[LOST]
    copy_numbers(f[ROW:], f[START : START + 13])
    n[START_NS] = n[NOW_NS]
    begin_segment(f, n, loads, methods)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def cut_segment(f: np.ndarray, n: np.ndarray, loads: np.ndarray, methods: np.ndarray) -> None:
    """End the segment at NOW_NS by the step that sampling there took, and begin another."""
    if n[NOW_NS] > n[COMMITTED_NS] and methods[n[METHOD], SLEEPS] == 0:
        n[TAKEN] += 1
    finish_segment(f, n, loads, methods)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _write(n: np.ndarray, events: np.ndarray, what: int, load_id: int, row: int) -> None:
    event = events[n[EVENTS]]
    event[EVENT_NS], event[WHAT], event[LOAD_ID], event[ROW_OF] = n[NOW_NS], what, load_id, row
    n[EVENTS] += 1


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _keep(times: np.ndarray, loads: np.ndarray, kept: int, row: int) -> None:
    """Let the load of a row that acts go on as row ``kept``, which is not after it."""
    if kept != row:
        copy_numbers(times[row], times[kept])
        copy_numbers(loads[row], loads[kept])


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def end_due(n: np.ndarray, times: np.ndarray, loads: np.ndarray, events: np.ndarray) -> bool:
    """End what ends at NOW_NS or should have before; whether anything did."""
    kept = 0
    for row in range(n[ACTING]):
        if times[row, END_NS] > n[NOW_NS]:
            _keep(times, loads, kept, row)
            kept += 1
            continue
        if times[row, KIND] == HELD_WRENCH:
            _write(n, events, TIMED_OUT, times[row, ID], times[row, SLOT])
            n[TIMEOUTS] += 1
        else:
            _write(n, events, ENDED, times[row, ID], row)
    ended = kept != n[ACTING]
    n[ACTING] = kept
    return ended


@njit(cache=True, error_model="numpy", allocates=False)
def end_slot(n: np.ndarray, times: np.ndarray, loads: np.ndarray, events: np.ndarray, slot: int) -> None:
    """End what acts in a slot, if anything does."""
    ended = False
    for row in range(n[ACTING]):
        if ended:
            _keep(times, loads, row - 1, row)
        elif times[row, SLOT] == slot:
            _write(n, events, ENDED, times[row, ID], row)
            ended = True
    if ended:
        n[ACTING] -= 1


@njit(cache=True, error_model="numpy", allocates=False)
def end_all(n: np.ndarray, times: np.ndarray, events: np.ndarray) -> None:
    """End everything that acts."""
    for row in range(n[ACTING]):
        _write(n, events, ENDED, times[row, ID], row)
    n[ACTING] = 0


@njit(cache=True, error_model="numpy", allocates=False)
def end_of_held(n: np.ndarray, begin_ns: int) -> int:
    """When a held wrench that began at ``begin_ns`` ends."""
    return max(begin_ns + n[TIMEOUT_NS], n[NOW_NS]) if n[TIMEOUT_NS] != 0 else NEVER


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def _begin(n: np.ndarray, times: np.ndarray, loads: np.ndarray, body: np.ndarray, row: int, end_ns: int) -> None:
    """Let the load of a row act from NOW_NS until ``end_ns``, as the last of those that act."""
    to = n[ACTING]
    _keep(times, loads, to, row)
    times[to, AT_NS], times[to, END_NS], times[to, ID] = n[NOW_NS], end_ns, n[LOAD_IDS]
    share_of(loads[to, :LOAD], body, loads[to, SHARE:])
    n[ACTING] += 1


@njit(cache=True, error_model="numpy", allocates=False)
def apply(f: np.ndarray, n: np.ndarray, times: np.ndarray, loads: np.ndarray, events: np.ndarray, row: int) -> None:
    """Apply the command of a row at NOW_NS. Rows before it may be taken by loads that act."""
    kind, body = times[row, KIND], f[BODY : BODY + of_body.BODY]
    if kind != CLEAR:
        n[LOAD_IDS] += 1
    load_id = n[LOAD_IDS]
    _write(n, events, APPLIED, load_id, row)
    attitude = f[ROW + 3 : ROW + 7].view(np.int64)
    for k in range(4):
        events[n[EVENTS] - 1, ATTITUDE + k] = attitude[k]
    if kind == CLEAR:
        end_all(n, times, events)
    elif kind == IMPULSE:
        apply_impulse(loads[row, :LOAD], body, f[ROW : ROW + 13])
        _write(n, events, BEGAN, load_id, row)
    else:
        if times[row, SLOT] != NO_SLOT:
            end_slot(n, times, loads, events, times[row, SLOT])
        duration_ns = times[row, DURATION_NS]
        if kind == PULSE:
            _begin(n, times, loads, body, row, n[NOW_NS] + (n[POKE_NS] if duration_ns < 0 else duration_ns))
            _write(n, events, BEGAN, load_id, row)
        elif not is_zero(loads[row, :LOAD]):
            _begin(n, times, loads, body, row, end_of_held(n, n[NOW_NS]))
            _write(n, events, BEGAN, load_id, row)
    _write(n, events, DONE, load_id, row)


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def next_event_ns(n: np.ndarray, times: np.ndarray) -> int:
    """When the next load ends or command acts, or the string's free end arrives."""
    event_ns = times[n[DUE], AT_NS] if n[DUE] < n[DUE_END] else NEVER
    for row in range(n[ACTING]):
        event_ns = min(event_ns, times[row, END_NS])
    if n[TIED] != 0 and n[STRING_END_NS] > n[START_NS]:
        event_ns = min(event_ns, n[STRING_END_NS])
    return event_ns


@njit(cache=True, error_model="numpy", allocates=False)
def fly(
    f: np.ndarray,
    n: np.ndarray,
    times: np.ndarray,
    loads: np.ndarray,
    events: np.ndarray,
    methods: np.ndarray,
    until_ns: int,
) -> int:
    """Carry the body to ``until_ns``; ROW is its state there, before what acts at that very time.

    Returns REACHED, FAILED (ROW is the last good state), or NO_KERNEL: then call again with a kernel for METHOD.
    """
    if n[WAITS] == 0:
        n[EVENTS], n[TIMEOUTS] = 0, 0
    while True:
        # 1. Until the next event: full steps, then one shorter step that ends exactly there.
        event_ns = min(next_event_ns(n, times), until_ns)
        came = advance_segment(f, n, methods, event_ns)
        if came != REACHED or event_ns == until_ns:
            return came
        # 2. What ends, then what begins; with new loads a new segment.
        end_due(n, times, loads, events)
        while n[DUE] < n[DUE_END] and times[n[DUE], AT_NS] == event_ns:
            apply(f, n, times, loads, events, n[DUE])
            n[DUE] += 1
        cut_segment(f, n, loads, methods)
