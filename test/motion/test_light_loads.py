# SPDX-License-Identifier: MIT
"""What a load may be: finite, and far from leaving no digits; a rough bound passes those that are light."""

import math

import numpy as np
import pytest
from flights import flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.loads import Load, is_within_magnitude


def test_none_that_is_too_strong_for_its_body_is_light() -> None:
    rng = np.random.default_rng(1)
    light = 0
    for _ in range(1000):
        mass, size = 10.0 ** rng.uniform(-9, 6), 10.0 ** rng.uniform(-6, 3, 4)
        moments = mass * size[0] ** 2 * np.array([1.0, 1.5, 2.0])
        body = make_body(mass, rng.normal(size=3) * size[1], np.diag(moments), rng.choice([-1.0, 1.0], 3) * size[1:])
        numbers = (10.0 ** rng.uniform(-5, 18) * rng.normal(size=6)).tolist()
        load = Load(rng.choice(["world", "body"]), (0.1, -0.2, 3e5), tuple(numbers[:3]), tuple(numbers[3:]))
        try:
            load.check_magnitude(body)
            light += 1
        except CommandRefused:
            pass
        else:
            assert is_within_magnitude(load.row, body.row)
    assert 200 < light < 1000


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_what_is_not_finite_is_refused(bad, place) -> None:
    numbers = [1.0] * 6
    numbers[place] = bad
    simulation = flight(make_body(1.0, np.zeros(3), np.eye(3)))
    with pytest.raises(CommandRefused) as refusal:
        simulation.submit(wrench("body@point/1,2,3", numbers[:3], numbers[3:]))
    assert refusal.value.reason == "nonfinite"


@pytest.mark.parametrize("frame", ["world@com", "body@point/.3,-.2,.1", "world;impulse"])
def test_a_load_of_more_than_1e15_is_refused_and_one_of_less_is_taken(frame) -> None:
    simulation = flight(make_body(2.0, np.zeros(3), np.eye(3)), integrator="auto")
    simulation.submit(wrench(frame, (1e15, 0.0, 0.0), held=False))
    with pytest.raises(CommandRefused) as refusal:
        simulation.submit(wrench(frame, (3e15, 0.0, 0.0), held=False))
    assert refusal.value.reason == "magnitude"
