# SPDX-License-Identifier: MIT
"""What a load may be: finite, and far from leaving no digits."""

import math

import numpy as np
import pytest
from flights import flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body


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
