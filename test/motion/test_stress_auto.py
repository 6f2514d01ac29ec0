# SPDX-License-Identifier: MIT
"""auto keeps its word: each committed step errs by at most accuracy·h, against the exact flow from that step's own start."""

import numpy as np
import pytest
from flights import SECOND
from local_error import committed_steps, local_error
from random_scenes import DURATION_S, random_scene

ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)
STEPS_PER_SCENE = 6


def allowed(step, accuracy):
    """accuracy·h, or the floor where that is more and reported."""
    share = max(accuracy * step.length, step.floor)
    assert max(accuracy, step.floor_rate) * step.length >= (1.0 - 1e-9) * share
    return share


def shares(simulation, duration_s, accuracy, seed, count=STEPS_PER_SCENE):
    """Of what is allowed, what each of some steps of a flight took; and their lengths [s]."""
    steps = committed_steps(simulation, round(duration_s * SECOND), count, np.random.default_rng(seed))
    assert not simulation.failure
    assert np.isfinite(simulation.state.row).all()
    return [(local_error(step) / allowed(step, accuracy), step.length) for step in steps]


def check(seeds, steps_per_scene):
    worst, judged, failures = 0.0, 0, []
    for seed in seeds:
        for accuracy in ACCURACIES:
            for share, length in shares(
                random_scene(seed, "auto", accuracy), DURATION_S, accuracy, seed, steps_per_scene
            ):
                worst, judged = max(worst, share), judged + 1
                if share > 1.0:
                    failures.append(
                        f"seed {seed}, accuracy {accuracy:g}: a step of {length:.3g} s errs {share:.3g} of it"
                    )
    print(f"{judged} steps, the worst takes {worst:.2f} of what is allowed")
    assert judged >= len(seeds)
    assert not failures, "\n".join(failures)


STIFF = [1051]
"""On a string whose rounding is more than what the accuracy allows: 2.1 times 32 ε in one step."""
STRESS_SEEDS = [range(first, first + 10) for first in range(1000, 1300, 10)]


@pytest.mark.parametrize(
    ("seeds", "steps_per_scene"),
    [
        (range(10), 2),
        (STIFF, STEPS_PER_SCENE),
        *(pytest.param(seeds, STEPS_PER_SCENE, marks=pytest.mark.stress) for seeds in STRESS_SEEDS),
    ],
)
def test_auto_meets_its_accuracy_in_random_scenes(seeds, steps_per_scene):
    check(seeds, steps_per_scene)
