# SPDX-License-Identifier: MIT
"""Steps where damping is stiff: Radau IIA of order 9 (integrators/radau.py), as long as the accuracy allows.

Damping of rate λ bounds an explicit series to steps of about 1/λ though nothing moves that fast once the first transient has gone. Here a
step is taken whole and in two halves, the halves are kept, and their difference, which the whole step's error dominates, must stay below the
accuracy. A step is accepted or rejected at full length; one that turns a pull-only string slack or taut is shortened to the last whole
nanosecond before that, and the nanosecond with the switch in it is walked through in parts that may be of any length.
"""

from __future__ import annotations

import math

import numpy as np

from ..compilation import njit
from ..motion import HEAT, STORED
from ..problem import ATTACH, BILATERAL, HAS_STRING, REST_LENGTH, STIFFNESS
from . import control as ctl
from .equations import accelerations, knot, stretch, tension_margin
from .error_measure import FLOOR, scales, size
from .radau import HALVES, STAGES, radau_step, stage_variables
from .runge_kutta import is_good
from .slack import first_spell, knot_of

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

STAGE_ROWS = 3 * STAGES + 2
"""Of the workspace: velocities at the stages of a whole step and of its halves, and variables between."""

_MOST_TRIALS = 60

_SHORTEST = 1e-24
"""Of any part [s]: a fastest rate of 1e24 /s."""


@njit(cache=True, error_model="numpy")
def _guess(y, V):
    for i in range(STAGES):
        for k in range(3):
            V[i, k], V[i, 3 + k] = y[4 + k], y[10 + k]


@njit(cache=True, error_model="numpy")
def _halves(y, p, h, taut, first, second, middle, out):
    """Two steps of h/2 from y into out, by guesses in first and second (5, 6); evaluations, 0 when there is no solution."""
    spent = radau_step(y, p, 0.5 * h, taut, first, middle)
    if spent == 0:
        return 0
    more = radau_step(middle, p, 0.5 * h, taut, second, out)
    return spent + more if more > 0 and is_good(out) else 0


@njit(cache=True, error_model="numpy")
def _plain(y, p, h, taut, first, second, middle, out):
    """``_halves`` without a whole step before them."""
    _guess(y, first)
    spent = radau_step(y, p, 0.5 * h, taut, first, middle)
    if spent == 0:
        return 0
    _guess(middle, second)
    more = radau_step(middle, p, 0.5 * h, taut, second, out)
    return spent + more if more > 0 and is_good(out) else 0


@njit(cache=True, error_model="numpy")
def _judged(y, p, h, taut, elapsed, whole, first, second, middle, out):
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
def _pulls(y, p):
    x, rate = stretch(y, p)
    return tension_margin(x, rate, p) > 0.0


@njit(cache=True, error_model="numpy")
def _first_sample(y, p, h, taut, first, second, middle, at):
    """Time in (0, h] of the first stage of the two halves at which the string's law is the other one, or at which it is hidden between
    two; 0 for none. at: scratch (STORED,).
    """
    x0, place0, before = stretch(y, p)[0], knot_of(y, p), 0.0
    for half in range(2):
        start, V = (y, first) if half == 0 else (middle, second)
        for i in range(STAGES):
            t = stage_variables(start, p, 0.5 * h, V, i, at) + 0.5 * h * half
            x1, rate1 = stretch(at, p)
            if (tension_margin(x1, rate1, p) > 0.0) != taut:
                return t
            place1 = knot_of(at, p)
            if not taut and x0 < 0.0 and x1 < 0.0:
                hidden, _ = first_spell(place0, place1, t - before, x0, p, taut)
                if hidden > 0.0:
                    return before + hidden
            before, x0, place0 = t, x1, place1
    return 0.0


@njit(cache=True, error_model="numpy")
def _locate(y, p, high, taut, first, second, middle, out):
    """The earliest known time in (0, high] at which the law is the other one, with out there; 0 when it isn't at ``high`` itself."""
    spent = _plain(y, p, high, taut, first, second, middle, out)
    if spent == 0 or _pulls(out, p) == taut:
        return 0.0
    x, rate = stretch(out, p)
    low, margin_high = 0.0, tension_margin(x, rate, p)
    x, rate = stretch(y, p)
    margin_low = tension_margin(x, rate, p)
    for trial in range(_MOST_TRIALS):
        if high - low <= 1e-12 * high + 1e-16:
            break
        # Regula falsi, Illinois variant; what it hasn't found after a while is halved.
        t = high - margin_high * (high - low) / (margin_high - margin_low) if trial < 20 else 0.5 * (low + high)
        if not low < t < high:
            t = 0.5 * (low + high)
        edge = 0.05 * 1e-12 * high
        t = min(max(t, low + edge), high - edge)
        spent = _plain(y, p, t, taut, first, second, middle, out)
        if spent == 0:
            break
        x, rate = stretch(out, p)
        margin = tension_margin(x, rate, p)
        if (margin > 0.0) != taut:
            high, margin_high = t, margin
            margin_low *= 0.5
        else:
            low, margin_low = t, margin
            margin_high *= 0.5
    _plain(y, p, high, taut, first, second, middle, out)
    return high


@njit(cache=True, error_model="numpy")
def _longest_free(y, p):
    """A time [s] in which a slack string's knot can't come and go unseen: what it needs to reach the end of its string, or a tenth of it."""
    x, _ = stretch(y, p)
    _, _, _, vx, vy, vz = knot(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12], p)
    ex, ey, ez, ax, ay, az, _, _ = accelerations(
        *(y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11], y[12]), p, False
    )
    arm = math.sqrt(p[ATTACH] ** 2 + p[ATTACH + 1] ** 2 + p[ATTACH + 2] ** 2)
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    speed = math.sqrt(vx * vx + vy * vy + vz * vz) + spin * arm
    gain = math.sqrt(ax * ax + ay * ay + az * az) + arm * math.sqrt(ex * ex + ey * ey + ez * ez)
    way = max(-x, 0.1 * p[REST_LENGTH])
    return min(way / max(speed, 1e-100), math.sqrt(way / max(gain, 1e-100)))


@njit(cache=True, error_model="numpy")
def _heat_of_slack(y, p, one_sided, taut, out):
    if one_sided and not taut:
        # Stretched but not pulling: the damper takes what is left of ½ k x² (see slack.py).
        before, after = max(stretch(y, p)[0], 0.0), max(stretch(out, p)[0], 0.0)
        out[HEAT] += 0.5 * p[STIFFNESS] * (before - after) * (before + after)


@njit(cache=True, error_model="numpy")
def _trial(y, p, control, h, whole_ns, taut, one_sided, elapsed, scratch, out):
    """The longest step of at most h seconds from y into out that the accuracy allows, 0 when none was found, and the time of a switch
    of the string's law within it (out is there then), or 0. Leaves in control what the next step may be.

    whole_ns: of a whole number of nanoseconds.
    """
    whole, first, second = scratch[0:5, 0:6], scratch[5:10, 0:6], scratch[10:15, 0:6]
    middle, at = scratch[15], scratch[16]
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
        factor = SAFETY * math.exp(math.log(allowed / error) * _EXPONENT) if math.isfinite(error) else 0.0
        h *= min(max(factor, _LEAST), 0.7)
        if whole_ns:
            h = math.floor(h * 1e9) * 1e-9
        if not h > _SHORTEST:
            control[ctl.NEXT] = 1e-10
            return 0.0, 0.0
    if error > allowed or accuracy * h < FLOOR:
        control[ctl.FLOOR_BINDS] = 1.0
    # What is estimated below a quarter of the floor is rounding, and says nothing about a longer step.
    clear = error > 0.25 * FLOOR
    growth = SAFETY * math.exp(math.log(allowed / error) * _EXPONENT) if clear else _MOST_GROWTH
    control[ctl.NEXT] = min(h * min(max(growth, 0.2), _MOST_GROWTH), ctl.LONGEST)
    if one_sided:
        sample = _first_sample(y, p, h, taut, first, second, middle, at)
        if sample > 0.0:
            keep = out.copy()
            switch = _locate(y, p, sample, taut, first, second, middle, out)
            if switch > 0.0:
                return h, switch
            out[:] = keep
    return h, 0.0


@njit(cache=True, error_model="numpy")
def _through_nanosecond(y, p, control, span, elapsed, scratch, out):
    """From y ``span`` seconds on into out, in as many parts as it takes; whether that was possible."""
    one_sided = p[HAS_STRING] != 0.0 and p[BILATERAL] == 0.0
    taut = not one_sided or _pulls(y, p)
    here = y.copy()
    gone, h = 0.0, min(max(control[ctl.NEXT], 1e-6 * span), span)
    for part in range(_MOST_PARTS):
        h = min(h, span - gone)
        watching = one_sided and part < _MOST_PARTS // 2
        step, switch = _trial(here, p, control, h, False, taut, watching, elapsed + gone, scratch, out)
        if step == 0.0:
            return False
        if switch > 0.0:
            step = switch
        _heat_of_slack(here, p, one_sided, taut, out)
        gone += step
        here[:] = out
        if switch > 0.0:
            taut = not taut
        if gone >= span * (1.0 - 1e-12):
            return True
        h = max(control[ctl.NEXT], 1e-6 * span)
    return False


@njit(cache=True, error_model="numpy")
def _accept(y, p, control, scratch, out):
    """One step from y into out; its length [ns], 0 when there is none."""
    one_sided = p[HAS_STRING] != 0.0 and p[BILATERAL] == 0.0
    taut = not one_sided or _pulls(y, p)
    elapsed = control[ctl.ELAPSED_NS] * 1e-9
    h = control[ctl.NEXT] if control[ctl.NEXT] > 0.0 else first_length(y, p)
    if not taut:
        h = min(h, _longest_free(y, p))
    length, watching = math.floor(h * 1e9), one_sided
    while length >= 1.0:
        step, switch = _trial(y, p, control, length * 1e-9, True, taut, watching, elapsed, scratch, out)
        if step == 0.0:
            break
        length = float(round(step * 1e9))
        if switch == 0.0:
            _heat_of_slack(y, p, one_sided, taut, out)
            return length
        # Once more up to the last whole nanosecond before the switch, where rounding may show either law.
        length, watching = min(math.floor(switch * 1e9), length - 1.0), False
    return 1.0 if _through_nanosecond(y, p, control, 1e-9, elapsed, scratch, out) else 0.0


@njit(cache=True, error_model="numpy")
def first_length(y, p):
    """Length of a segment's first trial step [s]: the error decides about those after it."""
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    return 0.01 / max(spin, 1.0)


def workspace(degree: int) -> np.ndarray:
    """Room for the stages of a whole step and its halves; the degree has no bearing."""
    return np.zeros((STAGE_ROWS, STORED))


@njit(cache=True, error_model="numpy")
def steps(y, p, control, following, c, span_ns, look):
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c: workspace.

    look: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it failed.
    """
    if look:
        one_sided = p[HAS_STRING] != 0.0 and p[BILATERAL] == 0.0
        taut = not one_sided or _pulls(y, p)
        out = np.empty(STORED)
        if _plain(y, p, span_ns * 1e-9, taut, c[0:5, 0:6], c[5:10, 0:6], c[15], out) == 0:
            return 0
        _heat_of_slack(y, p, one_sided, taut, out)
        y[:] = out
        return span_ns
    advanced = 0
    while True:
        if control[ctl.ACCEPTED_NS] == 0.0:
            control[ctl.ACCEPTED_NS] = _accept(y, p, control, c, following)
            if control[ctl.ACCEPTED_NS] < 1.0:
                control[ctl.FAILED] = 1.0
                return advanced
        length = int(control[ctl.ACCEPTED_NS])
        if advanced + length > span_ns:
            return advanced
        y[:] = following
        advanced += length
        ctl.commit(control)
