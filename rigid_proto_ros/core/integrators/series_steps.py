# SPDX-License-Identifier: MIT
"""Steps by the power series of the whole motion, as long as the accuracy allows, with slack and taut found on the series.

The length of a step is read off the coefficients (integrators/taylor_adaptive.py), so none is rejected. Where a pull-only string
turns slack or taut the series is cut at the root and continued with the other law; a step is such a chain of parts, ended
at a whole nanosecond, so that times of commands stay integers.
"""

from __future__ import annotations

import math

import numpy as np

from ..compilation import njit
from ..motion import HEAT, STORED
from ..problem import BILATERAL, HAS_STRING, STIFFNESS
from . import control as ctl
from .equations import stretch, tension_margin
from .error_measure import (
    FLOOR,
    WEIGHINGS,
    heavier,
    jump_of_displacement,
    scales,
    size,
)
from .motion_series import COLUMNS, motion_at, motion_series, stretch_at
from .runge_kutta import is_good
from .slack import extremum
from .taylor_adaptive import PART, step_length

SAMPLES = 8
"""Places on a part where the string's law is checked; between them the cubic through both ends is."""

PART_ON_A_STRING = 0.1
"""The same as taylor_adaptive.PART for a string, whose coefficients fall less evenly: the nearer the knot to its free end, the
nearer the poles."""

_MAX_PARTS = 200
"""In one step; more is chatter, and the rest of the step is taken with one law."""


@njit(cache=True, error_model="numpy")
def _growth(c, degree, weights):
    """σ from the last three coefficients: the largest k-th root of their measure."""
    attitude, spin, place, speed = weights
    growth = 0.0
    for k in range(degree - 2, degree + 1):
        a = size(c[k], attitude, spin, place, speed)
        if a > 0.0:
            growth = max(growth, math.exp(math.log(a) / k))
    return growth


@njit(cache=True, error_model="numpy")
def _pulls_at(c, p, degree, t):
    x, rate = stretch_at(c, p, degree, t)
    return tension_margin(x, rate, p) > 0.0


@njit(cache=True, error_model="numpy")
def _switch(c, p, degree, h, taut):
    """First time in (0, h] past which the string's law is the other one; −1 for none."""
    x0, rate0 = stretch_at(c, p, degree, 0.0)
    before = 0.0
    for j in range(1, SAMPLES + 1):
        t = h * j / SAMPLES
        x1, rate1 = stretch_at(c, p, degree, t)
        if (tension_margin(x1, rate1, p) > 0.0) != taut:
            return _bisect(c, p, degree, before, t, taut)
        hidden = extremum(x0, rate0, x1, rate1, t - before, taut)
        if hidden > 0.0 and _pulls_at(c, p, degree, before + hidden) != taut:
            return _bisect(c, p, degree, before, before + hidden, taut)
        before, x0, rate0 = t, x1, rate1
    return -1.0


@njit(cache=True, error_model="numpy")
def _bisect(c, p, degree, low, high, taut):
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high or high - low <= 1e-300:
            return high
        if _pulls_at(c, p, degree, middle) != taut:
            high = middle
        else:
            low = middle


@njit(cache=True, error_model="numpy")
def _walk(y, p, control, longest_ns, look, weights, c, out):
    """From y one step into out, or ``longest_ns`` if that is shorter; returns its length [ns], 0 when there is none. weights: of errors.

    look: it is known to reach that far.
    """
    degree, accuracy = int(control[ctl.DEGREE]), control[ctl.ACCURACY]
    longest = longest_ns * 1e-9
    jerk_of_place = jump_of_displacement(p, weights[1], weights[3])
    part = PART_ON_A_STRING if p[HAS_STRING] != 0.0 else PART
    one_sided = p[HAS_STRING] != 0.0 and p[BILATERAL] == 0.0
    x, rate = stretch(y, p)
    taut = not one_sided or tension_margin(x, rate, p) > 0.0
    out[:] = y
    gone = 0.0
    parts = 0
    while True:
        if control[ctl.SERIES] == 0.0 or parts > 0:
            motion_series(out, p, degree, taut, c)
        # Of a chain of parts the workspace holds the last one's.
        control[ctl.SERIES] = 1.0 if parts == 0 else 0.0
        parts += 1
        control[ctl.PENDING] += 1.0
        # A damped string that jerks taut turns an error of place into one of velocity: free flight must be that much better.
        allowance = part if taut else part / (1.0 + jerk_of_place)
        h = step_length(_growth(c, degree, weights), accuracy, degree, allowance)
        if not h * 1e9 >= 1.0 or not is_good(c[1]):
            return 0
        if accuracy * h < FLOOR:
            control[ctl.FLOOR_BINDS] = 1.0
        arrives = h >= longest - gone
        h = min(h, longest - gone)
        switch = _switch(c, p, degree, h, taut) if one_sided and parts < _MAX_PARTS else -1.0
        if switch < 0.0:
            break
        before_ns = int(math.floor((gone + switch) * 1e9))
        if parts > 1 and before_ns * 1e-9 > gone and not look:
            # One switch a step: each multiplies what the step has erred before it.
            h = before_ns * 1e-9 - gone
            break
        _move(c, p, degree, switch, one_sided and not taut, out)
        gone += switch
        taut = not taut
        if gone >= longest:
            return longest_ns
    length_ns = longest_ns
    if not arrives:
        length_ns = int(math.floor((gone + h) * 1e9))
        if length_ns * 1e-9 <= gone:
            length_ns += 1
    _move(c, p, degree, length_ns * 1e-9 - gone, one_sided and not taut, out)
    return length_ns


@njit(cache=True, error_model="numpy")
def _move(c, p, degree, h, slack, out):
    x0, _ = stretch_at(c, p, degree, 0.0)
    motion_at(c, p, degree, h, out)
    if slack:
        # Stretched but not pulling: the damper takes what is left of ½ k x² (see slack.py).
        before, after = max(x0, 0.0), max(stretch_at(c, p, degree, h)[0], 0.0)
        out[HEAT] += 0.5 * p[STIFFNESS] * (before - after) * (before + after)


def workspace(degree: int) -> np.ndarray:
    """Room for the coefficients, which stay there until the step is committed: every look before takes them once more."""
    return np.zeros((degree + 2, COLUMNS))


@njit(cache=True, error_model="numpy")
def steps(y, p, control, following, c, span_ns, look):
    """Commit steps in y that fit into span_ns; returns how far it came [ns]. See control.py for the arrays; c: workspace.

    look: take the one step to span_ns instead, shorter than the one accepted, and leave no trace; returns 0 if it failed.
    """
    advanced = 0
    while True:
        if look or control[ctl.ACCEPTED_NS] == 0.0:
            spent = control[ctl.PENDING]
            out = np.zeros(STORED) if look else following
            elapsed = control[ctl.ELAPSED_NS]
            weights = scales(y, p, elapsed * 1e-9)
            length, good = 0, False
            for _ in range(WEIGHINGS):
                length = _walk(y, p, control, span_ns if look else int(ctl.LONGEST * 1e9), look, weights, c, out)
                good = length >= 1 and is_good(out)
                # The errors of velocities are measured by those at the end: where they fall within the step, that counts.
                weights, more = heavier(scales(out, p, (elapsed + length) * 1e-9), weights)
                if look or not (good and more):
                    break
            if look:
                control[ctl.PENDING] = spent
                y[:] = out
                return length if good else 0
            if not good:
                control[ctl.FAILED] = 1.0
                return advanced
            control[ctl.ACCEPTED_NS] = length
        length = int(control[ctl.ACCEPTED_NS])
        if advanced + length > span_ns:
            return advanced
        y[:] = following
        advanced += length
        ctl.commit(control)
