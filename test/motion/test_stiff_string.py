# SPDX-License-Identifier: MIT
"""A body on a string of any stiffness that auto resolves keeps its energy and comes to where it belongs."""

import numpy as np
import pytest
from flights import SECOND, flight

import problems
from motion_measures import energy
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.string import StringSettings

STEP_S = 1e-3
FREQUENCIES = (10.0, 1e2, 1e3, 1e4, 1e5)
"""ω_s [rad/s]; with steps of 1 ms ω_s h is 0.01 to 100."""


def hung(problem, integrator):
    """A Simulation of one of the benchmark's bodies on a string."""
    s = problem.spring
    string = StringSettings(
        attached=True,
        attach=s.point,
        target=s.target,
        frequency=s.frequency,
        damping_ratio=s.damping_ratio,
        rest_length=s.rest_length,
        bilateral=s.bilateral,
    )
    return flight(
        make_body(problem.mass, np.zeros(3), np.array(problem.inertia)),
        integrator=integrator,
        step_s=STEP_S,
        initial=np.array(problem.row),
        gravity=np.array(problem.gravity),
        string=string,
    )


def energy_error(problem, integrator, duration_s, every_s):
    """Largest |E(t) − E(0)| over the largest kinetic energy."""
    simulation = hung(problem, integrator)
    start, largest = energy(problem, simulation.state.row)
    worst = 0.0
    for k in range(1, round(duration_s / every_s) + 1):
        now, kinetic = energy(problem, simulation.advance(round(k * every_s * SECOND)).row)
        worst, largest = max(worst, abs(now - start)), max(largest, kinetic)
    assert not simulation.failure
    assert simulation.time_ns == round(duration_s * SECOND)
    return worst / largest


@pytest.mark.parametrize(
    ("frequency", "every_s"),
    [(10.0, 0.125), (1e3, 0.125), *(pytest.param(f, 0.0125, marks=pytest.mark.stress) for f in FREQUENCIES)],
)
@pytest.mark.parametrize("bilateral", [True, False], ids=["bilateral", "pull-only"])
def test_auto_keeps_the_energy_on_a_string(bilateral, frequency, every_s):
    problem = problems.string_problem(frequency, 0.0, bilateral, 10.0)
    # Measured 8e-12 at most.
    assert energy_error(problem, "auto", 10.0, every_s) <= 1e-9
