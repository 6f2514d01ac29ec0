# SPDX-License-Identifier: MIT
"""Steps where damping is stiff: Radau IIA of order 9 (integrators/radau.py), as long as the accuracy allows.

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
from ...base.elementary import exponential_of, logarithm
from ...base.simd import aligned
from ..problem import (
    ATTACH,
    DAMPING_ANGULAR,
    DAMPING_LINEAR,
    HAS_STRING,
    MASS,
    MOMENT,
    MOMENTS,
    STIFFNESS,
    STRING_DAMPING,
    TORQUE_BODY,
    TORQUE_WORLD,
    TRANSLATES,
)
from ..variables import HEAT, STORED
from . import control as ctl
from .equations import stretch, tension_margin
from .error_measure import FLOOR, scales, size
from .first_root import NONE
from .motion_series import COLUMNS, motion_at, motion_series
from .radau import HALVES, STAGES, radau_step, stage_rates, within
from .runge_kutta import is_good
from .series_steps import PART_ON_A_STRING, allowed_length, known_length
from .slack import first_spell, knot_of
from .string_law import PULLS, SHORTENS, is_one_sided, knot_at, law_of, next_law

SAFETY = 0.8
"""Part of the step length that the error estimate would allow."""

_EXPONENT = 1.0 / 7.0
"""Of the step length by the error: between 1/9 of smooth motion and 1/5 of stiff components."""

_MOST_GROWTH, _LEAST = 6.0, 0.05
"""Of one step's length to the next, and to the next trial after a rejection."""

_NOISE = 2.0**-40
"""An estimate below this that doesn't fall with the step is rounding, and is reported as a floor."""

_MOST_PARTS = 400
"""In one nanosecond; more is chatter, and the rest of it is taken with one law."""

STIFF_RATE = 2e4
"""/s; slower damping leaves explicit steps of 75 µs and more, so that even they are far faster than the clock."""

STIFF_RATIO = 100.0
"""Of a damping's rate to those of the motion beside it: the cost of an implicit step over an explicit
one's, by their lengths.
"""

OVERDAMPED = 4.0
"""Of a string's damping rate c/m to its swing √(k/m): twice the damping ratio, 2 being critical."""

SERIES_ROW = STAGE_ROWS = 3 * STAGES + 2
"""Of the workspace: velocities at the stages of a whole step and of its halves, and variables between;
then a series.
"""

_SAMPLES = 8
"""At the string's law within half a step."""

_PART_OF_FLOOR = 0.1
"""Of what the accuracy allows a segment: steps that err more than their share by so much together are reported."""

_SHORTEST = 1e-24
"""Of any part [s]: a fastest rate of 1e24 /s."""


@njit(cache=True, error_model="numpy")
def damping_is_stiff(p: np.ndarray, y: np.ndarray, taut: bool) -> bool:
    """Whether some damping of a segment with problem p from variables y on is so much faster than the motion beside it
    that it, and not the motion, would set the length of explicit steps. taut: the string counts.

    An explicit step is about 1.5/λ long; an implicit one is some tenths of a radian of the motion, and costs some
    hundred times as much.
    """
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    smallest = p[MOMENTS]
    angular, fastest, motion = p[DAMPING_ANGULAR], 0.0, spin
    if angular > 0.0:
        torque = 0.0
        for k in range(3):
            torque += abs(p[TORQUE_BODY + k]) + abs(p[TORQUE_WORLD + k])
        for k in range(9):
            torque += abs(p[MOMENT + k])
        # Where damping is stiff the spin is soon what the torque keeps up.
        motion += torque / angular
        if spin > 0.0 or torque > 0.0 or p[HAS_STRING] != 0.0:
            fastest = angular / smallest
    if p[TRANSLATES] != 0.0:
        fastest = max(fastest, p[DAMPING_LINEAR])
    if taut and p[HAS_STRING] != 0.0:
        arm = p[ATTACH] ** 2 + p[ATTACH + 1] ** 2 + p[ATTACH + 2] ** 2
        lightness = 1.0 / p[MASS] + arm / smallest
        swing, damping = math.sqrt(p[STIFFNESS] * lightness), p[STRING_DAMPING] * lightness
        if damping > OVERDAMPED * swing:
            fastest = max(fastest, damping)
            motion += p[STIFFNESS] / p[STRING_DAMPING]
        else:
            motion += swing
    return fastest > max(STIFF_RATE, STIFF_RATIO * motion)


@njit(cache=True, error_model="numpy")
def _guess(y: np.ndarray, V: np.ndarray) -> None:
    for i in range(STAGES):
        for k in range(3):
            V[i, k], V[i, 3 + k] = y[4 + k], y[10 + k]


@njit(cache=True, error_model="numpy")
def _halves(
    y: np.ndarray,
    p: np.ndarray,
    h: float,
    taut: bool,
    first: np.ndarray,
    second: np.ndarray,
    middle: np.ndarray,
    out: np.ndarray,
) -> int:
    """Two steps of h/2 from y into out, by guesses in first and second (5, 6); evaluations, 0 when there
    is no solution.
    """
    spent = radau_step(y, p, 0.5 * h, taut, first, middle)
    if spent == 0:
        return 0
    more = radau_step(middle, p, 0.5 * h, taut, second, out)
    return spent + more if more > 0 and is_good(out) else 0


@njit(cache=True, error_model="numpy")
def _plain(
    y: np.ndarray,
    p: np.ndarray,
    h: float,
    taut: bool,
    first: np.ndarray,
    second: np.ndarray,
    middle: np.ndarray,
    out: np.ndarray,
) -> int:
    """``_halves`` without a whole step before them."""
    _guess(y, first)
    spent = radau_step(y, p, 0.5 * h, taut, first, middle)
    if spent == 0:
        return 0
    _guess(middle, second)
    more = radau_step(middle, p, 0.5 * h, taut, second, out)
    return spent + more if more > 0 and is_good(out) else 0


@njit(cache=True, error_model="numpy")
def _judged(  # noqa: PLR0913
    y: np.ndarray,
    p: np.ndarray,
    h: float,
    taut: bool,
    elapsed: float,
    whole: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    middle: np.ndarray,
    out: np.ndarray,
) -> tuple[int, float]:
    """Two halves into out; evaluations and the error estimated, infinite when there is no solution."""
    _guess(y, whole)
    spent = radau_step(y, p, h, taut, whole, out)
    if spent == 0:
        return STAGES, math.inf
    coarse = out.copy()
    # The whole step's polynomial is a good guess for the halves.
    for i in range(STAGES):
        for k in range(6):
            a, b = 0.0, 0.0
            for j in range(STAGES):
                a += HALVES[0, i, j] * whole[j, k]
                b += HALVES[1, i, j] * whole[j, k]
            first[i, k], second[i, k] = a, b
    more = _halves(y, p, h, taut, first, second, middle, out)
    if more == 0:
        return spent + STAGES, math.inf
    coarse -= out
    start, end = scales(y, p, elapsed), scales(out, p, elapsed + h)
    error = size(coarse, start[0], max(start[1], end[1]), start[2], max(start[3], end[3]))
    return spent + more, error if math.isfinite(error) else math.inf


@njit(cache=True, error_model="numpy")
def _margin(y: np.ndarray, p: np.ndarray, taut: bool) -> tuple[float, float]:
    """What changes its sign where the string's law ends: positive while it pulls; and the stretch."""
    x, rate = stretch(y, p)
    # A string that has just come taut has no stretch but for rounding: only its tension says whether it still pulls.
    return (p[STIFFNESS] * x + p[STRING_DAMPING] * rate if taut else tension_margin(x, rate, p)), x


@njit(cache=True, error_model="numpy")
def _switch_in_half(y: np.ndarray, p: np.ndarray, h: float, taut: bool, V: np.ndarray, at: np.ndarray) -> float:
    """Time in (0, h] at which the law ends along one step's polynomials, NONE for never. at: scratch (STORED,)."""
    rates = np.zeros((STAGES, 3))
    stage_rates(V, h, rates)
    before, x0, place0 = 0.0, stretch(y, p)[0], knot_of(y, p)
    for i in range(1, _SAMPLES + 1):
        s = i / _SAMPLES
        within(y, h, V, rates, s, at)
        margin, x = _margin(at, p, taut)
        place = knot_of(at, p)
        if (margin > 0.0) == taut:
            hidden = 0.0
            if not taut and x0 < 0.0 and x < 0.0:
                hidden = first_spell(place0, place, (s - before) * h, x0, p, False)[0] / h
            before_, x0, place0 = before, x, place
            before = s
            if hidden <= 0.0:
                continue
            s = before_ + hidden
            within(y, h, V, rates, s, at)
            if _margin(at, p, taut)[0] <= 0.0:
                continue
            before = before_
        low, high = before, s
        while high - low > 2.0**-40 * high:
            middle = 0.5 * (low + high)
            within(y, h, V, rates, middle, at)
            if (_margin(at, p, taut)[0] > 0.0) == taut:
                low = middle
            else:
                high = middle
        return high * h
    return NONE


@njit(cache=True, error_model="numpy")
def _heat_of_slack(y: np.ndarray, p: np.ndarray, one_sided: bool, taut: bool, out: np.ndarray) -> None:
    if one_sided and not taut:
        # Stretched but not pulling: the damper takes what is left of ½ k x² (see slack.py).
        before, after = max(stretch(y, p)[0], 0.0), max(stretch(out, p)[0], 0.0)
        out[HEAT] += 0.5 * p[STIFFNESS] * (before - after) * (before + after)


@njit(cache=True, error_model="numpy")
def _implicit(  # noqa: PLR0913
    y: np.ndarray,
    p: np.ndarray,
    control: np.ndarray,
    h: float,
    whole_ns: int,
    taut: bool,
    elapsed: float,
    room: np.ndarray,
    out: np.ndarray,
) -> tuple[float, float]:
    """The longest step of at most h seconds from y into out that the accuracy allows, 0 when none was found, and the
    time within it at which the string's law ends, or NONE. Leaves in control what the next step may be, and what this
    one errs above its share.

    whole_ns: of a whole number of nanoseconds.
    """
    whole, first, second = room[0:5, 0:6], room[5:10, 0:6], room[10:15, 0:6]
    middle, at = room[15][:STORED], room[16][:STORED]
    accuracy = control[ctl.ACCURACY]
    last = math.inf
    while True:
        spent, error = _judged(y, p, h, taut, elapsed, whole, first, second, middle, out)
        control[ctl.PENDING] += spent
        allowed = max(accuracy * h, FLOOR)
        noisy = error < _NOISE and error > 0.5 * last
        if error <= allowed or noisy:
            break
        last = error
        factor = SAFETY * exponential_of(logarithm(allowed / error) * _EXPONENT) if math.isfinite(error) else 0.0
        h *= min(max(factor, _LEAST), 0.7)
        if whole_ns:
            h = math.floor(h * 1e9) * 1e-9
        if not h > _SHORTEST:
            control[ctl.NEXT] = 1e-10
            return 0.0, NONE
    control[ctl.PENDING_EXCESS] += max(error - accuracy * h, 0.0)
    # What is estimated below a quarter of the floor is rounding, and says nothing about a longer step.
    clear = error > 0.25 * FLOOR
    growth = SAFETY * exponential_of(logarithm(allowed / error) * _EXPONENT) if clear else _MOST_GROWTH
    control[ctl.NEXT] = min(h * min(max(growth, 0.2), _MOST_GROWTH), ctl.LONGEST)
    switch = NONE
    if is_one_sided(p):
        switch = _switch_in_half(y, p, 0.5 * h, taut, first, at)
        if switch == NONE:
            switch = _switch_in_half(middle, p, 0.5 * h, taut, second, at)
            switch = switch if switch == NONE else 0.5 * h + switch
    return h, switch


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
            step, switch = _implicit(here, p, control, min(trial, rest), False, law == PULLS, elapsed + gone, room, out)
            if step == 0.0:
                return False
            trial, after = max(control[ctl.NEXT], 1e-6 * span), SHORTENS if law == PULLS else PULLS
            if switch != NONE:
                step = switch
                if _plain(here, p, step, law == PULLS, room[0:5, 0:6], room[5:10, 0:6], room[15][:STORED], out) == 0:
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
            step, switch = _implicit(y, p, control, length * 1e-9, True, law == PULLS, elapsed, room, out)
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
    """Take y ``span`` seconds on, less than the step that waits: one step mostly, but judged as that was;
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
        step, _switch = _implicit(y, p, own, span - gone, False, law == PULLS, elapsed + gone, room, out)
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
