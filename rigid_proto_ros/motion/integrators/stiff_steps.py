# SPDX-License-Identifier: MIT
"""Steps where damping is stiff: Radau IIA of order 9 (integrators/implicit_step.py), as long as the accuracy allows.

Damping of rate λ bounds an explicit series to steps of about 1/λ though nothing moves that fast once the first
transient has gone. Here a step is taken whole and in two halves, the halves are kept, and their difference, which the
whole step's error dominates, must stay below the accuracy. A step is accepted or rejected at full length; one in which
a pull-only string's law ends is shortened to the last whole nanosecond before that, and the nanosecond with the switch
in it is walked through in parts that may be of any length. While the string doesn't pull and no other damping is stiff,
the steps are those of the motion's series.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.simd import aligned
from ..problem import (
    STIFFNESS,
)
from ..variables import HEAT, STORED
from . import control as ctl
from .equations import stretch
from .error_measure import scales
from .first_root import NONE
from .implicit_step import implicit_step, two_halves
from .motion_series import COLUMNS, motion_at, motion_series
from .radau_tableau import STAGES
from .runge_kutta import is_good
from .series_steps import PART_ON_A_STRING, allowed_length, known_length
from .stiffness import damping_is_stiff
from .string_law import PULLS, SHORTENS, is_one_sided, knot_at, law_of, next_law

_MOST_PARTS = 400
"""In one nanosecond; more is chatter, and the rest of it is taken with one law."""

SERIES_ROW = STAGE_ROWS = 3 * STAGES + 2
"""Of the workspace: velocities at the stages of a whole step and of its halves, and variables between;
then a series.
"""

_PART_OF_FLOOR = 0.1
"""Of what the accuracy allows a segment: steps that err more than their share by so much together are reported."""


@njit(cache=True, error_model="numpy")
def _heat_of_slack(y: np.ndarray, p: np.ndarray, one_sided: bool, taut: bool, out: np.ndarray) -> None:
    if one_sided and not taut:
        # Stretched but not pulling: the damper takes what is left of ½ k x² (see slack.py).
        before, after = max(stretch(y, p)[0], 0.0), max(stretch(out, p)[0], 0.0)
        out[HEAT] += 0.5 * p[STIFFNESS] * (before - after) * (before + after)


@njit(cache=True, error_model="numpy")
def _explicit(
    y: np.ndarray, p: np.ndarray, control: np.ndarray, h: float, law: float, elapsed: float, c: np.ndarray
) -> tuple[float, float, float]:
    """Series c of a string that doesn't pull; how far it may be followed, at most h, when the law ends
    within that, or NONE, and which follows.
    """
    degree = int(control[ctl.DEGREE])
    weights = scales(y, p, elapsed)
    motion_series(y, p, knot_at(y, p), degree, False, c)
    control[ctl.PENDING] += 1.0
    longest = allowed_length(c, degree, weights, control[ctl.ACCURACY], PART_ON_A_STRING)
    longest = min(longest, known_length(c, degree, weights[2], control[ctl.ACCURACY], PART_ON_A_STRING))
    switch, after, known = next_law(c, p, degree, min(h, longest), law, control[ctl.ACCURACY])
    return known, switch, after


@njit(cache=True, error_model="numpy")
def _through_nanosecond(
    y: np.ndarray, p: np.ndarray, control: np.ndarray, span: float, elapsed: float, room: np.ndarray, out: np.ndarray
) -> bool:
    """From y ``span`` seconds on into out, in as many parts as it takes; whether that was possible."""
    one_sided, degree = is_one_sided(p), int(control[ctl.DEGREE])
    law = law_of(y, p, knot_at(y, p))
    here = y.copy()
    gone, trial = 0.0, min(max(control[ctl.NEXT], 1e-6 * span), span)
    for _ in range(_MOST_PARTS):
        rest = span - gone
        if law != PULLS and not damping_is_stiff(p, here, False):
            step, switch, after = _explicit(here, p, control, rest, law, elapsed + gone, room[SERIES_ROW:])
            step = switch if switch != NONE else step
            out[:] = here
            motion_at(room[SERIES_ROW:], p, degree, step, out)
            trial = rest
        else:
            step, switch = implicit_step(
                here, p, control, min(trial, rest), False, law == PULLS, elapsed + gone, room, out
            )
            if step == 0.0:
                return False
            trial, after = max(control[ctl.NEXT], 1e-6 * span), SHORTENS if law == PULLS else PULLS
            if switch != NONE:
                step = switch
                pulls, first, second = law == PULLS, room[0:5, 0:6], room[5:10, 0:6]
                if two_halves(here, p, step, pulls, False, first, second, room[15][:STORED], out) == 0:
                    return False
        _heat_of_slack(here, p, one_sided, law == PULLS, out)
        if switch != NONE:
            law = after
        gone += step
        here[:] = out
        if gone >= span * (1.0 - 1e-12):
            return is_good(out)
    return False


@njit(cache=True, error_model="numpy")
def _accept(y: np.ndarray, p: np.ndarray, control: np.ndarray, room: np.ndarray, out: np.ndarray) -> float:
    """One step from y into out; its length [ns], 0 when there is none."""
    elapsed = control[ctl.ELAPSED_NS] * 1e-9
    control[ctl.PENDING_EXCESS] = 0.0
    law = law_of(y, p, knot_at(y, p))
    control[ctl.LAW] = law
    control[ctl.SERIES] = 0.0
    if law != PULLS and not damping_is_stiff(p, y, False):
        h, switch, _ = _explicit(y, p, control, ctl.LONGEST, law, elapsed, room[SERIES_ROW:])
        length = math.floor((h if switch == NONE else switch) * 1e9)
        control[ctl.NEXT] = first_length(y)
        if length >= 1.0:
            control[ctl.SERIES] = 1.0
            out[:] = y
            motion_at(room[SERIES_ROW:], p, int(control[ctl.DEGREE]), length * 1e-9, out)
            _heat_of_slack(y, p, True, False, out)
            return length if is_good(out) else 0.0
    else:
        h = control[ctl.NEXT] if control[ctl.NEXT] > 0.0 else first_length(y)
        length = math.floor(h * 1e9)
        while length >= 1.0:
            step, switch = implicit_step(y, p, control, length * 1e-9, True, law == PULLS, elapsed, room, out)
            if step == 0.0:
                break
            length = float(round(step * 1e9))
            if switch == NONE or switch > step * (1.0 - 1e-12):
                _heat_of_slack(y, p, is_one_sided(p), law == PULLS, out)
                return length
            # Once more up to the last whole nanosecond before the switch.
            length = min(math.floor(switch * 1e9), length - 1.0)
    return 1.0 if _through_nanosecond(y, p, control, 1e-9, elapsed, room, out) else 0.0


@njit(cache=True, error_model="numpy")
def first_length(y: np.ndarray) -> float:
    """Length of a segment's first trial step [s]: the error decides about those after it."""
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    return 0.01 / max(spin, 1.0)


def workspace(degree: int) -> np.ndarray:
    """Room for the stages of a whole step and its halves, and for a series."""
    return aligned((SERIES_ROW + degree + 2, COLUMNS))


@njit(cache=True, error_model="numpy")
def _sample(y: np.ndarray, p: np.ndarray, control: np.ndarray, room: np.ndarray, span: float) -> bool:
    """Take y ``span`` seconds on, less than the step that waits: one step mostly, but checked as that was;
    whether it was possible.
    """
    law, one_sided, out = control[ctl.LAW], is_one_sided(p), np.empty(STORED)
    if control[ctl.SERIES] != 0.0:
        out[:] = y
        motion_at(room[SERIES_ROW:], p, int(control[ctl.DEGREE]), span, out)
        _heat_of_slack(y, p, one_sided, False, out)
        y[:] = out
        return is_good(y)
    own = control.copy()
    elapsed, gone = control[ctl.ELAPSED_NS] * 1e-9, 0.0
    for _ in range(_MOST_PARTS):
        step, _switch = implicit_step(y, p, own, span - gone, False, law == PULLS, elapsed + gone, room, out)
        if step == 0.0:
            return False
        _heat_of_slack(y, p, one_sided, law == PULLS, out)
        y[:] = out
        gone += step
        if gone >= span * (1.0 - 1e-15):
            return is_good(y)
    return False


@njit(cache=True, error_model="numpy")
def steps(
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    following: np.ndarray,
    c: np.ndarray,
    span_ns: int,
    sampling: bool,
) -> int:
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c:
    workspace.

    sampling: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it
    failed.
    """
    if sampling:
        return span_ns if _sample(y, p, control, c, span_ns * 1e-9) else 0
    advanced = 0
    while True:
        if control[ctl.ACCEPTED_NS] == 0.0:
            control[ctl.ACCEPTED_NS] = _accept(y, p, control, c, following)
            if control[ctl.ACCEPTED_NS] < 1.0:
                control[ctl.FAILED] = 1.0
                return advanced
        length = ctl.commit(control, y, following, span_ns - advanced)
        if length == 0:
            return advanced
        advanced += length
        # What tiny steps of a transient err above their shares is soon lost in the segment's.
        control[ctl.EXCESS] += control[ctl.PENDING_EXCESS]
        share = control[ctl.ACCURACY] * control[ctl.ELAPSED_NS] * 1e-9
        control[ctl.FLOOR_BINDS] = 1.0 if control[ctl.EXCESS] > _PART_OF_FLOOR * share else 0.0
