# SPDX-License-Identifier: MIT
"""The order of each integrator, measured with all the loads it carries, against high-precision series."""

import numpy as np
import pytest
from flights import SECOND, StringSettings, flight, spinning, wrench
from reference_scenes import error, scene_for, scene_with

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.series import taylor_steps_of_degree
from rigid_proto_ros.motion.loads import NO_GYROSCOPIC_TERM, STRING
from rigid_proto_ros.motion.problem import to_row
from rigid_proto_ros.simulation.quantities import attitude_angle

FLOOR = 2e-15
"""What rounding leaves after a second of these motions: errors of the orders' tests lie at least 1e3 times above it."""

STEPS = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100, 125, 160, 200, 250, 320, 400, 500)
ORDERED = [name for name, i in INTEGRATORS.items() if i.order is not None and name != "taylor"]
ON_A_STRING = [name for name in ORDERED if STRING in INTEGRATORS[name].supports and name != "dop853"]

STRINGS = {
    "bilateral": StringSettings(True, (0.3, -0.2, 0.25), (0.1, 0.2, 1.2), 300.0, 0.0, 0.1, 0.8, True),
    "rest length 0": StringSettings(True, (0.3, -0.2, 0.25), (0.1, 0.2, 1.2), 300.0, 0.0, 0.1, 0.0, False),
    "slack and taut": StringSettings(True, (0.3, -0.2, 0.25), (0.1, 0.2, 1.2), 100.0, 0.0, 0.3, 0.9, False),
}


def measured_order(errors) -> tuple[float, int]:
    """Slope of log error against log h by least squares over errors in the asymptotic range, and how many there are."""
    used = [(n, e) for n, e in errors if 1e3 * FLOOR <= e <= 1e-2]
    counts, sizes = np.array(used).T
    return -np.polyfit(np.log(counts), np.log(sizes), 1)[0], len(used)


def check(name, scene, seconds=1, steps=STEPS):
    integrator, reference = INTEGRATORS[name], scene.reference(seconds)
    errors = [(n, error(scene.flown(seconds, integrator=name, step=seconds / n), reference)) for n in steps]
    order, used = measured_order(errors)
    assert used >= 4
    assert abs(order - integrator.order) <= 0.2, errors


@pytest.mark.parametrize("name", ORDERED)
def test_order_under_loads(name):
    # Measured within 0.05 of the declared order.
    scene = scene_for(INTEGRATORS[name])
    if name == "dop853":
        check(name, scene, 4, (5, 8, 10, 16, 20))
    else:
        check(name, scene)


@pytest.mark.parametrize(
    "degree", [4, pytest.param(6, marks=pytest.mark.stress), pytest.param(8, marks=pytest.mark.stress)]
)
def test_order_of_taylor_series_is_their_degree(degree):
    scene = scene_for(INTEGRATORS["taylor"])
    reference, simulation = scene.reference(1.0), scene.simulation(integrator="taylor")
    simulation.advance(1)
    problem, errors = simulation.flight.problem, []
    for n in STEPS:
        y, row = simulation.flight.variables.copy(), np.empty(13)
        assert taylor_steps_of_degree(y, problem, 1.0 / n, n, degree) == n
        to_row(y, problem, 1.0, row)
        errors.append((n, error(row, reference)))
    order, used = measured_order(errors)
    assert used >= 4
    assert abs(order - degree) <= 0.2, errors  # measured within 0.1


def test_under_a_moderate_torque_splitting_errs_less_than_dop853_with_a_twelfth_of_the_evaluations():
    body, spin = make_body(1.0, np.zeros(3), np.diag((1.0, 2.0, 3.0))), np.array((0.3, 1.0, -0.2))
    ends = []
    for name in ("auto", "free_body_strang", "dop853"):
        start = spinning(100.0 * spin / np.linalg.norm(spin))
        simulation = flight(body, integrator=name, step_s=1e-2, accuracy=1e-12, initial=start)
        simulation.submit(wrench("world", torque=(0.5, 0.3, 0.8)))
        ends.append((simulation.advance(SECOND).row[3:7], simulation.force_evaluations))
    (exact, _), (split, few), (other, many) = ends
    # Measured 1.3e-5 and 3.1e-5 rad.
    assert (few, many) == (100, 1200)
    assert attitude_angle(split, exact) < 0.6 * attitude_angle(other, exact)


@pytest.mark.parametrize(("name", "order"), [("euler", 1), ("midpoint", 2), ("rk4", 4)])
def test_order_without_the_gyroscopic_term_against_the_motion_of_that_equation(name, order):
    check(name, scene_with(INTEGRATORS[name].supports - {STRING}))
    assert NO_GYROSCOPIC_TERM in INTEGRATORS[name].supports and INTEGRATORS[name].order == order


@pytest.mark.parametrize("string", STRINGS)
@pytest.mark.parametrize("name", ON_A_STRING)
def test_order_on_a_string_through_slack_and_taut(name, string):
    finest = (200, 250, 320, 400, 500, 640, 800, 1000)
    coarse = (16, 20, 25, 32, 40, 50, 64, 80, 100, 125, 160)
    first_order = INTEGRATORS[name].order == 1
    steps = (1000, 2000, 4000, 8000, 16000, 32000, 64000, 128000) if first_order else (*coarse, *finest)
    check(name, scene_for(INTEGRATORS[name], string=STRINGS[string]), 1, steps)


@pytest.mark.parametrize("string", STRINGS)
def test_dop853_loses_nothing_where_the_string_turns_slack_or_taut(string):
    """Its errors leave too few digits to measure order 8 on a string; a step across the kink would err by 1e-4."""
    scene = scene_for(INTEGRATORS["dop853"], string=STRINGS[string])
    row = scene.flown(1.0, integrator="dop853", step=1.0 / 40)
    assert error(row, scene.reference(1.0)) <= 1e-9  # measured up to 6e-11
