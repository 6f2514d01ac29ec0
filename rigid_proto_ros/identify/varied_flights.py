# SPDX-License-Identifier: MIT
"""A body's flight at all samples, and those of its variations from fewer points of time.

How far a varied flight is from the base bends with the body's turn, however often that is sampled: so variations are
flown at knots at most two fifths of a radian apart, and between these their distance from the base is interpolated by
polynomials of degree 7. That is linear in the distances, so directions of the unknowns that change nothing still change
nothing.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.rotation import exponential, multiply, normalize
from . import trajectories as tr
from .sensors import rotation_vector

ANGLE = 0.4
"""Turn between two knots [rad]: of a third harmonic 2e-5 is lost, of a second one 1e-6."""
NODES = 8
"""Knots that a value between them is interpolated from."""
DISTANCE = 18  # position, rotation vector in body axes, velocity, angular velocity, and what is felt (2, 3)


@njit(cache=True, error_model="numpy")
def _place_knots(
    times_ns: np.ndarray, edges_ns: np.ndarray, base: np.ndarray, knots: np.ndarray, firsts: np.ndarray, w: np.ndarray
) -> int:
    """Knots for times_ns (m,) between the edges (e,) of loads, over which nothing is smooth: into knots (m,), and for
    each time the first of its nodes (m,) and their weights (m, NODES). base (m, SAMPLE). Returns how many there are.
    """
    count, begin, edge = 0, 0, 0
    while begin < times_ns.shape[0]:
        # A sample at an edge is from before it.
        while edge < edges_ns.shape[0] and edges_ns[edge] < times_ns[begin]:
            edge += 1
        end, fastest = begin, 0.0
        while end < times_ns.shape[0] and (edge == edges_ns.shape[0] or times_ns[end] <= edges_ns[edge]):
            s = base[end]
            fastest = max(fastest, s[10] * s[10] + s[11] * s[11] + s[12] * s[12])
            end += 1
        first_ns, samples = times_ns[begin], end - begin
        span_ns = times_ns[end - 1] - first_ns
        wanted = math.ceil(math.sqrt(fastest) * 1e-9 * span_ns / ANGLE) + 1.0
        if wanted >= samples or samples <= NODES:
            for j in range(begin, end):
                knots[count], firsts[j] = times_ns[j], count
                w[j] = 0.0
                w[j, 0] = 1.0
                count += 1
        else:
            own = max(int(wanted), NODES)
            for k in range(own):
                knots[count + k] = first_ns + span_ns * k // (own - 1)
            for j in range(begin, end):
                near = int((times_ns[j] - first_ns) * (own - 1) // span_ns) - NODES // 2 + 1
                firsts[j] = count + min(max(near, 0), own - NODES)
                for i in range(NODES):
                    w[j, i] = 1.0
                    for k in range(NODES):
                        if k != i:
                            this, other = knots[firsts[j] + i], knots[firsts[j] + k]
                            w[j, i] *= (times_ns[j] - other) / (this - other)
            count += own
        begin = end
    return count


@njit(cache=True, error_model="numpy")
def _distance(base: np.ndarray, other: np.ndarray, d: np.ndarray) -> None:
    x, y, z = rotation_vector(base[3], base[4], base[5], base[6], other[3], other[4], other[5], other[6])
    for k in range(3):
        d[k], d[6 + k], d[9 + k] = other[k] - base[k], other[7 + k] - base[7 + k], other[10 + k] - base[10 + k]
        d[12 + k], d[15 + k] = other[13 + k] - base[13 + k], other[16 + k] - base[16 + k]
    d[3], d[4], d[5] = x, y, z


@njit(cache=True, error_model="numpy")
def _blend(at_knots: np.ndarray, firsts: np.ndarray, w: np.ndarray, samples: np.ndarray) -> None:
    """Samples (n, m, SAMPLE) of all flights but the first one, which is there, from those at knots (n, k, SAMPLE)."""
    count = at_knots.shape[1]
    distances, d = np.zeros((count + NODES, DISTANCE)), np.empty(DISTANCE)
    for f in range(1, at_knots.shape[0]):
        for k in range(count):
            _distance(at_knots[0, k], at_knots[f, k], distances[k])
        for j in range(firsts.shape[0]):
            d[:] = 0.0
            for i in range(NODES):
                weight, own = w[j, i], distances[firsts[j] + i]
                for c in range(DISTANCE):
                    d[c] += weight * own[c]
            base, to = samples[0, j], samples[f, j]
            turn = exponential(d[3], d[4], d[5])
            q = multiply(base[3], base[4], base[5], base[6], turn[0], turn[1], turn[2], turn[3])
            to[3], to[4], to[5], to[6] = normalize(q[0], q[1], q[2], q[3])
            for k in range(3):
                to[k], to[7 + k], to[10 + k] = base[k] + d[k], base[7 + k] + d[6 + k], base[10 + k] + d[9 + k]
                to[13 + k], to[16 + k] = base[13 + k] + d[12 + k], base[16 + k] + d[15 + k]


def fly_variations(rows: np.ndarray, times_ns: np.ndarray, wrenches: tr.Wrenches) -> np.ndarray | None:
    """Samples (n, m, SAMPLE) of the flights of ``rows`` (n, FLOWN), variations of the first one, at times_ns (m,)
    ascending from 0; None where one didn't come through.
    """
    samples = np.empty((len(rows), len(times_ns), tr.SAMPLE))
    base, good = tr.fly_rows(rows[:1], times_ns, wrenches)
    if not good.all():
        return None
    samples[0] = base[0]
    knots, firsts = np.empty(len(times_ns), np.int64), np.empty(len(times_ns), np.int64)
    weights = np.empty((len(times_ns), NODES))
    count = _place_knots(times_ns, wrenches.edges_ns, samples[0], knots, firsts, weights)
    at_knots, good = tr.fly_rows(rows, knots[:count], wrenches)
    if not good.all():
        return None
    _blend(at_knots, firsts, weights, samples)
    return samples
