# SPDX-License-Identifier: MIT
"""Adaptive steps by Taylor series of the motion; changes between slack and taut are located on the series.

The error norm is the largest of attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1 rad/s) and |Δv|/max(|v|, ℓ·1 rad/s).
``accuracy`` is a rate in this norm: a step of h seconds may err by accuracy·h, but rounding allows no less than 32 ε
per step, and more on a stiff string (``floor_of_step``). If coefficients grow as σᵏ, the remainder after degree N is
(σh)^(N+1)/(1 − σh), and h is chosen so that this is the accuracy times h. So the step length follows from the
coefficients, and no step is rejected. Source: Jorba and Zou, Experimental Mathematics 14 (2005) 99, section 3.

Loads that rotate with the body use the series of the spin, all others that of the whole motion. Where a pull-only
string becomes slack or taut (integrators/string_law.py), another series begins, with the other law. A step is first
planned at its full length: a series from its start and, if the law changes within it, a last one from that time on. It
ends at a whole nanosecond, so that times of commands stay integers. Committing it and sampling within it evaluate the
same series.

An accepted step that extends beyond the requested time is kept, in CONTROL and ``following``, until it can be
committed, so that the times of sampling never change the steps.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.arithmetic import BIAS, MANTISSA, MANTISSA_BITS, bits_of, double_of, logarithm
from ...base.compilation import copy_numbers, njit
from ...base.rotation import norm
from ...base.simd import Packed, filled, four, joined, largest, load
from ...base.vectors import FloatArray
from ..problem import ATTITUDE, HEAT, TIME, VARIABLES, Variables, damping_functions, is_good
from ..string import most_yielding
from .series import (
    A_KNOT,
    MAX_DEGREE,
    MOTION_COLUMNS,
    SPIN_COLUMNS,
    VARIABLES_AT,
    motion_at,
    motion_series,
    spin_at,
    spin_series,
    stretch_at,
)
from .string_law import (
    NONE,
    PULLS,
    SHORTENS,
    clear_of_the_end,
    is_one_sided,
    knot_at,
    law_of,
    next_law,
    shortening_heat,
)

LONGEST = 1e6
"""Longest step [s]: 10¹⁵ ns are exact in a double."""

PART = 0.5
"""Safety factor: the fraction of the allowed error for a remainder, since the last coefficients don't bound later ones.
Measured over random scenes at accuracies 1e-3 to 1e-12 the error stays below 0.6 of the allowed one.
"""
PART_ON_A_STRING = 0.1
"""The same for a string, whose coefficients decrease less evenly: the nearer the knot to its free end, the nearer the
poles.
"""

_HIGHER = 3
"""Added to the degree of a series of the spin for the whole motion, where the cost of a step besides its series is
higher.
"""

_MAX_PARTS = 200
"""Maximum number of series in one step, all but the first and last within one nanosecond; more means chattering, and
the rest of the step uses a single law.
"""


# Error norm

WEIGHINGS = 4
"""Maximum number of attempts at a step with larger error weights at its end than at its start; each is shorter."""

EPSILON = 2.0**-52
FLOOR = 32.0 * EPSILON

Weights = tuple[float, float, float, float]
"""Weights of attitude (as quaternion difference), ω, x and v in the error norm."""


@njit(error_model="numpy", allocates=False)
def scales(y: Variables, p: np.record, elapsed: float) -> Weights:
    """The weights at variables y, ``elapsed`` seconds into the segment."""
    spin = norm(y[4], y[5], y[6])
    if not p.translates:
        return 2.0, 1.0 / max(spin, 1.0), 0.0, 0.0
    c = p.reference_damping
    push = elapsed * damping_functions(c * elapsed)[0]
    speed = 0.0
    for k in range(3):
        v = p.reference_velocity[k]
        v += push * (p.reference_acceleration[k] - c * v) + y[10 + k]
        speed += v * v
    length = p.length
    return 2.0, 1.0 / max(spin, 1.0), 1.0 / length, 1.0 / max(math.sqrt(speed), length)


@njit(error_model="numpy", allocates=False)
def heavier(ending: Weights, weights: Weights) -> tuple[Weights, bool]:
    """The larger of the weights at a step's end and start, and whether they exceed those at the start by more than a
    quarter.
    """
    spin, speed = max(ending[1], weights[1]), max(ending[3], weights[3])
    return (weights[0], spin, weights[2], speed), spin > 1.25 * weights[1] or speed > 1.25 * weights[3]


@njit(error_model="numpy", allocates=False)
def response_at_knot(p: np.record, spin: float, speed: float) -> float:
    """Largest weighted velocity change by an impulse of 1 N s at the string's knot, for these weights of ω and v."""
    arm = norm(p.attach[0], p.attach[1], p.attach[2])
    return float(max(speed / p.mass, spin * arm / p.moments[0]))


@njit(error_model="numpy", allocates=False)
def jump_of_displacement(p: np.record, spin: float, speed: float) -> float:
    """Weighted velocity error per unit of displacement error, which makes a damped string become taut too early or too
    late.
    """
    return float(p.string_damping * p.length * response_at_knot(p, spin, speed)) if p.has_string else 0.0


@njit(error_model="numpy", allocates=False)
def fastest_swing(p: np.record) -> float:
    """Upper bound of the angular frequency [rad/s] of the body on the string, over all directions."""
    arm, I = p.attach, p.moments
    yields = most_yielding(p.mass, I[0], I[1], I[2], arm[0], arm[1], arm[2])
    return math.sqrt(p.stiffness * yields)


@njit(error_model="numpy", allocates=False)
def floor_of_step(y: Variables, p: np.record, weights: Weights, pulls: bool, h: float) -> float:
    """Rounding error, in the error norm, of a step of h seconds from y: 32 ε and, for a string that pulls, the effect
    of a force known only to the rounding of its knot's position. The span from free end to knot errs by ε times itself
    and the arm, k and c multiply that, and an oscillation reverses it after a radian. Near the free end, a string that
    pushes also errs in its direction.
    """
    if not pulls:
        return FLOOR
    _, _, _, length, _ = knot_at(y, p)
    arm, k, c = norm(p.attach[0], p.attach[1], p.attach[2]), p.stiffness, p.string_damping
    reach = max(length, p.rest_length)
    size = reach + (arm * reach / length if p.bilateral and length > 0.0 else arm)
    speed = norm(y[10], y[11], y[12]) + norm(y[4], y[5], y[6]) * arm
    time = min(h, 1.0 / fastest_swing(p))
    impulse: float = EPSILON * (size * (k * time + c) + speed * c * time)
    # Within the step, velocity errors change position and attitude.
    return FLOOR + impulse * response_at_knot(p, max(weights[1], h), max(weights[3], h * weights[2]))


# Step length

# log₂(1 − 2ˣ) is concave: chords from σh = 0.18 to 0.6, and from there to 0.9, as constant − slope x.
_REST, _SLOPE = -1.7613260844219780, 0.5962259201961054
_REST_NEAR, _SLOPE_NEAR = -3.8416301040166890, 3.4190225827029095
_LOG2_MOST = -0.15200309344504997
"""log₂ of 0.9"""


# log₂ and 2ˣ to two digits from the exponent of a double: ten times faster than libm, with the same bits everywhere.


@njit(error_model="numpy", allocates=False)
def fast_log2(x: float) -> float:
    """log₂ x for x > 0 with an error below 0.006; −1023 for subnormal x."""
    bits = bits_of(x)
    # m − 1 with x = 2ⁿ m: exact if x is normal. log₂ m − (m − 1) is zero at m = 1 and 2; the linear factor matches its
    # slopes there.
    f: float = double_of((bits & MANTISSA) | (BIAS << MANTISSA_BITS)) - 1.0
    return float((bits >> MANTISSA_BITS) - BIAS) + f + f * (1.0 - f) * (0.4427 - 0.164 * f)


@njit(error_model="numpy", allocates=False)
def fast_exp2(x: float) -> float:
    """2ˣ with a relative error below 0.001, for x clamped to ±1000."""
    x = min(max(x, -1000.0), 1000.0)
    whole = int(x)
    if whole > x:
        whole -= 1
    f = x - whole
    power: float = double_of((whole + BIAS) << MANTISSA_BITS)
    return power * (1.0 + f - f * (1.0 - f) * (0.3069 + 0.0794 * f))


_TO_NEAREST = 6755399441055744.0  # 1.5·2⁵²


@njit(error_model="numpy", allocates=False)
def degree_for(accuracy: float) -> int:
    """Degree with the least work per simulated time at this accuracy, as measured; the minimum is flat (12 at 1e-3, 19
    at 1e-9).
    """
    degree = 8.5 - 1.15 * logarithm(accuracy) / logarithm(10.0)
    return min(max(int((degree + _TO_NEAREST) - _TO_NEAREST), 6), MAX_DEGREE)


@njit(error_model="numpy", allocates=False)
def degree_of_motion(degree: int) -> int:
    """Degree of a series of the whole motion, if ``degree`` is that of the spin alone."""
    return min(degree + _HIGHER, MAX_DEGREE)


@njit(error_model="numpy", allocates=False)
def _length_for(
    c: FloatArray, at: int, columns: int, degree: int, weights: Packed, accuracy: float, part: float
) -> float:
    """h [s] with (σh)^(N+1)/(1 − σh) = max(accuracy h, floor) times ``part``, or a little less. at: offset of the
    variables in a row of ``columns`` numbers; weights: one for each of them.
    """
    # log₂ σ from the last three coefficients: the largest k-th root of a bound on their norm.
    last = degree * columns + at
    # A vector's length is at most twice its largest component, which unlike squares of coefficients doesn't overflow.
    growth = fast_log2(2.0 * largest(load(c, last - 2 * columns, weights) * weights)) * (1.0 / (degree - 2.0))
    growth = max(growth, fast_log2(2.0 * largest(load(c, last - columns, weights) * weights)) * (1.0 / (degree - 1.0)))
    growth = max(growth, fast_log2(2.0 * largest(load(c, last, weights) * weights)) * (1.0 / degree))
    share, least = fast_log2(part * accuracy) - growth, fast_log2(part * FLOOR)
    # (N + 1) x = max(share + x, least) + log₂(1 − 2ˣ) for x = log₂ σh, the last term bounded from below by two chords.
    x = max(
        min((share + _REST) / (degree + _SLOPE), (share + _REST_NEAR) / (degree + _SLOPE_NEAR)),
        min((least + _REST) / (degree + 1.0 + _SLOPE), (least + _REST_NEAR) / (degree + 1.0 + _SLOPE_NEAR)),
    )
    return min(fast_exp2(min(x, _LOG2_MOST) - growth), LONGEST)


@njit(error_model="numpy", allocates=False)
def _allowed_length(c: FloatArray, degree: int, weights: Weights, accuracy: float, part: float) -> float:
    """h [s] at which the error of a series of the motion is this part of the accuracy times h."""
    attitude, spin, place, speed = weights
    of_row = joined(
        filled(attitude, 4),
        four(spin, spin, spin, place),
        four(place, place, speed, speed),
        four(speed, 0.0, 0.0, 0.0),
    )
    return _length_for(c, ATTITUDE, MOTION_COLUMNS, degree, of_row, accuracy, part)


@njit(error_model="numpy", allocates=False)
def _known_length(c: FloatArray, degree: int, place: float, accuracy: float, part: float) -> float:
    """h [s] at which the series of the knot's position has the same error. The position rotates by the full angle, the
    quaternion by half of it: the remainder after degree N is up to 2ᴺ times that of the attitude.
    """
    of_row = four(place, place, place, 0.0)
    return _length_for(c, A_KNOT, MOTION_COLUMNS, degree, of_row, accuracy, part)


# The pending step


@njit(error_model="numpy", allocates=False, forceinline=True)
def begin_control(control: np.record, accuracy: float, degree: int) -> None:
    """Initialize the control record of a segment."""
    control.accuracy, control.degree = accuracy, degree
    control.accepted_ns, control.elapsed_ns = 0, 0
    control.steps, control.evaluations, control.pending = 0, 0, 0
    control.floor_rate, control.pull_floor_rate = 0.0, 0.0
    control.failed, control.series = False, False
    control.law, control.switch, control.last_start, control.last_law = 0.0, 0.0, 0.0, 0.0


@njit(error_model="numpy", allocates=False)
def _note_floor(y: Variables, p: np.record, control: np.record, weights: Weights, h: float) -> None:
    """Record the error floor of a step of h seconds from y if it exceeds what the accuracy allows."""
    pulls = p.has_string and (control.law == PULLS or control.switch < math.inf)
    floor = floor_of_step(y, p, weights, pulls, h)
    if floor <= control.accuracy * h:
        return
    if floor > 2.0 * FLOOR:
        control.pull_floor_rate = max(control.pull_floor_rate, floor / h)
    else:
        control.floor_rate = max(control.floor_rate, floor / h)


@njit(error_model="numpy", allocates=False)
def _count(control: np.record) -> None:
    """Count the pending step as committed."""
    control.elapsed_ns += control.accepted_ns
    control.evaluations += control.pending
    control.steps += 1
    control.accepted_ns = 0
    control.pending = 0
    control.series = False


@njit(error_model="numpy", allocates=False)
def spin_workspace(degree: int) -> tuple[int, int]:
    """Workspace for the series of the spin alone, cleared when the method changes; a fifth of the other's size."""
    return degree + 1, SPIN_COLUMNS


@njit(error_model="numpy", allocates=False)
def series_workspace(degree: int) -> tuple[int, int]:
    """Workspace for the coefficients of the step's first series and of its last one, and for the initial variables of
    the last one. They are kept until the step is committed, because samples within the step evaluate them.
    """
    return 2 * (degree_of_motion(degree) + 2) + 1, MOTION_COLUMNS


@njit(error_model="numpy", allocates=False)
def _is_spin(p: np.record) -> bool:
    """Whether all loads rotate with the body."""
    return not (p.has_string or p.has_world_torque)


@njit(error_model="numpy", allocates=False)
def _spin_length(y: Variables, p: np.record, control: np.record, weights: Weights, c: FloatArray) -> int:
    """Compute the series of the spin from y into c; returns the step's length [ns]."""
    if not control.series:
        spin_series(y, p, control.degree, c)
        control.series = True
    control.pending, control.switch = 1, math.inf
    of_row = joined(filled(weights[0], 4), filled(weights[1], 4), filled(weights[2], 4), filled(weights[3], 4))
    return int(_length_for(c, VARIABLES_AT, SPIN_COLUMNS, control.degree, of_row, control.accuracy, PART) * 1e9)


@njit(error_model="numpy", allocates=False)
def _lay_out(y: Variables, p: np.record, control: np.record, weights: Weights, c: FloatArray) -> int:
    """Compute the series of one step from y into c and control; returns its length [ns], 0 if no step is possible.
    weights: of errors.
    """
    if _is_spin(p):
        return _spin_length(y, p, control, weights, c)
    degree, accuracy = degree_of_motion(control.degree), control.accuracy
    jerk_of_place = jump_of_displacement(p, weights[1], weights[3])
    part = PART_ON_A_STRING if p.has_string else PART
    series, last = c, c[2 * (degree + 2)]
    start = y
    knot = knot_at(y, p)
    law = law_of(y, p)
    control.law, control.switch = law, math.inf
    gone = 0.0
    parts = 0
    while True:
        if not control.series or parts > 0:
            motion_series(start, p, knot, degree, law == PULLS, series)
            control.pending += 1
        control.series = True
        parts += 1
        # A damped string that becomes taut turns a position error into a velocity error: free flight must be that much
        # more accurate.
        allowance = part if law == PULLS else part / (1.0 + jerk_of_place)
        h = _allowed_length(series, degree, weights, accuracy, allowance)
        if law != PULLS:
            # The time at which it pulls again is computed from that series.
            h = min(h, _known_length(series, degree, weights[2], accuracy, allowance))
        h = clear_of_the_end(series, p, degree, knot[3], h)
        if not h * 1e9 >= 1.0 or not is_good(series[1]):
            return 0
        if not is_one_sided(p) or parts >= _MAX_PARTS:
            break
        switch, after, h = next_law(series, p, degree, h, law, accuracy)
        if h == 0.0:
            return 0
        if switch == NONE:
            break
        before_ns = int((gone + switch) * 1e9)
        if parts > 1 and before_ns * 1e-9 > gone:
            # One change of law per step: each multiplies the error of the step before it.
            return before_ns
        if parts == 1:
            copy_numbers(y, last[:VARIABLES])
            control.switch = switch
        _move(series, p, degree, switch, law, last)
        start, series = last, c[degree + 2 : 2 * (degree + 2)]
        knot = knot_at(start, p)
        gone, law = gone + switch, after
        control.last_start, control.last_law = gone, law
    length_ns = int((gone + h) * 1e9)
    # The last series must cover a part of the step.
    return length_ns if length_ns * 1e-9 > gone else length_ns + 1


@njit(error_model="numpy", allocates=False)
def _reach(p: np.record, control: np.record, c: FloatArray, time_ns: int, out: Variables) -> None:
    """Advance out, the variables at the start of the planned step, by ``time_ns`` within this step."""
    degree, t = degree_of_motion(control.degree), time_ns * 1e-9
    if _is_spin(p):
        spin_at(c, control.degree, t, out)
    elif t <= control.switch:
        _move(c, p, degree, t, control.law, out)
    else:
        copy_numbers(c[2 * (degree + 2)], out)
        _move(c[degree + 2 : 2 * (degree + 2)], p, degree, t - control.last_start, control.last_law, out)


@njit(error_model="numpy", allocates=False)
def _move(c: FloatArray, p: np.record, degree: int, h: float, law: float, out: Variables) -> None:
    motion_at(c, p, degree, h, out)
    if law == SHORTENS:
        out[HEAT] += shortening_heat(p, stretch_at(c, p, degree, 0.0)[0], stretch_at(c, p, degree, h)[0])


@njit(error_model="numpy", allocates=False)
def _accept(y: Variables, p: np.record, control: np.record, following: Variables, c: FloatArray) -> bool:
    """Plan the next step and write its end into ``following``; returns whether there is one."""
    elapsed = control.elapsed_ns
    weights = scales(y, p, elapsed * 1e-9)
    length, good = 0, False
    for _ in range(WEIGHINGS):
        length = _lay_out(y, p, control, weights, c)
        if length < 1:
            return False
        copy_numbers(y, following)
        _reach(p, control, c, length, following)
        following[TIME] = (elapsed + length) * 1e-9
        good = is_good(following)
        # Velocity errors are also weighted by velocities at the end, which matters if these decrease within the step.
        weights, more = heavier(scales(following, p, (elapsed + length) * 1e-9), weights)
        if not (good and more):
            break
    control.accepted_ns = length
    _note_floor(y, p, control, weights, length * 1e-9)
    return good


@njit(error_model="numpy", allocates=False)
def series_steps(
    y: Variables,
    p: np.record,
    control: np.record,
    following: Variables,
    c: FloatArray,
    span_ns: int,
    sampling: bool,
) -> int:
    """Commit the steps in y that fit into span_ns; returns the time advanced [ns]. control: CONTROL. following:
    variables at the end of the pending step. c: workspace.

    sampling: advance y by span_ns within the pending step, which is longer, and commit nothing; returns 0 on failure.
    """
    advanced = 0
    while True:
        if control.accepted_ns == 0 and not _accept(y, p, control, following, c):
            control.failed = True
            return advanced
        if sampling:
            _reach(p, control, c, span_ns, y)
            return span_ns if is_good(y) else 0
        length = int(control.accepted_ns)
        if length > span_ns - advanced:
            return advanced
        copy_numbers(following, y)
        _count(control)
        advanced += length
