# SPDX-License-Identifier: MIT
"""What integrators keep: energy and momentum as a random walk of roundings, and the length of the quaternion."""

import numpy as np
import pytest
from flights import flight, spinning

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS

MOMENTS = np.array((1.0, 2.0, 3.0))
BODY = make_body(1.0, (0.0, 0.0, 0.0), np.diag(MOMENTS))
STEPPED = [name for name, integrator in INTEGRATORS.items() if integrator.kernel is not None]
SPINS = [(0.9, 1.1, -0.7), (1.3, -0.2, 0.4), (-0.3, 0.5, 1.2)]


def free_problem(spin):
    """A segment's problem and the variables at its start."""
    simulation = flight(BODY, initial=spinning(spin))
    simulation.advance(1)
    return simulation.flight.problem, simulation.flight.variables.copy()


def energy_and_momentum(y):
    """In long doubles, so that the measuring adds no rounding of its own: E and L (3,) in the world."""
    w, q = y[4:7].astype(np.longdouble), y[0:4].astype(np.longdouble)
    momentum = MOMENTS * w
    twice = 2.0 * np.cross(q[:3], momentum)
    return (w * momentum).sum() / 2.0, momentum + q[3] * twice + np.cross(q[:3], twice)


def drifts(name, h, spins, marks):
    """Relative drifts of E and |L − L₀| (spins, marks, 2) after the given numbers of steps."""
    kernel, found = INTEGRATORS[name].kernel, np.zeros((len(spins), len(marks), 2))
    for i, spin in enumerate(spins):
        problem, y = free_problem(spin)
        energy, momentum = energy_and_momentum(y)
        done = 0
        for j, mark in enumerate(marks):
            assert kernel(y, problem, h, mark - done) == mark - done
            done = mark
            assert abs((y[:4] ** 2).sum() - 1.0) <= 4e-15
            now = energy_and_momentum(y)
            found[i, j] = abs(now[0] / energy - 1.0), np.sqrt(((now[1] - momentum) ** 2).sum() / (momentum**2).sum())
    return found


def check_random_walk(name, h, spins, marks, bound):
    found = drifts(name, h, spins, marks)
    assert found.max() <= bound
    typical = np.sqrt((found**2).mean(axis=0))
    for quantity in typical.T:
        # A random walk of roundings grows with n^½, a bias with n.
        assert np.polyfit(np.log(marks), np.log(quantity), 1)[0] <= 0.7


@pytest.mark.parametrize("h", [0.01, 0.1])
@pytest.mark.parametrize("name", ["free_body", "lie_midpoint"])
def test_energy_and_momentum_walk_at_random_over_a_million_steps(name, h):
    # Measured up to 4e-13, slopes 0.4 to 0.6.
    check_random_walk(name, h, SPINS, np.unique(np.logspace(3, 6, 13).astype(int)), 1e-12)


@pytest.mark.parametrize("name", STEPPED)
def test_attitude_stays_a_rotation_for_a_hundred_thousand_steps(name):
    problem, y = free_problem(SPINS[0])
    for _ in range(10):
        assert INTEGRATORS[name].kernel(y, problem, 1e-3, 10_000) == 10_000
        R = matrix_from_quaternion(y[0:4])
        assert np.abs(R.T @ R - np.eye(3)).max() <= 4e-15  # measured 1.1e-15
        assert abs((y[:4] ** 2).sum() - 1.0) <= 2e-15


@pytest.mark.parametrize(("step", "least", "most"), [(1.0 / 60.0, 1.2, 1.35), (1e-3, 0.035, 0.045)])
def test_semi_implicit_euler_gains_energy_that_nothing_gives(step, least, most):
    problem, y = free_problem(6.0 * np.array((0.3, 1.0, -0.2)) / np.linalg.norm((0.3, 1.0, -0.2)))
    energy, steps = energy_and_momentum(y)[0], round(10.0 / step)
    assert INTEGRATORS["semi_implicit_euler"].kernel(y, problem, step, steps) == steps
    # Measured 1.27 and 0.0404.
    assert least < energy_and_momentum(y)[0] / energy - 1.0 < most
