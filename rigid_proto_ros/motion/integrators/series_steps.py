# SPDX-License-Identifier: MIT
"""Steps by the power series of the whole motion, as long as the accuracy allows, with slack and taut found on the
series.

The length of a step is read off the coefficients (integrators/taylor_adaptive.py), so none is rejected. Where a
pull-only string turns slack or taut (integrators/string_law.py) the series is left and another one, with the other law,
begun. A step is laid out at its full length first: a series from its start, and where the law changes within it a last
one from that time on. It ends at a whole nanosecond, so that times of commands stay integers. Committing it and
sampling within it evaluate those same series.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.simd import aligned, filled, joined
from ...base.uncounted_arrays import copy_numbers
from ..variables import ATTITUDE, HEAT, STORED
from . import control as ctl
from .error_measure import (
    WEIGHINGS,
    heavier,
    jump_of_displacement,
    scales,
)
from .first_root import NONE
from .motion_series import A_KNOT, COLUMNS, motion_at, motion_series, stretch_at
from .runge_kutta import is_good
from .string_law import PASSES, PULLS, SHORTENS, before_passage, is_one_sided, knot_at, law_of, may_pass, next_law
from .taylor_adaptive import MAX_DEGREE, PART, length_for, log2_growth

PART_ON_A_STRING = 0.1
"""The same as taylor_adaptive.PART for a string, whose coefficients fall less evenly: the nearer the knot to its free
end, the nearer the poles.
"""

_MAX_PARTS = 200
"""In one step, all but the first and last within one nanosecond; more is chatter, and the rest of the
step is taken with one law.
"""


_HIGHER = 3
"""By so much the degree is higher than that of a series of the spin: what a step costs beside its series
is more here.
"""


@njit(cache=True, error_model="numpy", allocates=False)
def degree_of_motion(degree: int) -> int:
    """The degree of a series of the whole motion, where that of the spin alone would be ``degree``."""
    return min(degree + _HIGHER, MAX_DEGREE)


def workspace(degree: int) -> np.ndarray:
    """Room for the coefficients from the step's start, those of its last series, and the variables that one starts
    from. They stay there until the step is committed: every sample before takes them once more.
    """
    return aligned((2 * (degree_of_motion(degree) + 2) + 1, COLUMNS))


@njit(cache=True, error_model="numpy", allocates=False)
def allowed_length(
    c: np.ndarray, degree: int, weights: tuple[float, float, float, float], accuracy: float, part: float
) -> float:
    """h [s] after which a series of the motion errs by this part of the accuracy times h."""
    attitude, spin, place, speed = weights
    of_row = joined(
        filled(attitude, 4),
        joined(filled(spin, 1), filled(spin, 1), filled(spin, 1), filled(place, 1)),
        joined(filled(place, 1), filled(place, 1), filled(speed, 1), filled(speed, 1)),
        joined(filled(speed, 1), filled(0.0, 1), filled(0.0, 1), filled(0.0, 1)),
    )
    return length_for(log2_growth(c, ATTITUDE, COLUMNS, degree, of_row), accuracy, degree, part)


@njit(cache=True, error_model="numpy", allocates=False)
def known_length(c: np.ndarray, degree: int, place: float, accuracy: float, part: float) -> float:
    """h [s] after which the series of the knot's place errs as much. It turns with the body, and attitude by half the
    angle: of the degree N its remainder is up to 2ᴺ times that of the attitude's series.
    """
    of_row = joined(filled(place, 1), filled(place, 1), filled(place, 1), filled(0.0, 1))
    return length_for(log2_growth(c, A_KNOT, COLUMNS, degree, of_row), accuracy, degree, part)


@njit(cache=True, error_model="numpy", allocates=False)
def _lay_out(
    y: np.ndarray, p: np.record, control: np.record, weights: tuple[float, float, float, float], c: np.ndarray
) -> int:
    """Series of one step from y into c and control; returns its length [ns], 0 when there is none.
    weights: of errors.
    """
    degree, accuracy = degree_of_motion(control.degree), control.accuracy
    jerk_of_place = jump_of_displacement(p, weights[1], weights[3])
    part = PART_ON_A_STRING if p.has_string else PART
    series, last = c, c[2 * (degree + 2)]
    start = y
    knot = knot_at(y, p)
    law = law_of(y, p, knot)
    control.law, control.switch = law, math.inf
    gone = 0.0
    parts = 0
    while True:
        if not control.series or parts > 0:
            motion_series(start, p, knot, degree, law == PULLS, series)
            control.pending += 1
        control.series = True
        parts += 1
        # A damped string that jerks taut turns an error of place into one of velocity: free flight must be that much
        # better.
        allowance = part if law == PULLS else part / (1.0 + jerk_of_place)
        h = allowed_length(series, degree, weights, accuracy, allowance)
        if law != PULLS:
            # The time at which it pulls again is read off that series.
            h = min(h, known_length(series, degree, weights[2], accuracy, allowance))
        if may_pass(p):
            h, length_ns = before_passage(series, p, degree, knot, h)
            if length_ns > 0:
                motion_series(y, p, knot, degree, False, c)
                control.law, control.series = PASSES, 0.0
                control.passages += 1
                return length_ns if length_ns * 1e-9 <= allowed_length(c, degree, weights, accuracy, part) else 0
        if not h * 1e9 >= 1.0 or not is_good(series[1]):
            return 0
        if not is_one_sided(p) or parts >= _MAX_PARTS:
            break
        switch, after, h = next_law(series, p, degree, h, law, accuracy)
        if switch == NONE:
            break
        before_ns = int(math.floor((gone + switch) * 1e9))
        if parts > 1 and before_ns * 1e-9 > gone:
            # One switch a step: each multiplies what the step has erred before it.
            return before_ns
        if parts == 1:
            copy_numbers(y, last[:STORED])
            control.switch = switch
        _move(series, p, degree, switch, law, last)
        start, series = last, c[degree + 2 : 2 * (degree + 2)]
        knot = knot_at(start, p)
        gone, law = gone + switch, after
        control.last_start, control.last_law = gone, law
    length_ns = int(math.floor((gone + h) * 1e9))
    # The last series must be of some use.
    return length_ns if length_ns * 1e-9 > gone else length_ns + 1


@njit(cache=True, error_model="numpy", allocates=False)
def _reach(p: np.record, control: np.record, c: np.ndarray, time_ns: int, out: np.ndarray) -> None:
    """Take the variables at the beginning of the step that is laid out ``time_ns`` into it."""
    degree, t = degree_of_motion(control.degree), time_ns * 1e-9
    if t <= control.switch:
        _move(c, p, degree, t, control.law, out)
    else:
        copy_numbers(c[2 * (degree + 2)], out)
        _move(c[degree + 2 : 2 * (degree + 2)], p, degree, t - control.last_start, control.last_law, out)


@njit(cache=True, error_model="numpy", allocates=False)
def _move(c: np.ndarray, p: np.record, degree: int, h: float, law: float, out: np.ndarray) -> None:
    motion_at(c, p, degree, h, out)
    if law == SHORTENS:
        # Stretched but not pulling: the damper takes what is left of ½ k x².
        before, after = max(stretch_at(c, p, degree, 0.0)[0], 0.0), max(stretch_at(c, p, degree, h)[0], 0.0)
        out[HEAT] += 0.5 * p.stiffness * (before - after) * (before + after)


@njit(cache=True, error_model="numpy", allocates=False)
def _accept(y: np.ndarray, p: np.record, control: np.record, following: np.ndarray, c: np.ndarray) -> bool:
    """Lay out the next step and take it into ``following``; returns whether there is one."""
    elapsed = control.elapsed_ns
    weights = scales(y, p, elapsed * 1e-9)
    length, good = 0, False
    for _ in range(WEIGHINGS):
        length = _lay_out(y, p, control, weights, c)
        if length < 1:
            return False
        copy_numbers(y, following)
        _reach(p, control, c, length, following)
        good = is_good(following)
        # The errors of velocities are measured by those at the end: where they fall within the step, that counts.
        weights, more = heavier(scales(following, p, (elapsed + length) * 1e-9), weights)
        if not (good and more):
            break
    ctl.accept(control, length)
    return good


@njit(cache=True, error_model="numpy", allocates=False)
def steps(
    y: np.ndarray,
    p: np.record,
    control: np.record,
    following: np.ndarray,
    c: np.ndarray,
    span_ns: int,
    sampling: bool,
) -> int:
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c:
    workspace.

    sampling: go span_ns into the step that waits instead, which is longer; returns 0 if that failed.
    """
    advanced = 0
    while True:
        if control.accepted_ns == 0 and not _accept(y, p, control, following, c):
            control.failed = True
            return advanced
        if sampling:
            _reach(p, control, c, span_ns, y)
            return span_ns if is_good(y) else 0
        length = ctl.commit(control, y, following, span_ns - advanced)
        if length == 0:
            return advanced
        advanced += length
