# SPDX-License-Identifier: MIT
"""auto picks the cheapest method per segment, says which and why, and sleeps when nothing moves."""

import numpy as np
import pytest
from flights import AT_REST, SECOND, StringSettings, flight, spinning, wrench
from reference_motion import angle_between, free_motion
from reference_scenes import BODY, ROW, error, scene_with

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.loads import (
    ANGULAR_DAMPING,
    BODY_FORCE,
    BODY_TORQUE,
    NO_GYROSCOPIC_TERM,
    WORLD_TORQUE,
)

GRAVITY = np.array((0.0, 0.0, -9.81))
STRING = StringSettings(attached=True, attach=(0.1, 0.15, 0.2), target=(0.0, 0.0, 2.0), frequency=20.0, rest_length=1.0)


def auto(initial=AT_REST, **changes):
    return flight(BODY, integrator="auto", initial=initial, **changes)


@pytest.mark.parametrize(
    ("simulation", "method"),
    [
        (auto(), "sleeping"),
        (auto(gravity=GRAVITY), "closed form"),
        (auto(np.array([0, 0, 0, 0, 0, 0, 1.0, 1, 0, 0, 0, 0, 0])), "closed form"),
        (auto(spinning((1, 2, 3))), "free_body"),
        (auto(spinning((1, 2, 3)), gravity=GRAVITY, linear_damping=0.3), "free_body"),
        (auto(spinning((1, 2, 3)), gyroscopic=False), "closed form"),
        (auto(spinning((1, 2, 3)), angular_damping=0.3), "taylor"),
        (auto(string=STRING), "taylor"),
        (auto(string=StringSettings(attached=True, target=(0.0, 0.0, 0.5), rest_length=1.0)), "sleeping"),
    ],
)
def test_the_method_is_the_cheapest_that_fits_the_segment(simulation, method):
    assert simulation.choice.startswith("auto: ")
    assert method in simulation.choice
    simulation.advance(SECOND // 100)
    assert np.isfinite(simulation.state.row).all()


@pytest.mark.parametrize(("frame", "why"), [("body", "turn with the body"), ("world", "depend on the attitude")])
def test_held_wrenches_are_stepped_by_series_and_the_choice_says_why(frame, why):
    simulation = auto(spinning((1, 2, 3)))
    simulation.submit(wrench(frame, (1.0, 0.0, 0.0), (0.0, 0.5, 0.0)))
    simulation.advance(SECOND // 100)
    assert "taylor" in simulation.choice and why in simulation.choice


def test_its_steps_follow_from_accuracy_and_not_from_step():
    ends = {auto(ROW, step_s=step, string=STRING).advance(SECOND).sha256() for step in (1e-6, 1e-3, 1.0)}
    assert len(ends) == 1


def test_a_body_at_rest_takes_no_step_and_wakes_at_a_poke():
    simulation = auto()
    simulation.submit(wrench("body@point/.1,.2,.3", (1.0, 0.0, 0.0), held=False), 3600 * SECOND)
    simulation.advance(3600 * SECOND)
    assert (simulation.steps, simulation.force_evaluations) == (0, 0)
    simulation.advance(3601 * SECOND)
    assert simulation.steps > 0
    assert simulation.state.angular_velocity_body.any()


def test_a_day_of_tumbling_is_one_evaluation_and_still_right():
    simulation, spin, day = auto(spinning((1.0, 2.0, 3.0))), (1.0, 2.0, 3.0), 86400
    simulation.advance(day * SECOND)
    assert simulation.steps == 0
    exact, _ = free_motion(BODY.inertia, spin, day)
    # 50 ε (1 + |ω|t) is 3.6e-9; rounding the principal axes alone gives some of it. Measured 3e-11.
    assert angle_between(simulation.state.orientation_xyzw, exact) <= 3.6e-9


SOFT = StringSettings(True, (0.3, -0.2, 0.25), (0.1, 0.2, 1.2))
SCENES = {
    "body wrench": ({BODY_TORQUE, BODY_FORCE}, None),
    "body wrench, damped": ({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING}, None),
    "all loads": ({BODY_TORQUE, BODY_FORCE, ANGULAR_DAMPING, WORLD_TORQUE}, None),
    "all loads, term dropped": ({BODY_TORQUE, BODY_FORCE, WORLD_TORQUE, NO_GYROSCOPIC_TERM}, None),
    "body force alone": ({BODY_FORCE}, None),
    "string": (set(), SOFT._replace(stiffness=300.0, rest_length=0.8)),
    "rubber band": ({BODY_TORQUE}, SOFT),
}


@pytest.mark.parametrize("accuracy", [1e-3, 1e-9, 1e-12])
@pytest.mark.parametrize("scene", SCENES)
def test_the_global_error_follows_the_accuracy(scene, accuracy):
    scene = scene_with(*SCENES[scene])
    simulation = scene.simulation(integrator="auto", accuracy=accuracy)
    # Local rates add up to at most the accuracy here, rounding aside: measured up to 0.4 of it.
    assert error(simulation.advance(SECOND).row, scene.reference(1.0)) <= accuracy + 1e-13
    assert simulation.steps < 60


def test_a_smaller_accuracy_is_no_worse_and_the_error_grows_as_the_docs_say():
    """Moments 1, 2, 2.5 kg m², 1 rad/s, a world force of 1e-7 N at a point, ten minutes."""
    body, spin, time = make_body(1.0, np.zeros(3), np.diag((1.0, 2.0, 2.5))), np.array((0.5, 0.7, 0.5)), 600
    attitudes = {}
    for accuracy in (1e-6, 1e-9, 1e-12, 1e-14):
        simulation = flight(body, integrator="auto", accuracy=accuracy, initial=spinning(spin / np.linalg.norm(spin)))
        simulation.submit(wrench("world@point/.3,.2,.1", (1e-7, 0.0, 0.0)))
        attitudes[accuracy] = simulation.advance(time * SECOND).orientation_xyzw
    errors = [2.0 * np.linalg.norm(attitudes[a] - attitudes[1e-14]) for a in (1e-6, 1e-9, 1e-12)]
    # Measured 1.0e-3, 8.3e-7 and 2e-9.
    for accuracy, found in zip((1e-6, 1e-9, 1e-12), errors, strict=True):
        assert found <= accuracy * (time + 0.5 * time**2) + 1e-10
    assert errors[0] >= errors[1] >= errors[2]
