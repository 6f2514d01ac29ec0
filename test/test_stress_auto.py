# SPDX-License-Identifier: MIT
"""auto keeps its word: each committed step errs by at most accuracy·h, against the exact flow from that step's own start."""

import numpy as np
import pytest
from flights import SECOND
from local_error import FLOOR, committed_steps, local_error
from random_scenes import DURATION_S, random_scene

from rigid_proto_ros.core.integrators.error_measure import jerk_of_rounding, scales

ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)
SCENES = 10
STRESS_SCENES = 300
STRESS_SCENES_A_TEST = 10
STEPS_PER_SCENE = 6


def allowed(step, accuracy):
    """accuracy·h and the floor; where the floor is reported to bind, what a rounding of a stiff string's knot does too."""
    if not step.floor_binds:
        return accuracy * step.length + FLOOR
    _, spin, _, speed = scales(step.before, step.problem, step.begin_ns * 1e-9)
    return accuracy * step.length + 2.0 * FLOOR + jerk_of_rounding(step.problem, spin, speed) * step.length


def check(seeds):
    worst, judged, failures = 0.0, 0, []
    for seed in seeds:
        for accuracy in ACCURACIES:
            simulation = random_scene(seed, "auto", accuracy)
            steps = committed_steps(
                simulation, round(DURATION_S * SECOND), STEPS_PER_SCENE, np.random.default_rng(seed)
            )
            assert not simulation.failure
            assert np.isfinite(simulation.state.row).all()
            for step in steps:
                share = local_error(step) / allowed(step, accuracy)
                worst, judged = max(worst, share), judged + 1
                if share > 1.0:
                    failures.append(
                        f"seed {seed}, accuracy {accuracy:g}: a step of {step.length:.3g} s errs {share:.3g} times that"
                    )
    print(f"{judged} steps, the worst takes {worst:.2f} of what is allowed")
    assert judged >= len(seeds)
    assert not failures, "\n".join(failures)


def test_auto_meets_its_accuracy_in_random_scenes():
    check(range(SCENES))


@pytest.mark.stress
@pytest.mark.parametrize("first", range(1000, 1000 + STRESS_SCENES, STRESS_SCENES_A_TEST))
def test_auto_meets_its_accuracy_in_three_hundred_random_scenes(first):
    check(range(first, first + STRESS_SCENES_A_TEST))
