# SPDX-License-Identifier: MIT
"""What integrators keep: energy and momentum as a random walk of roundings, and the length of the quaternion."""

import numpy as np
import pytest
from flights import SECOND, bundled_body, flight, spinning

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.integrator import ONE_STEP
from rigid_proto_ros.simulation.commands import CLEAR, NO_SLOT

MOMENTS = np.array((1.0, 2.0, 3.0))
BODY = make_body(1.0, (0.0, 0.0, 0.0), np.diag(MOMENTS))
STEPPED = [name for name, integrator in INTEGRATORS.items() if integrator.kernel is not None]
BLOCK = 5000
SPINS = [(0.9, 1.1, -0.7), (1.3, -0.2, 0.4), (-0.3, 0.5, 1.2)]


def stepped(simulation, h_ns, first, last):
    """Fly the steps ``first`` to ``last`` − 1 of so many nanoseconds, and return q and ω. A method that reaches any time by one
    step from its segment's start is given a command that does nothing before each.
    """
    arrays = simulation._arrays
    if simulation.setup.integrator.methods[0].way == ONE_STEP:
        for block in range(first, last, BLOCK):
            end = min(block + BLOCK, last)
            arrays.put((k * h_ns, -1, CLEAR, NO_SLOT, b"") for k in range(block, end))
            assert arrays.fly(end * h_ns)
        assert arrays.flight.segments == last + 1
    else:
        assert arrays.fly(last * h_ns)
        assert simulation.steps == last
    # The body's axes are its principal ones.
    return arrays.row[3:7].copy(), arrays.row[10:13].copy()


def energy_and_momentum(q, w):
    """In long doubles, so that the measuring adds no rounding of its own: E and L (3,) in the world."""
    w, q = w.astype(np.longdouble), q.astype(np.longdouble)
    momentum = MOMENTS * w
    twice = 2.0 * np.cross(q[:3], momentum)
    return (w * momentum).sum() / 2.0, momentum + q[3] * twice + np.cross(q[:3], twice)


def drifts(name, h, spins, marks):
    """Relative drifts of E and |L − L₀| (spins, marks, 2) after the given numbers of steps."""
    h_ns, found = round(h * SECOND), np.zeros((len(spins), len(marks), 2))
    for i, spin in enumerate(spins):
        start = spinning(spin)
        simulation = flight(BODY, integrator=name, step_s=h, initial=start)
        energy, momentum = energy_and_momentum(start[3:7], start[10:13])
        done = 0
        for j, mark in enumerate(marks):
            q, w = stepped(simulation, h_ns, done, mark)
            done = mark
            assert abs((q**2).sum() - 1.0) <= 2e-15  # measured 4e-16
            now = energy_and_momentum(q, w)
            found[i, j] = abs(now[0] / energy - 1.0), np.sqrt(((now[1] - momentum) ** 2).sum() / (momentum**2).sum())
    return found


@pytest.mark.parametrize("name", ["free_body", "lie_midpoint"])
def test_energy_and_momentum_walk_at_random_over_a_million_steps(name):
    # Measured up to 4e-13, slopes 0.4 to 0.6.
    marks = np.unique(np.logspace(3, 6, 13).astype(int)).tolist()
    found = drifts(name, 0.1, SPINS, marks)
    assert found.max() <= 1e-12
    typical = np.sqrt((found**2).mean(axis=0))
    for quantity in typical.T:
        # A random walk of roundings grows with n^½, a bias with n.
        assert np.polyfit(np.log(marks), np.log(quantity), 1)[0] <= 0.7


@pytest.mark.parametrize("name", STEPPED)
def test_the_quaternion_keeps_its_length_for_a_hundred_thousand_steps(name):
    drifts(name, 1e-3, SPINS[:1], range(10_000, 100_001, 10_000))


@pytest.mark.parametrize("name", ["rk4", "auto"])
def test_momentum_keeps_its_direction_in_the_world(name):
    simulation = flight(bundled_body("t_handle"), integrator=name, initial=spinning((0.3, 4.0, 0.2)))
    momentum = simulation.angular_momentum
    for tenth in range(1, 21):
        simulation.advance(tenth * SECOND // 10)
        now = simulation.angular_momentum
        # Measured 2e-11 (rk4).
        assert np.linalg.norm(np.cross(now, momentum)) <= 1e-9 * (now @ momentum)
