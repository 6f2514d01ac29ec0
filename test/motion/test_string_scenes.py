# SPDX-License-Identifier: MIT
"""auto in scenes of every pair of features, and in everyday ones, against a reference: error within accuracy × time × condition.

Slow, fast and no spin; strings that start slack, taut and at their free end; pull-only and bilateral ones and none; dampers, gravity,
wrenches, a free end that moves; bodies from micrometres to kilometres.
"""

import numpy as np
import pytest
from everyday_scenes import everyday_scene
from feature_scenes import END_S, FEATURES, make_scene, random_features, share
from flights import SECOND
from hypothesis import given, settings
from hypothesis import strategies as st

END_NS = round(END_S * SECOND)
SCENES = 10
STRESS_SCENES, STRESS_EVERYDAY, CHUNK = 20_000, 1_000, 500
ACCURACIES = (1e-6, 1e-9, 1e-11)


def chunks(stress):
    """Where a few scenes, and where chunks of a stress test's begin."""
    return [0, *(pytest.param(first, marks=pytest.mark.stress) for first in range(SCENES, stress, CHUNK))]


def random_scene(seed):
    rng = np.random.default_rng([2026, seed])
    accuracy = ACCURACIES[seed % len(ACCURACIES)]
    return make_scene(random_features(rng), rng, accuracy), accuracy


def share_of_random_scene(seed):
    scene, accuracy = random_scene(seed)
    return share(scene, scene.row_at, accuracy)


def share_of_everyday_scene(seed):
    scene = everyday_scene(seed)
    return share(scene, scene.row_at, 1e-9)


def check(share_of, seeds):
    shares = {seed: share_of(seed) for seed in seeds}
    worst = max(shares, key=shares.__getitem__)
    print(f"{len(shares)} scenes, the worst, {worst}, takes {shares[worst]:.2f} of what is allowed")
    assert shares[worst] <= 1.0, {seed: round(x, 2) for seed, x in shares.items() if x > 1.0}


def check_portions(scene, seed):
    """In one portion and in a thousand random ones: the same bits."""
    rng = np.random.default_rng([7, seed])
    whole, split = scene.simulation(), scene.simulation()
    whole.advance(END_NS)
    for time_ns in np.sort(rng.integers(0, END_NS, 1000)):
        split.advance(int(time_ns))
    split.advance(END_NS)
    assert split.state.sha256() == whole.state.sha256()
    assert (split.steps, split.force_evaluations) == (whole.steps, whole.force_evaluations)
    assert (split.hand_work, split.string_heat) == (whole.hand_work, whole.string_heat)


@pytest.mark.parametrize("first", chunks(STRESS_SCENES))
def test_scenes_of_all_features_fly_as_the_reference_does(first):
    check(share_of_random_scene, range(first, first + (CHUNK if first else SCENES)))


@pytest.mark.parametrize("first", chunks(STRESS_EVERYDAY))
def test_everyday_throws_on_a_rope_fly_as_the_reference_does(first):
    check(share_of_everyday_scene, range(first, first + (CHUNK if first else SCENES)))


@settings(max_examples=10, deadline=None)
@given(
    features=st.fixed_dictionaries({name: st.sampled_from(levels) for name, levels in FEATURES.items()}),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_features_together_fly_as_the_reference_does(features, seed):
    scene = make_scene(features, np.random.default_rng(seed))
    assert share(scene, scene.row_at, 1e-9) <= 1.0


@pytest.mark.parametrize(
    "seed", [*range(8), *(pytest.param(seed, marks=pytest.mark.stress) for seed in range(8, 1000))]
)
def test_a_thousand_portions_of_any_scene_give_the_bits_of_one(seed):
    check_portions(random_scene(seed)[0], seed)
