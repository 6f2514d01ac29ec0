# SPDX-License-Identifier: MIT
"""The short way to resolve a load gives what the long one does, or leaves it to that."""

import math

import numpy as np
import pytest
from flights import flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.loads import light_amount, light_row, resolve_load

POINTS = ("com", "origin", "point/0.1,-0.2,3e5", "point/1e-3,0,-0.0")


def random_body(rng: np.random.Generator):
    mass, size = 10.0 ** rng.uniform(-9, 6), 10.0 ** rng.uniform(-6, 3, 4)
    moments = mass * size[0] ** 2 * np.array([1.0, 1.5, 2.0])
    return make_body(mass, rng.normal(size=3) * size[1], np.diag(moments), rng.choice([-1.0, 1.0], 3) * size[1:])


def test_a_light_load_is_resolved_as_any_other_and_none_too_strong_is_light():
    rng = np.random.default_rng(1)
    light = 0
    for _ in range(1000):
        body = random_body(rng)
        frame = parse_frame(f"{rng.choice(['world', 'body'])}@{rng.choice(POINTS)}")
        numbers = (10.0 ** rng.uniform(-5, 18) * rng.normal(size=6)).tolist()
        force, torque = numbers[:3], numbers[3:]
        row = light_row(frame, force, torque, light_amount(body))
        if not row:
            continue
        light += 1
        load = resolve_load(frame, force, torque, body, None, {}, None)
        load.check_magnitude(body)
        assert row == load.packed
    assert light > 200


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_what_is_not_finite_is_never_light(bad, place):
    numbers = [1.0] * 6
    numbers[place] = bad
    body, frame = make_body(1.0, np.zeros(3), np.eye(3)), parse_frame("body@point/1,2,3")
    assert light_row(frame, numbers[:3], numbers[3:], light_amount(body)) == b""
    with pytest.raises(CommandRefused):
        resolve_load(frame, numbers[:3], numbers[3:], body, None, {}, None)


@pytest.mark.parametrize("frame", ["world@com", "body@point/.3,-.2,.1", "world;impulse"])
def test_a_load_of_more_than_1e15_is_refused_and_one_of_less_is_taken(frame):
    simulation = flight(make_body(2.0, np.zeros(3), np.eye(3)), integrator="auto")
    simulation.submit(wrench(frame, (1e15, 0.0, 0.0), held=False))
    with pytest.raises(CommandRefused) as refusal:
        simulation.submit(wrench(frame, (3e15, 0.0, 0.0), held=False))
    assert refusal.value.reason == "magnitude"
