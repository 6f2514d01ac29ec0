# SPDX-License-Identifier: MIT
"""Millions of steps: what must stay, stays; rounding walks at random and does not march."""

import numpy as np
import pytest
from flights import flight, spinning
from numba import njit

from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS

STEPS = 1_000_000
STRESS_STEPS = 100_000_000
TENSOR = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
SPIN = (0.7, 1.9, -0.6)
EXACTLY_CONSERVING = ("free_body", "lie_midpoint")


@njit
def invariants(y, moments):
    """2E, L in the world (3,), |q|² of the variables of a segment."""
    m = moments * y[4:7]
    lx, ly, lz = rotate(y[0], y[1], y[2], y[3], m[0], m[1], m[2])
    twice = (m * y[4:7]).sum()
    return np.array([twice, lx, ly, lz, (y[:4] ** 2).sum()])


def drifts(name: str, steps: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Step counts, half-decade by half-decade, the largest drift of E and L up to each, and the largest | |q|² − 1 |."""
    simulation = flight(make_body(2.0, np.zeros(3), TENSOR), integrator=name, initial=spinning(SPIN))
    segment = simulation._segment
    p, y = segment.problem, segment.variables.copy()
    moments, kernel = p.moments.copy(), INTEGRATORS[name].kernel
    start = invariants(y, moments)
    L = np.linalg.norm(start[1:4])
    counts = np.unique(np.round(10.0 ** np.arange(2.0, np.log10(steps) + 0.01, 0.25)).astype(int))
    largest, drift, norm, done = [], 0.0, 0.0, 0
    for count in counts:
        # Several looks between two counts, so that the walk's size is seen and not one position of it.
        for portion in np.diff(np.linspace(done, count, 21).astype(int)):
            assert kernel(y, p, 1e-2, portion) == portion
            now = invariants(y, moments)
            drift = max(drift, abs(now[0] / start[0] - 1.0), np.linalg.norm(now[1:4] - start[1:4]) / L)
            norm = max(norm, abs(now[4] - 1.0))
        done = count
        largest.append(drift)
    return counts, np.array(largest), norm


def check_drift(name, steps, bound):
    counts, drift, norm = drifts(name, steps)
    slope = np.polyfit(np.log(counts), np.log(drift), 1)[0]
    print(f"{name}: drift {drift[-1]:.1e} after {steps:.0e} steps, slope {slope:.2f}, | |q|² − 1 | {norm:.1e}")
    assert drift[-1] <= bound
    assert slope <= 0.7
    assert norm <= 4e-15


@pytest.mark.parametrize("name", EXACTLY_CONSERVING)
def test_energy_and_momentum_walk_at_random_for_a_million_steps(name):
    check_drift(name, STEPS, 1e-12)


@pytest.mark.stress
@pytest.mark.parametrize("name", EXACTLY_CONSERVING)
def test_energy_and_momentum_walk_at_random_for_a_hundred_million_steps(name):
    check_drift(name, STRESS_STEPS, 1e-11)


@pytest.mark.parametrize("name", sorted(n for n, i in INTEGRATORS.items() if i.kernel is not None))
def test_attitudes_stay_rotations_for_a_million_steps(name):
    simulation = flight(make_body(2.0, np.zeros(3), TENSOR), integrator=name, initial=spinning((0.07, 0.19, -0.06)))
    segment = simulation._segment
    y, kernel = segment.variables.copy(), INTEGRATORS[name].kernel
    for _ in range(100):
        assert kernel(y, segment.problem, 1e-3, STEPS // 100) == STEPS // 100
        # |RᵀR − 1| of the matrix of q is at most twice this.
        assert abs((y[:4] ** 2).sum() - 1.0) <= 2e-15
