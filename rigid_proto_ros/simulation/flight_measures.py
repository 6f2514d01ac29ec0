# SPDX-License-Identifier: MIT
"""What is measured of one flight, from its states at the sample times: one number a measure.

A measure is a row (MEASURE,): a kind, a quantity or difference by number (simulation/quantities.py), and what the kind
needs.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.rotation import rotate
from .quantities import START, difference, met, quantity

FINAL, SAMPLE, LARGEST, SMALLEST, FIRST, FLIPS, DIFFERENCE, LARGEST_DIFFERENCE = range(8)
KIND, CODE, A, B, C, D, MEASURE = range(7)
"""SAMPLE: A the sample's number. FIRST: A sign and B limit of the condition. FLIPS: A margin, B to D the axis in the
body, all zero for that of the first spin.
"""


@njit(cache=True, error_model="numpy", allocates=False)
def count_flips(
    measure: np.ndarray, states: np.ndarray, watched: np.ndarray, reached: int, context: np.ndarray
) -> float:
    """How often a body axis turns over: its cosine to where it pointed at the start passes −margin, then margin, ...

    The margin keeps an axis that lies across from being counted at each tremble. NaN without an axis.
    """
    x, y, z = measure[B], measure[C], measure[D]
    if x == 0.0 and y == 0.0 and z == 0.0:
        x, y, z = context[START + 10], context[START + 11], context[START + 12]
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return math.nan
    s = START
    ax, ay, az = rotate(context[s + 3], context[s + 4], context[s + 5], context[s + 6], x / size, y / size, z / size)
    flips, side = 0, 1.0
    for k in range(reached):
        if not watched[k]:
            continue
        q = states[k]
        bx, by, bz = rotate(q[3], q[4], q[5], q[6], x / size, y / size, z / size)
        if side * (ax * bx + ay * by + az * bz) < -measure[A]:
            side = -side
            flips += 1
    return float(flips)


@njit(cache=True, error_model="numpy", allocates=False)
def _extreme(measure: np.ndarray, states: np.ndarray, watched: np.ndarray, reached: int, context: np.ndarray) -> float:
    sign = 1.0 if measure[KIND] == LARGEST else -1.0
    found = -math.inf
    for k in range(reached):
        if watched[k]:
            found = max(found, sign * quantity(int(measure[CODE]), states[k], context))
    return sign * found


@njit(cache=True, error_model="numpy")
def _first(measure: np.ndarray, states: np.ndarray, watched: np.ndarray, reached: int, context: np.ndarray) -> int:
    """The first watched sample at which the condition of a measure holds, or −1."""
    condition = np.array([measure[CODE], measure[A], measure[B]])
    for k in range(reached):
        if watched[k] and met(condition, states[k], context):
            return k
    return -1


@njit(cache=True, error_model="numpy", allocates=False)
def _largest_difference(code: int, states: np.ndarray, others: np.ndarray, watched: np.ndarray, reached: int) -> float:
    """Over the watched samples."""
    largest = 0.0
    for k in range(reached):
        if watched[k]:
            largest = max(largest, difference(code, states[k], others[k]))
    return largest


@njit(cache=True, error_model="numpy", allocates=False)
def measure_flight(
    measures: np.ndarray,
    states: np.ndarray,
    others: np.ndarray,
    sample_ns: np.ndarray,
    watched: np.ndarray,
    reached: int,
    context: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill out (k,) with the measures (k, MEASURE) of a flight that reached so many of its samples.

    states, others (m, STATE): at sample_ns (m,), of the flight and of its reference. watched (m,): which samples count
    for extremes and firsts. NaN where there is nothing to say: an event that didn't happen, a sample after the end.
    """
    last = states[reached - 1]
    for j in range(measures.shape[0]):
        measure = measures[j]
        kind, code = int(measure[KIND]), int(measure[CODE])
        out[j] = math.nan
        if kind == FINAL:
            out[j] = quantity(code, last, context)
        elif kind == SAMPLE:
            if measure[A] < reached:
                out[j] = quantity(code, states[int(measure[A])], context)
        elif kind in (LARGEST, SMALLEST):
            out[j] = _extreme(measure, states, watched, reached, context)
        elif kind == FIRST:
            first = _first(measure, states, watched, reached, context)
            if first >= 0:
                out[j] = sample_ns[first] * 1e-9
        elif kind == FLIPS:
            out[j] = count_flips(measure, states, watched, reached, context)
        elif kind == DIFFERENCE:
            out[j] = difference(code, last, others[reached - 1])
        else:
            out[j] = _largest_difference(code, states, others, watched, reached)
