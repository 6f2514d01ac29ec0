# SPDX-License-Identifier: MIT
"""What a load may be: finite, and far from leaving no digits; the short way for light ones gives what the long one does."""

import math

import numpy as np
import pytest
from flights import flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.loads import light_row, resolve_load

CONTACTS = {"tip": (0.2, -3.0, 4e4)}


def test_a_light_load_is_resolved_as_any_other_and_none_too_strong_is_light() -> None:
    rng = np.random.default_rng(1)
    light = 0
    for _ in range(1000):
        mass, size = 10.0 ** rng.uniform(-9, 6), 10.0 ** rng.uniform(-6, 3, 4)
        moments = mass * size[0] ** 2 * np.array([1.0, 1.5, 2.0])
        body = make_body(mass, rng.normal(size=3) * size[1], np.diag(moments), rng.choice([-1.0, 1.0], 3) * size[1:])
        numbers = (10.0 ** rng.uniform(-5, 18) * rng.normal(size=6)).tolist()
        frame = parse_frame(f"{rng.choice(['world', 'body'])}@{rng.choice(['com', 'tip', 'point/0.1,-0.2,3e5'])}")
        row = light_row(frame, numbers[:3], numbers[3:], body, CONTACTS)
        if row:
            light += 1
            load = resolve_load(frame, numbers[:3], numbers[3:], body, None, CONTACTS, None)
            load.check_magnitude(body)
            assert row == load.packed
    assert light > 200


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
